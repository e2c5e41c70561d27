"""The table of the docs."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from pathlib import Path

from tega_campaigns.station_faults.trials import StationFault, StationOutcome

__all__ = ["put_table", "table"]

_HAND = {"hold": "keeps its level", "idle": "opens", "active": "steered", "armed": "", "stopped": "no force"}
_ARM = {"following": "follows", "holding": "holds", "idle": "lets go", "stopped": "stops"}


def table(done: Sequence[tuple[StationFault, StationOutcome]]) -> str:
    """Return the outcomes as a table in Markdown."""
    rows = [
        "| fault | shall | seen | hand | arm | vest | over | used | too old | oldest |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for fault, found in done:
        cells = (
            fault.name,
            fault.wish + ("" if found.as_wished else " (**did not**)"),
            _seconds(found.seen_s),
            _course(found.hand, _HAND, "active"),
            _course(found.arm, _ARM, "following"),
            fault.vest or _vest(found) + _refused(found),
            _seconds(found.over_s) if found.over_s != 0 else "–",
            str(found.used),
            str(found.stale),
            f"{found.oldest_ms:.0f} ms",
        )
        rows.append(f"| {' | '.join(cells)} |")
    return "\n".join(rows) + "\n"


def put_table(page: Path, done: Sequence[tuple[StationFault, StationOutcome]], *, name: str) -> None:
    """Put the table between the two marks of a page that bear a name.

    Raises:
        ValueError: The page has none.
    """
    begin, end = (f"<!-- {name}: {where} -->\n" for where in ("begin", "end"))
    head, rest = page.read_text(encoding="utf-8").split(begin)
    _, tail = rest.split(end)
    page.write_text(f"{head}{begin}\n{table(done)}\n{end}{tail}", encoding="utf-8", newline="\n")


def _seconds(value: float | None) -> str:
    return "–" if value is None else f"{value:.2f} s"


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
