"""Where a bar or a shape touches the rounded gel and the pad, found by other ways; frames of a gel."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tega import _native
from tega_sim.gel import Gel, ball
from tega_sim.seams import Indenter


def nearest_touch(indenter: Indenter) -> tuple[float, float, float, float]:
    """Return where a long bar lies on the pad as the gel does there: x, y; how far off it is, mm; how turned, rad."""
    axis, middle = indenter.pose_mm[:, 2], indenter.pose_mm[:, 3]
    best = (0.0, 0.0, np.inf, np.inf)
    for x in np.arange(-13.0, 13.1, 0.25):
        for y in np.arange(-15.0, 15.1, 0.5):
            place = np.array([x, y, 0.0])
            foot = middle + axis * ((place - middle) @ axis) - place
            distance = float(np.linalg.norm(foot))
            right, down = _native.gel_fall(float(x), float(y))
            normal = np.array([right, down, 1.0]) / np.sqrt(1 + right**2 + down**2)
            turned = float(np.arccos(np.clip(foot @ normal / distance, -1, 1)))
            off = abs(distance - indenter.size_mm[0])
            if turned + off / 10 < best[3] + best[2] / 10:
                best = (float(x), float(y), off, turned)
    return best


PERIOD_NS = 16_666_667
# A finger is pressed from here to there; the other for the whole time.
PRESSED = range(20, 70)
N_FRAMES = 190


@lru_cache
def gel_frames(seed: int, *, held: bool) -> tuple[list[np.ndarray[Any, Any]], np.ndarray[Any, Any]]:
    """Return the frames of a gel that keeps something after a release, and its baseline."""
    gel = Gel(seed, memory=True)
    baseline = np.rint(np.mean([gel.frame([], k).astype(float) for k in range(10)], axis=0)).astype(np.uint8)
    gel.forget()
    press = [ball(force_n=4.0)]
    frames = [gel.frame(press if k in PRESSED or (held and k >= 20) else [], k) for k in range(N_FRAMES)]
    return frames, baseline


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
    right, down = _native.gel_fall(1e3 * across, 1e3 * along)
    roll = turn_between(np.array([0, 0, 1.0]), np.array([right, down, 1.0])) @ turn_between(
        out, np.array([0, 0, 1.0])
    )
    place, lies = shape
    pose = np.empty((3, 4))
    pose[:, :3] = roll @ to_gel @ lies
    pose[:, 3] = 1e3 * (roll @ to_gel @ (place - near_m) + (across, along, 0.0))
    return pose
