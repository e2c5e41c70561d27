"""SpaceMouse and pedal on emulated ones: the cap is pushed with a button down, the pedal is stepped on."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any, Final, NamedTuple

from tega.devices.input.hid_input import AT_REST, HidInput
from tega.devices.input.pedal import Pedal, PedalOptions
from tega.devices.input.spacemouse import SpaceMouse, SpaceMouseOptions
from tega.errors import DeviceUnavailableError
from tega_campaigns.faults.trials import DriverOutcome, FaultTrial
from tega_campaigns.runner import until
from tega_emulators.hid_input import FAULTS
from tega_emulators.hid_port import HidBoard, HidPort
from tega_emulators.process import Emulator

__all__ = ["CANNOT", "trials"]

_WATCH_S = 1.5
_START_S = 10.0
_OFF_S = 0.5  # the emulator's
_AWAY = frozenset({"unplug", "power-cycle"})
_JOYSTICK = (0x05F3, 0x00FF)


class _InputDevice(NamedTuple):
    emulated: str
    numbers: tuple[int, int]
    options: dict[str, Any]


_STICK: Final[dict[str, Any]] = {"report": "joystick", "vendor_id": 0x05F3, "button_byte": 3}
_DEVICES: Final = {
    "spacemouse": _InputDevice("spacemouse", (0x046D, 0xC626), {}),
    "pedal": _InputDevice("pedal-keyboard", (0x0C45, 0x7403), {}),
    "pedal (silent_after_ms = 100)": _InputDevice(
        "pedal-repeating", _JOYSTICK, {**_STICK, "silent_after_ms": 100.0}
    ),
}
_NAMES: Final = {
    "freeze": "freeze",
    "garbage": "garbage",
    "half packet": "half",
    "slow": "slow",
    "duplicate": "duplicate",
}
_CHANGES: Final = "it reports a change once, and at its own time"
CANNOT: Final = {
    ("pedal", "slow"): _CHANGES,
    ("pedal", "garbage"): "USB checks every report; other reports than a keyboard's are counted and not used",
    (
        "pedal (silent_after_ms = 100)",
        "garbage",
    ): "USB checks every report; a byte of buttons can be any byte",
    (
        "pedal (silent_after_ms = 100)",
        "wrong version",
    ): "any report that is long enough has a byte of buttons",
}


def trials() -> list[FaultTrial]:
    """Return the trials."""
    tried = []
    for name in _DEVICES:
        tried += [
            FaultTrial(name, fault, FAULTS[reported], partial(_met, name, reported))
            for fault, reported in _NAMES.items()
            if (name, fault) not in CANNOT
        ]
        tried.append(FaultTrial(name, "unplug", "is taken away", partial(_met, name, "unplug")))
        tried.append(
            FaultTrial(name, "power cycle", "is away for half a second", partial(_met, name, "power-cycle"))
        )
    tried.append(
        FaultTrial("spacemouse", "wrong version", "is a CadMouse, with a wheel and no cap", _cad_mouse)
    )
    tried.append(FaultTrial("pedal", "wrong version", "is a joystick, set as a keyboard", _joystick))
    return tried


@contextmanager
def _bench(name: str) -> Iterator[tuple[Emulator, HidInput]]:
    device = _DEVICES[name]
    with (
        Emulator("hid_input", "--device", device.emulated) as peer,
        HidPort(HidBoard(peer.port, *device.numbers)).installed(),
    ):
        make: Any = SpaceMouseOptions if name == "spacemouse" else PedalOptions
        driver: Any = SpaceMouse if name == "spacemouse" else Pedal
        with driver(make(**device.options)) as source:
            yield peer, source


def _act(name: str, peer: Emulator) -> None:
    if name == "spacemouse":
        peer.say("push 0 -300 0 0 0 100")
    peer.say("press 0")


def _acts(name: str, source: HidInput) -> bool:
    state = source.state()
    return state.motion != AT_REST if name == "spacemouse" else bool(state.held)


def _met(name: str, fault: str) -> DriverOutcome:
    with _bench(name) as (peer, source):
        _act(name, peer)
        until(lambda: _acts(name, source), _START_S)
        peer.say(fault)
        begin_s = time.monotonic()
        if fault in {"half", "duplicate"} and name == "pedal":
            peer.say("press 1")  # it says nothing until something changes
        seen_s = until(lambda: not _acts(name, source), _WATCH_S)
        text = _text(name, fault, source)
        if seen_s is None:
            return DriverOutcome(effect="goes on", said=text)
        if fault == "power-cycle":
            time.sleep(max(0.0, begin_s + _OFF_S - time.monotonic()))
        else:
            peer.say("plug" if fault == "unplug" else "clear")
        start_s = time.monotonic()
        if name != "spacemouse":
            peer.say("lift 0")
            peer.say("lift 1")
        if name != "spacemouse" or fault in _AWAY:
            until(lambda: source.state().live, _START_S)
            _act(name, peer)
        came = until(lambda: _acts(name, source), _START_S)
        back_s = None if came is None else time.monotonic() - start_s
    return DriverOutcome(effect="falls silent", said=text, seen_s=seen_s, back_s=back_s)


def _text(name: str, fault: str, source: HidInput) -> str:
    counts, is_cap = source.counts, name == "spacemouse"
    text = "an equal report changes nothing"
    if fault in _AWAY:
        text = (
            "at rest, nothing held, no data; reconnected; a button that is held then has to be released first"
        )
    elif name == "pedal" and fault == "freeze":
        text = (
            "stays as it was: a pedal that only reports changes and freezes looks like one that is held; "
            "set silent_after_ms for one that repeats itself"
        )
    elif fault == "slow":
        text = "between two reports the watchdog of 100 ms brings it to rest, with no data"
    elif counts.odd and is_cap:
        text = "what cannot be read is counted and not used; without others the watchdog of 100 ms brings it to rest"
    elif counts.odd:
        text = "a report that cannot be read releases it, and it has to be let go before it counts again"
    elif counts.stalled:
        text = "its watchdog of 100 ms brings it to rest, nothing held, no data"
    return text


def _cad_mouse() -> DriverOutcome:
    with (
        Emulator("hid_input") as peer,
        HidPort(HidBoard(peer.port, 0x256F, 0xC650)).installed(),
    ):
        start_s = time.monotonic()
        try:
            SpaceMouse(SpaceMouseOptions()).open()
        except DeviceUnavailableError as error:
            return DriverOutcome(effect="refused", said=error.message, seen_s=time.monotonic() - start_s)
    return DriverOutcome(effect="goes on", said="opens, unnoticed")


def _joystick() -> DriverOutcome:
    with (
        Emulator("hid_input", "--device", "pedal-joystick") as peer,
        HidPort(HidBoard(peer.port, *_JOYSTICK)).installed(),
        Pedal(PedalOptions(vendor_id=_JOYSTICK[0])) as source,
    ):
        peer.say("press 0")
        until(lambda: source.counts.odd > 0, _START_S)
        held = source.state().held
        text = f"never counts as held; a note says so: {source.info.notes[0]}"
    return DriverOutcome(effect="goes on" if held else "falls silent", said=text, seen_s=0.0)
