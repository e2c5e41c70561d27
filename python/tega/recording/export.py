"""Export a recording as tables and pictures, for programs that do not read MCAP."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cache, partial
from pathlib import Path
from typing import Any, Literal

from tega.devices.base import DeviceInfo
from tega.errors import ConfigError
from tega.recording.column_names import channel_columns, emg_source, list_columns, time_column
from tega.recording.copies import note_copy
from tega.recording.growing_table import GrowingCsv, GrowingParquet, GrowingTable, Row
from tega.recording.mcap_reader import McapReader, Message, Progress
from tega.recording.origin import LEAD_IN
from tega.runtime.files.foreign_file import reports_damage
from tega.runtime.files.plain_name import plain_name
from tega.runtime.lifecycle import require


@reports_damage
def export_file(
    path: Path,
    folder: Path,
    *,
    kind: Literal["csv", "parquet"] = "csv",
    pictures: bool = False,
    progress: Progress | None = None,
) -> list[Path]:
    """Write one table per topic, and the attached files as they are.

    Columns are named as in a run's own tables. Times are seconds since the start of the session, exact to the
    nanosecond: ``t_s`` when something was captured, ``log_s`` when it was received. EMG channels have their names,
    else ``ch1`` and so on, motors ``m`` and their number, other lists count from 1. CAN frames become text such as
    ``180#0A0B``, an arm's forearm poses such as ``t_ns x y z qx qy qz qw valid``. EMG has a row per sample.

    Args:
        path: The recording.
        folder: Output folder; new or empty.
        kind: ``csv``, or ``parquet`` (extra ``parquet``).
        pictures: Also write every picture, as PNG or the JPEG that it is, in a folder per finger named by its number.
        progress: Called as the file is read.

    Returns:
        The tables.

    Raises:
        ConfigError: The folder holds something.
        RecordingError: The recording cannot be read.
        UnsafeNameError: A topic or an attachment has a name that cannot be a file's.
        MissingExtraError: A package is not installed.
    """
    if kind == "parquet":
        require("pyarrow.parquet", driver="export", extra="parquet")
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise ConfigError(f"{str(folder)!r} is not empty, or is a file", "name a new folder with --out")
    folder.mkdir(parents=True, exist_ok=True)
    note_copy(path, folder)
    reader = McapReader(path)
    reader.progress = progress or reader.progress
    tables: dict[str, GrowingTable] = {}
    growing = GrowingCsv if kind == "csv" else GrowingParquet
    waiting: dict[str, Message] = {}
    epoch_ns = 0
    info: DeviceInfo | None = None
    for message in reader.messages(lambda topic: pictures or not topic.endswith("/image")):
        epoch_ns = epoch_ns or int(reader.metadata.get("tega", {}).get("epoch_ns", "0"))
        if message.topic.endswith("/image"):
            waiting[message.topic] = message
            continue
        if message.schema == "tega.Frame" and pictures:
            image = waiting.pop(f"{message.topic.removesuffix('/frame')}/image", None)
            if image is not None:
                finger = plain_name(
                    message.topic.split("/")[2], subject=f"{message.topic}: finger", source=path.name
                )
                _picture(image, folder / finger, message.value.seq)
        name = message.topic.strip("/").replace("/", ".")
        if name not in tables:
            plain_name(name, subject="topic", source=path.name)
            tables[name] = growing(folder / f"{name}.{kind}")
        if info is None and message.topic.startswith("/emg/"):
            info = emg_source(reader)
        for row in _rows(message, (message.log_ns - epoch_ns) / 1e9, () if info is None else info.channels):
            tables[name].add(row)
    attached = [
        plain_name(name, subject="attachment", source=path.name) for name in reader.files if name != LEAD_IN
    ]
    for name in attached:
        (folder / name).write_bytes(reader.files[name])
    return [table.close() for _, table in sorted(tables.items()) if table.n_rows]


def _rows(message: Message, log_s: float, channels: Sequence[str]) -> Iterator[Row]:
    value = message.value
    if message.schema == "tega.EmgSamples":
        n = value.n_channels
        names = channel_columns(channels, n, ("log_s", "chunk_t_s", "index"))
        for k in range(len(value.samples) // n):
            samples = value.samples[k * n : (k + 1) * n]
            row: Row = {"log_s": log_s, "chunk_t_s": value.t_ns / 1e9, "index": value.first_index + k}
            yield row | dict(zip(names, samples, strict=True))
        return
    if message.schema == "foxglove.JointStates":
        yield {"log_s": log_s} | {joint.name: joint.position for joint in value.joints}
        return
    if message.schema == "foxglove.PoseInFrame":
        place, turn = value.pose.position, value.pose.orientation
        row = {"log_s": log_s, "frame_id": value.frame_id, "x": place.x, "y": place.y, "z": place.z}
        yield row | {f"q{axis}": getattr(turn, axis) for axis in "xyzw"}
        return
    yield {"log_s": log_s} | message_columns(value, channels)


def message_columns(value: Any, channels: Sequence[str] = ()) -> Row:
    """Return the cells of a message by their columns, named as :mod:`tega.recording.column_names` says.

    Args:
        value: The decoded message.
        channels: Names of the EMG channels.
    """
    row: Row = {}
    for name, optional, cells in _fields(value.DESCRIPTOR):
        if optional and not value.HasField(name):
            continue
        content = getattr(value, name)
        if cells is None:
            row.update(
                zip(
                    list_columns(
                        name,
                        len(content),
                        layout=row.get("layout", ""),
                        channels=channels,
                        taken=_own(value.DESCRIPTOR),
                    ),
                    content,
                    strict=True,
                )
            )
        else:
            cells(row, name, content)
    return row


@cache
def _own(descriptor: Any) -> frozenset[str]:
    """Return the columns of a message's own fields."""
    names = list(descriptor.fields_by_name)
    return frozenset({"log_s", *names, *(time_column(name) for name in names if name.endswith("_ns"))})


