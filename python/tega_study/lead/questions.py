"""Ask a participant after each block: six NASA-TLX scales and comfort, each 0 to 100 in steps of 5.

Raw NASA-TLX (Hart and Staveland 1988) is the mean of its six scales. Their questions are asked in the words of NASA's
form, a work of the US government: other words would be another questionnaire. The left end of Performance is the good
one, so that more is worse on all six and nothing is turned round. One key is an answer, and each answer can be taken
back until the last is kept.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any, Final, Literal, NamedTuple

from tega.runtime.clock import Clock
from tega_study.journal import Journal, JournalEvent, counting, undone_numbers
from tega_study.lead.experimenter import ENTER, Screen
from tega_study.lead.trial import PARTICIPANT
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
    """Read an answer: ``a`` to ``u`` for 0 to 100 in steps of 5, or ``-`` to pass over; else ``ValueError``.

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


_BACK: Final = {"\x7f", "\x08", "<"}
_IN_A_LINE: Final = 7


class BlockQuestions:
    """Questions after one block, whose last trial is ``trial``; ``over`` once all are answered and kept.

    Enter comes first: a slip that is keyed a moment late, once the trial is over, answers nothing.
    """

    def __init__(self, journal: Journal, clock: Clock, trial: int, heading: str) -> None:
        self._journal, self._clock, self._trial, self._heading = journal, clock, trial, heading
        self.over = self._begun = False

    def _answers(self) -> Sequence[JournalEvent]:
        """Return the answers that count, in the order in which they came."""
        return [event for event in counting(self._journal.events, self._trial, 1) if event.kind == "rating"]

    def _next(self) -> Question | None:
        answered = {event.item for event in self._answers()}
        return next((question for question in QUESTIONS if question.item not in answered), None)

    def press(self, key: str) -> None:
        """Take in a key: an answer, one taken back, or Enter at the end; any other does nothing."""
        requested, answers = self._next(), self._answers()
        if not self._begun:
            self._begun = key == ENTER
        elif key in _BACK:
            if answers and not self.over:
                self._add("undo", undone=answers[-1].n)
        elif requested is None:
            self.over = self.over or key == ENTER
        else:
            with suppress(ValueError):
                self._add("rating", item=requested.item, value=answer_of(key))

    def pass_over(self) -> None:
        """Record each open question as skipped, if no participant is there to answer."""
        while (requested := self._next()) is not None:
            self._add("rating", item=requested.item, value=None)
        self.over = True

    def _add(self, kind: Literal["rating", "undo"], **more: Any) -> None:
        now_ns = self._clock.now_ns()
        self._journal.add(kind, t_ns=now_ns, trial=self._trial, source=PARTICIPANT, **more)

    def screen(self) -> Screen:
        """Return the screen: the question with the keys of its scale, or the answers once all are given."""
        requested, answers = self._next(), self._answers()
        if not self._begun:
            lines = ["let the participant see the keyboard, or type their answers"]
            return Screen("questions", self._heading, "questions", lines, [("Enter", "begin")])
        back = [("Backspace", "take the last answer back")] if answers else []
        if requested is None:
            texts = [
                f"{e.item.partition('.')[2]} {'passed over' if e.value is None else f'{e.value:g}'}"
                for e in answers
            ]
            lines = [", ".join(texts[n : n + 4]) for n in range(0, len(texts), 4)]
            return Screen("questions", self._heading, "all answered", lines, [("Enter", "keep"), *back])
        pairs = [f"{key} {STEP * n}" for n, key in enumerate(KEYS)]
        scale = ["   ".join(pairs[n : n + _IN_A_LINE]) for n in range(0, len(pairs), _IN_A_LINE)]
        ends = f"0 {requested.left} … 100 {requested.right}"
        where = f"{self._heading} · question {QUESTIONS.index(requested) + 1} of {len(QUESTIONS)}"
        keys = [(f"{KEYS[0]} … {KEYS[-1]}", "0 … 100"), (PASS, "pass over"), *back]
        return Screen("questions", where, requested.title, [requested.text, ends, *scale], keys)
