"""Ask how to handle a fault in a calibration step: repeat the step, keep its result, or give up."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

from tega.errors import CalibrationError
from tega.runtime.guide import Guide, Undecided

_Result = TypeVar("_Result")


def until_good(
    guide: Guide,
    subject: str,
    attempt: Callable[[], _Result],
    problems: Callable[[_Result], Sequence[str]],
    *,
    can_keep: Callable[[_Result], bool] = lambda _result: True,
) -> tuple[_Result, tuple[str, ...]]:
    """Repeat a step until nothing is wrong with it or the person keeps it; return it and the problems kept.

    Raises ``CalibrationError`` if there is a problem and no answer about it, as without a terminal;
    ``KeyboardInterrupt`` if the person gives up.
    """
    while True:
        result = attempt()
        found = tuple(problems(result))
        if not found:
            return result, ()
        for text in found:
            guide.say(text, tone="bad")
        answers = {"a": "again"}
        if can_keep(result):
            answers["k"] = "keep it as it is"
        answers["q"] = "stop here"
        try:
            answer = guide.ask(f"{subject}: what now?", answers)
        except Undecided:
            raise CalibrationError(
                f"{subject}: {'; '.join(found)}", "see to it, then run the same command"
            ) from None
        if answer == "q":
            raise KeyboardInterrupt
        if answer == "k":
            return result, tuple(f"{subject}, kept in spite of: {text}" for text in found)
