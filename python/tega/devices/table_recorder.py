"""Write what a device would be sent into a table instead."""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar

from tega.devices.base import DeviceInfo, Kind, Options
from tega.errors import DeviceUnavailableError
from tega.runtime.files.csv_tables import CsvWriter
from tega.runtime.lifecycle import Opened


class TableRecorderOptions(Options, frozen=True):
    """Settings of a recorder.

    Attributes:
        file: The table to write; it is replaced.
    """

    file: Path


class TableRecorder(Opened):
    """A sink without a device; a driver adds the rows."""

    kind: ClassVar[Kind]
    name: ClassVar[str]
    unit: ClassVar[str]
    options_type: ClassVar[type[Options]] = TableRecorderOptions

    def __init__(self, options: TableRecorderOptions) -> None:
        self._options, self._is_open = options, False
        self._csv: CsvWriter | None = None

    @classmethod
    def harmless(cls, options: TableRecorderOptions) -> None:
        """Do nothing: opening would empty its file."""

    @property
    def info(self) -> DeviceInfo:
        """Name and unit."""
        return DeviceInfo(
            driver=self.name, kind=self.kind, label=self._options.file.name, live=False, unit=self.unit
        )

    def open(self) -> None:
        """Prepare; the file is created as soon as its columns are known."""
        self.close()
        self._is_open = True

    def close(self) -> None:
        """Finish the file."""
        self._is_open = False
        if self._csv is not None:
            self._csv.close()
        self._csv = None

    def _table(self, columns: tuple[str, ...]) -> CsvWriter:
        if not self._is_open:
            raise DeviceUnavailableError(
                f"{self.name} {self._options.file.name!r} is not open", "open it first"
            )
        self._csv = self._csv or CsvWriter(self._options.file, columns)
        return self._csv
