"""Drive a vest through a microcontroller on USB.

bHaptics vests are not HID devices, and this driver cannot open one. It talks to a board with firmware for TEGA's own
64-byte reports (docs/wire.md), which either passes them on to a vest by radio or drives motors itself.
"""

from __future__ import annotations

import time
from typing import Annotated, Any, ClassVar

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.devices.base import Found, Options
from tega.devices.machine import hid_module, open_hid
from tega.devices.vest.vest_link import VestLink
from tega.devices.vest.vest_stream import HOLD_MS, StreamedVest, VestOptions
from tega.errors import DeviceUnavailableError, WireError
from tega.wire import HidStatus, hid_motor_report, hid_status, hid_stop_report

_ANSWER_S = 1.0  # a board sends its status every 100 ms; ten missing ones are too many
_LEAVE_S = 0.2
_REPORT_BYTES = 64
_CONNECTED = 2


class HidVestOptions(VestOptions, frozen=True):
    """Settings of :class:`HidVest`.

    Attributes:
        vendor_id: The board's USB vendor number; the default pair is one for bench work, not to be shipped.
        product_id: Its product number.
        serial: Its serial number; empty for the first one found.
        require_vest: Refuse to open when the board says that it has no vest.
        most_hz: As above. USB carries one report a millisecond, and each waits for the answer to the one before.
    """

    vendor_id: Annotated[int, msgspec.Meta(ge=0, le=0xFFFF)] = 0x1209
    product_id: Annotated[int, msgspec.Meta(ge=0, le=0xFFFF)] = 0x0001
    serial: str = ""
    require_vest: bool = True
    most_hz: Annotated[float, msgspec.Meta(ge=10, le=1000)] = 500.0


class HidVest(StreamedVest):
    """Sends motor reports, each with a time to live of 200 ms, and each when the board has answered the one before."""

    name: ClassVar[str] = "hid-vest"
    in_steps: ClassVar[bool] = False
    unseen: ClassVar[str] = "no board with TEGA's reports is on USB"
    summary: ClassVar[str] = (
        "microcontroller on USB with TEGA's own reports (no bHaptics vest is a HID device)"
    )
    extra: ClassVar[str] = "lab"
    requires: ClassVar[tuple[str, ...]] = ("hid",)
    options_type: ClassVar[type[Options]] = HidVestOptions
    _options: HidVestOptions

    def __init__(self, options: HidVestOptions) -> None:
        super().__init__(options, options.serial or f"{options.vendor_id:04x}:{options.product_id:04x}")

    @classmethod
    def discover(cls, timeout_s: float) -> list[Found]:  # noqa: ARG003  # the system knows at once
        """List the USB boards with the vendor and product number of the default settings."""
        usual = HidVestOptions()
        return [
            Found(
                driver=cls.name,
                label=board["serial_number"] or f"{usual.vendor_id:04x}:{usual.product_id:04x}",
                options={"serial": board["serial_number"]} if board["serial_number"] else {},
            )
            for board in hid_module(cls.name).enumerate(usual.vendor_id, usual.product_id)
        ]

    def _new_link(self) -> VestLink:
        return _HidLink(self._options)


class _HidLink(VestLink):
    def __init__(self, options: HidVestOptions) -> None:
        self._options = options
        self._device: Any = None
        self._sequence = 0
        self._status: HidStatus | None = None
        self._received_s = 0.0
        self._garbage = 0
        self._last_garbage = ""

    @property
    def present(self) -> bool:
        return self._status is not None and self._status.link == _CONNECTED

    @property
    def notes(self) -> tuple[str, ...]:
        notes, status = [], self._status
        if self._garbage:
            notes.append(f"{self._garbage} reports of the board could not be read ({self._last_garbage})")
        if status is not None and status.link != _CONNECTED:
            notes.append("the board has no vest connected")
        if status is not None and status.faults:
            notes.append(f"the board reports the fault bits {status.faults:#06x}")
        return tuple(notes)

    @property
    def battery_percent(self) -> int | None:
        return None if self._status is None else self._status.battery

    @property
    def condition(self) -> str:
        return "" if self._status is None else f"board's vest {'' if self.present else 'not '}connected"

    def connect(self) -> None:
        o = self._options
        boards = hid_module(HidVest.name).enumerate(o.vendor_id, o.product_id)
        found = [d for d in boards if o.serial in {"", d["serial_number"]}]
        wanted = f"{o.vendor_id:04x}:{o.product_id:04x}" + (f", serial number {o.serial}" if o.serial else "")
        if not found:
            raise DeviceUnavailableError(
                f"no USB board {wanted} is there",
                "is it plugged in, and may you open it? tega-teleop doctor --udev-rules prints the rule",
            )
        self._device = open_hid(HidVest.name, found[0], f"the USB board {wanted}")
        deadline = time.monotonic() + min(_ANSWER_S, o.open_timeout_s * 0.6)
        self._write(hid_motor_report([0] * 40, sequence=self._next(), ttl_ms=HOLD_MS, request_status=True))
        while self._status is None and time.monotonic() < deadline:
            self._read(10)
        if self._status is None:
            text = f": {self._last_garbage}" if self._garbage else ""
            raise DeviceUnavailableError(
                f"the USB board {wanted} sends no status in report format version 1{text}",
                "its firmware has to speak the reports in docs/wire.md, version 1",
            )
        if o.require_vest and not self.present:
            raise DeviceUnavailableError(
                f"the USB board {wanted} has no vest connected",
                "switch the vest on; require_vest = false opens without one",
            )

    def ready(self, timeout_s: float) -> bool:
        deadline = time.monotonic() + timeout_s
        while self._status is None or self._status.sequence != self._sequence:
            left_ms = round((deadline - time.monotonic()) * 1000)
            if left_ms <= 0:
                return False
            self._read(left_ms)
        return True

    def send(self, intensities: NDArray[np.uint8]) -> None:
        self._write(hid_motor_report(intensities, sequence=self._next(), ttl_ms=HOLD_MS, request_status=True))

    def poll(self) -> None:
        self._read()
        if time.monotonic() - self._received_s > _ANSWER_S:
            raise DeviceUnavailableError(f"the USB board has sent no status for {_ANSWER_S:g} s")

    def close(self) -> None:
        if self._device is None:
            return
        try:
            self.ready(_LEAVE_S)  # the zeros sent last have arrived
            self._write(hid_stop_report(sequence=self._next()))
        finally:
            self._device.close()
            self._device = None

    def _next(self) -> int:
        self._sequence = (self._sequence + 1) % 65536
        return self._sequence

    def _write(self, report: bytes) -> None:
        if self._device is None:
            raise DeviceUnavailableError("the USB board is not open")
        try:
            written = self._device.write(report)
        except (OSError, ValueError) as error:
            raise DeviceUnavailableError(f"the USB board took no report: {error}") from error
        if written < 0:
            raise DeviceUnavailableError(f"the USB board took no report: {self._device.error()}")

    def _read(self, timeout_ms: int = 0) -> None:
        """Read every report that has come, waiting for the first; count reports that are no status."""
        while True:
            try:
                report = bytes(self._device.read(_REPORT_BYTES, timeout_ms))
            except (OSError, ValueError) as error:
                raise DeviceUnavailableError(f"the USB board is gone: {error}") from error
            timeout_ms = 0
            if not report:
                return
            try:
                self._status = hid_status(report)
            except WireError as error:
                self._garbage += 1
                self._last_garbage = error.message
            else:
                self._received_s = time.monotonic()
