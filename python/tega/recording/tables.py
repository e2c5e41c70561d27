"""Write the tables of a run's output folder, one for each kind of record."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Final

from tega.records import ArmTurn, Contact, Event, Intent, Record
from tega.records.table import columns, rows
from tega.runtime.files.csv_writer import CsvWriter

TABLES: Final[dict[type[Record], str]] = {
    Contact: "contacts.csv",
    Event: "events.csv",
    Intent: "levels.csv",
    ArmTurn: "arm.csv",
}
"""File of each record that has a table and no recording device."""

# A second of an arm's turns: whoever looks into a table while the run lasts is not far behind.
_MOST_LINES = 64


class RecordTable:
    """Writes records of one kind into their table, with header and rows from the record's fields.

    ``names`` are the columns of a list field with one number per part of a device, by the field.
    """

    def __init__(self, folder: Path, kind: type[Record], **names: Iterable[str]) -> None:
        self._file = CsvWriter(folder / TABLES[kind], columns(kind, **names), most_lines=_MOST_LINES)

    def take(self, record: Record) -> None:
        """Add a record."""
        self._file.write(*rows(record))

    def close(self) -> None:
        """Finish the file."""
        self._file.close()
