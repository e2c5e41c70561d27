"""Where a shape lies before the gel that touches a pad of the physics: from the rule alone, in rotations one by one."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tega_sim.gel import fall

Array = NDArray[np.float64]


def turn_between(one: Array, other: Array) -> Array:
    """Return the rotation of the shortest way from one direction to another (Rodrigues)."""
    one, other = one / np.linalg.norm(one), other / np.linalg.norm(other)
    axis, cosine = np.cross(one, other), float(one @ other)
    sine = float(np.linalg.norm(axis))
    if sine < 1e-12:
        return np.eye(3)
    x, y, z = axis / sine
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    turned: Array = np.eye(3) + sine * cross + (1 - cosine) * cross @ cross
    return turned


def pad_pose(
    pad: tuple[Array, Array],
    near_m: Array,
    normal: Array,
    shape: tuple[Array, Array],
    *,
    radius_m: float,
    half_length_m: float,
) -> Array:
    """Return rotation and translation, float64 (3, 4), millimetres, from the shape's own frame to the pad frame."""
    at_m, turned = pad
    # The gel's x, y and z are the pad's -y, -z and x.
    to_gel = np.array([[0, -1, 0], [0, 0, -1], [1, 0, 0]]) @ turned.T
    off, out = to_gel @ (near_m - at_m), to_gel @ normal
    out /= np.linalg.norm(out)
    # On the capsule the normal leans by the arc from the middle; along the finger the straight part goes before it.
    straight = np.clip(off[1] - radius_m * out[1], -half_length_m, half_length_m)
    lean = np.arctan2(np.hypot(out[0], out[1]), out[2])
    sideways = out[:2] / max(np.hypot(out[0], out[1]), 1e-300)
    across, along = radius_m * lean * sideways + (0.0, straight)
    right, down = fall(1e3 * across, 1e3 * along)
    roll = turn_between(np.array([0, 0, 1.0]), np.array([right, down, 1.0])) @ turn_between(
        out, np.array([0, 0, 1.0])
    )
    place, lies = shape
    pose = np.empty((3, 4))
    pose[:, :3] = roll @ to_gel @ lies
    pose[:, 3] = 1e3 * (roll @ to_gel @ (place - near_m) + (across, along, 0.0))
    return pose
