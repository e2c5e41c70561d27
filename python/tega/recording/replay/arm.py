"""Compute the arm's commands again from the forearm poses as they came, and compare them bit for bit."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from tega.arm.chain import ArmChain
from tega.arm.pose import ArmCommand, StampedPose
from tega.arm.settings import ArmSettings, MappingSettings
from tega.arm.turn import Turn, lead
from tega.errors import RecordingError
from tega.recording.replay.compare import Compared
from tega.recording.replay.head import Head
from tega.recording.replay.recorded import read_recorded
from tega.records import ArmTurn

if TYPE_CHECKING:
    from tega.recording.replay.feed import RecordFeed

_POSE = ("x", "y", "z", "qx", "qy", "qz", "qw")
_SPEEDS = ("x", "y", "z", "about_x", "about_y", "about_z")


def arm_settings(head: Head) -> ArmSettings:
    """Return the settings of a recorded run's chain."""
    tree = head.tree.get("arm", {})
    return msgspec.convert({k: tree[k] for k in ArmSettings.__struct_fields__ if k in tree}, ArmSettings)


def compare_arm(feed: RecordFeed, settings: ArmSettings) -> Compared:
    """Give a new chain the input of every turn, and compare its commands.

    Args:
        feed: The recording.
        settings: Settings of the new chain.
    """
    compared, chain = Compared(ArmTurn.topic), ArmChain(settings)

    def turn(row: ArmTurn) -> None:
        command = lead(chain, _turn(row))
        if row.t_ns >= feed.head.from_ns:
            compared.recorded(_told(row), row.t_ns)
            compared.replayed(_commanded(command), row.t_ns)

    feed.bus.subscribe(ArmTurn, turn, vital=True)
    return compared


def _turn(row: Any) -> Turn:
    return Turn(
        row.t_ns,
        tuple(_pose(pose) for pose in row.poses),
        clutch=row.clutch,
        dead_man=row.dead_man,
        may_move=row.may_move,
        measured=_pose(row.measured[0]) if row.measured else None,
        stopped=row.stopped,
        cleared=row.cleared,
    )


def _pose(pose: Any) -> StampedPose:
    return StampedPose(pose.t_ns, list(pose.position), list(pose.quaternion), valid=pose.valid)


def _told(row: Any) -> dict[str, Any]:
    said = {"state": row.state, "reason": row.reason, "holds": row.holds}
    return said | _named("target", _POSE, row.target) | _named("velocity", _SPEEDS, row.velocity)


def _commanded(command: ArmCommand) -> dict[str, Any]:
    said = {"state": command.state, "reason": command.reason, "holds": command.engagements}
    target = [] if command.target is None else np.concatenate(command.target).tolist()
    speeds = [*command.velocity_m_s.tolist(), *command.velocity_rad_s.tolist()]
    return said | _named("target", _POSE, target) | _named("velocity", _SPEEDS, speeds)


def _named(what: str, names: tuple[str, ...], numbers: Any) -> dict[str, float]:
    return {f"{what}_{name}": number for name, number in zip(names, numbers, strict=False)}


def forearm(path: Path) -> tuple[MappingSettings, list[StampedPose]]:
    """Return how a recorded run turned forearm poses into the base's axes, and the poses as they came.

    Raises:
        RecordingError: The recording cannot be read, or has no tracked forearm.
    """
    recorded = read_recorded(path, pictures_wanted=lambda _head: False)
    poses = [_pose(pose) for row in recorded.of(ArmTurn) for pose in row.poses]
    if not poses:
        raise RecordingError(f"{path.name}: no forearm was tracked in it", "name a run with an [arm]")
    return arm_settings(recorded.head).mapping, poses
