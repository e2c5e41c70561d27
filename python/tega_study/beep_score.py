"""Score the answers to a trial's beeps: answered, missed, false, and how fast."""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from typing import Final, NamedTuple

from tega_study.journal import JournalEvent

ANSWER_S: Final = (0.1, 2.0)
"""So long after a beep, at least and at most, a press answers it, seconds."""
HELD_S: Final = 0.2
"""A press that comes sooner after another is the same one: a key that is held types on and on."""


class BeepScore(NamedTuple):
    """Score of the second task in one trial.

    Attributes:
        beeps: Those that count: answered, or followed by the whole time in which they could have been.
        false_answers: Presses that answered no beep.
        reaction_s: Median from beep to press; ``None`` where none was answered.
    """

    beeps: int
    answered: int
    false_answers: int
    reaction_s: float | None


def score_beeps(events: Sequence[JournalEvent], end_ns: int) -> BeepScore:
    """Score an attempt's beeps and answers."""
    least_ns, most_ns = (round(limit_s * 1e9) for limit_s in ANSWER_S)
    open_ns = sorted(event.t_ns for event in events if event.kind == "beep")
    reactions_s: list[float] = []
    n_false = 0
    last_ns: int | None = None
    for press_ns in sorted(event.t_ns for event in events if event.kind == "answer"):
        held = last_ns is not None and press_ns - last_ns < HELD_S * 1e9
        last_ns = press_ns
        if held:
            continue
        beep_ns = next((t for t in open_ns if least_ns <= press_ns - t <= most_ns), None)
        if beep_ns is None:
            n_false += 1
        else:
            open_ns.remove(beep_ns)
            reactions_s.append((press_ns - beep_ns) / 1e9)
    missed = sum(end_ns - t >= most_ns for t in open_ns)
    median_s = statistics.median(reactions_s) if reactions_s else None
    return BeepScore(len(reactions_s) + missed, len(reactions_s), n_false, median_s)


def beep_sentence(events: Sequence[JournalEvent], end_ns: int) -> str:
    """Return the score as the experimenter reads it behind how a trial went; ``""`` where no beep counts."""
    score = score_beeps(events, end_ns)
    if not score.beeps:
        return ""
    fast = "" if score.reaction_s is None else f", {score.reaction_s:.2f} s"
    return f"; beeps answered {score.answered} of {score.beeps}{fast}"
