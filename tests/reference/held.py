"""A SpaceMouse and a pedal, emulated in other processes behind hidapi's calls."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from tega.devices.input.hid_input import HidInput
from tega.devices.input.pedal import Pedal, PedalOptions
from tega.devices.input.spacemouse import SpaceMouse, SpaceMouseOptions
from tega_emulators.hid_port import HidBoard, HidPort
from tega_emulators.process import Emulator

MS = 1_000_000


def spacemouse(**options: Any) -> SpaceMouse:
    make: Any = SpaceMouseOptions
    return SpaceMouse(make(**options))


def pedal(**options: Any) -> Pedal:
    make: Any = PedalOptions
    return Pedal(make(**options))


@contextmanager
def emulated(device: str, numbers: tuple[int, int]) -> Iterator[Emulator]:
    with (
        Emulator("hid_input", "--device", device) as peer,
        HidPort(HidBoard(peer.port, *numbers)).installed(),
    ):
        yield peer


def moves(source: HidInput, wanted: list[float]) -> Callable[[], bool]:
    return lambda: source.state().motion == pytest.approx(wanted)


def holds(source: HidInput, button: str) -> Callable[[], bool]:
    return lambda: source.state().held == {button}


TWO, ONE, PEDAL = (0x046D, 0xC626), (0x256F, 0xC62E), (0x0C45, 0x7403)
