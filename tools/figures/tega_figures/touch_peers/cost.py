"""Measure what the tracker costs beside NumPy's or-reduce over frame and baseline, in turns in one run.

::

    python -m tega_figures.touch_peers.cost

Prints JSON: medians and tenth percentiles in microseconds, and ratios to the or-reduce; at rest and touched, one finger
and four in one call.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from itertools import cycle
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from tega import _native
from tega.tactile import Outline
from tega.tactile.tracker import TouchTracker, update_fingers
from tega_figures.bench.timing import ratio, take_turns, timing
from tega_sim.gel import Gel, ball, board

__all__ = ["costs"]

Image = NDArray[np.uint8]
_FLOOR: Final = "or-reduce of frame and baseline"
_WARM: Final = 40


def _frames(gel: Gel, indenters: list[Any], first: int) -> list[Image]:
    return [gel.frame(indenters, first + k) for k in range(8)]


def _reading(tracker: TouchTracker, frames: list[Image], *, in_contact: bool) -> Callable[[], object]:
    """Return a call that reads the next of some frames, once the tracker has settled on them."""
    frames_on = cycle(frames)
    for _ in range(_WARM):
        reported = tracker.update(next(frames_on)).in_contact
    assert reported == in_contact  # what is timed is what it is named for
    return lambda: tracker.update(next(frames_on))


def _floor(frames: list[Image], baseline: Image) -> Callable[[], object]:
    pairs = cycle(
        [(frame.reshape(-1).view(np.uint64), baseline.reshape(-1).view(np.uint64)) for frame in frames]
    )
    reduce = np.bitwise_or.reduce

    def read() -> tuple[np.uint64, np.uint64]:
        frame, still = next(pairs)
        return reduce(frame), reduce(still)

    return read


def _hand(baseline: Image, frames: list[Image], pressed: int, light: list[Image]) -> Callable[[], object]:
    trackers = [TouchTracker(baseline) for _ in range(4)]
    rounds = cycle([[frames[k]] * pressed + [light[k]] * (4 - pressed) for k in range(len(frames))])
    for _ in range(_WARM):
        update_fingers(trackers, next(rounds))
    return lambda: update_fingers(trackers, next(rounds))


def costs(*, budget_s: float = 4.0, outline: Outline = "dent") -> dict[str, Any]:
    """Return medians and tenth percentiles in microseconds and ratios to the or-reduce, by what is read."""
    gel = Gel(5)
    baseline = gel.still()
    rest = _frames(gel, [], 0)
    pressed = {
        "a ball of 4 mm, 3 N": _frames(gel, [ball(force_n=3.0, radius_mm=4.0)], 100),
        "a face, 5 N": _frames(gel, [board(force_n=5.0)], 200),
    }
    calls = {_FLOOR: _floor(rest, baseline)}
    calls["untouched"] = _reading(TouchTracker(baseline, outline=outline), rest, in_contact=False)
    for name, frames in pressed.items():
        calls[name] = _reading(TouchTracker(baseline, outline=outline), frames, in_contact=True)
    touched = next(iter(pressed.values()))
    for n in (0, 4):
        calls[f"four fingers in one call, {n} touched"] = _hand(baseline, touched, n, rest)
    turns = take_turns(calls, budget_s=budget_s)
    return {
        "instruction_set": _native.instruction_set(),
        "rows": [
            {
                "what": name,
                "median_us": round(timing(turns[name]).median_us, 1),
                "fastest_tenth_us": round(float(np.percentile(np.concatenate(turns[name]), 10)) / 1000, 1),
                "over_floor": round(ratio(turns[name], turns[_FLOOR]), 2),
            }
            for name in calls
        ],
    }


if __name__ == "__main__":
    print(json.dumps(costs(), indent=1))
