"""The table of the docs."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

from tega_campaigns.report import seconds, table
from tega_campaigns.station_faults.trials import StationFault, StationOutcome

__all__ = ["station_table"]

_HAND = {"hold": "keeps its level", "idle": "opens", "active": "steered", "armed": "", "stopped": "no force"}
_ARM = {"following": "follows", "holding": "holds", "idle": "lets go", "stopped": "stops"}


def station_table(done: Sequence[tuple[StationFault, StationOutcome]]) -> str:
    """Return the outcomes as a table in Markdown."""
    rows = [
        (
            fault.name,
            fault.wish + ("" if found.as_wished else " (**did not**)"),
            seconds(found.seen_s),
            _course(found.hand, _HAND, "active"),
            _course(found.arm, _ARM, "following"),
            fault.vest or _vest(found) + _refused(found),
            seconds(found.over_s) if found.over_s != 0 else "–",
            str(found.used),
            str(found.stale),
            f"{found.oldest_ms:.0f} ms",
        )
        for fault, found in done
    ]
    head = ("fault", "shall", "seen", "hand", "arm", "vest", "over", "used", "too old", "oldest")
    return table(head, rows)


def _vest(found: StationOutcome) -> str:
    if found.silent_s is None:
        return "felt"
    said = "" if found.no_data_s is None else f', "no data" {found.no_data_s:.2f} s'
    return f"silent {found.silent_s:.2f} s{said}"


def _refused(found: StationOutcome) -> str:
    if found.refused_s is None:
        return ""
    return f"; the other is refused {found.refused_s:.2f} s after it began"


def _course(changes: Sequence[tuple[float, str]], words: dict[str, str], usual: str) -> str:
    """Say what became of hand or arm; much to and fro is counted instead of told."""
    told = [(t, words.get(what, what)) for t, what in changes[1:] if words.get(what, what)]
    if not told:
        return words.get(changes[0][1], changes[0][1]) if changes else "–"
    if len(told) > 6:
        n = sum(
            what != words[usual] and before == words[usual]
            for (_, before), (_, what) in itertools.pairwise(told)
        )
        return f"{n + 1} times interrupted, first {told[0][1]} {told[0][0]:.2f} s; in the end {told[-1][1]}"
    return ", ".join(f"{what} {t:.2f} s" for t, what in told)
