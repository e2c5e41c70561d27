"""The live vests on emulated ones: a touch is written 30 times a second, and the motors' own record tells the times."""

from __future__ import annotations

import functools
import threading
import time
from typing import Final, NamedTuple

from tega.devices.vest.vest_stream import StreamedVest
from tega.errors import DeviceUnavailableError
from tega.haptics import MotorLevels, vest_frame
from tega.wire import vest_levels
from tega_campaigns.faults.trials import DriverOutcome, FaultTrial
from tega_campaigns.runner import until
from tega_emulators.process import Emulator
from tega_emulators.vest_bench import vest_bench
from tega_emulators.vests import seen_by

__all__ = ["CANNOT", "FAULT_S", "VestTrouble", "trials", "trouble"]

FAULT_S: Final = 3.0
"""How long a fault lasts that is not over at once."""

_RECOVERY_S: Final = 15.0
_VERSION_3: Final = "bhaptics-player (version = 3)"
_AT_ONCE: Final = {("bhaptics-player", "drop"), ("bhaptics-ble", "drop")}
_TOUCH: Final = vest_frame([80, 60, 40, 20], [13, 0, 100, 53], layout="x40")
_AFTERWARDS: Final = vest_frame([20, 40, 60, 80], [53, 100, 0, 13], layout="x40")

_PLAYER: Final = (
    ("unplug", "the connection breaks once", "drop"),
    ("freeze", "it takes nothing and says nothing", "freeze"),
    ("garbage", "its messages are no messages", "garbage"),
    ("slow", "takes a message in 150 ms", "slow"),
    ("power cycle", "the Player is closed and is back after 3 s", "refuse"),
    ("no vest", "the vest has left the Player", "no-vest"),
    ("no frames", "no program writes a frame", "no writes"),
)

# By driver: the fault's name in the table, what the emulator does, and what it is told.
_FAULTS: Final = {
    "bhaptics-player": _PLAYER,
    _VERSION_3: _PLAYER,
    "bhaptics-ble": (
        ("unplug", "the radio link breaks once", "drop"),
        ("freeze", "takes no frame and answers none", "freeze"),
        ("slow", "takes a frame in 150 ms", "slow"),
        ("power cycle", "the vest is switched off and on after 3 s", "off"),
        ("no frames", "no program writes a frame", "no writes"),
    ),
    "hid-vest": (
        ("unplug", "the board is taken away for 3 s", "close"),
        ("freeze", "takes nothing and says nothing", "freeze"),
        ("garbage", "its reports have a wrong checksum", "garbage"),
        ("slow", "takes a report in 150 ms", "slow"),
        ("power cycle", "the board is away for 3 s, and restarts", "close"),
        ("no vest", "the board has no link to a vest", "no-vest"),
        ("no frames", "no program writes a frame", "no writes"),
    ),
}
_WHOLE: Final = "its transport delivers whole messages or none"
_TALKS: Final = "its answers change nothing on the vest, once or twice"
CANNOT: Final = {
    **{(name, "half packet"): _WHOLE for name in _FAULTS},
    **{(name, "duplicate"): _TALKS for name in _FAULTS},
    ("bhaptics-ble", "garbage"): "frames go one way only; the battery is all that is read",
}


class VestTrouble(NamedTuple):
    """What one fault did.

    Attributes:
        rest_s: From the fault to motors at rest; ``None`` if they were not before the touch was back.
        lost: How often the driver gave a link up.
        back_s: From the fault's end to the new touch on the motors; ``None`` if it never came.
        write_ms: The longest call of ``write`` meanwhile.
        withheld: Whether ``write`` returned zeros during the fault.
    """

    rest_s: float | None
    lost: int
    back_s: float | None
    write_ms: float
    withheld: bool


def trials() -> list[FaultTrial]:
    """Return the trials."""
    tried = []
    for driver, faults in _FAULTS.items():
        tried += [
            FaultTrial(driver, name, subject, functools.partial(_met, driver, fault))
            for name, subject, fault in faults
        ]
        tried.append(FaultTrial(driver, "wrong version", _WRONG[driver], functools.partial(_refused, driver)))
    return tried


_WRONG: Final = {
    "bhaptics-player": "serves no version 2",
    _VERSION_3: "serves no version 3",
    "bhaptics-ble": "has no motor characteristic",
    "hid-vest": "speaks version 2 of the reports",
}


def _options(label: str) -> tuple[str, dict[str, str]]:
    """Return the driver's name of a row, and the option that the row sets."""
    return ("bhaptics-player", {"version": "3"}) if label == _VERSION_3 else (label, {})


