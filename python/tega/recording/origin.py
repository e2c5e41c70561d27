"""Note in a recording which others it was made out of, which versions and features made it, and copies beside it.

The origin is in tables of names and texts in the file: ``span``, the part of the session in the file, and
``origin-1``, ``origin-2`` and so on, one for every step from the run's own file to this one. An MCAP file that another
program wrote is named by its profile and its topics.
"""

from __future__ import annotations

import logging
import platform
import re
import sys
from collections.abc import Iterable, Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, Final, NamedTuple

from tega.errors import ConfigError, RecordingError
from tega.runtime.features import broken_features, features
from tega.runtime.files.whole_file import open_to_append
from tega.runtime.lifecycle import require
from tega.runtime.words import printable

LEAD_IN = "lead-in.mcap"
"""Name of the attachment with the records from before the span that a replay needs."""

SPAN = "span"
_ORIGIN = "origin-"

Tables = Mapping[str, Mapping[str, str]]

_MOST_TOPICS: Final = 12


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
    """Return the steps from the run's own file to this one, none for the run's own file; ``RecordingError`` if odd."""
    try:
        numbers = sorted(int(name.removeprefix(_ORIGIN)) for name in tables if name.startswith(_ORIGIN))
        steps = [dict(tables[f"{_ORIGIN}{n}"]) for n in numbers]
        for step in steps:
            _ = step["made_by"], step["session"], step["file"], str(span({SPAN: step}))
    except (KeyError, ValueError, OverflowError) as error:
        raise RecordingError(f"a step that made it is damaged: {error}"[:200], "make it again") from error
    return steps


def origin(tables: Tables, source: Path, *, made_by: str, part: Span) -> tuple[str, dict[str, str]]:
    """Return name and content of the table for one more step: a verb, and the part of the source copied."""
    from tega import __version__

    head = tables.get("tega", {})
    return f"{_ORIGIN}{len(origins(tables)) + 1}", {
        "made_by": f"tega-teleop {made_by} {__version__}",
        "session": printable(source.resolve().parent.name),
        "file": printable(source.name),
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
            file.write(bytes(copy.absolute()) + b"\n")
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


def no_session(path: Path, names: Iterable[str]) -> RecordingError:
    """Return the error for a file that holds no recording of a session.

    If one of ``names``, its tables and schemas, is of TEGA, the file is another kind of recording; if none
    is, the error names the profile, the topics, their types and numbers of messages.
    """
    if any(name.startswith("tega") for name in names):
        return RecordingError(f"{path.name}: no recording of a session", "name a file made with --record")
    if not path.stat().st_size:
        return RecordingError(f"{path.name}: is empty (0 bytes)", "copy it again from its source")
    profile, library, topics = _reported(path)
    listed = ", ".join(topics[:_MOST_TOPICS])
    if len(topics) > _MOST_TOPICS:
        listed += f" and {len(topics) - _MOST_TOPICS} more"
    by = f"profile {profile}" if profile else f"written by {library}" if library else "no profile"
    hint = "name a recording made with --record"
    if profile == "ros2":
        hint = f"replay pictures or arrays in it: tega-teleop replay --tactile thumb={path.name} --topic thumb=TOPIC"
    text = f"its topics: {listed}" if listed else "it holds no topic"
    return RecordingError(f"{path.name}: not recorded by TEGA ({by}); {text}"[:2000], hint)


def _reported(path: Path) -> tuple[str, str, list[str]]:
    """Return profile, library, and topics as ``/camera sensor_msgs/msg/Image (120)``, as far as the file has them."""
    make_reader: Any = require("mcap.reader", driver="recording", extra="record").make_reader
    profile = library = ""
    try:
        with path.open("rb") as file:
            reader = make_reader(file)
            header = reader.get_header()
            profile, library = header.profile, header.library
            summary = reader.get_summary()
        counts = summary.statistics.channel_message_counts if summary.statistics else {}
        types = {number: schema.name for number, schema in summary.schemas.items()} | {0: "no schema"}
        topics = [
            f"{channel.topic} {types[channel.schema_id]} ({counts.get(number, 0)})"
            for number, channel in summary.channels.items()
        ]
    except Exception:  # of a file that was cut the reader raises what it likes; it has no summary
        topics = []
    return profile, library, sorted(topics)
