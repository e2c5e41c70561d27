"""Publish an arm's turns, so that each can be computed again, with poses for viewers; describe a turn for displays."""

from __future__ import annotations

import math
from typing import Any, NamedTuple, cast

import numpy as np
from msgspec.structs import asdict, astuple, replace

from tega.arm.chain import Turn
from tega.arm.frames import ToBase
from tega.arm.messages import Health
from tega.arm.pose import ArmCommand, ArmState, StampedPose
from tega.arm.rotation import from_matrix
from tega.arm.settings import MappingSettings
from tega.devices.base import ArmDriver, TellingArm
from tega.records import (
    ArmHealth,
    ArmMeasured,
    ArmSent,
    ArmTarget,
    ArmTurn,
    ForearmPose,
    PoseNumbers,
    PoseRecord,
    TrackerAxes,
)
from tega.records.bus import Bus

# Names of the two coordinate frames.
_BASE, _TRACKER = "arm_base", "tracker"

_HEALTH_NS = 1_000_000_000


class ArmRecords:
    """Publishes every turn of the steering of an arm."""

    def __init__(self, bus: Bus, start_ns: int, mapping: MappingSettings) -> None:
        self._bus, self._start_ns, self._mapping = bus, start_ns, mapping
        self._begun = False
        self._measured_ns: int | None = None
        self._led_ns = self._health_ns = -1

    def turn(self, row: ArmTurn, arm: ArmDriver) -> None:
        """Publish a turn with its command, as :func:`arm_row` returns it."""
        t_ns = row.t_ns
        if not self._begun:
            self._begun = True
            self._axes(t_ns)
        for pose in row.poses:
            if pose.valid and np.isfinite([*pose.position, *pose.quaternion]).all():
                self._pose(ForearmPose, t_ns, _TRACKER, pose)
        self._bus.publish(row)
        for seen in row.measured:
            if seen.t_ns != self._measured_ns:
                self._measured_ns = seen.t_ns
                self._pose(ArmMeasured, t_ns, _BASE, seen)
        if row.target:
            self._pose(ArmTarget, t_ns, _BASE, PoseNumbers(t_ns, row.target[:3], row.target[3:]))
        led = arm.led() if isinstance(arm, TellingArm) else None
        if led is not None and led.t_ns != self._led_ns:
            self._led_ns = led.t_ns
            self._pose(ArmSent, t_ns, _BASE, _numbers(led, self._start_ns))
        if t_ns - self._health_ns >= _HEALTH_NS or self._health_ns < 0:
            self._health_ns = t_ns
            health = asdict(arm.health)
            if health["success_rate"] is None:
                health["success_rate"] = -1.0
            self._bus.publish(ArmHealth(t_ns=t_ns, **health))

    def _pose(self, kind: type[PoseRecord], t_ns: int, frame: str, pose: PoseNumbers) -> None:
        if len(pose.position) == 3 and len(pose.quaternion) == 4:
            place, turned = pose.position, pose.quaternion
            self._bus.publish(
                kind(t_ns=pose.t_ns, taken_ns=t_ns, frame=frame, position=place, quaternion=turned)
            )

    def _axes(self, t_ns: int) -> None:
        """Publish the orientation of the tracker's axes, unless the mapping mirrors and so is no rotation."""
        matrix = ToBase(self._mapping).matrix
        if np.linalg.det(matrix) > 0:
            turned = tuple(from_matrix(matrix).tolist())
            self._bus.publish(TrackerAxes(t_ns=t_ns, parent=_BASE, child=_TRACKER, quaternion=turned))


def arm_row(turn: Turn, command: ArmCommand, arm: ArmDriver, start_ns: int) -> ArmTurn:
    """Return the record of a turn and its command; ``start_ns`` is the session's start on the monotonic clock."""
    return ArmTurn(
        t_ns=turn.t_ns - start_ns,
        poses=tuple(_numbers(pose, start_ns) for pose in turn.poses),
        clutch=turn.clutch,
        dead_man=turn.dead_man,
        may_move=turn.may_move,
        measured=() if turn.measured is None else (_numbers(turn.measured, start_ns),),
        stopped=turn.stopped,
        cleared=turn.cleared,
        phase=arm.phase,
        **_commanded(command),
    )


def turn_of(row: ArmTurn) -> Turn:
    """Return the inputs of a recorded turn."""
    poses, measured = ([StampedPose(*astuple(pose)) for pose in some] for some in (row.poses, row.measured))
    same: dict[str, Any] = {name: getattr(row, name) for name in Turn._fields}
    return Turn(**same | {"poses": tuple(poses), "measured": measured[0] if measured else None})


def with_command(row: ArmTurn, command: ArmCommand) -> ArmTurn:
    """Return a turn with the command that its input led to."""
    return replace(row, **_commanded(command))


def _commanded(command: ArmCommand) -> dict[str, Any]:
    return {
        "state": command.state,
        "reason": command.reason,
        "holds": command.engagements,
        "target": () if command.target is None else tuple(np.concatenate(command.target).tolist()),
        "velocity": (*command.velocity_m_s.tolist(), *command.velocity_rad_s.tolist()),
    }


def _numbers(pose: StampedPose, start_ns: int) -> PoseNumbers:
    place, turned = _listed(pose.position_m), _listed(pose.quaternion_xyzw)
    return PoseNumbers(pose.t_ns - start_ns, place, turned, bool(pose.valid))


def _listed(numbers: Any) -> tuple[float, ...]:
    """Return a place or a turn as numbers; none where it is neither, which no gate lets pass."""
    array = np.asarray(numbers, np.float64)
    return tuple(array.tolist()) if array.ndim == 1 else ()


class ArmView(NamedTuple):
    """View of an arm at one moment; ``hand_m`` is in the base's axes, ``behind_mm`` the distance from the target."""

    state: ArmState
    reason: str
    phase: str
    clutch: bool
    dead_man: bool
    hand_m: tuple[float, float, float] | None
    behind_mm: float | None
    health: Health

    @property
    def words(self) -> str:
        """Summary of the arm in one line: state, reason and timing of its loop."""
        health = self.health
        took = "" if health.success_rate is None else f", robot took {100 * health.success_rate:.0f} %"
        return (
            f"{self.state}: {self.reason} "
            f"({self.phase}, {health.rate_hz:.0f} Hz, worst {health.worst_ms:.0f} ms{took})"
        )

    @property
    def place(self) -> str:
        """Words for the hand's place, and how far it is behind its target."""
        if self.hand_m is None:
            return "not known yet"
        x, y, z = self.hand_m
        behind = "" if self.behind_mm is None else f", {self.behind_mm:.0f} mm from its target"
        return f"{x:+.3f} {y:+.3f} {z:+.3f} m{behind}"

    @property
    def switches(self) -> str:
        """Words for the switches that the operator holds."""
        return (
            f"clutch {'pressed' if self.clutch else 'open'}, dead-man {'held' if self.dead_man else 'let go'}"
        )


def arm_view(row: ArmTurn, health: Health) -> ArmView:
    """Return the view of an arm's turn."""
    measured, target = row.measured[0].position if row.measured else (), row.target[:3]
    hand_m: tuple[float, float, float] | None = None
    behind_mm = None
    if len(measured) == 3:
        x, y, z = measured
        hand_m = x, y, z
        behind_mm = 1e3 * math.dist(measured, target) if len(target) == 3 else None
    state = cast("ArmState", row.state)
    return ArmView(state, row.reason, row.phase, row.clutch, row.dead_man, hand_m, behind_mm, health)
