"""Ask a participant a block's questions: one key an answer, each of which can be taken back until the last is kept."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from typing import Any, Final, Literal

from tega.runtime.clock import Clock
from tega_study.journal import Journal, JournalEvent, counting
from tega_study.lead.experimenter import ENTER, Screen
from tega_study.lead.questions import KEYS, PASS, QUESTIONS, STEP, Question, answer_of
from tega_study.lead.trial import PARTICIPANT

_BACK: Final = {"\x7f", "\x08", "<"}
_IN_A_LINE: Final = 7


class BlockQuestions:
    """Questions after one block; an answer is an event of the session, and so is its undoing.

    Enter comes first: a slip that is keyed a moment late, once the trial is over, answers nothing. ``trial``
    is the number of the block's last trial, ``heading`` where in the session this is. ``over`` once all are
    answered and kept.
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
            texts = [_short(event) for event in answers]
            lines = [", ".join(texts[n : n + 4]) for n in range(0, len(texts), 4)]
            return Screen("questions", self._heading, "all answered", lines, [("Enter", "keep"), *back])
        pairs = [f"{key} {STEP * n}" for n, key in enumerate(KEYS)]
        scale = ["   ".join(pairs[n : n + _IN_A_LINE]) for n in range(0, len(pairs), _IN_A_LINE)]
        ends = f"0 {requested.left} … 100 {requested.right}"
        where = f"{self._heading} · question {QUESTIONS.index(requested) + 1} of {len(QUESTIONS)}"
        keys = [(f"{KEYS[0]} … {KEYS[-1]}", "0 … 100"), (PASS, "pass over"), *back]
        return Screen("questions", where, requested.title, [requested.text, ends, *scale], keys)


def _short(event: JournalEvent) -> str:
    message = "passed over" if event.value is None else f"{event.value:g}"
    return f"{event.item.partition('.')[2]} {message}"
