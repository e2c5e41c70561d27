"""Drive a bHaptics vest over Bluetooth LE, without the vendor's software."""

from __future__ import annotations

import asyncio
import contextlib
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Final

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.devices.at_exit import last_words
from tega.devices.base import Found, Options
from tega.devices.bluetooth_state import bluetooth_trouble
from tega.devices.guard_process import GuardProcess
from tega.devices.vest_ble_guard import LONGEST_S, MOTORS, guard_vest
from tega.devices.vest_stream import StreamedVest, VestLink, VestOptions
from tega.errors import DeviceUnavailableError
from tega.lifecycle import require
from tega.wire import x40_ble_frame

if TYPE_CHECKING:
    from collections.abc import Coroutine


_NAMES: Final = ("TactSuit", "Tactot")
_SERVICE: Final = "6e400001-b5a3-f393-e0a9-e50e24dcca9e"
_BATTERY: Final = "6e400008-b5a3-f393-e0a9-e50e24dcca9e"
_CALL_S = 1.5  # no call to the radio may take longer


class BleOptions(VestOptions, frozen=True):
    """Settings of :class:`BleVest`.

    Attributes:
        address: The vest's Bluetooth address (on macOS its identifier); empty for the first vest that is heard.
        scan_s: How long to listen for it.
        most_hz: As above; 20 to 50 writes a second are known to work, and more of them pile up in the radio.
        front_mirror: Swap left and right on the front panel: its sense rests on one published table, see
            ``tega-teleop vest identify``.
    """

    address: str = ""
    scan_s: Annotated[float, msgspec.Meta(gt=0, le=30)] = 5.0
    front_mirror: bool = False


class BleVest(StreamedVest):
    """Writes the 20-byte motor frame, without response, to the vest's motor characteristic.

    As far as is known a vest holds the last frame for ever, so everything rests on the zeros that are sent on the way
    out; a second process sends them if this one is killed. A broken radio link may leave it vibrating until it is
    found again. Nothing but motor frames is ever written to a vest.
    """

    name: ClassVar[str] = "bhaptics-ble"
    summary: ClassVar[str] = "bHaptics vest over Bluetooth LE, without the vendor's software"
    extra: ClassVar[str] = "lab"
    requires: ClassVar[tuple[str, ...]] = ("bleak",)
    options_type: ClassVar[type[Options]] = BleOptions

    def __init__(self, options: BleOptions) -> None:
        super().__init__(options)
        self._options = options
        self._watch = _LinkWatch()

    @classmethod
    def discover(cls, timeout_s: float) -> list[Found]:
        """Listen for vests; connects to none.

        Raises:
            DeviceUnavailableError: There is no Bluetooth, or it is switched off.
            MissingExtraError: bleak is not installed.
        """
        bleak = require("bleak", driver=cls.name, extra=cls.extra)
        try:
            heard = asyncio.run(
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
                note="heard, not connected to",
                may_open=False,
            )
            for device in heard
            if (device.name or "").startswith(_NAMES)
        ]

    @property
    def _label(self) -> str:
        return self._options.address or "first vest heard"

    def _new_link(self) -> VestLink:
        return _BleLink(self._options, self._watch)

    def close(self) -> None:
        """Send zeros and disconnect; the process that guards the vest is dismissed if the vest took them."""
        try:
            super().close()
        finally:
            if self._thread is None:
                self._watch.end()


class _LinkWatch:
    """State that outlives a link: the process that silences the vest, and whether the vest is silent.

    Attributes:
        guard: The process; ``None`` before the first link.
        silent: Whether zeros were the last that the vest is known to have taken, and nothing was sent since.
    """

    def __init__(self) -> None:
        self.guard: GuardProcess | None = None
        self.silent = True
        self._of = ("", "")

    def over(self, address: str, path: str) -> None:
        """Have a process watch over a vest."""
        if self.guard is not None and self._of != (address, path):
            self.end()
        if self.guard is None:
            self.guard, self._of, self.silent = guard_vest(address, path), (address, path), True

    def end(self) -> None:
        """Dismiss the process if the vest is known to be silent; else leave the vest to it, and say so."""
        guard, self.guard = self.guard, None
        if guard is None:
            return
        if self.silent:
            guard.dismiss()
            return
        guard.leave_to_it()
        last_words(
            f"USE THE VEST'S SWITCH: {self._of[0]}: it has not confirmed that its motors rest, so it may still be "
            f"vibrating; another process goes on telling it to, for {LONGEST_S / 60:g} minutes"
        )


class _BleLink:
    def __init__(self, options: BleOptions, watch: _LinkWatch) -> None:
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

    notes: tuple[str, ...] = ()

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
            what = f"no vest with the address {o.address}" if o.address else "no vest (TactSuit…, Tactot…)"
            raise DeviceUnavailableError(
                f"{what} was heard in {o.scan_s:g} s of Bluetooth scanning",
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

    def ready(self, timeout_s: float) -> bool:  # noqa: ARG002  # a write returns when the radio's stack has it
        return True

    def send(self, intensities: NDArray[np.uint8]) -> None:
        if self._client is None or self._gone:
            raise DeviceUnavailableError("the vest has disconnected")
        if (guard := self._watch.guard) is not None:
            guard.beat()
            if guard.problem and intensities.any():  # it is being replaced; until then nothing vibrates
                raise DeviceUnavailableError("the process that would silence the vest was lost")
        frame = x40_ble_frame(intensities, front_mirror=self._options.front_mirror)
        self._watch.silent = self._rests = False
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
                    runner.run(asyncio.wait_for(client.read_gatt_char(_BATTERY), _CALL_S))
                    self._watch.silent = True
            with contextlib.suppress(*self._broken, TimeoutError):
                runner.run(asyncio.wait_for(client.disconnect(), _CALL_S))
        runner.close()

    def abort(self) -> None:
        """Do nothing: every call has its own end."""

    async def _find(self) -> Any:
        def wanted(device: Any, name: str | None) -> bool:
            if self._options.address:
                return bool(device.address.lower() == self._options.address.lower())
            return (name or "").startswith(_NAMES)

        # A connected vest is not heard: a program that was killed may have left it so.
        with contextlib.suppress(NotImplementedError):
            adapter = await self._bleak.BleakAdapter.get()
            for device in await adapter.get_connected_devices([_SERVICE]):
                if wanted(device, device.name):
                    return device
        return await self._bleak.BleakScanner.find_device_by_filter(
            lambda device, heard: wanted(device, heard.local_name or device.name),
            timeout=self._options.scan_s,
        )

    def _call(self, work: Coroutine[Any, Any, Any], timeout_s: float, doing: str) -> Any:
        if self._runner is None:
            work.close()
            raise DeviceUnavailableError("the vest is not connected")
        try:
            return self._runner.run(asyncio.wait_for(work, timeout_s))
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

    def _on_disconnected(self, _client: Any) -> None:
        self._gone = True
