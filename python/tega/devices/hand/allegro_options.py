"""Define the settings of the Allegro Hand's driver."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec

from tega.devices.base import Options
from tega.hand import TORQUE_LIMITS, HandController
from tega.hand.link import HandLink

BITRATE = 1_000_000
"""CAN bit rate of the hand, bit/s."""
_Share = Annotated[float, msgspec.Meta(gt=0, le=1)]


class CanOptions(Options, frozen=True):
    """Settings of an adapter that python-can knows.

    Attributes:
        interface: The adapter's name in python-can, such as ``virtual``, ``socketcan``, ``pcan``, ``slcan``.
        channel: Channel of the adapter.
        bitrate: Bits per second, 1,000,000 for an Allegro Hand; ``socketcan`` is set with ``ip link`` instead.
        bus: Further options, passed to ``can.Bus`` as they are.
    """

    interface: str
    channel: str | int
    bitrate: Annotated[int, msgspec.Meta(gt=0, le=1_000_000)] = BITRATE
    bus: dict[str, Any] = msgspec.field(default_factory=dict)

    def can_bus(self) -> dict[str, Any]:
        """Return the arguments of ``can.Bus``."""
        return {"interface": self.interface, "channel": self.channel, "bitrate": self.bitrate, **self.bus}


class AllegroOptions(CanOptions, frozen=True):
    """Settings of :class:`Allegro`.

    Attributes:
        device_id: The hand's number on its bus, 0 from the factory.
        side: Side of the mounted hand; the other side is refused.
        poses: Pose file of the closure levels; ``None`` for the built-in ones.
        torque_share: Ceiling of every torque, as a share of the vendor's limits.
        kp: Torque units per rad; ``None`` for the built-in gains, 1.5 and 2 for the thumb.
        kd: Torque units per rad/s; ``None`` for 0.08.
        torque: Switch the motors on; without it the hand is only read.
        silent_after_ms: Without a set of positions for so long the motors go off.
        lowest_rate_hz: Sets of positions a second that are needed; the hand sends 333.
        reconnects: How often a silent hand is looked for again, once a second.
        guard: Have a further process let go of the hand if the one that steers it, or this one, is lost.
    """

    device_id: Annotated[int, msgspec.Meta(ge=0, le=3)] = 0
    side: Literal["right", "left"] = "right"
    poses: Path | None = None
    torque_share: _Share = 1.0
    kp: Annotated[float, msgspec.Meta(gt=0, le=10)] | None = None
    kd: Annotated[float, msgspec.Meta(ge=0, le=1)] | None = None
    torque: bool = True
    silent_after_ms: Annotated[float, msgspec.Meta(ge=10, le=10_000)] = 30.0
    lowest_rate_hz: Annotated[float, msgspec.Meta(ge=0, le=1000)] = 250.0
    reconnects: Annotated[int, msgspec.Meta(ge=0, le=100)] = 5
    guard: bool = True

    def link(self) -> HandLink:
        """Make the hand's side of the exchange, without a bus; ``ConfigError`` for an unusable pose file."""
        from tega.hand.poses import load_poses

        controller = HandController(
            poses_rad=None if self.poses is None else load_poses(self.poses),
            kp=self.kp,
            kd=self.kd,
            torque_limits=TORQUE_LIMITS * self.torque_share,
        )
        return HandLink(
            controller,
            device_id=self.device_id,
            side=self.side,
            torque=self.torque,
            silent_after_ms=self.silent_after_ms,
            lowest_rate_hz=self.lowest_rate_hz,
            reconnects=self.reconnects,
        )
