"""Rows of the CSV tables, made from the records that a table holds."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from tega.csv_writer import time_text
from tega.records.base import Record
from tega.records.schema import fields

__all__ = ["columns", "rows"]

# What a row is made of where a record has a row for each part, as a hand's command has for each CAN frame.
_PARTS = {"frames": ("id", "data")}


def columns(kind: type[Record], **names: Iterable[str]) -> tuple[str, ...]:
    """Return the head of a record's table.

    Args:
        kind: The record.
        names: Columns of a field that holds several numbers, by the field.
    """
    written = {field.attribute: field.name for field in fields(kind) if field.of_pair is None}
    head: list[str] = []
    for name in kind.table:
        head += names[name] if name in names else _PARTS.get(name) or [written.get(name, name)]
    return tuple(head)


def rows(record: Record) -> list[str]:
    """Return a record's lines of its table; most have one."""
    lines: list[list[str]] = [[]]
    for name in record.table:
        if name in _PARTS:
            lines = [[*line, *_frame(frame)] for line in lines for frame in getattr(record, name)]
        else:
            cells = (
                [time_text(getattr(record, "t_ns", 0))] if name == "t_s" else _cells(getattr(record, name))
            )
            lines = [[*line, *cells] for line in lines]
    return [",".join(line) + "\n" for line in lines]


def _cells(value: Any) -> Sequence[str]:
    if isinstance(value, tuple):
        return [str(one) for one in value]
    if isinstance(value, bool):
        return [str(int(value))]
    return [repr(value) if isinstance(value, float) else str(value)]


def _frame(frame: Any) -> tuple[str, str]:
    """Return a CAN frame as its identifier and its bytes, ``R`` for one that asks."""
    return f"{frame.id:03X}", "R" if frame.remote else frame.data.hex().upper()
