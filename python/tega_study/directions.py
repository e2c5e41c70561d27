"""Compare the direction of each difference that the paper prints with a study's."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import msgspec

from tega_study.difference import OutcomeDifference, outcome
from tega_study.paper import PAPER_OBJECTS, PAPER_TABLE_1
from tega_study.trials import Trial

Verdict = Literal["as printed", "opposite", "not distinguished", "no data"]


class Direction(OutcomeDifference, frozen=True, kw_only=True):
    """One difference that the paper prints with touch (``paper_first``) and without, and the study's.

    ``paper_sign`` is 1 where the first is more, -1 where it is less. ``verdict`` is ``as printed`` or
    ``opposite`` where the interval is all on one side of 0.
    """

    paper_first: str
    paper_second: str
    paper_sign: int
    verdict: Verdict = "no data"


def directions(trials: Sequence[Trial], conditions: tuple[str, str]) -> tuple[Direction, ...]:
    """Compare a study's differences with the paper's, for every number of its Table I that differs.

    The first condition stands for the paper's haptic, the second for its non-haptic.
    """
    printed, reference = PAPER_TABLE_1["haptic"], PAPER_TABLE_1["non-haptic"]
    found = []
    for metric, texts in printed.items():
        for name, first, second in zip(PAPER_OBJECTS, texts, reference[metric], strict=True):
            off = _value(first) - _value(second)
            if not off:
                continue
            seen, sign = outcome(trials, metric, name, conditions), 1 if off > 0 else -1
            verdict: Verdict = "not distinguished" if seen.people else "no data"
            if seen.apart:
                verdict = "as printed" if (seen.difference or 0.0) * sign > 0 else "opposite"
            found.append(
                Direction(
                    **msgspec.structs.asdict(seen),
                    paper_first=first,
                    paper_second=second,
                    paper_sign=sign,
                    verdict=verdict,
                )
            )
    return tuple(found)


def _value(text: str) -> float:
    part, _, whole = text.partition("/")
    return float(part) / float(whole or 1)
