"""Drive a bHaptics vest over Bluetooth LE, without the vendor's software."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import Coroutine
from typing import Annotated, Any, ClassVar, Final

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.devices.base import Found, Options
from tega.devices.hand.guard_process import BEAT_S
from tega.devices.machine import bluetooth_trouble
from tega.devices.vest.vest_ble_guard import MOTORS, VestWatch
from tega.devices.vest.vest_link import VestLink
from tega.devices.vest.vest_stream import StreamedVest, VestOptions
from tega.errors import DeviceUnavailableError
from tega.runtime.lifecycle import require
from tega.wire import x40_ble_frame

_NAMES: Final = ("TactSuit", "Tactot")
_SERVICE: Final = "6e400001-b5a3-f393-e0a9-e50e24dcca9e"
_BATTERY: Final = "6e400008-b5a3-f393-e0a9-e50e24dcca9e"
_CALL_S = 1.5  # no call to the radio may take longer


class BleOptions(VestOptions, frozen=True):
    """Settings of :class:`BleVest`.

    Attributes:
        address: The vest's Bluetooth address (on macOS its identifier); empty for the first vest found.
        scan_s: How long to listen for it.
        most_hz: As above, 50 at most: more writes pile up in the radio, and zeros would arrive behind them.
        front_mirror: Swap left and right on the front panel: its sense rests on one published table, see
            ``tega-teleop vest identify``.
    """

    address: str = ""
    most_hz: Annotated[float, msgspec.Meta(ge=10, le=50)] = 50.0
    scan_s: Annotated[float, msgspec.Meta(gt=0, le=30)] = 5.0
    front_mirror: bool = False


class BleVest(StreamedVest):
    """Writes the 20-byte motor frame, without response, to the vest's motor characteristic.

    As far as is known a vest holds the last frame for ever, so everything rests on the zeros that are sent on
    the way out; a second process sends them if this one is killed or stands still. A broken radio link may
    leave it vibrating until it is found again. Nothing but motor frames is ever written to a vest.
    """

    name: ClassVar[str] = "bhaptics-ble"
    unseen: ClassVar[str] = "no vest was found over Bluetooth"
    likelihood: ClassVar[int] = 1
    summary: ClassVar[str] = "bHaptics vest over Bluetooth LE, without the vendor's software"
    extra: ClassVar[str] = "lab"
    requires: ClassVar[tuple[str, ...]] = ("bleak",)
    options_type: ClassVar[type[Options]] = BleOptions
    _options: BleOptions

    def __init__(self, options: BleOptions) -> None:
        super().__init__(options, options.address or "first vest found")
        self._watch = VestWatch()

    @classmethod
    def discover(cls, timeout_s: float) -> list[Found]:
        """Listen for vests; connects to none. ``DeviceUnavailableError``: no Bluetooth, or it is off."""
        bleak = require("bleak", driver=cls.name, extra=cls.extra)
        try:
            received = asyncio.run(
                asyncio.wait_for(bleak.BleakScanner.discover(timeout=0.7 * timeout_s), timeout_s)
            )
        except (OSError, EOFError, TimeoutError, bleak.exc.BleakError) as error:
            why, hint = bluetooth_trouble()
            raise DeviceUnavailableError(
                why or f"Bluetooth does not answer ({error or type(error).__name__})",
                hint
                or "on Linux: systemctl start bluetooth; in a container the system's D-Bus socket is needed",
            ) from error
        return [
            Found(
                driver=cls.name,
                label=f"{device.name} at {device.address}",
                options={"address": device.address},
                note="found, not connected",
                may_open=False,
            )
            for device in received
            if (device.name or "").startswith(_NAMES)
        ]

    @property
    def confirmed_rest(self) -> bool:
        """Whether the vest is closed and has answered behind its last zeros."""
        return self._thread is None and self._watch.confirmed

    def _new_link(self) -> VestLink:
        return _BleLink(self._options, self._watch)

    def _over(self, rest_s: float) -> bool:
        until_s = time.monotonic() + rest_s
        while not super()._over(max(0.0, min(BEAT_S, until_s - time.monotonic()))):
            if time.monotonic() >= until_s:
                return False
            self._watch.beat()
        return True

    def close(self) -> None:
        """Send zeros and disconnect; the process that guards the vest is dismissed if the vest took them."""
        try:
            super().close()
        finally:
            if self._thread is None:
                self._watch.end()


class _BleLink(VestLink):
    def __init__(self, options: BleOptions, watch: VestWatch) -> None:
        self._options = options
        self._watch = watch
        self._confirms = self._rests = False
        self._runner: asyncio.Runner | None = None
        self._client: Any = None
        self._broken: tuple[type[Exception], ...] = (OSError, EOFError)
        self._gone = False
        self._battery: int | None = None

    @property
    def present(self) -> bool:
        return not self._gone

    @property
    def battery_percent(self) -> int | None:
        return self._battery

    @property
    def condition(self) -> str:
        client = self._client
        return "" if client is None else f"{client.name or 'vest'} {'not ' if self._gone else ''}connected"

    def connect(self) -> None:
        self._bleak = require("bleak", driver=BleVest.name, extra="lab")
        self._broken = (OSError, EOFError, self._bleak.exc.BleakError)
        self._runner = asyncio.Runner()
        o = self._options
        device = self._call(self._find(), o.scan_s + _CALL_S, "looking for the vest")
        if device is None:
            subject = f"no vest with the address {o.address}" if o.address else "no vest (TactSuit…, Tactot…)"
            raise DeviceUnavailableError(
                f"{subject} was found in {o.scan_s:g} s of Bluetooth scanning",
                "switch it on and close the Player and the phone's app: a vest talks to one program at a time",
            )
        self._client = self._bleak.BleakClient(device, disconnected_callback=self._on_disconnected)
        self._call(self._client.connect(), o.open_timeout_s, "connecting")
        details = device.details
        self._watch.over(device.address, details.get("path", "") if isinstance(details, dict) else "")
        if self._client.services.get_characteristic(MOTORS) is None:
            raise DeviceUnavailableError(
                f"{device.name or device.address} has no motor characteristic {MOTORS}",
                "it is no vest of the kinds this driver knows (X40, X16 and their likes)",
            )
        if self._client.services.get_characteristic(_BATTERY) is not None:
            with contextlib.suppress(DeviceUnavailableError):
                value = self._call(self._client.read_gatt_char(_BATTERY), _CALL_S, "reading the battery")
                self._battery = value[0] if value else None
                self._confirms = True

    def send(self, intensities: NDArray[np.uint8]) -> None:
        if self._client is None or self._gone:
            raise DeviceUnavailableError("the vest has disconnected")
        guard = self._watch.guard
        if guard is not None and guard.problem and intensities.any():  # it is being replaced
            raise DeviceUnavailableError("the process that would silence the vest was lost")
        frame = x40_ble_frame(intensities, front_mirror=self._options.front_mirror)
        self._watch.silent = self._watch.confirmed = self._rests = False
        self._call(self._client.write_gatt_char(MOTORS, frame, response=False), _CALL_S, "writing a frame")
        self._rests = not any(frame)
        self._watch.silent = self._rests and not self._confirms

    def poll(self) -> None:
        self._call(asyncio.sleep(0.001), _CALL_S, "listening")
        if self._gone:
            raise DeviceUnavailableError("the vest has disconnected")

    def close(self) -> None:
        client, self._client = self._client, None
        runner, self._runner = self._runner, None
        if runner is None:
            return
        if client is not None:
            with contextlib.suppress(*self._broken, TimeoutError):
                if self._rests and self._confirms:
                    # Packets are taken in their order: with the answer to this the zeros before it have arrived.
                    runner.run(self._alive(client.read_gatt_char(_BATTERY), _CALL_S))
                    self._watch.silent = self._watch.confirmed = True
            with contextlib.suppress(*self._broken, TimeoutError):
                runner.run(self._alive(client.disconnect(), _CALL_S))
        runner.close()

    async def _find(self) -> Any:
        def wanted(device: Any, name: str | None) -> bool:
            if self._options.address:
                return bool(device.address.lower() == self._options.address.lower())
            return (name or "").startswith(_NAMES)

        # A connected vest is not found: a program that was killed may have left it so.
        with contextlib.suppress(NotImplementedError):
            adapter = await self._bleak.BleakAdapter.get()
            for device in await adapter.get_connected_devices([_SERVICE]):
                if wanted(device, device.name):
                    return device
        return await self._bleak.BleakScanner.find_device_by_filter(
            lambda device, received: wanted(device, received.local_name or device.name),
            timeout=self._options.scan_s,
        )

    def _call(self, work: Coroutine[Any, Any, Any], timeout_s: float, doing: str) -> Any:
        if self._runner is None:
            work.close()
            raise DeviceUnavailableError("the vest is not connected")
        try:
            return self._runner.run(self._alive(work, timeout_s))
        except TimeoutError as error:
            raise DeviceUnavailableError(
                f"Bluetooth: no answer within {timeout_s:g} s while {doing}",
                "move closer, or restart the adapter",
            ) from error
        except self._bleak.exc.BleakBluetoothNotAvailableError as error:
            raise DeviceUnavailableError(
                f"Bluetooth: {error.args[0]}", "plug an adapter in, or switch it on"
            ) from error
        except self._bleak.exc.BleakError as error:
            raise DeviceUnavailableError(
                f"Bluetooth: {error}, while {doing}",
                "close the Player and the phone's app (a vest talks to one program at a time), move closer, try again",
            ) from error
        except self._broken as error:
            raise DeviceUnavailableError(
                f"Bluetooth: the system's service cannot be reached ({error!r}) while {doing}",
                "on Linux: systemctl start bluetooth; in a container the system's D-Bus socket is needed",
            ) from error

    async def _alive(self, work: Coroutine[Any, Any, Any], timeout_s: float) -> Any:
        """Wait for the radio, and keep reporting to the guard meanwhile."""
        beats = asyncio.ensure_future(self._beats())
        try:
            async with asyncio.timeout(timeout_s):
                return await work
        finally:
            beats.cancel()

    async def _beats(self) -> None:
        while True:
            self._watch.beat()
            await asyncio.sleep(BEAT_S)

    def _on_disconnected(self, _client: Any) -> None:
        self._gone = True
