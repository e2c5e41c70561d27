"""Send CAN frames to a hand over any adapter that python-can knows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from tega.devices.base import DeviceInfo, Kind, Options
from tega.devices.hand.allegro_options import CanOptions
from tega.devices.hand.hand_bus import SEND_S, HandBus
from tega.errors import ConfigError, DeviceUnavailableError
from tega.runtime.lifecycle import Opened
from tega.wire import CanFrame

_NO_HARDWARE = frozenset({"virtual", "udp_multicast"})


class PythonCanOptions(CanOptions, frozen=True):
    """Settings of :class:`PythonCan`.

    Attributes:
        open_loop: Allow a bus with real hardware behind it. The torques come from an ideal joint model that
            does not know where the real joints are.
    """

    interface: str = "virtual"
    channel: str | int = "tega"
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
        self._bus: HandBus | None = None

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
        bus = HandBus(o.can_bus(), "python-can")
        bus.open()
        self._bus = bus

    def close(self) -> None:
        """Close the bus."""
        bus, self._bus = self._bus, None
        if bus is not None:
            bus.drop()

    def write(self, t_ns: int, frames: Sequence[CanFrame]) -> Sequence[CanFrame]:  # noqa: ARG002  # a bus has no past
        """Send frames in order; ``DeviceUnavailableError`` if the bus did not take a frame in time."""
        if self._bus is None:
            raise DeviceUnavailableError("python-can: the bus is not open", "open it first")
        for frame in frames:
            if not self._bus.send([frame]):
                raise DeviceUnavailableError(
                    f"python-can: frame {frame.id:#05x} was not sent within {SEND_S} s: {self._bus.unsent}",
                    "check that the hand is powered, the bus terminated, and its rate 1 Mbit/s",
                )
        return frames
