"""Average by condition what participants answered: questions after blocks, and the beeps of a second task."""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from pathlib import Path

import msgspec

from tega_study.journal import events_path, read_events, undone_numbers
from tega_study.lead.questions import QUESTIONS, raw_tlx
from tega_study.plan import read_plan
from tega_study.study_notes import staying
from tega_study.trials import Trial

RAW_TLX = "raw NASA-TLX"


class RatingUse(msgspec.Struct, frozen=True, kw_only=True):
    """Answers to a question under a condition, a mean for each person first.

    Attributes:
        item: The question; :data:`RAW_TLX` for the mean of the six scales, of blocks that have all of them.
        median: Over people, 0 to 100.
        low: Smallest of a person; ``high`` is the largest.
    """

    item: str
    condition: str
    people: int
    answers: int
    median: float
    low: float
    high: float


def ratings(folder: Path) -> tuple[RatingUse, ...]:
    """Return all answers of a study by question and condition."""
    plan = read_plan(folder)
    scores: dict[tuple[str, str], dict[str, list[float]]] = {}
    for person in staying(folder, plan):
        condition_of = {trial.trial: trial.condition for trial in plan.of(person)}
        blocks: dict[int, dict[str, float | None]] = {}
        events = read_events(events_path(folder, person))
        undone = undone_numbers(events)
        for event in events:
            if event.kind == "rating" and event.n not in undone:
                blocks.setdefault(event.trial, {})[event.item] = event.value
        for trial, answers in blocks.items():
            for item, value in {RAW_TLX: raw_tlx(answers), **answers}.items():
                if value is not None and trial in condition_of:
                    scores.setdefault((item, condition_of[trial]), {}).setdefault(person, []).append(value)
    items = [RAW_TLX, *(question.item for question in QUESTIONS)]
    found = []
    for item in items:
        for condition in plan.settings.conditions:
            if by_person := scores.get((item, condition)):
                means = [statistics.fmean(values) for values in by_person.values()]
                found.append(
                    RatingUse(
                        item=item,
                        condition=condition,
                        people=len(means),
                        answers=sum(map(len, by_person.values())),
                        median=statistics.median(means),
                        low=min(means),
                        high=max(means),
                    )
                )
    return tuple(found)


class ProbeUse(msgspec.Struct, frozen=True, kw_only=True):
    """Answers to the beeps under a condition, a mean for each person first.

    Attributes:
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
