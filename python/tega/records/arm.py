"""Define the records of the arm: its turns, its poses, its targets and its health."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar

import msgspec

from tega.records.base import Count, Milliseconds, Ns, Record, Share, quantity

Metres = Annotated[float, quantity("m")]
Quaternion = Annotated[float, quantity("1")]


class PoseNumbers(msgspec.Struct, frozen=True):
    """A pose as it came, whatever it holds.

    Attributes:
        t_ns: Its stamp, since the start of the session.
        position: Metres; three numbers, unless it is damaged.
        quaternion: x, y, z, w; likewise.
        valid: Whether the tracker believes it.
        table: Names of the columns of position and quaternion, wherever poses stand in a table.
    """

    schema: ClassVar[str] = "ArmPose"
    table: ClassVar[tuple[str, ...]] = ("x_m", "y_m", "z_m", "qx", "qy", "qz", "qw")

    t_ns: Ns
    position: tuple[Metres, ...]
    quaternion: tuple[Quaternion, ...]
    valid: bool = True


class ArmTurn(Record, frozen=True, kw_only=True):
    """Inputs of one turn of the loop that steers an arm, and the resulting command.

    Attributes:
        poses: Forearm poses since the last turn, in the tracker's axes.
        may_move: Whether the run let the arm move.
        measured: New measured pose of the hand: one or none.
        stopped: Why the arm was to stop; ``""`` if it was not.
        cleared: Whether a person had said that it may go on.
        holds: How often the arm was engaged.
        target: Position and quaternion; empty for none.
        velocity: Linear, m/s, then angular, rad/s.
        phase: Phase of the arm's own driver.
    """

    topic: ClassVar[str] = "/arm/turn"
    table: ClassVar[tuple[str, ...]] = ("t_s", "state", "reason", "holds", "measured", "target")
    columns: ClassVar[Mapping[str, tuple[str, ...]]] = {
        "measured": tuple(f"arm_{name}" for name in PoseNumbers.table),
        "target": tuple(f"target_{name}" for name in PoseNumbers.table),
    }

    t_ns: Ns
    poses: tuple[PoseNumbers, ...]
    clutch: bool
    dead_man: bool
    may_move: bool
    measured: tuple[PoseNumbers, ...]
    stopped: str
    cleared: bool
    state: str
    reason: str
    holds: Count
    target: tuple[Annotated[float, quantity("m, 1")], ...]
    velocity: tuple[Annotated[float, quantity("m/s, rad/s")], ...]
    phase: str


class ArmHealth(Record, frozen=True, kw_only=True):
    """Health of the arm's process, once a second.

    Attributes:
        rate_hz: Its commands a second.
        worst_ms: Its latest command.
        success_rate: As the robot says; -1 where it does not.
    """

    topic: ClassVar[str] = "/arm/health"

    t_ns: Ns
    rate_hz: Annotated[float, quantity("Hz")]
    worst_ms: Milliseconds
    late: Count
    refused: Count
    success_rate: Share


class PoseRecord(Record, frozen=True, kw_only=True):
    """A pose for viewers; its subclasses define the tracked object.

    Attributes:
        t_ns: Its stamp, since the start of the session.
        taken_ns: The turn it belongs to.
        frame: Name of its axes.
        quaternion: x, y, z, w.
    """

    schema: ClassVar[str] = "foxglove.PoseInFrame"
    logged: ClassVar[str] = "taken_ns"

    t_ns: Ns
    taken_ns: Ns
    frame: str
    position: tuple[Metres, ...]
    quaternion: tuple[Quaternion, ...]


class ForearmPose(PoseRecord, frozen=True, kw_only=True):
    """Pose of the operator's forearm, in the tracker's axes."""

    topic: ClassVar[str] = "/arm/forearm"


class ArmMeasured(PoseRecord, frozen=True, kw_only=True):
    """Pose of the arm's end, as measured."""

    topic: ClassVar[str] = "/arm/measured"


class ArmTarget(PoseRecord, frozen=True, kw_only=True):
    """Pose that the arm's end is to take."""

    topic: ClassVar[str] = "/arm/target"


class ArmSent(PoseRecord, frozen=True, kw_only=True):
    """Pose that the robot was really sent, after its own limits."""

    topic: ClassVar[str] = "/arm/sent"


class TrackerAxes(Record, frozen=True, kw_only=True):
    """Turn of the tracker's axes in the robot's base.

    Attributes:
        parent: Name of the base's axes.
        child: Name of the tracker's axes.
        quaternion: The turn, x, y, z, w.
    """

    topic: ClassVar[str] = "/arm/axes"
    schema: ClassVar[str] = "foxglove.FrameTransform"

    t_ns: Ns
    parent: str
    child: str
    quaternion: tuple[Quaternion, ...]
