"""Ask a participant after each block: six NASA-TLX scales and comfort, each 0 to 100 in steps of 5.

Raw NASA-TLX (Hart and Staveland 1988) is the mean of its six scales. The left end of Performance is the good one, so
that more is worse on all six and nothing is turned round.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

from tega.study.journal import JournalEvent
from tega.study.plan import PlannedTrial

if TYPE_CHECKING:
    from tega.study.lead.experimenter import Desk


STEP = 5


class Question(NamedTuple):
    """Scale that a participant is asked about.

    Attributes:
        item: Its name in the events.
        title: What is shown.
        left: What 0 means.
        right: What 100 means.
    """

    item: str
    title: str
    left: str
    right: str


TLX = (
    Question("tlx.mental", "Mental Demand", "low", "high"),
    Question("tlx.physical", "Physical Demand", "low", "high"),
    Question("tlx.temporal", "Temporal Demand", "low", "high"),
    Question("tlx.performance", "Performance", "good", "poor"),
    Question("tlx.effort", "Effort", "low", "high"),
    Question("tlx.frustration", "Frustration", "low", "high"),
)

COMFORT = (
    Question("comfort.vest", "Comfort of the vest", "very uncomfortable", "very comfortable"),
    Question("comfort.warmth", "Warmth of the vest", "not warm", "too hot"),
    Question("comfort.distraction", "Distraction by the vest", "none", "very distracting"),
    Question("comfort.arm", "Tiredness of the arm", "none", "cannot go on"),
    Question("comfort.grip", "Confidence in the grip", "none", "complete"),
)

QUESTIONS: tuple[Question, ...] = TLX + COMFORT


def answer_of(said: str) -> float | None:
    """Read an answer: a multiple of 5 from 0 to 100, or ``-`` to pass over the question.

    Raises:
        ValueError: It is neither.

    Example:
        >>> answer_of("35"), answer_of("-")
        (35.0, None)
    """
    if said.strip() == "-":
        return None
    value = int(said.strip())
    if not 0 <= value <= 100 or value % STEP:
        raise ValueError(said)
    return float(value)


def ask(question: Question, desk: Desk, stop: Callable[[], bool]) -> float | None:
    """Ask until there is an answer.

    Args:
        question: What.
        desk: Where.
        stop: Asked before each try whether to give up.

    Raises:
        KeyboardInterrupt: ``stop`` said so, or nobody is at the desk.
    """
    while not stop():
        said = desk.line(f"{question.title}: 0 {question.left} … 100 {question.right}:")
        try:
            return answer_of(said)
        except ValueError:
            desk.say(f"{said!r} is not one of 0, 5, 10 … 100, and not -")
    raise KeyboardInterrupt


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
) -> list[tuple[int, list[Question]]]:
    """Return which questions are still to be asked, by the last trial of each block that is over.

    Args:
        trials: The person's.
        events: The session's.
        open_trials: Numbers of the trials that are still to be done.
    """
    asked = {(event.trial, event.item) for event in events if event.kind == "rating"}
    ran = {event.trial for event in events if event.kind == "trial_start"}
    found = []
    for block in dict.fromkeys(trial.block for trial in trials):
        mine = [trial.trial for trial in trials if trial.block == block]
        if open_trials.isdisjoint(mine) and not ran.isdisjoint(mine):
            left = [question for question in QUESTIONS if (mine[-1], question.item) not in asked]
            if left:
                found.append((mine[-1], left))
    return found
