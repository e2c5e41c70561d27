"""Where a bar touches the rounded gel: found by looking everywhere."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from tega_sim.gel import Gel, ball, fall
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
            right, down = fall(float(x), float(y))
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
