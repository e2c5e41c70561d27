"""Scores the touch of the demo's three lifts against what the simulator knows: felt, reported falsely, jumps, ranks.

The lifts are those of ``tega-teleop demo``: the same objects, person and loop, in which each finger is told whether
another bears a load. The truth of a frame is that of its exposure.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from tega.config import FINGERS
from tega_learn.score import rank_correlation
from tega_sim.lab import lab_of
from tega_sim.plan import TrialPlan
from tega_sim.rig import CAMERA_DELAY_NS
from tega_sim.streams import Streams
from tega_sim.trial import run_trial

if TYPE_CHECKING:
    from tega.stages.base import MeasuredPicture
    from tega_sim.lab import Lab

__all__ = ["DEMO_OBJECTS", "DemoScore", "KeptPictures", "score_demo"]

DEMO_OBJECTS: Final = ("bottle", "container", "bag")
LOAD_N: Final = 0.5
QUARTER: Final = 0.25
RELEASE_S: Final = 0.1
# A force is steady that changes by less than this share between two frames.
_STEADY: Final = 0.05
_JUMP: Final = 0.15


class DemoScore(NamedTuple):
    """How one finger's touch follows the truth over the lifts."""

    loaded: int
    """Frames in which the finger carries 0.5 N or more."""
    missed: int
    """Those of them without contact."""
    beyond: int
    """Loaded frames whose touching area lies beyond the picture altogether."""
    missed_beyond: int
    partly: int
    """Loaded frames in which less than a quarter of the touching area is in the picture, but some."""
    missed_partly: int
    in_view: int
    """Loaded frames in which a quarter or more is."""
    missed_in_view: int
    told_late: int
    """Frames with a contact later than 0.1 s after the last true one, which a release may take."""
    steady: int
    """Pairs of frames in contact, 0.5 N and more, whose force differs by less than 5 %."""
    jumps: int
    """Those of them whose EDA differs by more than 0.15 of the range that this finger's EDA has in this lift."""
    full: int
    """Frames in which a column of the vest stands at 100."""
    rank: float
    """Rank correlation of force with front plus back of the vest over all frames."""


class KeptPictures(Streams):
    """Keeps of every picture what was measured and what was so."""

    def __init__(self, lab: Lab) -> None:
        super().__init__()
        self._lab = lab
        self.seen: list[tuple[str, float, bool, float, bool, float]] = []

    def picture_of(self, picture: MeasuredPicture) -> None:
        """Keep time, contact, EDA, whether something touches, and how much of where it does is in the picture."""
        super().picture_of(picture)
        found = picture.contact
        gel = self._lab.gels[found.finger]
        t_s = (found.t_ns - CAMERA_DELAY_NS) / 1e9
        self.seen.append(
            (found.finger, t_s, found.in_contact, float(found.eda), gel.truth.touches, gel.in_view)
        )


def score_demo(seed: int = 1) -> dict[str, DemoScore]:
    """Run the demo's three lifts and score each finger over all of them.

    ``seed`` is of the person and of all noise; the demo's own is 1.
    """
    counts = {finger: np.zeros(len(DemoScore._fields) - 1, np.int64) for finger in FINGERS}
    felt: dict[str, list[tuple[float, float]]] = {finger: [] for finger in FINGERS}
    for name in DEMO_OBJECTS:
        kept = KeptPictures(lab_of(seed, "live", ()))
        run_trial(TrialPlan(object=name, seed=seed), streams=kept)
        at_s = kept.array("truth", "t_s")
        for finger in FINGERS:
            force = kept.array("truth", f"{finger}_force_n")
            rows = np.array([row[1:] for row in kept.seen if row[0] == finger], np.float64)
            whose = ("finger", finger)
            front, back = (kept.array("contacts", column, where=whose) for column in ("front", "back"))
            counts[finger] += [
                *_count(rows, np.interp(rows[:, 0], at_s, force)),
                int(np.sum((front >= 100) | (back >= 100))),
            ]
            displayed_s = kept.array("contacts", "t_s", where=whose) - CAMERA_DELAY_NS / 1e9
            felt[finger] += list(zip(np.interp(displayed_s, at_s, force), front + back, strict=True))
    scores = {}
    for finger, pairs in felt.items():
        rank = rank_correlation(*zip(*pairs, strict=True))
        scores[finger] = DemoScore._make([*counts[finger].tolist(), rank])
    return scores


def _count(rows: np.ndarray[tuple[int, int], np.dtype[np.float64]], force: np.ndarray) -> list[int]:
    """Return what is counted in a lift's pictures, in the order of :class:`DemoScore`."""
    t_s, on, eda, touches = rows[:, 0], rows[:, 1] > 0, rows[:, 2], rows[:, 3] > 0
    loaded, share = force >= LOAD_N, np.nan_to_num(rows[:, 4])
    beyond, in_view = loaded & (share == 0), loaded & (share >= QUARTER)
    partly = loaded & ~beyond & ~in_view
    since_s = t_s - np.maximum.accumulate(np.where(touches, t_s, -np.inf))
    late = since_s > RELEASE_S + 1e-6
    pair = on[1:] & on[:-1] & loaded[1:] & (np.abs(np.diff(force)) < _STEADY * force[1:])
    wide = np.ptp(eda[on]) if on.any() else 1.0
    which = [some for part in (loaded, beyond, partly, in_view) for some in (part, part & ~on)]
    which += [on & late, pair, pair & (np.abs(np.diff(eda)) > _JUMP * wide)]
    return [int(some.sum()) for some in which]
