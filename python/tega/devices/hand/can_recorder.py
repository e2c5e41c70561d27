"""Write CAN frames for a hand into a file instead of the hand's bus."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from tega.devices.base import DeviceInfo, Kind, Options
from tega.errors import DeviceUnavailableError
from tega.records import HandCommand
from tega.records.table import columns, rows
from tega.runtime.files.csv_writer import CsvWriter
from tega.runtime.lifecycle import Opened

if TYPE_CHECKING:
    from tega.wire import CanFrame


class CanRecorderOptions(Options, frozen=True):
    """Settings of :class:`CanRecorder`.

    Attributes:
        file: The table to write; it is replaced.
    """

    file: Path


class CanRecorder(Opened):
    """Writes every CAN frame as a row: time, identifier and data in hexadecimal (``R`` for a remote frame)."""

    kind: ClassVar[Kind] = "hand"
    summary: ClassVar[str] = "writes a hand's CAN frames to a table instead of a bus"
    extra: ClassVar[str] = ""
    requires: ClassVar[tuple[str, ...]] = ()
    options_type: ClassVar[type[Options]] = CanRecorderOptions

    def __init__(self, options: CanRecorderOptions) -> None:
        self._options = options
        self._csv: CsvWriter | None = None

    @classmethod
    def harmless(cls, options: CanRecorderOptions) -> None:
        """Do nothing: opening would empty its file."""

    @property
    def info(self) -> DeviceInfo:
        """Name and unit."""
        return DeviceInfo(
            driver="can-recorder", kind="hand", label=self._options.file.name, live=False, unit="CAN frames"
        )

    def open(self) -> None:
        """Make the file."""
        self.close()
        self._csv = CsvWriter(self._options.file, columns(HandCommand))

    def close(self) -> None:
        """Finish the file."""
        if self._csv is not None:
            self._csv.close()
        self._csv = None

    def write(self, t_ns: int, frames: Sequence[CanFrame]) -> Sequence[CanFrame]:
        """Write frames down.

        Raises:
            DeviceUnavailableError: The recorder is not open.
        """
        if self._csv is None:
            raise DeviceUnavailableError(
                f"can-recorder {self._options.file.name!r} is not open", "open it first"
            )
        sent: Any = tuple(frames)
        self._csv.write(*rows(HandCommand(t_ns=t_ns, level=0, frames=sent)))
        return frames
