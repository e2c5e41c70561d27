"""Score what the vest shows of the forces on the fingertips in simulated lifts: felt where loaded, silent where not."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from tega.config import FINGERS
from tega_figures.touch_demo import DEMO_OBJECTS, LOAD_N, RELEASE_S
from tega_learn.score import rank_correlation
from tega_sim.plan import TrialPlan
from tega_sim.streams import Streams
from tega_sim.trial import run_trial

if TYPE_CHECKING:
    from numpy.typing import NDArray

FELT_PERCENT: Final = 20
"""Intensity that skin feels where a wearer's threshold was not measured."""

# A picture is this old when it is measured; what is shown is compared with the force of then.
_LAG_S: Final = 0.02


class Shown(NamedTuple):
    """Vest frames of one finger in one lift.

    Attributes:
        loaded: Frames before which the finger carried 0.5 N throughout 0.1 s.
        felt: Those of them in which a motor of its columns ran at 20 % or more.
        free: Frames before which nothing touched the finger for 0.2 s.
        false: Those of them in which a motor of its columns ran.
        rank: Rank correlation of force and the mean of its columns, over all frames.
    """

    loaded: int
    felt: int
    free: int
    false: int
    rank: float


def score_lifts(seeds: Iterable[int]) -> list[Shown]:
    """Run lifts of the default person and settings, one a person's seed, and score every finger."""
    found = []
    for seed in seeds:
        for name in DEMO_OBJECTS:
            kept = Streams()
            run_trial(TrialPlan(object=name, seed=seed), streams=kept)
            vest = np.array(kept.rows["vest"], np.float64)
            t_s, motors = vest[:, 0], vest[:, 1:].reshape(len(vest), 2, -1, 4)
            at_s = kept.array("truth", "t_s")
            for column, finger in enumerate(FINGERS):
                force_n = kept.array("truth", f"{finger}_force_n")
                found.append(Shown(*_score(t_s, motors[..., column], at_s, force_n)))
    return found


def _score(
    t_s: NDArray[np.float64],
    motors: NDArray[np.float64],
    at_s: NDArray[np.float64],
    force_n: NDArray[np.float64],
) -> tuple[int, int, int, int, float]:
    before = np.searchsorted(at_s, t_s, side="right")
    since = np.searchsorted(at_s, t_s - RELEASE_S), np.searchsorted(at_s, t_s - 2 * RELEASE_S)
    least = np.array([force_n[i:j].min(initial=np.inf) for i, j in zip(since[0], before, strict=True)])
    most = np.array([force_n[i:j].max(initial=0.0) for i, j in zip(since[1], before, strict=True)])
    strongest = motors.max(axis=(1, 2))
    loaded, free = np.isfinite(least) & (least >= LOAD_N), most == 0
    rank = rank_correlation(np.interp(t_s - _LAG_S, at_s, force_n), motors.mean(axis=(1, 2)))
    counts = (loaded, loaded & (strongest >= FELT_PERCENT), free, free & (strongest > 0))
    n_loaded, n_felt, n_free, n_false = (int(some.sum()) for some in counts)
    return n_loaded, n_felt, n_free, n_false, float(rank)
