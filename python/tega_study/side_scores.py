"""Draw and score what goes on beside the lifts: beeps and their answers, squeezes in rests, and how far muscles tire.

A person who has to think about the vest answers a beep later or not at all (dual task). Beeps come at times drawn from
the plan's seed. A tired muscle's spectrum moves down, and its strongest squeeze gets weaker.
"""

from __future__ import annotations

import hashlib
import math
import statistics
from collections.abc import Sequence
from typing import Final, NamedTuple

from tega.loop.emg_condition import FELL_SHARE
from tega.records import MuscleCondition
from tega_study.journal import JournalEvent
from tega_study.plan import PlannedTrial

FIRST_S: Final = 1.5
"""Seconds from a trial's start before which no beep comes."""
APART_S: Final = (2.5, 4.5)
"""Seconds between two beeps: drawn evenly between these."""
ANSWER_S: Final = (0.1, 2.0)
"""So long after a beep, at least and at most, a press answers it, seconds."""
HELD_S: Final = 0.2
"""A press that comes sooner after another is the same one: a key that is held types on and on."""


class BeepScore(NamedTuple):
    """Score of the second task in one trial.

    Attributes:
        beeps: Those that count: answered, or followed by the whole time in which they could have been.
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


def beep_times(trial: PlannedTrial, attempt: int, *, seed: int, until_s: float) -> list[float]:
    """Draw when beeps come in an attempt of a trial, seconds from its start; none later than ``until_s``.

    ``seed`` is the plan's; a second attempt has other times.

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


def squeeze_shares(events: Sequence[JournalEvent]) -> dict[int, float]:
    """Return each squeeze's strength as a share of the first one's, by the event's number.

    The first is the last one before the first trial, a half-hearted one being done again; else the first of all.
    """
    known = {e.n: e.value for e in events if e.kind == "squeeze" and e.value is not None and e.value > 0}
    if not known:
        return {}
    begins = next((event.n for event in events if event.kind == "trial_start"), math.inf)
    first = known[max((n for n in known if n < begins), default=min(known))]
    return {n: value / first for n, value in known.items()}


_MOST: Final = 3
"""So many trials at most are taken together: the spectrum of a single second differs from the next one's."""


def trial_medians(seen: Sequence[MuscleCondition]) -> dict[str, float]:
    """Return each channel's median frequency over a trial's seconds of effort, Hz, by ``ch1`` and so on.

    ``seen`` has one condition a second; a channel that did not work has NaN.
    """
    n_channels = max((len(one.median_hz) for one in seen), default=0)
    found = {}
    for k in range(n_channels):
        all_hz = [one.median_hz[k] for one in seen if k < len(one.median_hz)]
        known = [hz for hz in all_hz if math.isfinite(hz)]
        if known:
            found[f"ch{k + 1}"] = statistics.median(known)
    return found


def muscle_sentence(events: Sequence[JournalEvent]) -> list[str]:
    """Return how the muscles' median frequencies have changed since the first trials, and which muscles are tired."""
    by_channel: dict[str, list[float]] = {}
    for event in events:
        if event.kind == "muscles" and event.value is not None:
            by_channel.setdefault(event.item, []).append(event.value)
    changes = {}
    for channel, values_hz in by_channel.items():
        if n := min(_MOST, len(values_hz) // 2):
            first_hz, newest_hz = statistics.fmean(values_hz[:n]), statistics.fmean(values_hz[-n:])
            changes[channel] = newest_hz / first_hz - 1
    if not changes:
        return []
    displayed = ", ".join(f"{channel} {100 * change:+.0f} %" for channel, change in sorted(changes.items()))
    tired = sorted(channel for channel, change in changes.items() if change <= -FELL_SHARE)
    lines = [f"median frequency against the first trials: {displayed}".replace("-", "−")]
    return lines + ([f"{', '.join(tired)}: tired; let the arm rest longer"] if tired else [])


def squeeze_sentence(events: Sequence[JournalEvent]) -> list[str]:
    """Return how strong the newest squeeze was, to be shown in a rest; nothing before the first."""
    shares = squeeze_shares(events)
    return [f"squeeze: {100 * shares[max(shares)]:.0f} % of the first"] if len(shares) > 1 else []
