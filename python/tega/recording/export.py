"""Export a recording as tables and pictures, for programs that do not read MCAP."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from functools import cache, partial
from itertools import groupby
from operator import attrgetter, methodcaller
from pathlib import Path
from typing import Any, Final, Literal

from tega.errors import ConfigError, RecordingError
from tega.loop.pacing import settled
from tega.recording.growing_table import Columns, GrowingCsv, GrowingParquet, GrowingTable
from tega.recording.mcap_index import open_indexed
from tega.recording.mcap_reader import WHOLE, McapReader, Message, Progress, Within
from tega.recording.origin import LEAD_IN, note_copy
from tega.recording.pictures import paired
from tega.recording.record_columns import channel_columns, emg_source, list_columns, time_column
from tega.records.outputs import frames_text
from tega.runtime.child_process import called_beside
from tega.runtime.files.foreign_file import MIB, plain_name, reports_damage
from tega.runtime.lifecycle import require

# Pictures' cells, seven kilobytes each, wait with the messages that they are in: memory that the system has to clear.
_MESSAGES_KEPT: Final = 1024
_BYTES_KEPT: Final = MIB // 2
# Of a larger file another process writes the second half: two minutes of four fingers.
_SPLIT_BYTES: Final = 512 * MIB
_GROWING: Final[dict[str, type[GrowingTable]]] = {"csv": GrowingCsv, "parquet": GrowingParquet}


@reports_damage
@settled()
def export_file(
    path: Path,
    folder: Path,
    *,
    kind: Literal["csv", "parquet"] = "csv",
    pictures: bool = False,
    progress: Progress | None = None,
) -> list[Path]:
    """Write one table per topic, and the attached files as they are; return the tables.

    Columns are named as in a run's own tables. Times are seconds since the start of the session, exact to the
    nanosecond: ``t_s`` when something was captured, ``log_s`` when it was received. EMG channels have their
    names, else ``ch1`` and so on, motors ``m`` and their number, other lists count from 1. CAN frames become
    text such as ``180#0A0B``, an arm's forearm poses such as ``t_ns x y z qx qy qz qw valid``. EMG has one
    row a sample.

    ``folder`` is new or empty, else ``ConfigError``. ``parquet`` needs the extra of that name. With
    ``pictures`` every picture is written too, as PNG or the JPEG that it is, in a folder per finger named by
    its number. ``progress`` is called as the file is read, of a large one its first half: another process
    reads the second. A topic or an attachment with a name that cannot be a file's is ``UnsafeNameError``.
    """
    if kind == "parquet":
        require("pyarrow.parquet", driver="export", extra="parquet")
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise ConfigError(f"{str(folder)!r} is not empty, or is a file", "name a new folder with --out")
    folder.mkdir(parents=True, exist_ok=True)
    note_copy(path, folder)
    split = not pictures and path.is_file() and path.stat().st_size >= _SPLIT_BYTES
    middle = open_indexed(path).middle() if split else None
    if middle is None:
        return _closed(_write_tables(path, folder, kind, pictures=pictures, progress=progress)[0])
    lost = RecordingError("the program that writes the second half ended", "run it again; is memory short?")
    with (
        tempfile.TemporaryDirectory(dir=folder, prefix=".") as beside,
        called_beside(_write_second_half, path, Path(beside), kind, middle, lost=lost) as written,
    ):
        tables, cut = _write_tables(path, folder, kind, (0, middle), progress=progress)
        for part in [] if cut else written():
            tables.setdefault(part.name, _GROWING[kind](folder / part.name)).append(part)
            part.unlink()
        for attached in [] if cut else Path(beside).iterdir():
            attached.replace(folder / attached.name)
    return _closed(tables)


def _closed(tables: Mapping[str, GrowingTable]) -> list[Path]:
    """Finish the tables that have rows, and return their files."""
    return sorted(table.close() for table in tables.values() if not table.empty)


def _write_second_half(path: Path, folder: Path, kind: str, begins: int) -> list[Path]:
    """Write the tables of what a recording holds from a place on, and return them; attached files are beside them."""
    return _closed(_write_tables(path, folder, kind, (begins, math.inf))[0])


def _write_tables(
    path: Path,
    folder: Path,
    kind: str,
    within: Within = WHOLE,
    *,
    pictures: bool = False,
    progress: Progress | None = None,
) -> tuple[dict[str, GrowingTable], str]:
    """Write what a recording holds in a part of its file; return the tables, and why the file ends early."""
    reader = open_indexed(path) if within[0] else McapReader(path)
    reader.progress = progress or reader.progress
    tables: dict[str, _TopicTable] = {}
    epoch_ns = 0
    channels: Sequence[str] = ()
    taken = reader.messages(lambda topic: pictures or not topic.endswith("/image"), within, every=False)
    with closing(taken) as messages:
        for message in paired(messages):
            topic, schema, log_ns, n_bytes, value, image = message
            if image is not None:
                finger = plain_name(topic.split("/")[2], subject=f"{topic}: finger", source=path.name)
                _picture(image, folder / finger, value.seq)
            table = tables.get(topic)
            if table is None:
                if not tables:
                    epoch_ns = int(reader.metadata.get("tega", {}).get("epoch_ns", "0"))
                    channels = () if (info := emg_source(reader)) is None else info.channels
                name = plain_name(topic.strip("/").replace("/", "."), subject="topic", source=path.name)
                to = _GROWING[kind](folder / f"{name}.{kind}")
                table = tables[topic] = _TopicTable(to, schema, epoch_ns, channels)
            table.log_ns.append(log_ns)
            table.values.append(value)
            table.n_bytes += n_bytes
            if len(table.values) >= _MESSAGES_KEPT or table.n_bytes >= _BYTES_KEPT:
                table.flush()
    attached = [
        plain_name(name, subject="attachment", source=path.name) for name in reader.files if name != LEAD_IN
    ]
    for name in attached:
        (folder / name).write_bytes(reader.files[name])
    for table in tables.values():
        table.flush()
    reader.warn_cut()
    return {table.to.path.name: table.to for table in tables.values()}, reader.cut


class _TopicTable:
    """Turns the messages of a topic into the rows of its table, many at a time.

    ``epoch_ns`` is the log time at the start of the session; ``values`` and ``log_ns`` are those of the
    messages that wait.
    """

    def __init__(self, to: GrowingTable, schema: str, epoch_ns: int, channels: Sequence[str]) -> None:
        self.to, self._schema, self._epoch_ns, self._channels = to, schema, epoch_ns, channels
        self.log_ns: list[int] = []
        self.values: list[Any] = []
        self.n_bytes = 0

    def flush(self) -> None:
        """Write the rows of all messages that wait."""
        at = 0
        for n in _runs(self.values):
            log_s = [(log_ns - self._epoch_ns) / 1e9 for log_ns in self.log_ns[at : at + n]]
            columns = _columns(self._schema, log_s, self.values[at : at + n], self._channels)
            if columns["log_s"]:
                self.to.add(columns)
            at += n
        self.log_ns.clear()
        self.values.clear()
        self.n_bytes = 0


def _columns(schema: str, log_s: Sequence[float], values: Sequence[Any], channels: Sequence[str]) -> Columns:
    """Return the columns of messages alike that were received at these times."""
    columns: dict[str, Sequence[Any]] = {"log_s": log_s}
    match schema:
        case "tega.EmgSamples":
            return _sample_columns(log_s, values, channels)
        case "foxglove.JointStates":
            names = [joint.name for joint in values[0].joints]
            angles = zip(*[[joint.position for joint in value.joints] for value in values], strict=True)
            return columns | dict(zip(names, angles, strict=True))
        case "foxglove.PoseInFrame":
            columns["frame_id"] = [value.frame_id for value in values]
            places, turns = [value.pose.position for value in values], [v.pose.orientation for v in values]
            columns |= {axis: list(map(attrgetter(axis), places)) for axis in "xyz"}
            return columns | {f"q{axis}": list(map(attrgetter(axis), turns)) for axis in "xyzw"}
        case _:
            return columns | message_columns(values, channels)


def _sample_columns(log_s: Sequence[float], values: Sequence[Any], channels: Sequence[str]) -> Columns:
    """Return the columns of chunks of EMG samples, a row a sample."""
    n = values[0].n_channels
    chunks = [(t_s, value, len(value.samples) // n) for t_s, value in zip(log_s, values, strict=True)]
    columns: dict[str, Sequence[Any]] = {
        "log_s": [t_s for t_s, _, n_rows in chunks for _ in range(n_rows)],
        "chunk_t_s": [value.t_ns / 1e9 for _, value, n_rows in chunks for _ in range(n_rows)],
        "index": [value.first_index + k for _, value, n_rows in chunks for k in range(n_rows)],
    }
    samples = [x for _, value, n_rows in chunks for x in value.samples[: n_rows * n]]
    return columns | {name: samples[k::n] for k, name in enumerate(channel_columns(channels, n, columns))}


def message_columns(values: Sequence[Any], channels: Sequence[str] = ()) -> dict[str, Sequence[Any]]:
    """Return the columns of messages alike, named as :mod:`tega.recording.record_columns` says.

    The decoded messages all have the same fields present and lists of the same length.
    """
    columns: dict[str, Sequence[Any]] = {}
    first = values[0]
    own = _own(first.DESCRIPTOR)
    for field in first.DESCRIPTOR.fields:
        name, part = field.name, None if field.message_type is None else field.message_type.name
        if field.type == field.TYPE_BYTES or (_optional(field) and not first.HasField(name)):
            continue
        cells = list(map(attrgetter(name), values))
        if part == "NamedValue":
            # A named value that is named as a column of the record is not that column.
            columns |= {
                f"more.{one.name}" if one.name in own else one.name: [more[k].value for more in cells]
                for k, one in enumerate(cells[0])
            }
        elif not field.is_repeated:
            if name.endswith("_ns"):
                columns[time_column(name)] = [t_ns / 1e9 for t_ns in cells]
            else:
                columns[name] = cells if part is None else list(map(str, cells))
        elif part is not None:
            columns[name] = list(map(_poses_text if part == "ArmPose" else frames_text, cells))
        elif field.type == field.TYPE_STRING:
            columns[name] = list(map(" ".join, cells))
        else:
            layout = getattr(first, "layout", "")
            names = list_columns(name, len(cells[0]), layout=layout, channels=channels, taken=own)
            columns |= dict(zip(names, zip(*cells, strict=True), strict=True))
    return columns


def _runs(values: Sequence[Any]) -> list[int]:
    """Return how many messages in a row have columns of the same names, over and over."""
    if not values:
        return []
    parts = _shape_parts(values[0].DESCRIPTOR)
    if not parts:
        return [len(values)]
    return [
        len(list(alike)) for _, alike in groupby(zip(*[map(part, values) for part in parts], strict=True))
    ]


@cache
def _shape_parts(descriptor: Any) -> list[Callable[[Any], Any]]:
    parts: list[Callable[[Any], Any]] = []
    for field in descriptor.fields:
        part = None if field.message_type is None else field.message_type.name
        if _optional(field):
            parts.append(methodcaller("HasField", field.name))
        elif part in {"NamedValue", "JointState"}:
            parts.append(
                partial(lambda name, value: tuple([one.name for one in getattr(value, name)]), field.name)
            )
        elif field.is_repeated and part is None and descriptor.full_name != "tega.EmgSamples":
            parts.append(partial(lambda name, value: len(getattr(value, name)), field.name))
        elif field.name in {"layout", "n_channels"}:
            parts.append(attrgetter(field.name))
    return parts


def _optional(field: Any) -> bool:
    return field.containing_oneof is not None


@cache
def _own(descriptor: Any) -> frozenset[str]:
    """Return the columns of a message's own fields."""
    names = list(descriptor.fields_by_name)
    return frozenset({"log_s", *names, *(time_column(name) for name in names if name.endswith("_ns"))})


def _poses_text(poses: Any) -> str:
    """Return poses, each as its time, place, turn and validity."""
    numbers = [(pose.t_ns, *pose.position, *pose.quaternion, int(pose.valid)) for pose in poses]
    return "; ".join(" ".join(map(str, one)) for one in numbers)


def _picture(message: Message, folder: Path, seq: int) -> None:
    import numpy as np

    folder.mkdir(exist_ok=True)
    value = message.value
    if message.schema == "foxglove.CompressedImage":
        (folder / f"{seq:06d}.jpg").write_bytes(value.data)
        return
    cv2 = require("cv2", driver="export", extra="record")
    image = np.frombuffer(value.data, np.uint8).reshape(value.height, value.width, 3)
    # Through memory: OpenCV takes no path that its C library's encoding does not have.
    (folder / f"{seq:06d}.png").write_bytes(cv2.imencode(".png", image)[1].tobytes())
