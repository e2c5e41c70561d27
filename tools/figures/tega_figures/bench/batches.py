"""Many frames in one call against one call a frame."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.tactile import contact_metrics, contact_metrics_many, read_contact, read_contacts
from tega_figures.bench.scenes import SIZE_OF_A_FINGER, scenes
from tega_figures.bench.timing import Timing, ratio, take_turns, timing

__all__ = ["BatchRow", "batch_rows"]

# The fingers of a hand, which one core does sooner than it wakes another, and a batch for all of them.
FRAMES = (4, 64)


class BatchRow(msgspec.Struct, frozen=True, kw_only=True):
    """One reading of a batch of a finger's pictures.

    ``reading`` is the law of the equations, or the preset. ``one_by_one`` is a call a frame, ``at_once`` one
    call, each for all frames; ``to_one_by_one`` is the second's time over the first's.
    """

    reading: str
    n_frames: int
    one_by_one: Timing
    at_once: Timing
    to_one_by_one: float


def batch_rows(*, budget_s: float) -> list[BatchRow]:
    """Measure batches; unlike everything else here they may use all cores."""
    pictures = scenes(SIZE_OF_A_FINGER)
    still = pictures[0].baseline
    readings: dict[str, tuple[Callable[..., Any], Callable[..., Any]]] = {
        "rectified, spatial": (
            partial(contact_metrics, difference="rectified"),
            partial(contact_metrics_many, difference="rectified"),
        ),
        "live": (read_contact, read_contacts),
    }
    rows = []
    for reading, (one, many) in readings.items():
        for n_frames in FRAMES:
            frames = [pictures[k % len(pictures)].frame.copy() for k in range(n_frames)]
            calls = {
                "one by one": partial(_one_by_one, one, frames, still),
                "at once": partial(many, frames, still),
            }
            turns = take_turns(calls, budget_s=budget_s / 4)
            rows.append(
                BatchRow(
                    reading=reading,
                    n_frames=n_frames,
                    one_by_one=timing(turns["one by one"]),
                    at_once=timing(turns["at once"]),
                    to_one_by_one=ratio(turns["at once"], turns["one by one"]),
                )
            )
    return rows


def _one_by_one(
    read: Callable[..., Any], frames: list[NDArray[np.uint8]], still: NDArray[np.uint8]
) -> list[Any]:
    return [read(frame, still) for frame in frames]
