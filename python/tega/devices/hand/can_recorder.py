"""Write CAN frames for a hand into a file instead of the hand's bus."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

from tega.devices.base import Kind
from tega.devices.table_recorder import TableRecorder
from tega.records import HandCommand
from tega.records.table import columns, rows
from tega.wire import CanFrame


class CanRecorder(TableRecorder):
    """Writes every CAN frame as a row: time, identifier and data in hexadecimal (``R`` for a remote frame)."""

    kind: ClassVar[Kind] = "hand"
    name: ClassVar[str] = "can-recorder"
    unit: ClassVar[str] = "CAN frames"
    summary: ClassVar[str] = "writes a hand's CAN frames to a table instead of a bus"

    def open(self) -> None:
        """Make the file."""
        super().open()
        self._table(columns(HandCommand))

    def write(self, t_ns: int, frames: Sequence[CanFrame]) -> Sequence[CanFrame]:
        """Write frames down."""
        sent: Any = tuple(frames)
        self._table(columns(HandCommand)).write(*rows(HandCommand(t_ns=t_ns, level=0, frames=sent)))
        return frames