@cache
def _fields(descriptor: Any) -> list[tuple[str, bool, Callable[[Row, str, Any], None] | None]]:
    """Return of each field its name, whether it is optional, and the maker of its cells; a list of numbers has none.

    Bytes are no column.
    """
    return [
        (field.name, field.containing_oneof is not None, _cells(field, _own(descriptor)))
        for field in descriptor.fields
        if field.type != field.TYPE_BYTES
    ]


def _named_cells(row: Row, _name: str, content: Any, *, own: frozenset[str]) -> None:
    for one in content:
        row[f"more.{one.name}" if one.name in own else one.name] = one.value


def _cells(field: Any, own: frozenset[str]) -> Callable[[Row, str, Any], None] | None:
    """Return what puts the content of a field into a row; ``None`` for a list of numbers."""
    part = None if field.message_type is None else field.message_type.name
    if part == "NamedValue":
        # A named value that is named as a column of the record is not that column.
        return partial(_named_cells, own=own)
    if not field.is_repeated:
        if field.name.endswith("_ns"):
            return partial(_one_cell, column=time_column(field.name), made=_seconds)
        return partial(_one_cell, column=field.name, made=None if part is None else str)
    if part is not None:
        return partial(_one_cell, column=field.name, made=_poses_text if part == "ArmPose" else _frames_text)
    return partial(_one_cell, column=field.name, made=" ".join) if field.type == field.TYPE_STRING else None


def _one_cell(row: Row, _name: str, content: Any, *, column: str, made: Callable[[Any], Any] | None) -> None:
    row[column] = content if made is None else made(content)


def _seconds(t_ns: int) -> float:
    return t_ns / 1e9


def _frames_text(frames: Any) -> str:
    return " ".join(f"{f.id:03X}#{'R' if f.remote else f.data.hex().upper()}" for f in frames)


def _poses_text(poses: Any) -> str:
    return "; ".join(_pose_text(pose) for pose in poses)


def _pose_text(pose: Any) -> str:
    """Return a pose as its time, place, turn and validity."""
    return " ".join(map(str, (pose.t_ns, *pose.position, *pose.quaternion, int(pose.valid))))


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
