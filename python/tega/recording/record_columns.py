"""Name the columns of a recording's tables, and turn its messages into records and columns, by their record types.

The names are the same in an export, in Python and in a run's own tables.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from functools import cache
from typing import Any, Final

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.devices.base import DeviceInfo
from tega.errors import TegaError
from tega.hand import JOINT_NAMES
from tega.haptics.motor_layout import find_layout
from tega.recording.mcap_reader import McapReader, Message
from tega.recording.mcap_schemas import PACKAGE
from tega.records import Joints, LogLine, Picture, PoseRecord, Record, TrackerAxes
from tega.records.base import VideoPacket
from tega.records.schema import MessageField, fields, own_schema, read, schema_name, values
from tega.records.types import record_types
from tega.runtime.files.foreign_file import parse_json

Columns = dict[str, list[Any]]

_LOG_LEVELS: Final = {1: 10, 2: 20, 3: 30, 4: 40, 5: 50}


def time_column(field: str) -> str:
    """Return the column of a time in nanoseconds, which a table has in seconds.

    Example:
        >>> time_column("taken_ns")
        'taken_s'
    """
    return f"{field.removesuffix('_ns')}_s"


def list_columns(
    field: str, n: int, *, layout: str = "", channels: Sequence[str] = (), taken: Collection[str] = ()
) -> Sequence[str]:
    """Return the columns of a list of ``n`` numbers; ``taken`` are the names of the other columns.

    The ``field`` is ``channels`` of EMG, named ``channels``, ``intensities`` of a layout's motors, or any other.

    Example:
        >>> list_columns("channels", 2), list_columns("gains", 2), list_columns("intensities", 2)
        (['ch1', 'ch2'], ('gains_1', 'gains_2'), ('m0', 'm1'))
    """
    if field == "channels":
        return channel_columns(channels, n, taken)
    return motor_columns(layout, n) if field == "intensities" else _numbered(field, n)


def channel_columns(channels: Sequence[str], n: int, taken: Collection[str] = ()) -> list[str]:
    """Return a column for each EMG channel: its name, or its number where names are missing, repeated or taken."""
    names = list(channels) if len(channels) == n else [""] * n
    good = [bool(name) and names.count(name) == 1 and name not in taken for name in names]
    return [name if ok else f"ch{k}" for k, (name, ok) in enumerate(zip(names, good, strict=True), 1)]


@cache
def motor_columns(layout: str, n: int) -> tuple[str, ...]:
    """Return the columns of a layout's motors, by their numbers at the device; of an unknown layout by their order."""
    numbers = list(range(n))
    with suppress(TegaError):
        known = find_layout(layout).numbers.tolist()
        numbers = known if len(known) == n else numbers
    return tuple(f"m{number}" for number in numbers)


@cache
def _numbered(field: str, n: int) -> tuple[str, ...]:
    return tuple(f"{field}_{k}" for k in range(1, n + 1))


def emg_source(reader: McapReader) -> DeviceInfo | None:
    """Return the EMG source's description in a recording; ``None`` if it is missing or damaged."""
    sources: Mapping[str, str] = reader.metadata.get("sources", {})
    with suppress(msgspec.MsgspecError):
        return parse_json(sources.get("emg", ""), DeviceInfo)
    return None


def find_kind(topic: str, schema: str) -> tuple[type[Record], dict[str, str]] | None:
    """Return the record type of a topic, and those of its fields that only the topic names; ``None`` if unknown."""
    for kind in record_types():
        name = f"{PACKAGE}.{schema_name(kind)}" if own_schema(kind) else kind.schema
        where = kind.topic.replace("/image", "/frame") if kind is Picture else kind.topic
        found = _pattern(where).fullmatch(topic)
        if schema == name and found is not None:
            own = own_schema(kind)
            return kind, {n: t for n, t in found.groupdict().items() if not own or n in kind.unwritten}
    return None


@cache
def _pattern(topic: str) -> re.Pattern[str]:
    parts = re.split(r"\{(\w+)\}", topic)
    return re.compile(
        "".join(f"(?P<{part}>[^/]+)" if k % 2 else re.escape(part) for k, part in enumerate(parts))
    )


def record_of(kind: type[Record], message: Message, named: Mapping[str, Any], zero_ns: int) -> Record:
    """Return the record of a decoded message.

    ``named`` are the fields that only the topic names; ``zero_ns`` is the log time at the start of the session.
    """
    value: Any = message.value
    if own_schema(kind):
        return read(kind, value, **named, **({"image": None} if kind is Picture else {}))
    make: Any = kind
    t_ns = value.timestamp.seconds * 1_000_000_000 + value.timestamp.nanos - zero_ns
    if issubclass(kind, Joints):
        return kind(t_ns=t_ns, angles_rad=tuple(joint.position for joint in value.joints))
    if issubclass(kind, LogLine):
        return kind(t_ns=t_ns, level=_LOG_LEVELS.get(value.level, 0), name=value.name, text=value.message)
    if issubclass(kind, VideoPacket):
        made: Record = make(t_ns=t_ns, data=value.data, video=value.format, **named)
        return made
    if issubclass(kind, TrackerAxes):
        return kind(
            t_ns=t_ns,
            parent=value.parent_frame_id,
            child=value.child_frame_id,
            quaternion=_axes(value.rotation, "xyzw"),
        )
    assert issubclass(kind, PoseRecord)
    place, turn = _axes(value.pose.position, "xyz"), _axes(value.pose.orientation, "xyzw")
    return kind(
        t_ns=t_ns, taken_ns=message.log_ns - zero_ns, frame=value.frame_id, position=place, quaternion=turn
    )


