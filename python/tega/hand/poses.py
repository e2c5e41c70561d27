"""Read and write the poses of the closure levels, in a file that a person can read, teach and change.

::

    [level-1]
    index = [0.0, 0.0, 0.1, 0.1]
    middle = [0.0, 0.0, 0.1, 0.1]
    ring = [0.0, 0.0, 0.1, 0.1]
    thumb = [0.8, 0.15, 0.1, 0.2]

and so on to ``[level-5]``: joint angles in rad, from the palm outwards.
"""

from __future__ import annotations

import tomllib
from itertools import pairwise
from pathlib import Path

import numpy as np
import tomlkit
from numpy.typing import ArrayLike, NDArray

from tega.errors import ConfigError, TegaError
from tega.hand.motion import CLOSURE_POSES_RAD, JOINT_LIMITS_RAD, JOINT_NAMES, HandController
from tega.runtime.files.foreign_file import parse_toml, read_words
from tega.runtime.files.toml_text import tree_item
from tega.runtime.files.whole_file import write_whole
from tega.wire import HAND_FINGERS
from tega.wire.arrays import float_array

POSE_MARGIN_RAD = 0.04
"""Poses keep so far inside the joint limits."""

_LEVELS = range(1, 6)


def load_poses(file: Path) -> NDArray[np.float64]:
    """Read the joint angles of the closure levels, float64 (5, 16), rad.

    ``ConfigError``: the file cannot be read, or a level, finger or angle is missing, odd or out of range.
    """
    try:
        tables = parse_toml(read_words(file, error=ConfigError))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise ConfigError(
            f"{file.name}: the poses cannot be read: {error}", "tega-teleop hand teach writes such a file"
        ) from error
    wanted = {f"level-{level}" for level in _LEVELS}
    if set(tables) != wanted:
        odd = sorted(wanted ^ set(tables))
        raise ConfigError(f"{file.name}: {', '.join(odd)} is missing or unknown", "it has level-1 to level-5")
    poses = np.array([_pose(file.name, name, tables[name]) for name in sorted(wanted)])
    try:
        HandController(poses_rad=poses)
    except TegaError as error:
        raise ConfigError(f"{file.name}: {error.message}", error.hint) from error
    return poses


def _pose(file: str, name: str, table: object) -> list[float]:
    if not isinstance(table, dict) or set(table) != set(HAND_FINGERS):
        raise ConfigError(f"{file}: [{name}] has to have {', '.join(HAND_FINGERS)} and nothing else")
    angles: list[float] = []
    for finger in HAND_FINGERS:
        values = table[finger]
        numbers = (
            isinstance(values, list) and len(values) == 4 and all(type(v) in {int, float} for v in values)
        )
        if not numbers:
            raise ConfigError(f"{file}: [{name}] {finger} = {values!r} is not four angles in rad")
        angles += values
    return angles


def save_poses(file: Path, poses_rad: ArrayLike) -> None:
    """Write closure poses, (5, 16), rad, to a tenth of a milliradian.

    The file is replaced in one step, so that a reader never sees half of it. ``InvalidValueError``: an angle
    is not finite or within 0.04 rad of a joint limit.
    """
    poses = float_array("poses_rad", poses_rad, (5, 16)).round(4)
    HandController(poses_rad=poses)
    text = tomlkit.document()
    text.add(
        tomlkit.comment("Closure levels, 1 open to 5 tight. Joint angles in rad, from the palm outwards.")
    )
    text.add(tomlkit.nl())
    for level, pose in zip(_LEVELS, poses.reshape(-1, len(HAND_FINGERS), 4).tolist(), strict=True):
        text.add(f"level-{level}", tree_item(dict(zip(HAND_FINGERS, pose, strict=True))))
    write_whole(file, tomlkit.dumps(text))


def taught(
    poses_rad: ArrayLike | None, level: int, angles_rad: NDArray[np.float64]
) -> tuple[NDArray[np.float64], list[str]]:
    """Return the poses with measured angles, float64 (16,), in the place of one level's, 1 to 5.

    ``poses_rad`` (5, 16) are the poses so far; ``None`` for the built-in ones. The result is the new poses,
    float64 (5, 16), and the names of the joints that had to be moved inside the limits.
    """
    poses = np.array(CLOSURE_POSES_RAD if poses_rad is None else poses_rad, np.float64)
    # A hair more than the margin, since the file is rounded.
    low, high = JOINT_LIMITS_RAD[:, 0] + POSE_MARGIN_RAD, JOINT_LIMITS_RAD[:, 1] - POSE_MARGIN_RAD
    inside = np.clip(angles_rad, np.ceil(low * 1e4 + 1e-6) / 1e4, np.floor(high * 1e4 - 1e-6) / 1e4)
    poses[level - 1] = inside
    moved = np.flatnonzero(np.abs(inside - angles_rad) > 1e-3)
    return poses, [JOINT_NAMES[j] for j in moved]


class ClosureScale:
    """Reads a hand's closure off its joint angles: 1 in the pose of level 1, 5 in that of level 5.

    Angles are projected onto the way from the first pose to the last; between two levels they count in
    proportion. ``poses_rad`` are those of the five levels, float64 (5, 16); the built-in ones where ``None``.
    """

    def __init__(self, poses_rad: NDArray[np.float64] | None = None) -> None:
        poses = CLOSURE_POSES_RAD if poses_rad is None else poses_rad
        self._route = poses[4] - poses[0]
        self._at_level: list[float] = (poses @ self._route).tolist()

    def __call__(self, angles_rad: NDArray[np.float64]) -> float:
        """Return the closure at joint angles, float64 (16,), rad."""
        at = float(angles_rad @ self._route)
        for level, (one, other) in enumerate(pairwise(self._at_level), start=1):
            if at < other:
                return level + max(0.0, (at - one) / (other - one))
        return 5.0
