"""The two tables the loop itself fills: contacts and levels."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from tega.csv_writer import CsvWriter, time_text
from tega.records import Contact, Intent

__all__ = ["RunRecorder"]


class RunRecorder:
    """Writes ``contacts.csv`` and ``levels.csv``.

    Args:
        folder: Where to.
        channels: Names of the EMG channels, such as ``ch3``.
    """

    def __init__(self, folder: Path, channels: Sequence[str]) -> None:
        self._contacts = CsvWriter(folder / "contacts.csv", Contact.table)
        self._levels = CsvWriter(folder / "levels.csv", ("t_s", *channels, "fused"))

    def contact(self, contact: Contact) -> None:
        """Add one measured frame, and what of it the wearer is to feel."""
        self._contacts.write(_row(contact))

    def levels(self, intent: Intent) -> None:
        """Add one EMG block: the level of each channel and the fused one."""
        self._levels.write(_row(intent))

    def close(self) -> None:
        """Finish both files."""
        self._contacts.close()
        self._levels.close()


def _row(record: Contact | Intent) -> str:
    """Return a record's line of its table."""
    cells: list[str] = []
    for column in record.table:
        value = None if column == "t_s" else getattr(record, column)
        if column == "t_s":
            cells.append(time_text(record.t_ns))
        elif isinstance(value, tuple):
            cells += map(str, value)
        elif isinstance(value, bool):
            cells.append(str(int(value)))
        else:
            cells.append(repr(value) if isinstance(value, float) else str(value))
    return ",".join(cells) + "\n"
