"""Timing by turns: every variant in every round, so that what slows the machine down slows all of them.

A benchmark runner that finishes one variant before the next cannot take turns; ``docs/evidence/pareto.md`` says what
that does to a ratio.
"""

from __future__ import annotations

import gc
import statistics
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, TypeVar

import msgspec
import numpy as np

__all__ = ["Call", "Timing", "in_turns", "ratio", "single_threaded", "take_turns", "timing"]

Call = Callable[[], object]
_Key = TypeVar("_Key")
_Subject = TypeVar("_Subject")
_Result = TypeVar("_Result")

# Calls of a turn. The first of them is not timed: it brings code and data back into the caches that the others used.
CALLS_PER_TURN = 5
FEWEST_ROUNDS, MOST_ROUNDS = 3, 1000
# Rounds before the timed ones: allocators, lazy imports, first-call compilation.
WARM_ROUNDS = 2


class Timing(msgspec.Struct, frozen=True, kw_only=True):
    """What a variant took: median and 99th percentile of the timed calls.

    Of fewer than 100 calls the latter is close to the slowest one.
    """

    median_us: float
    p99_us: float
    n_calls: int


def in_turns(
    subjects: Mapping[_Key, _Subject], measure: Callable[[_Subject], _Result], *, budget_s: float
) -> dict[_Key, list[list[_Result]]]:
    """Measure each subject a few times in every round.

    The order is reversed from round to round, so that nobody always follows the same one. The garbage
    collector is off and what lives already is put out of its sight. ``measure`` uses a subject once and
    returns how long that took; ``budget_s`` is roughly for all rounds together, of which there are at least
    three. Results are by name, then by round; the first use of each turn is left out.
    """
    names = list(subjects)
    with _no_collection():
        for _ in range(WARM_ROUNDS):
            started_ns = time.perf_counter_ns()
            for name in names:
                measure(subjects[name])
            round_s = (time.perf_counter_ns() - started_ns) * CALLS_PER_TURN / 1e9
        rounds = min(max(int(budget_s / round_s), FEWEST_ROUNDS), MOST_ROUNDS)
        results: dict[_Key, list[list[_Result]]] = {name: [] for name in names}
        for number in range(rounds):
            for name in names if number % 2 == 0 else reversed(names):
                turn = [measure(subjects[name]) for _ in range(CALLS_PER_TURN)]
                results[name].append(turn[1:])
    return results


def take_turns(variants: Mapping[str, Call], *, budget_s: float) -> dict[str, list[list[int]]]:
    """Time calls by :func:`in_turns`; return nanoseconds, by name, then by round."""
    return in_turns(variants, _timed, budget_s=budget_s)


def _timed(call: Call) -> int:
    started_ns = time.perf_counter_ns()
    call()
    return time.perf_counter_ns() - started_ns


def timing(turns: list[list[int]]) -> Timing:
    """Sum up the calls of one variant."""
    calls = np.concatenate([np.array(turn) for turn in turns]) / 1000.0
    return Timing(
        median_us=float(np.median(calls)), p99_us=float(np.percentile(calls, 99)), n_calls=calls.size
    )


def ratio(turns: list[list[int]], reference: list[list[int]]) -> float:
    """Return how many times a reference's time a variant takes: the median over rounds of the turns' ratio.

    Both turns of a round lie close together in time, so a slow drift of the machine cancels.
    """
    pairs = zip(turns, reference, strict=True)
    return statistics.median(statistics.median(own) / statistics.median(its) for own, its in pairs)


@contextmanager
def _no_collection() -> Iterator[None]:
    was_on = gc.isenabled()
    gc.collect()
    gc.freeze()
    gc.disable()
    try:
        yield
    finally:
        gc.unfreeze()
        if was_on:
            gc.enable()


@contextmanager
def single_threaded() -> Iterator[dict[str, str]]:
    """Hold the peers' libraries to one thread, as the kernels use one; yield what could be held."""
    held = {}
    restore: list[Callable[[], Any]] = []
    try:
        import cv2
    except ImportError:
        pass
    else:
        before = cv2.getNumThreads()
        cv2.setNumThreads(1)
        restore.append(lambda: cv2.setNumThreads(before))
        held["OpenCV"] = "1"
    try:
        from threadpoolctl import threadpool_limits
    except ImportError:
        held["BLAS"] = "not limited: threadpoolctl is not installed"
    else:
        limits = threadpool_limits(limits=1)
        restore.append(limits.restore_original_limits)
        held["BLAS"] = "1"
    try:
        yield held
    finally:
        for undo in restore:
            undo()
