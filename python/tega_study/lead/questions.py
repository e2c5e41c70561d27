"""Ask a participant after each block: six NASA-TLX scales and comfort, each 0 to 100 in steps of 5.

Raw NASA-TLX (Hart and Staveland 1988) is the mean of its six scales. Their questions are asked in the words of NASA's
form, a work of the US government: other words would be another questionnaire. The left end of Performance is the good
one, so that more is worse on all six and nothing is turned round.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

from tega_study.journal import JournalEvent, undone_numbers
from tega_study.plan import PlannedTrial

STEP: Final = 5
KEYS: Final = "abcdefghijklmnopqrstu"
"""A key for each of the 21 marks of a scale, as the printed form has them."""
PASS: Final = "-"


class Question(NamedTuple):
    """Scale put to a participant, from ``left`` (0) to ``right`` (100); ``item`` names it in the events."""

    item: str
    title: str
    text: str
    left: str
    right: str


TLX = (
    Question("tlx.mental", "Mental Demand", "How mentally demanding was the task?", "low", "high"),
    Question("tlx.physical", "Physical Demand", "How physically demanding was the task?", "low", "high"),
    Question(
        "tlx.temporal", "Temporal Demand", "How hurried or rushed was the pace of the task?", "low", "high"
    ),
    Question(
        "tlx.performance",
        "Performance",
        "How successful were you in accomplishing what you were asked to do?",
        "good",
        "poor",
    ),
    Question(
        "tlx.effort",
        "Effort",
        "How hard did you have to work to accomplish your level of performance?",
        "low",
        "high",
    ),
    Question(
        "tlx.frustration",
        "Frustration",
        "How insecure, discouraged, irritated, stressed, and annoyed were you?",
        "low",
        "high",
    ),
)

COMFORT = (
    Question(
        "comfort.vest",
        "Comfort of the vest",
        "How comfortable was the vest?",
        "very uncomfortable",
        "very comfortable",
    ),
    Question("comfort.warmth", "Warmth of the vest", "How warm was the vest?", "not warm", "too hot"),
    Question(
        "comfort.distraction",
        "Distraction by the vest",
        "How much did the vest distract you from the task?",
        "none",
        "very distracting",
    ),
    Question("comfort.arm", "Tiredness of the arm", "How tired is your arm?", "none", "cannot go on"),
    Question(
        "comfort.grip",
        "Confidence in the grip",
        "How sure were you that the hand held the object?",
        "none",
        "complete",
    ),
)

QUESTIONS: tuple[Question, ...] = TLX + COMFORT


def answer_of(key: str) -> float | None:
    """Read an answer: ``a`` to ``u`` for 0 to 100 in steps of 5, or ``-`` to pass over the question.

    Raises:
        ValueError: It is neither.

    Example:
        >>> answer_of("a"), answer_of("h"), answer_of("u"), answer_of("-")
        (0.0, 35.0, 100.0, None)
    """
    if key == PASS:
        return None
    if len(key) != 1 or key not in KEYS:
        raise ValueError(key)
    return float(STEP * KEYS.index(key))


def raw_tlx(answers: Mapping[str, float | None]) -> float | None:
    """Return the mean of the six scales; ``None`` where one is missing.

    Example:
        >>> names = [question.item for question in TLX]
        >>> round(raw_tlx(dict(zip(names, [70, 35, 50, 25, 60, 40]))), 10)
        46.6666666667
    """
    values = [value for question in TLX if (value := answers.get(question.item)) is not None]
    return sum(values) / len(TLX) if len(values) == len(TLX) else None


def blocks_to_ask(
    trials: Sequence[PlannedTrial], events: Sequence[JournalEvent], open_trials: set[int]
) -> list[int]:
    """Return the last trial of each finished block that still has open questions."""
    undone = undone_numbers(events)
    requested = {(e.trial, e.item) for e in events if e.kind == "rating" and e.n not in undone}
    ran = {event.trial for event in events if event.kind == "trial_start"}
    found = []
    for block in dict.fromkeys(trial.block for trial in trials):
        mine = [trial.trial for trial in trials if trial.block == block]
        over = open_trials.isdisjoint(mine) and not ran.isdisjoint(mine)
        if over and any((mine[-1], question.item) not in requested for question in QUESTIONS):
            found.append(mine[-1])
    return found
