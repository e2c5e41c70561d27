"""Decide which columns of a table are channels and which one is the time, and say so in one line."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NoReturn

import msgspec

from tega.errors import RecordingError
from tega.runtime.files.tables.table import Column, FileEvent, Reading, Table

_WORDS = {
    "time": "is time", "counter": "counts", "label": "is a label", "sensor": "is another sensor", "text": "is text",
    "unknown": "is no channel", "channel": "is no channel",
}  # fmt: skip
_MOST_NAMED = 6
_VOLTS = frozenset({"v", "mv", "uv", "µv", "μv"})


class Decision(msgspec.Struct, kw_only=True):
    """Way in which a file was read.

    Attributes:
        channels: Columns that are read as channels, from 1.
        unit: Unit of the channels; ``""`` if the file does not state it, or several.
        time: Column of the time, from 1; 0 if there is none.
        counter: Column of a counter that shows losses, from 1; 0 if there is none.
        facts: Encoding, delimiter, decimal sign and the first row's line, of a text table.
        rate_hz: Samples per second that are used; ``None`` if unknown.
        n_samples: Samples of a channel.
        faults: Findings of the comparison of time and rate.
        notes: Other facts that a reader of the results must know.
        words: The decision in one line; ``""`` where all columns are channels and nothing had to be decided.
    """

    file: str
    format: str
    channels: list[int]
    names: list[str]
    unit: str = ""
    time: int = 0
    counter: int = 0
    columns: list[Column] = []
    facts: dict[str, str] = {}
    sideways: bool = False
    rate_hz: float | None = None
    rate_from: str = ""
    n_samples: int = 0
    events: list[FileEvent] = []
    faults: list[str] = []
    notes: list[str] = []
    words: str = ""


def decide(table: Table, reading: Reading) -> Decision:
    """Decide which columns of a table are read; ``RecordingError`` where several readings are possible."""
    columns = table.columns
    check_channels(table.file, reading.channels, len(columns))
    channels = reading.channels or _channels(table.file, columns)
    chosen = [columns[c - 1] for c in channels]
    units = {column.unit for column in chosen}
    decision = Decision(
        file=table.file,
        format=table.format,
        channels=list(channels),
        names=[column.name for column in chosen],
        unit=units.pop() if len(units) == 1 else "",  # else they are noted
        time=_time_of(table, channels, reading),
        counter=next((c.number for c in columns if c.holds == "counter" and c.number not in channels), 0),
        columns=columns,
        facts=table.facts,
        sideways=table.sideways,
        notes=list(table.notes),
        events=table.events,
    )
    if units:
        decision.notes.append(f"channels have several units: {', '.join(c.unit or 'none' for c in chosen)}")
    decision.words = _words(decision, requested=bool(reading.channels))
    return decision


def check_channels(file: str, channels: Sequence[int], n_columns: int) -> None:
    """Refuse channels that are not there, or asked for twice."""
    for c in channels:
        if not 1 <= c <= n_columns:
            raise RecordingError(
                f"{file}: has no channel {c}", f"it has {n_columns}; channels are counted from 1"
            )
    if len(set(channels)) != len(channels):
        raise RecordingError(
            f"{file}: a channel is asked for twice in {', '.join(map(str, channels))}",
            "name each channel once",
        )


def _channels(file: str, columns: list[Column]) -> tuple[int, ...]:
    names = {column.name.lower() for column in columns}
    if "value" in names and names & {"variable", "channel", "sensor"}:
        raise RecordingError(f"{file}: a row per value (a long table)", "pivot it to a column per channel")
    named = [c.number for c in columns if c.holds == "channel"]
    unknown = [c for c in columns if c.holds == "unknown"]
    moving = [c for c in unknown if not c.constant]
    units = {c.unit.lower() for c in columns if c.holds == "channel"}
    if named and moving and units <= _VOLTS and all({c.unit.lower()} == units for c in moving):
        for column in moving:  # in the unit of those that are named EMG
            column.holds, column.why = "channel", "name"
        return tuple(c.number for c in columns if c.holds == "channel")
    if named and moving:
        others = f"{', '.join(c.called for c in moving[:_MOST_NAMED])}"
        _refuse(file, f"some columns are named EMG, and {others} may be EMG too", columns)
    if named:
        return tuple(named)
    by_values = [c for c in columns if c.why == "values" and c.holds in {"time", "counter", "label"}]
    if not unknown and by_values and not any(c.name for c in columns):
        for column in by_values:  # ramps are all that there is: numbers that somebody made
            column.holds, column.why = "unknown", ""
        unknown = by_values
    if not unknown:
        _refuse(file, "no column is EMG by its name or values", columns)
    doubtful = not any(c.name for c in columns) and by_values and by_values[0].holds != "label"
    if doubtful and (n_still := len(unknown) - len(moving)) > 0 and len(columns) > 4:
        why = f"a table without names, {_of(by_values)}, and {n_still} columns never change"
        _refuse(file, why, columns)
    return tuple(c.number for c in unknown)


def _refuse(file: str, why: str, columns: list[Column]) -> NoReturn:
    likely = [str(c.number) for c in columns if c.holds == "channel"] or [
        str(c.number) for c in columns if c.holds == "unknown" and not c.constant
    ]
    if not likely:
        likely = [str(c.number) for c in columns if c.holds not in {"time", "counter", "text"}]
    raise RecordingError(f"{file}: {why}", f"name the channels, such as {','.join(likely[:16]) or '2,3'}")


def _time_of(table: Table, channels: Sequence[int], reading: Reading) -> int:
    """Return the column of the time, from 1; 0 if there is none, or it is not wanted."""
    if reading.time == "none" or table.times_s is not None:
        return 0
    if isinstance(reading.time, int):
        if reading.time > len(table.columns):
            raise RecordingError(
                f"{table.file}: has no column {reading.time} for the time",
                f"it has {len(table.columns)} columns",
            )
        return reading.time
    times = [c for c in table.columns if c.holds == "time" and c.number not in channels]
    # Of several the one nearest before the first channel: each sensor may have its own.
    times = [c for c in times if c.even] or times
    before = [c for c in times if c.number < channels[0]]
    return (before[-1:] or times[:1])[0].number if times else 0


def _of(columns: list[Column]) -> str:
    parts = [f"{c.called} {_WORDS[c.holds]}" for c in columns[:_MOST_NAMED]]
    if len(columns) > _MOST_NAMED:
        parts.append(f"{len(columns) - _MOST_NAMED} more are left out")
    return ", ".join(parts)


def _words(decision: Decision, *, requested: bool) -> str:
    facts = decision.facts
    left = [c for c in decision.columns if c.number not in decision.channels]
    text = []
    if left and not requested:
        moving = [c for c in left if not (c.constant and c.holds in {"unknown", "sensor"})]
        same = len(left) - len(moving)
        parts = _of(moving) + (", " if moving and same else "") + (f"{same} never change" if same else "")
        text.append(parts)
    if decision.sideways and len(decision.channels) > 1:  # of one row it is no question
        text.append("each row is a channel")
    text += [f"decimal {facts['decimal']}"] if facts.get("decimal") == "comma" else []
    text += [f"{facts['encoding']} text"] if facts.get("encoding", "UTF-8") != "UTF-8" else []
    if facts.get("names") == "numbers":
        text.append("the first row of whole numbers names the columns")
    if int(facts.get("first_line", "1")) > 2:
        text.append(f"rows from line {facts['first_line']} on")
    if not text:
        return ""
    n = len(decision.channels)
    of = f" of {len(decision.columns)} columns" if left else ""
    return f"{n} channel{'s' if n > 1 else ''}{of}: {'; '.join(text)}"