def _axes(value: Any, names: str) -> tuple[float, ...]:
    return tuple(getattr(value, name) for name in names)


def row_of(record: Record, *, shift_ns: int, channels: Sequence[str] = ()) -> dict[str, Any]:
    """Return a record as a row, its columns named as this module says.

    ``shift_ns`` is added to its times; ``channels`` are the names of the EMG channels.
    """
    row: dict[str, Any] = {}
    cells: dict[str, Any] = values(record) if not isinstance(record, Joints) else {"t_ns": record.t_ns}
    if isinstance(record, Joints):
        row |= dict(zip(JOINT_NAMES, record.angles_rad, strict=False))
    for field, column, is_time in _columns_of(type(record)):
        name, value = field.name, cells.get(field.name)
        if is_time:
            row[column] = np.nan if value is None else (value + shift_ns) / 1e9
        elif name == "more" and value:
            # One that is named as a column of the record is not that column.
            row |= {
                f"more.{one['name']}" if one["name"] in cells else one["name"]: one["value"] for one in value
            }
        elif not isinstance(value, (tuple, list, np.ndarray)):
            row[column] = value
        elif not len(value) or isinstance(value[0], (int, float, str, np.number)):
            places = type(record).columns.get(name, ())
            listed = list_columns(
                name,
                len(value),
                layout=cells.get("layout", ""),
                channels=channels,
                taken={*cells, "t_s", "log_s"},
            )
            given = places if len(places) == len(value) else listed
            row |= dict(zip(given, value, strict=True))
        else:
            row[column] = value
    optional = _optional(type(record))
    return {name: value for name, value in row.items() if value is not None or name in optional}


@cache
def _columns_of(kind: type[Record]) -> tuple[tuple[MessageField, str, bool], ...]:
    """Return the fields that are columns, all but bytes, each with its column and whether it is a time."""
    found = []
    for field in fields(kind):
        is_time = field.unit == "ns" and field.name.endswith("_ns")
        if field.wire != "bytes":
            found.append((field, time_column(field.name) if is_time else field.name, is_time))
    return tuple(found)


@cache
def _optional(kind: type[Record]) -> frozenset[str]:
    return frozenset(column for field, column, _ in _columns_of(kind) if field.optional)


def column_names(kind: type[Record]) -> list[str]:
    """Return the columns of a record type, one per field, as for a topic without messages."""
    return [column for _, column, _ in _columns_of(kind)]


def units_of(kind: type[Record]) -> dict[str, str]:
    """Return the unit of each column of a record type that has one."""
    columns = _columns_of(kind)
    return {column: "s" if is_time else field.unit for field, column, is_time in columns if field.unit}


def arrays_of(rows: Iterable[Mapping[str, Any]], *, most_rows: int = 4096) -> dict[str, NDArray[Any]]:
    """Return rows as columns; numbers that are missing are NaN, missing texts ``None``.

    A name may be missing in some rows. At most ``most_rows`` are Python objects before they become arrays.
    """
    blocks: dict[str, list[NDArray[Any]]] = {}
    waiting: list[Mapping[str, Any]] = []
    n_rows = 0

    def settle() -> None:
        nonlocal n_rows
        for name in dict.fromkeys(name for row in waiting for name in row):
            parts = blocks.setdefault(name, [] if not n_rows else [np.full(n_rows, None, object)])
            parts.append(_array([row.get(name) for row in waiting]))
        n_rows += len(waiting)
        for parts in blocks.values():
            if (missing := n_rows - sum(map(len, parts))) > 0:
                parts.append(np.full(missing, None, object))
        waiting.clear()

    for row in rows:
        waiting.append(row)
        if len(waiting) >= most_rows:
            settle()
    settle()
    return {name: _joined(parts) for name, parts in blocks.items()}


def _array(column: list[Any]) -> NDArray[Any]:
    kinds = {type(value) for value in column}
    if kinds == {bool}:
        return np.array(column, bool)
    if kinds and kinds <= {int, np.int64} and all(-(2**63) <= value < 2**63 for value in column):
        return np.array(column, np.int64)
    if kinds <= {int, float, bool, np.int64, np.float64, type(None)} and kinds != {type(None)}:
        return np.array([np.nan if value is None else value for value in column], np.float64)
    made = np.empty(len(column), object)
    made[:] = column
    return made


def _joined(parts: list[NDArray[Any]]) -> NDArray[Any]:
    """Return parts of a column as one; one of nothing alone is NaN."""
    if all(part.dtype != object for part in parts):
        return np.concatenate(parts)
    column = [value for part in parts for value in part.tolist()]
    return _array(column) if any(value is not None for value in column) else np.full(len(column), np.nan)
