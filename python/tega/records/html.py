"""Draw records as HTML for notebooks; names in them may come from anywhere and are escaped."""

from __future__ import annotations

import math
from collections.abc import Iterable
from html import escape
from typing import Any

from tega.records.base import Record
from tega.records.schema import units, values
from tega.runtime.number_text import number_text


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
