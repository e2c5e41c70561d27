"""Show in a rest whether the arm tires: median frequencies against the first trials, a squeeze against the first one.

A tired muscle's spectrum moves down, and its strongest squeeze gets weaker. Each value is an event of the session, so a
stop forgets nothing.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence
from typing import Final

from tega.loop.emg_condition import FELL_SHARE
from tega.records import MuscleCondition
from tega_study.journal import JournalEvent
from tega_study.squeeze_score import squeeze_shares

_MOST: Final = 3
"""So many trials at most are taken together: the spectrum of a single second differs from the next one's."""


def trial_medians(seen: Sequence[MuscleCondition]) -> dict[str, float]:
    """Return each channel's median frequency over a trial's seconds of effort, Hz, by ``ch1`` and so on.

    ``seen`` has one condition a second; a channel that did not work has NaN.
    """
    n_channels = max((len(one.median_hz) for one in seen), default=0)
    found = {}
    for k in range(n_channels):
        known = [
            one.median_hz[k] for one in seen if k < len(one.median_hz) and math.isfinite(one.median_hz[k])
        ]
        if known:
            found[f"ch{k + 1}"] = statistics.median(known)
    return found


def muscle_sentence(events: Sequence[JournalEvent]) -> list[str]:
    """Return how the muscles' median frequencies have changed since the first trials, to be shown in a rest.

    A second line where a muscle has fallen by 15 % or more; nothing before the second trial with EMG.
    """
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
