"""Note in a recording which others it was made out of, and make the folder that it goes to.

The origin is in tables of names and texts in the file: ``span``, the part of the session in the file, and
``origin-1``, ``origin-2`` and so on, one for every step from the run's own file to this one.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from tega.errors import ConfigError

LEAD_IN = "lead-in.mcap"
"""Name of the attachment with the records from before the span that a replay needs."""

SPAN = "span"
_ORIGIN = "origin-"

Tables = Mapping[str, Mapping[str, str]]


class Span(NamedTuple):
    """Part of a session, ns since its start; ``to_ns``, not in it, is ``None`` where nothing was cut off."""

    from_ns: int = 0
    to_ns: int | None = None

    def table(self) -> dict[str, str]:
        """Return the span as texts."""
        return {"from_ns": str(self.from_ns), "to_ns": "" if self.to_ns is None else str(self.to_ns)}

    def __str__(self) -> str:
        """Return it for people."""
        end = "its end" if self.to_ns is None else f"{self.to_ns / 1e9:g} s"
        return f"{self.from_ns / 1e9:g} s to {end}"


def span(tables: Tables) -> Span:
    """Return which part of its session a recording holds."""
    table = tables.get(SPAN, {})
    to_ns = table.get("to_ns")
    return Span(int(table.get("from_ns", "0")), int(to_ns) if to_ns else None)


def made_with(tables: Tables) -> tuple[str, bool]:
    """Return the version of TEGA that made a recording, and whether it is later than this one or unknown."""
    from tega import __version__

    made = tables.get("versions", {}).get("tega", "unknown")
    numbers, now = ([int(n) for n in re.findall(r"\d+", text)[:3]] for text in (made, __version__))
    return made, not numbers or numbers > now


def origins(tables: Tables) -> list[dict[str, str]]:
    """Return the steps from the run's own file to this one; none for the run's own file."""
    numbers = sorted(int(name.removeprefix(_ORIGIN)) for name in tables if name.startswith(_ORIGIN))
    return [dict(tables[f"{_ORIGIN}{n}"]) for n in numbers]


def origin(tables: Tables, source: Path, *, made_by: str, part: Span) -> tuple[str, dict[str, str]]:
    """Return name and content of the table for one more step: a verb, and the part of the source copied."""
    from tega import __version__

    head = tables.get("tega", {})
    return f"{_ORIGIN}{len(origins(tables)) + 1}", {
        "made_by": f"tega-teleop {made_by} {__version__}",
        "session": source.resolve().parent.name,
        "file": source.name,
        "epoch_ns": head.get("epoch_ns", ""),
        "config_sha256": head.get("config_sha256", ""),
        **part.table(),
    }


def new_session(folder: Path) -> None:
    """Make the folder of a new session; ``ConfigError`` if there is something already."""
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise ConfigError(f"{folder.name!r} is there already", "name a new or empty folder with --out")
    folder.mkdir(parents=True, exist_ok=True)
