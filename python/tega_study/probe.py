"""Measure a participant's spare attention in a trial: a beep now and then, answered with a pedal (dual task).

A person who has to think about the vest answers later or not at all. Beeps come at times drawn from the plan's seed,
so that they cannot be expected. ``beep_score.py`` defines which presses count as answers.
"""

from __future__ import annotations

import hashlib
import statistics
from collections.abc import Sequence
from typing import Final

import msgspec

from tega_study.plan import PlannedTrial
from tega_study.trials import Trial

FIRST_S: Final = 1.5
"""Seconds from a trial's start before which no beep comes."""
APART_S: Final = (2.5, 4.5)
"""Seconds between two beeps: drawn evenly between these."""


def beep_times(trial: PlannedTrial, attempt: int, *, seed: int, until_s: float) -> list[float]:
    """Draw when beeps come in an attempt, seconds from its start.

    Args:
        trial: Which.
        attempt: Its attempt; the second has other times.
        seed: Seed of the plan.
        until_s: No beep comes later.

    Example:
        >>> bag = PlannedTrial("p01", 7, 1, "bag", "haptic", 1, 60.0)
        >>> [round(t_s, 2) for t_s in beep_times(bag, 1, seed=7, until_s=15.0)]
        [3.44, 7.31, 11.06, 14.16]
    """
    found: list[float] = []
    t_s = FIRST_S - APART_S[0]
    while True:
        word = f"tega-beep|{seed}|{trial.id}|{attempt}|{len(found)}"
        share = int.from_bytes(hashlib.sha256(word.encode()).digest()[:8], "big") / 2**64
        t_s += APART_S[0] + share * (APART_S[1] - APART_S[0])
        if t_s > until_s:
            return found
        found.append(t_s)


class ProbeUse(msgspec.Struct, frozen=True, kw_only=True):
    """Answers to the beeps under a condition, a mean for each person first.

    Attributes:
        people: With at least one beep.
        beeps: How many counted.
        answered: Share of them that was answered, mean over people.
        answered_low: Smallest of a person.
        reaction_s: Median over people of each one's mean reaction time; ``None`` without any answer.
        false_answers: Presses that answered nothing.
    """

    condition: str
    people: int
    beeps: int
    answered: float
    answered_low: float
    reaction_s: float | None
    false_answers: int


def probe_uses(trials: Sequence[Trial], conditions: Sequence[str]) -> tuple[ProbeUse, ...]:
    """Sum up the second task by condition, over the trials that count; nothing where there was none."""
    found = []
    for condition in conditions:
        mine = [t for t in trials if t.counts and t.beeps and t.condition == condition]
        by_person = [
            [t for t in mine if t.participant == person]
            for person in dict.fromkeys(t.participant for t in mine)
        ]
        shares = [sum(t.beeps_answered for t in own) / sum(t.beeps for t in own) for own in by_person]
        means_s = [
            statistics.fmean(times_s)
            for own in by_person
            if (times_s := [t.reaction_s for t in own if t.reaction_s is not None])
        ]
        if mine:
            found.append(
                ProbeUse(
                    condition=condition,
                    people=len(by_person),
                    beeps=sum(t.beeps for t in mine),
                    answered=statistics.fmean(shares),
                    answered_low=min(shares),
                    reaction_s=statistics.median(means_s) if means_s else None,
                    false_answers=sum(t.false_answers for t in mine),
                )
            )
    return tuple(found)
