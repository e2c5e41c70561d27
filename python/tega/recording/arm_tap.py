"""What of an arm is recorded: all that a turn took in, so that it can be computed again, and poses for viewers."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from tega.arm.frames import ToBase
from tega.arm.rotation import from_matrix
from tega.devices.base import TellingArm

if TYPE_CHECKING:
    from tega.arm.pose import ArmCommand, StampedPose
    from tega.arm.settings import MappingSettings
    from tega.arm.turn import Turn
    from tega.devices.base import ArmDriver

__all__ = ["BASE", "TRACKER", "ArmTap"]

BASE, TRACKER = "arm_base", "tracker"
"""Names of the two coordinate frames in a recording."""

_HEALTH_NS = 1_000_000_000

Put = Callable[[str, int, str, Any], None]


class ArmTap:
    """Sees every turn of what leads an arm.

    Args:
        put: Takes a topic, a time since the start of the session, a kind and a value.
        start_ns: Start of the session on the monotonic clock.
        mapping: How the tracker's axes become the base's.
    """

    def __init__(self, put: Put, start_ns: int, mapping: MappingSettings) -> None:
        self._put, self._start_ns, self._mapping = put, start_ns, mapping
        self._begun = False
        self._measured_ns = self._led_ns = self._health_ns = -1

    def turn(self, turn: Turn, command: ArmCommand, arm: ArmDriver) -> None:
        """See a turn and what came of it."""
        t_ns = turn.t_ns - self._start_ns
        if not self._begun:
            self._begun = True
            self._axes(t_ns)
        poses = [self._numbers(pose) for pose in turn.poses]
        for pose in poses:
            if pose["valid"] and np.isfinite([*pose["position"], *pose["quaternion"]]).all():
                self._pose("/arm/forearm", t_ns, TRACKER, pose)
        self._put("/arm/turn", t_ns, "ArmTurn", self._row(turn, command, arm, poses))
        if (seen := turn.measured) is not None and seen.t_ns != self._measured_ns:
            self._measured_ns = seen.t_ns
            self._pose("/arm/measured", t_ns, BASE, self._numbers(seen))
        if command.target is not None:
            place, turned = (numbers.tolist() for numbers in command.target)
            self._pose("/arm/target", t_ns, BASE, {"t_ns": t_ns, "position": place, "quaternion": turned})
        led = arm.led() if isinstance(arm, TellingArm) else None
        if led is not None and led.t_ns != self._led_ns:
            self._led_ns = led.t_ns
            self._pose("/arm/sent", t_ns, BASE, self._numbers(led))
        if t_ns - self._health_ns >= _HEALTH_NS or self._health_ns < 0:
            self._health_ns = t_ns
            h = arm.health
            health = {
                "t_ns": t_ns,
                "rate_hz": h.rate_hz,
                "worst_ms": h.worst_ms,
                "late": h.late,
                "refused": h.refused,
                "success_rate": -1.0 if h.success_rate is None else h.success_rate,
            }
            self._put("/arm/health", t_ns, "ArmHealth", health)

    def _row(
        self, turn: Turn, command: ArmCommand, arm: ArmDriver, poses: list[dict[str, Any]]
    ) -> dict[str, Any]:
        return {
            "t_ns": turn.t_ns - self._start_ns,
            "poses": poses,
            "clutch": turn.clutch,
            "dead_man": turn.dead_man,
            "may_move": turn.may_move,
            "measured": [] if turn.measured is None else [self._numbers(turn.measured)],
            "stopped": turn.stopped,
            "cleared": turn.cleared,
            "state": command.state,
            "reason": command.reason,
            "holds": command.engagements,
            "target": [] if command.target is None else np.concatenate(command.target).tolist(),
            "velocity": [*command.velocity_m_s.tolist(), *command.velocity_rad_s.tolist()],
            "phase": arm.phase,
        }

    def _numbers(self, pose: StampedPose) -> dict[str, Any]:
        return {
            "t_ns": pose.t_ns - self._start_ns,
            "position": _listed(pose.position_m),
            "quaternion": _listed(pose.quaternion_xyzw),
            "valid": bool(pose.valid),
        }

    def _pose(self, topic: str, t_ns: int, frame: str, pose: dict[str, Any]) -> None:
        if len(pose["position"]) == 3 and len(pose["quaternion"]) == 4:
            self._put(topic, t_ns, "pose", (frame, pose))

    def _axes(self, t_ns: int) -> None:
        """Tell viewers how the tracker's axes lie; a mapping that mirrors is no turn, and is left out."""
        matrix = ToBase(self._mapping).matrix
        if np.linalg.det(matrix) > 0:
            self._put("/arm/axes", t_ns, "axes", (BASE, TRACKER, from_matrix(matrix).tolist()))


def _listed(numbers: Any) -> list[float]:
    """Return a place or a turn as numbers; none where it is neither, which no gate lets pass."""
    array = np.asarray(numbers, np.float64)
    return array.tolist() if array.ndim == 1 else []
