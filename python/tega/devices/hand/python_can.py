"""Send CAN frames to a hand over any adapter that python-can knows."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from typing import Annotated, Any, ClassVar, Final

import msgspec

from tega.devices.base import DeviceInfo, Kind, Options
from tega.devices.hand.can_open import open_can_bus
from tega.devices.hand.hand_bus import can_message
from tega.errors import ConfigError, DeviceUnavailableError
from tega.runtime.lifecycle import Opened, require
from tega.wire import CanFrame

_NO_HARDWARE = frozenset({"virtual", "udp_multicast"})

_SEND_TIMEOUT_S: Final = 0.01
"""How long a frame may wait for the adapter: three periods of the hand, after which its torque is out of date."""


class PythonCanOptions(Options, frozen=True):
    """Settings of :class:`PythonCan`.

    Attributes:
        interface: The adapter's name in python-can, such as ``virtual``, ``socketcan``, ``pcan``, ``slcan``.
        channel: Channel of the adapter.
        bitrate: Bits per second; the Allegro Hand uses 1,000,000. ``socketcan`` is set with ``ip link`` instead.
        bus: Further options, passed to ``can.Bus`` as they are.
        open_loop: Allow a bus with real hardware behind it. The torques come from an ideal joint model that
            does not know where the real joints are.
    """

    interface: str = "virtual"
    channel: str | int = "tega"
    bitrate: Annotated[int, msgspec.Meta(gt=0, le=1_000_000)] = 1_000_000
    bus: dict[str, Any] = msgspec.field(default_factory=dict)
    open_loop: bool = False


def may_have_hardware(interface: str, channel: str | int) -> bool:
    """Return whether a real hand may be connected to one of python-can's buses."""
    return interface not in _NO_HARDWARE and not str(channel).startswith("vcan")


class PythonCan(Opened):
    """Sends classic CAN frames with 11-bit identifiers; never CAN FD."""

    kind: ClassVar[Kind] = "hand"
    summary: ClassVar[str] = "any CAN adapter python-can knows; 'virtual' needs no hardware"
    extra: ClassVar[str] = "lab"
    requires: ClassVar[tuple[str, ...]] = ("can",)
    options_type: ClassVar[type[Options]] = PythonCanOptions

    def __init__(self, options: PythonCanOptions) -> None:
        self._options = options
        self._bus: Any = None
        self._can: Any = None

    @classmethod
    def harmless(cls, options: PythonCanOptions) -> PythonCanOptions:
        """The options as they are: an open bus sends nothing by itself."""
        return options

    @property
    def info(self) -> DeviceInfo:
        """Name of the bus."""
        o = self._options
        return DeviceInfo(
            driver="python-can", kind="hand", label=f"{o.interface}:{o.channel}", live=True, unit="CAN frames"
        )

    def open(self) -> None:
        """Open the bus; ``ConfigError`` for real hardware without ``open_loop``."""
        o = self._options
        self.close()
        if may_have_hardware(o.interface, o.channel) and not o.open_loop:
            raise ConfigError(
                f"python-can: interface {o.interface!r} may have a real hand behind it, and these torques come from "
                "a joint model that does not read the hand's angles",
                "use interface = 'virtual', or set open_loop = true with the hand's power off or nothing attached",
            )
        self._can = require("can", driver="python-can", extra="lab")
        self._bus = open_can_bus(
            "python-can",
            o.interface,
            lambda: self._can.Bus(interface=o.interface, channel=o.channel, bitrate=o.bitrate, **o.bus),
            can=self._can,
            channel=o.channel,
        )

    def close(self) -> None:
        """Close the bus."""
        bus, self._bus = self._bus, None
        if bus is not None:
            with contextlib.suppress(Exception):  # adapters raise what they like
                bus.shutdown()

    def write(self, t_ns: int, frames: Sequence[CanFrame]) -> Sequence[CanFrame]:  # noqa: ARG002  # a bus has no past
        """Send frames in order; ``DeviceUnavailableError`` if the bus did not take a frame in time."""
        if self._bus is None:
            raise DeviceUnavailableError("python-can: the bus is not open", "open it first")
        for frame in frames:
            try:
                self._bus.send(can_message(self._can, frame), timeout=_SEND_TIMEOUT_S)
            except Exception as error:  # as above
                raise DeviceUnavailableError(
                    f"python-can: frame {frame.id:#05x} was not sent within {_SEND_TIMEOUT_S} s: {error}",
                    "check that the hand is powered, the bus terminated, and its rate 1 Mbit/s",
                ) from error
        return frames
