"""Keep who compared conditions before the plan was complete: an event in the study's journal, never taken back."""

from __future__ import annotations

import time
from datetime import UTC, datetime
from pathlib import Path

from tega_study.journal import Journal, read_events

JOURNAL = "journal.jsonl"
"""The study's own journal, beside its plan; sessions have theirs."""


def note_unblinding(folder: Path, text: str) -> None:
    """Write into the study's journal that its conditions are compared now."""
    with Journal(folder / JOURNAL) as journal:
        journal.add("unblind", t_ns=time.time_ns(), source="auto", text=text)


def unblindings(folder: Path) -> tuple[str, ...]:
    """Return when the study was unblinded before its plan was complete, and how far it was, one text each.

    An anonymised copy has no dates.
    """
    found = []
    for event in read_events(folder / JOURNAL):
        if event.kind == "unblind":
            day = datetime.fromtimestamp(event.t_ns / 1e9, UTC).date().isoformat()
            found.append(f"{day}: {event.text}" if event.t_ns else event.text)
    return tuple(found)


def copy_unblindings(folder: Path, out: Path) -> None:
    """Copy them into an anonymised copy of the study, without dates."""
    texts = [event.text for event in read_events(folder / JOURNAL) if event.kind == "unblind"]
    if texts:
        with Journal(out / JOURNAL) as journal:
            for text in texts:
                journal.add("unblind", t_ns=0, source="auto", text=text)
