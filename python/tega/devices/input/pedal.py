"""Read a foot pedal or any other switch on USB: a dead-man's switch while it is held, a marker when it is pressed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, ClassVar, Final, Literal

import msgspec

from tega.devices.base import Options
from tega.devices.input.hid_input import HidInput, HidInputOptions
from tega.errors import DeviceUnavailableError

PEDALS: Final = {
    (0x0C45, 0x7403): "PCsensor FootSwitch",
    (0x0C45, 0x7404): "PCsensor FootSwitch",
    (0x413D, 0x2107): "PCsensor FootSwitch",
    (0x1A86, 0xE026): "PCsensor FootSwitch",
    (0x3553, 0xB001): "PCsensor FootSwitch",
}
"""Keyboard-type pedals that are found without being named, by vendor and product number."""

_USAGES: Final = {"keyboard": ((1, 6),), "joystick": ((1, 4), (1, 5))}
_MODIFIERS: Final = tuple(
    f"{side} {key}" for side in ("left", "right") for key in ("ctrl", "shift", "alt", "gui")
)
# Keys 1 to 3 of a keyboard's report are errors: too many keys, a failed self-test, unknown.
_FIRST_KEY: Final = 4
_BOOT_BYTES: Final = 8


class PedalOptions(HidInputOptions, frozen=True, kw_only=True):
    """Settings of :class:`Pedal`.

    Attributes:
        report: Type of device that the pedal presents: a ``keyboard`` that types a key, or a ``joystick`` with
            buttons.
        button_byte: For a joystick, the index of the report's byte with the buttons, one bit each, counted from 0 and
            including a leading report number.
        debounce_ms: How long a contact has to hold to count as pressed; a release counts at once.
    """

    report: Literal["keyboard", "joystick"] = "keyboard"
    button_byte: Annotated[int, msgspec.Meta(ge=0, le=63)] = 0
    debounce_ms: Annotated[float, msgspec.Meta(ge=0, le=500)] = 20.0


class Pedal(HidInput):
    """Gives which buttons are down, without bounces, and every press with its time.

    A keyboard's buttons are named by the keys they type (``b``, ``left ctrl``, ``key 0x3a``), a joystick's by
    number (``1``). A pedal that is unplugged, or sends unreadable data, is released at that moment. One that
    reports only changes and freezes while held looks like one that is held: only ``silent_after_ms`` ends
    that, and a dead-man requires it. Always keep an emergency stop in reach.
    """

    name: ClassVar[str] = "pedal"
    summary: ClassVar[str] = "foot pedal or switch on USB that passes itself off as a keyboard or a joystick"
    options_type: ClassVar[type[Options]] = PedalOptions

    known: ClassVar[Mapping[tuple[int, int], str]] = PEDALS
    _options: PedalOptions

    def __init__(self, options: PedalOptions) -> None:
        super().__init__(options, hold_ms=options.debounce_ms)

    def _fits(self, numbers: tuple[int, int]) -> bool:
        o = self._options
        if o.vendor_id is None and o.product_id is None:
            return bool(o.serial) or (o.report == "keyboard" and numbers in PEDALS)
        return o.vendor_id in {None, numbers[0]} and o.product_id in {None, numbers[1]}

    def _usages(self) -> Sequence[tuple[int, int]]:
        return _USAGES[self._options.report]

    def _absence(self, found: Sequence[Mapping[str, Any]]) -> DeviceUnavailableError:
        o = self._options
        there = ", ".join(sorted({f"{d['vendor_id']:04x}:{d['product_id']:04x}" for d in found})) or "none"
        if o.vendor_id is None and o.product_id is None and not o.serial:
            subject = "no pedal that is known"
            if o.report == "joystick":
                subject = "no vendor_id and product_id is set, so no joystick"
            return DeviceUnavailableError(
                f"pedal: {subject} is there; input devices: {there}",
                "set vendor_id and product_id, as lsusb shows them with 0x in front",
            )
        wanted = ":".join("any" if n is None else f"{n:04x}" for n in (o.vendor_id, o.product_id))
        if o.serial:
            wanted += f", serial number {o.serial},"
        return DeviceUnavailableError(
            f"pedal: no device {wanted} is there; input devices: {there}",
            "plug it in, and see docs/device-inputs.md for the udev rule",
        )

    def _take(self, report: bytes, t_ns: int) -> bool:
        down = self._keys(report) if self._options.report == "keyboard" else self._joystick(report)
        if down is None:
            # What it meant is unknown, and may have been that the foot is off.
            if self._buttons.held:
                self._is_stalled = True
                self._release(t_ns)
            return False
        self._press(down, t_ns)
        return True

    @staticmethod
    def _keys(report: bytes) -> set[str] | None:
        """Read a keyboard's report: modifiers, a byte of nothing, six keys; a report number 1 may stand in front."""
        if len(report) == _BOOT_BYTES + 1 and report[0] == 1:
            report = report[1:]
        if len(report) != _BOOT_BYTES or report[1] != 0:
            return None
        keys = [key for key in report[2:] if key]
        if any(key < _FIRST_KEY for key in keys):
            return None
        down = {name for bit, name in enumerate(_MODIFIERS) if report[0] >> bit & 1}
        return down | {chr(ord("a") + k - 4) if k < 30 else f"key {k:#04x}" for k in keys}

    def _joystick(self, report: bytes) -> set[str] | None:
        if len(report) <= self._options.button_byte:
            return None
        mask = report[self._options.button_byte]
        return {str(bit + 1) for bit in range(8) if mask >> bit & 1}
