"""A whole lab of emulated devices, each in a process of its own, and the settings that reach them."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from itertools import cycle
from pathlib import Path
from typing import Any, Literal

import numpy as np

from tega.config.calibration import Calibration, EmgMaxima, TouchMaxima, save_calibration
from tega.devices.fingertip.digit import Digit, DigitOptions
from tega.errors import DeviceUnavailableError
from tega.runtime.clock import every
from tega_emulators.emulated_operator import PEDAL, write_hidapi
from tega_emulators.franka_faults import HAND_KG, on_franky_sim
from tega_emulators.hid_port import HidBoard, HidPort
from tega_emulators.process import Emulator
from tega_emulators.vest_bench import felt_now

__all__ = ["PRESSED", "EmulatedLab", "emulated_lab", "keep_baseline", "pressing"]

PRESSED = TouchMaxima(cci_max=1.2, eda_max=9000.0)
"""What counts as full so that each press of :func:`pressing` is felt otherwise."""

_CYTON_HZ = 250.0
_PRESS_S = 0.1
_FIRMNESSES = (0.5, 0.6, 0.7, 0.8, 0.9)


class EmulatedLab:
    """What runs, and how to reach it; each device is there only if it was asked for.

    Attributes:
        tree: Settings of a session, as nested tables.
        sensors: Emulated DIGITs by finger.
        headset: The emulated headset, if there is an arm.
        cap: The emulated SpaceMouse, if there is an arm; its buttons are dead-man, clutch and recover.
        robot: franky-sim's robot with a hand's weight at its flange, if that is the arm.
        pedal: The emulated pedal, if that is the dead-man; its buttons are dead-man and recover.
        environment: What a program has to have in its environment to reach the devices.
    """

    emg: Emulator
    hand: Emulator
    vest: Emulator
    headset: Emulator
    cap: Emulator
    robot: Emulator
    pedal: Emulator

    def __init__(self) -> None:
        self.tree: dict[str, Any] = {}
        self.environment: dict[str, str] = {}
        self.sensors: dict[str, Emulator] = {}

    @property
    def devices(self) -> list[Emulator]:
        """All emulators that run."""
        names = ("emg", "hand", "vest", "headset", "cap", "robot", "pedal")
        found = [getattr(self, name) for name in names if hasattr(self, name)]
        return [*found, *self.sensors.values()]

    def go_ahead(self) -> bool:
        """Let every device go before every thread of a run; return whether the system allows that."""
        granted = [device.go_ahead() for device in self.devices]
        return all(granted)

    def limp(self) -> bool:
        """Whether no motor of the hand pushes."""
        state = self.hand.say("look")
        return not state["servo_on"] and not any(state["duties"])

    def at_rest(self) -> bool:
        """Whether no motor of the vest turns."""
        return not any(felt_now(self.vest))


@contextmanager
def emulated_lab(
    folder: Path,
    *,
    emg_hz: float | None = None,
    hand: bool | Literal["network"] = False,
    vest: bool | str = False,
    fingers: Sequence[str] = (),
    arm: bool | str = False,
    dead_man: Literal["spacemouse", "pedal"] = "spacemouse",
    camera_hz: float = 60.0,
    touch: TouchMaxima | None = None,
    preset: Literal["paper", "live"] = "live",
) -> Iterator[EmulatedLab]:
    """Start emulators; everything ends with the block.

    Args:
        folder: For calibration and baselines.
        emg_hz: Three tensed muscles at so many samples a second: 250 on a Cyton, else on a Chords board.
        hand: An Allegro Hand behind a serial CAN adapter; ``network`` puts that behind TCP.
        vest: A vest behind the vendor's Player, or that of another driver: ``bhaptics-ble`` has one behind
            BlueZ on a message bus of its own.
        fingers: DIGITs, each with something pressed into its gel.
        arm: A simulated arm, or the driver of another, led by a wrist that a headset sees, with the buttons
            of a SpaceMouse; ``franky`` is led on franky-sim's robot, which carries a hand's weight.
        dead_man: With ``pedal`` a pedal that repeats itself while it is held is dead-man and clutch in one,
            and its other button recovers. Only a program with the lab's ``environment`` finds it.
        camera_hz: Pictures a second that they really give.
        touch: What counts as full touch; ``None`` for so little that what is pressed is felt fully.
        preset: Whose maxima the calibration holds.
    """
    with ExitStack() as stack:
        lab = EmulatedLab()
        tree = lab.tree
        tree["session"] = {}
        tree["calibration"] = {"file": str(folder / "calibration.toml")}
        maxima = None
        if emg_hz is not None:
            lab.emg, tree["emg"] = _amplifier(stack, emg_hz)
            maxima = EmgMaxima(
                kind="raw",
                rate_hz=emg_hz,
                tau=round(emg_hz / 10),
                channels=("ch1", "ch2", "ch3"),
                maxima=(1.0, 1.0, 1.0),
            )
        if hand:
            where = () if hand is True else ("--channel", hand)
            lab.hand = stack.enter_context(Emulator("allegro_port", *where))
            # The emulated hand shares a busy machine with everything else.
            patient = {"silent_after_ms": 1000.0, "lowest_rate_hz": 10.0, "reconnects": 0}
            tree["hand"] = {"driver": "allegro", "options": {**lab.hand.address, **patient}}
        if vest:
            _vest(stack, lab, vest if isinstance(vest, str) else "bhaptics-player")
        for seed, finger in enumerate(fingers):
            sensor = Emulator("digit", "--rate-hz", str(camera_hz), "--seed", str(seed))
            lab.sensors[finger] = stack.enter_context(sensor)
            tree.setdefault("tactile", {})[finger] = _fingertip(sensor, folder / f"{finger}.npy")
        if arm:
            _arm(stack, lab, arm if isinstance(arm, str) else "simulated-arm")
            if dead_man == "pedal":
                _pedal(stack, lab, folder)
            else:
                _cap(stack, lab)
        full = touch or TouchMaxima(cci_max=0.01, eda_max=500.0)
        calibration = Calibration(
            preset=preset,
            origin="emulated devices",
            tactile=dict.fromkeys(fingers, full),
            emg=maxima,
        )
        save_calibration(calibration, folder / "calibration.toml")
        yield lab


@contextmanager
def pressing(lab: EmulatedLab) -> Iterator[None]:
    """Press all fingertips now more and now less, ten times a second, so that there is something new to feel."""
    for firmness in _FIRMNESSES:  # a sensor makes the pictures of each when it is asked for the first time
        for sensor in lab.sensors.values():
            sensor.say(f"press {firmness}")

    firmnesses = cycle(_FIRMNESSES)

    def press() -> None:
        firmness = next(firmnesses)
        for sensor in lab.sensors.values():
            sensor.say(f"press {firmness}")

    with every(press, every_s=_PRESS_S):
        yield


def _amplifier(stack: ExitStack, rate_hz: float) -> tuple[Emulator, dict[str, Any]]:
    quick = {"measure_s": 0.25, "silence_s": 0.5}
    if rate_hz == _CYTON_HZ:
        board = stack.enter_context(Emulator("cyton", "--signal", "emg"))
        return board, {"driver": "cyton", "kind": "raw", "options": {"port": board.port, **quick}}
    board = stack.enter_context(Emulator("chords", "--signal", "emg", "--rate", str(rate_hz)))
    # A fast board on a busy machine takes longer to prove its rate.
    options = {"port": board.port, "rate_hz": rate_hz, "measure_s": 1.0, "start_s": 20.0}
    return board, {"driver": "chords", "kind": "raw", "options": options}


def _arm(stack: ExitStack, lab: EmulatedLab, driver: str) -> None:
    """Start a headset, and set an arm that follows it."""
    lab.headset = stack.enter_context(Emulator("hololens"))
    tracker = {"driver": "hololens", "options": dict(lab.headset.address)}
    lab.tree["arm"] = {"driver": driver, "tracker": tracker}
    if driver == "franky":
        lab.robot = stack.enter_context(Emulator("franka_faults", "--hand-kg", str(HAND_KG)))
        lab.tree["arm"] |= on_franky_sim(lab.robot.address["host"])


def _cap(stack: ExitStack, lab: EmulatedLab) -> None:
    """Start a SpaceMouse, and seat its buttons; this program finds it."""
    lab.cap = stack.enter_context(Emulator("hid_input", "--device", "spacemouse"))
    stack.enter_context(HidPort(HidBoard(lab.cap.port, 0x046D, 0xC626)).installed())
    # Its buttons say nothing while they are held, as a real one's; so long it is believed.
    held = {"silent_after_ms": 10_000.0}
    buttons = {"dead_man": "left", "clutch": "right", "recover": "button 3"}
    lab.tree["input"] = {
        seat: {"driver": "spacemouse", "button": b, "options": held} for seat, b in buttons.items()
    }


def _pedal(stack: ExitStack, lab: EmulatedLab, folder: Path) -> None:
    """Start a pedal, and seat its buttons; a program with the lab's environment finds it."""
    lab.pedal = stack.enter_context(Emulator("hid_input", "--device", "pedal-repeating"))
    write_hidapi(folder / "hidapi", lab.pedal.port)
    before = os.environ.get("PYTHONPATH", "")
    lab.environment["PYTHONPATH"] = os.pathsep.join(filter(None, (str(folder / "hidapi"), before)))
    buttons = {"dead_man": "1", "recover": "2"}
    options = PEDAL | {"silent_after_ms": 100.0}
    lab.tree["input"] = {
        seat: {"driver": "pedal", "button": b, "options": options} for seat, b in buttons.items()
    }


