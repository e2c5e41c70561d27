"""Score the squeezes of a session's rests: each as a share of the first one."""

from __future__ import annotations

import math
from collections.abc import Sequence

from tega_study.journal import JournalEvent


def squeeze_shares(events: Sequence[JournalEvent]) -> dict[int, float]:
    """Return each squeeze's strength as a share of the first one's, by the event's number.

    The first is the last one before the first trial, so that a half-hearted one can be done again; without any there,
    the first of all.
    """
    known = {e.n: e.value for e in events if e.kind == "squeeze" and e.value is not None and e.value > 0}
    if not known:
        return {}
    begins = next((event.n for event in events if event.kind == "trial_start"), math.inf)
    first = known[max((n for n in known if n < begins), default=min(known))]
    return {n: value / first for n, value in known.items()}
