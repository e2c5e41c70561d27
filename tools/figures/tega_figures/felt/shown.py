"""Score what the vest shows of the forces on the fingertips in simulated lifts: felt where loaded, silent where not.

``python -m tega_figures.felt.shown --seeds 41,42 [KEY=VALUE ...]`` prints a table by object and finger.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from tega.config import FINGERS
from tega_figures.touch_demo import DEMO_OBJECTS, LOAD_N, RELEASE_S
from tega_figures.touch_presses import rank_correlation
from tega_sim.plan import TrialPlan
from tega_sim.streams import Streams
from tega_sim.trial import run_trial

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Shown", "score_lifts", "shown_table"]

FELT_PERCENT: Final = 20
"""Intensity that skin feels where a wearer's threshold was not measured."""

# A picture is this old when it is measured; what is shown is compared with the force of then.
_LAG_S: Final = 0.02


class Shown(NamedTuple):
    """Vest frames of one finger in one lift.

    Attributes:
        seed: Of the person.
        object: The lifted object.
        finger: The finger.
        loaded: Frames before which the finger carried 0.5 N throughout 0.1 s.
        felt: Those of them in which a motor of its columns ran at 20 % or more.
        free: Frames before which nothing touched the finger for 0.2 s.
        false: Those of them in which a motor of its columns ran.
        rank: Rank correlation of force and the mean of its columns, over all frames.
    """

    seed: int
    object: str
    finger: str
    loaded: int
    felt: int
    free: int
    false: int
    rank: float


def score_lifts(
    seeds: Iterable[int], *, settings: Sequence[str] = (), objects: Sequence[str] = DEMO_OBJECTS
) -> list[Shown]:
    """Run lifts of the default person and settings, and score every finger.

    Args:
        seeds: Of the people.
        settings: What differs from the defaults, as ``key=value``.
        objects: What is lifted.
    """
    found = []
    for seed in seeds:
        for name in objects:
            kept = Streams()
            run_trial(TrialPlan(object=name, seed=seed, settings=tuple(settings), rules=3), streams=kept)
            vest = np.array(kept.rows["vest"], np.float64)
            t_s, motors = vest[:, 0], vest[:, 1:].reshape(len(vest), 2, -1, 4)
            at_s = kept.array("truth", "t_s")
            for column, finger in enumerate(FINGERS):
                force_n = kept.array("truth", f"{finger}_force_n")
                found.append(Shown(seed, name, finger, *_score(t_s, motors[..., column], at_s, force_n)))
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


def shown_table(found: Sequence[Shown]) -> str:
    """Return the scores by object and finger as a Markdown table, with the worst seed of each."""
    lines = [
        "| object | finger | loaded frames | felt | worst seed | silent frames | shown in them | rank, median |",
        "|---|---|---|---|---|---|---|---|",
    ]
    keys = [(one.object, one.finger) for one in found]
    groups = [[s for s in found if (s.object, s.finger) == key] for key in dict.fromkeys(keys)]
    lines.extend(_row(some[0].object, some[0].finger, some) for some in groups)
    lines.append(_row("all", "all", list(found)))
    return "\n".join(lines)


def _row(name: str, finger: str, some: Sequence[Shown]) -> str:
    loaded, felt = sum(s.loaded for s in some), sum(s.felt for s in some)
    free, false = sum(s.free for s in some), sum(s.false for s in some)
    worst, seed = min((s.felt / max(s.loaded, 1), s.seed) for s in some if s.loaded)
    rank = float(np.median([s.rank for s in some]))
    return (
        f"| {name} | {finger} | {loaded} | {felt / max(loaded, 1):.1%} | {worst:.1%} ({seed}) | {free} | "
        f"{false / max(free, 1):.2%} | {rank:.2f} |"
    )


def _main() -> None:
    words = argparse.ArgumentParser(description=__doc__)
    words.add_argument("--seeds", default="41,42,43,44,45", help="of the people, with commas")
    words.add_argument("settings", nargs="*", help="KEY=VALUE of the loop")
    given = words.parse_args()
    seeds = [int(seed) for seed in given.seeds.split(",")]
    print(shown_table(score_lifts(seeds, settings=given.settings)))


if __name__ == "__main__":
    _main()