def _vest(stack: ExitStack, lab: EmulatedLab, driver: str) -> None:
    """Start a vest, and set it."""
    options: dict[str, Any] = {}
    if driver == "bhaptics-ble":
        lab.vest = stack.enter_context(Emulator("bluez_vest"))
        lab.environment["DBUS_SYSTEM_BUS_ADDRESS"] = lab.vest.address["bus"]
    else:
        lab.vest = stack.enter_context(Emulator("bhaptics_player", "--port", "0"))
        options["port"] = lab.vest.address["port"]
    lab.tree["vest"] = {"driver": driver, "layout": "x40", "options": options}


def _fingertip(sensor: Emulator, baseline: Path) -> dict[str, Any]:
    """Take a sensor's untouched picture, press something into it, and return its settings."""
    options = {"source": sensor.address["source"], "warm_up_s": 0.1}
    keep_baseline(DigitOptions(**options), baseline)
    sensor.say("press 0.7")
    return {"driver": "digit", "baseline": str(baseline), "options": options}


def keep_baseline(options: Any, file: Path) -> None:
    """Write the picture that an emulated DIGIT, with its driver's options, sends now."""
    with Digit(options) as camera:
        frame = camera.read(5.0)
    if frame is None:
        raise DeviceUnavailableError("an emulated sensor sends no picture", "try again")
    np.save(file, frame.image)