def _refused(label: str) -> DriverOutcome:
    driver, options = _options(label)
    with vest_bench(driver, open_timeout_s=2.0, **options) as bench:
        bench.peer.say("wrong-version")
        start_s = time.monotonic()
        try:
            with bench.vest:
                return DriverOutcome(effect="goes on", said="opens, unnoticed")
        except DeviceUnavailableError as error:
            # The emulated Player's port is another one each time.
            ports = (bench.peer.address.get(name) for name in ("port", "port_v3"))
            sentence = functools.reduce(
                lambda text, port: text.replace(f":{port} ", " "), ports, error.message
            )
            return DriverOutcome(effect="refused", said=sentence, seen_s=time.monotonic() - start_s)


def _met(label: str, fault: str) -> DriverOutcome:
    driver, options = _options(label)
    with vest_bench(driver, **options) as bench, bench.vest:
        met = trouble(driver, fault, bench.vest, bench.peer)
    sentence = []
    if fault == "no writes":
        sentence.append("its watchdog sends zeros")
    elif met.lost:
        sentence.append("gives the link up, makes a new one, which begins with zeros")
    elif met.rest_s is not None:
        sentence.append("frames lapse in between, which feels like flicker; each that arrives is the newest")
    elif fault == "slow":
        sentence.append("fewer frames arrive, each the newest")
    elif met.withheld:
        sentence.append("says that no vest is connected: write returns zeros")
    else:
        sentence.append("counts and ignores invalid messages; frames go out as before")
    sentence.append(f"no write took longer than {max(met.write_ms, 0.1):.1f} ms")
    if met.rest_s is not None and met.rest_s > 1.0:
        sentence.append("until then the emulated vest holds its last frame, as the real one is thought to")
    if met.rest_s is None:
        return DriverOutcome(effect="goes on", said="; ".join(sentence))
    return DriverOutcome(
        effect="falls silent", said="; ".join(sentence), seen_s=met.rest_s, back_s=met.back_s
    )


def trouble(
    driver: str, fault: str, vest: StreamedVest, peer: Emulator, fault_s: float = FAULT_S
) -> VestTrouble:
    """Let a fault happen under an open vest, and end it.

    Args:
        driver: The vest driver's name.
        fault: What its emulator is told; ``no writes`` is the caller's own.
        vest: The open driver.
        peer: Its emulator.
        fault_s: How long it lasts.
    """
    before, after = _displayed(_TOUCH, peer), _displayed(_AFTERWARDS, peer)
    writer = _Writer(vest)
    writer.start()
    try:
        until(lambda: seen_by(peer).motors == before, _RECOVERY_S, look_s=0.05)
        writer.longest_s, writer.withheld, begun_s = 0.0, False, time.monotonic()
        if fault == "no writes":
            writer.paused = True
        else:
            peer.say(fault)
        if (driver, fault) not in _AT_ONCE:
            time.sleep(fault_s)
        withheld, ended_s = writer.withheld, time.monotonic()
        writer.frame, writer.paused = _AFTERWARDS, False
        peer.say("clear")
        until(lambda: seen_by(peer).motors == after, _RECOVERY_S, look_s=0.05)
    finally:
        writer.stopped = True
        writer.join()
    history = seen_by(peer).history
    silent = [t for t, motors in history if t >= begun_s and not any(motors)]
    back = [t for t, motors in history if t >= ended_s and motors == after]
    return VestTrouble(
        silent[0] - begun_s if silent and (not back or silent[0] < back[0]) else None,
        vest.counters.lost,
        back[0] - ended_s if back else None,
        writer.longest_s * 1000,
        withheld,
    )


class _Writer(threading.Thread):
    """Writes the touch 30 times a second, as the loop does."""

    def __init__(self, vest: StreamedVest) -> None:
        super().__init__()
        self._vest = vest
        self.frame = _TOUCH
        self.paused = False
        self.stopped = False
        self.withheld = False
        self.longest_s = 0.0

    def run(self) -> None:
        while not self.stopped:
            if not self.paused:
                before = time.perf_counter()
                sent = self._vest.write(0, self.frame)
                self.longest_s = max(self.longest_s, time.perf_counter() - before)
                self.withheld = self.withheld or not sent.intensities.any()
            time.sleep(1 / 30)


def _displayed(frame: MotorLevels, peer: Emulator) -> list[int]:
    """Return what a frame looks like on this peer's motors: the X40's know sixteen levels only."""
    if "bus" in peer.address:
        return [round(level * 100 / 15) for level in vest_levels(frame.x40()).tolist()]
    return [int(i) for i in frame.x40()]
