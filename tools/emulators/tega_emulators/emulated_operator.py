"""An emulated operator of an arm: a wrist that a headset sees, and a foot on a pedal that is the dead-man.

A program that is to use the pedal has to find the folder :attr:`EmulatedOperator.hidapi` first on its ``PYTHONPATH``:
it holds a module that stands for hidapi, since no program can plug a USB device in.
"""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import Any, Final, Self

from tega.devices import Found
from tega.runtime.lifecycle import require
from tega.setup.doctor.bench import DriverProbe
from tega_emulators.franka_faults import HAND_KG, on_franky_sim
from tega_emulators.process import Emulator

__all__ = ["PEDAL", "EmulatedOperator", "write_hidapi"]

_PEDAL: Final = (0x05F3, 0x00FF)
PEDAL: Final = {"vendor_id": _PEDAL[0], "product_id": _PEDAL[1], "report": "joystick", "button_byte": 3}
"""Options by which the driver of pedals finds the emulated one."""

_HELD_S, _LET_GO_S = 8.0, 2.0
_HIDAPI: Final = '''"""Stands for hidapi, so that the emulated pedal is found."""

from tega_emulators.hid_port import HidBoard, HidPort

_port = HidPort(HidBoard({path!r}, {vendor:#06x}, {product:#06x}))
enumerate = _port.enumerate
device = _port.device
'''


def write_hidapi(folder: Path, port: str) -> None:
    """Write the module that stands for hidapi and finds an emulated pedal, which is reached at ``port``.

    A program finds it if ``PYTHONPATH`` names the folder first.
    """
    folder.mkdir(parents=True, exist_ok=True)
    text = _HIDAPI.format(path=port, vendor=_PEDAL[0], product=_PEDAL[1])
    for name in ("hid", "hidraw"):
        (folder / f"{name}.py").write_text(text, encoding="utf-8")


class EmulatedOperator:
    """Headset, pedal, and for ``franky`` franky-sim's robot with a hand's weight at its flange.

    ``driver`` is the arm's. The ``pedal``'s one button repeats itself while it is held. ``robot`` is ``None``
    where the driver needs none; ``hidapi`` is the folder with the module that stands for hidapi, ``None``
    until it was written.
    """

    def __init__(self, driver: str) -> None:
        self._driver, self._up = driver, ExitStack()
        self.headset = Emulator("hololens")
        self.pedal = Emulator("hid_input", "--device", "pedal-repeating")
        self.robot: Emulator | None = None
        if driver == "franky":
            self.robot = Emulator("franka_faults", "--hand-kg", str(HAND_KG))
        self.hidapi: Path | None = None
        self._is_held = False

    def __enter__(self) -> Self:
        """Start them; the wrist swings forward and back."""
        if self.robot is not None:
            require("franky_sim", driver="franky-sim's robot", extra="arm-sim")
        with ExitStack() as starting:
            for device in self.devices:
                starting.enter_context(device)
            self._up = starting.pop_all()
        self.headset.say("wave 0.06 0.2")
        return self

    def __exit__(self, *_error: object) -> None:
        """End them."""
        self._up.close()

    @property
    def devices(self) -> list[Emulator]:
        """All of them."""
        return [self.headset, self.pedal, *([] if self.robot is None else [self.robot])]

    @property
    def looked(self) -> dict[str, DriverProbe]:
        """What a search would have found, had they been real."""
        # A program that repeats itself is held up now and then, as no pedal is.
        options = PEDAL | {"silent_after_ms": 500}
        return {
            "pedal": DriverProbe("input", [Found(driver="pedal", label="emulated pedal", options=options)])
        }

    @property
    def tables(self) -> dict[str, Any]:
        """The ``[arm]`` table that leads the arm by the wrist."""
        tracker = {"driver": "hololens", "options": dict(self.headset.address)}
        arm: dict[str, Any] = {"driver": self._driver, "tracker": tracker, "mapping": {"frame": "openxr"}}
        if self.robot is not None:
            arm |= on_franky_sim(self.robot.address["host"])
        return arm

    def write_hidapi(self, folder: Path) -> None:
        """Write the module that stands for hidapi."""
        write_hidapi(folder, self.pedal.port)
        self.hidapi = folder

    def act(self, after_s: float) -> None:
        """Step on the pedal or off it: held for 8 s, then let go for 2 s, from the operator's beginning."""
        held = after_s % (_HELD_S + _LET_GO_S) >= _LET_GO_S
        if held != self._is_held:
            self._is_held = held
            self.pedal.say("press 0" if held else "lift 0")
