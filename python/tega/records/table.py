"""Make rows of the CSV tables from records, and HTML for notebooks, where names from anywhere are escaped."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from html import escape
from typing import Any

from tega.records.arm import PoseNumbers
from tega.records.base import Record
from tega.records.schema import fields, units, values
from tega.runtime.files.csv_tables import cell_text, time_text
from tega.runtime.words import number_text

# What a row is made of where a record has a row for each part, as a hand's command has for each CAN frame.
_PARTS = {"frames": ("id", "data")}


def columns(kind: type[Record], **names: Iterable[str]) -> tuple[str, ...]:
    """Return the head of a record's table."""
    names = {**kind.columns, **names}
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
            lines = [[*line, *_cells(record, name)] for line in lines]
    return [",".join(line) + "\n" for line in lines]


def numbers(record: Record) -> tuple[Any, ...]:
    """Return a record's row of its table as values, the time in seconds; for a table that is kept in memory."""
    row: list[Any] = []
    for name in record.table:
        value = getattr(record, "t_ns", 0) / 1e9 if name == "t_s" else getattr(record, name)
        row += value if isinstance(value, tuple) else (value,)
    return tuple(row)


def _cells(record: Record, name: str) -> Sequence[str]:
    if name == "t_s":
        return [time_text(getattr(record, "t_ns", 0))]
    value = getattr(record, name)
    if name in record.columns:  # nothing under each of them where a pose is unknown or damaged
        if value and isinstance(value[0], PoseNumbers):
            value = (*value[0].position, *value[0].quaternion)
        n = len(record.columns[name])
        value = value if len(value) == n else (None,) * n
    return [cell_text(one) for one in (value if isinstance(value, tuple) else (value,))]


def _frame(frame: Any) -> tuple[str, str]:
    return f"{frame.id:03X}", "R" if frame.remote else frame.data.hex().upper()


def rows_html(title: str, rows: Iterable[tuple[str, object, str]]) -> str:
    """Return a table with a title; each row has a name, a value and its unit."""
    cells = "".join(
        f"<tr><th style='text-align:left'>{escape(name)}</th>"
        f"<td>{escape(_displayed(value))} {'' if unit == '1' else escape(unit)}</td></tr>"
        for name, value, unit in rows
    )
    return f"<table><caption>{escape(title)}</caption>{cells}</table>"


def record_html(record: Record, title: str) -> str:
    """Return a record as a table of the values that are known, without its times."""
    named, known = units(type(record)), dict[str, Any](values(record))
    more = known.pop("more", ())
    rows = [
        (name, value, named.get(name, ""))
        for name, value in known.items()
        if not name.endswith("_ns") and not (isinstance(value, float) and math.isnan(value))
    ]
    return rows_html(title, [*rows, *((one["name"], one["value"], one["unit"]) for one in more)])


def _displayed(value: object) -> str:
    return number_text(value) if isinstance(value, float) else str(value)
