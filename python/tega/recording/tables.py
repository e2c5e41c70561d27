"""The two tables the loop itself fills: contacts and levels."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from tega.csv_writer import CsvWriter
from tega.records import Contact, Intent
from tega.records.table import columns, rows

__all__ = ["RunRecorder"]


class RunRecorder:
    """Writes ``contacts.csv`` and ``levels.csv``.

    Args:
        folder: Where to.
        channels: Names of the EMG channels, such as ``ch3``.
    """

    def __init__(self, folder: Path, channels: Sequence[str]) -> None:
        self._contacts = CsvWriter(folder / "contacts.csv", columns(Contact))
        self._levels = CsvWriter(folder / "levels.csv", columns(Intent, channels=channels))

    def contact(self, contact: Contact) -> None:
        """Add one measured frame, and what of it the wearer is to feel."""
        self._contacts.write(*rows(contact))

    def levels(self, intent: Intent) -> None:
        """Add one EMG block: the level of each channel and the fused one."""
        self._levels.write(*rows(intent))

    def close(self) -> None:
        """Finish both files."""
        self._contacts.close()
        self._levels.close()
