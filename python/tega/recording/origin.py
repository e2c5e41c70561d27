"""Note in a recording which others it was made out of, which versions and features made it, and copies beside it.

The origin is in tables of names and texts in the file: ``span``, the part of the session in the file, and
``origin-1``, ``origin-2`` and so on, one for every step from the run's own file to this one.
"""

from __future__ import annotations

import logging
import platform
import re
import sys
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Final, NamedTuple

from tega.errors import ConfigError
from tega.recording.mcap_reader import McapReader
from tega.runtime.features import broken_features, features
from tega.runtime.files.whole_file import open_to_append

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


_PACKAGES = ("tega", "numpy", "msgspec", "foxglove-sdk", "protobuf", "mcap", "opencv-contrib-python-headless")


def versions() -> dict[str, str]:
    """Return the versions of Python, machine, system and packages, by name."""
    known = {"python": sys.version.split()[0], "machine": platform.machine(), "system": platform.system()}
    for package in _PACKAGES:
        try:
            known[package] = version(package)
        except PackageNotFoundError:
            known[package] = "not installed"
    return known


_LOG = logging.getLogger(__name__)

NOTES: Final = "elsewhere.txt"
"""File beside a recording: one absolute path of a copy a line. Copies have one, too, so that their copies are found."""


def note_copy(source: Path, copy: Path) -> None:
    """Note the existing folder of a copy, if the source is part of a study or itself such a copy."""
    folder = source.absolute().parent
    notes = folder / NOTES
    of_study = any((parent / "study.toml").is_file() for parent in folder.parents)
    if not (of_study or notes.is_file()):
        return
    try:
        with open_to_append(notes) as file:
            file.write(f"{copy.absolute()}\n".encode())
        with open_to_append(copy / NOTES):
            pass
    except OSError as error:
        _LOG.warning("%s: the copy %s cannot be noted: %s", source, copy, error)


# A recording can come from anybody: nothing but the name of a package is printed out of it, and what to install only
# where that package is TEGA's own.
_NAME: Final = re.compile(r"[A-Za-z0-9][\w.-]{0,63}", re.ASCII)
_REQUIREMENT: Final = re.compile(r"[A-Za-z0-9][\w.-]{0,63}(\[[\w,-]{1,64}\])?", re.ASCII)


def absent_features(metadata: Mapping[str, Mapping[str, str]]) -> list[str]:
    """Return a sentence for each feature of a recording's tables that is not installed or not loaded here."""
    broken = {one.name: f"{one.said}; {one.hint}" for one in broken_features()}
    return [
        f"recorded with the feature {name!r}, "
        + broken.get(name, f"which is not installed here: {_next_step(requirement)}")
        for name, requirement in metadata.get("features", {}).items()
        if name not in features() and _NAME.fullmatch(name) and _REQUIREMENT.fullmatch(requirement)
    ]


def _next_step(requirement: str) -> str:
    if requirement.partition("[")[0] == "tega":
        return f"pip install '{requirement}'"
    return f"the recording names the package {requirement!r}; ask who made it before installing that"


def absent_in(path: Path) -> list[str]:
    """Return the sentences of :func:`absent_features` for a file."""
    reader = McapReader(path)
    next(reader.messages(lambda _topic: False), None)  # the tables come before every message
    return absent_features(reader.metadata)
