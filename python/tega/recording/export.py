"""Export a recording as tables and pictures, for programs that do not read MCAP."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache, partial
from pathlib import Path
from typing import Any, Literal

from tega.errors import ConfigError, TegaError
from tega.haptics.motor_layout import find_layout
from tega.recording.copies import note_copy
from tega.recording.growing_table import GrowingCsv, GrowingParquet, GrowingTable, Row
from tega.recording.mcap_reader import McapReader, Message, Progress
from tega.recording.origin import LEAD_IN
from tega.runtime.files.foreign_file import tells_damage
from tega.runtime.files.plain_name import plain_name
from tega.runtime.lifecycle import require


@tells_damage
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
    nanosecond: ``t_s`` when something was captured, ``log_s`` when it was received. Channels are ``ch1`` and so on,
    motors ``m`` and their number, other lists count from 1. CAN frames become text such as ``180#0A0B``, an arm's
    forearm poses such as ``t_ns x y z qx qy qz qw valid``. EMG has a row per sample.

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
    for message in reader.messages(lambda topic: pictures or not topic.endswith("/image")):
        epoch_ns = epoch_ns or int(reader.metadata.get("tega", {}).get("epoch_ns", "0"))
        if message.topic.endswith("/image"):
            waiting[message.topic] = message
            continue
        if message.schema == "tega.Frame" and pictures:
            image = waiting.pop(f"{message.topic.removesuffix('/frame')}/image", None)
            if image is not None:
                finger = plain_name(
                    message.topic.split("/")[2], what=f"{message.topic}: finger", source=path.name
                )
                _picture(image, folder / finger, message.value.seq)
        name = message.topic.strip("/").replace("/", ".")
        if name not in tables:
            plain_name(name, what="topic", source=path.name)
            tables[name] = growing(folder / f"{name}.{kind}")
        for row in _rows(message, (message.log_ns - epoch_ns) / 1e9):
            tables[name].add(row)
    attached = [
        plain_name(name, what="attachment", source=path.name) for name in reader.files if name != LEAD_IN
    ]
    for name in attached:
        (folder / name).write_bytes(reader.files[name])
    return [table.close() for _, table in sorted(tables.items()) if table.n_rows]


def _rows(message: Message, log_s: float) -> Iterator[Row]:
    value = message.value
    if message.schema == "tega.EmgSamples":
        n = value.n_channels
        for k in range(len(value.samples) // n):
            samples = value.samples[k * n : (k + 1) * n]
            row: Row = {"log_s": log_s, "chunk_t_s": value.t_ns / 1e9, "index": value.first_index + k}
            yield row | {f"ch{c + 1}": sample for c, sample in enumerate(samples)}
        return
    if message.schema == "foxglove.JointStates":
        yield {"log_s": log_s} | {joint.name: joint.position for joint in value.joints}
        return
    if message.schema == "foxglove.PoseInFrame":
        place, turn = value.pose.position, value.pose.orientation
        row = {"log_s": log_s, "frame_id": value.frame_id, "x": place.x, "y": place.y, "z": place.z}
        yield row | {f"q{axis}": getattr(turn, axis) for axis in "xyzw"}
        return
    yield {"log_s": log_s} | message_columns(value)


def message_columns(value: Any) -> Row:
    """Return the cells of a message by their columns."""
    row: Row = {}
    for name, optional, cells in _fields(value.DESCRIPTOR):
        if not optional or value.HasField(name):
            cells(row, name, getattr(value, name))
    return row


@cache
def _fields(descriptor: Any) -> list[tuple[str, bool, Callable[[Row, str, Any], None]]]:
    """Return name, whether it may be missing, and how its cells are made, of each field of a message."""
    # A named value that is named as a column of the record is not that column.
    own = {"log_s", *descriptor.fields_by_name}
    own |= {f"{name.removesuffix('_ns')}_s" for name in own if name.endswith("_ns")}
    return [
        (
            field.name,
            field.containing_oneof is not None,
            partial(_named_cells, own=own) if named else _cells(field),
        )
        for field in descriptor.fields
        for named in (field.message_type is not None and field.message_type.name == "NamedValue",)
    ]


def _named_cells(row: Row, _name: str, content: Any, *, own: set[str]) -> None:
    for one in content:
        row[f"more.{one.name}" if one.name in own else one.name] = one.value


def _cells(field: Any) -> Callable[[Row, str, Any], None]:
    """Return the function that writes the content of a field into a row."""
    text: Callable[[Any], Any] | None = None
    if field.name.endswith("_ns") and not field.is_repeated:
        return partial(_time_cell, column=f"{field.name.removesuffix('_ns')}_s")
    if not field.is_repeated:
        text = None if field.message_type is None else str
    elif field.message_type is not None and field.message_type.name == "ArmPose":
        text = _poses_text
    elif field.message_type is not None:
        text = _frames_text
    elif field.type == field.TYPE_STRING:
        text = " ".join
    elif field.name == "intensities":
        return _motor_cells
    else:
        return partial(_numbered_cells, stem="ch" if field.name == "channels" else f"{field.name}_")
    return partial(_one_cell, text=text)


def _one_cell(row: Row, name: str, content: Any, *, text: Callable[[Any], Any] | None) -> None:
    row[name] = content if text is None else text(content)


def _time_cell(row: Row, _name: str, content: int, *, column: str) -> None:
    row[column] = content / 1e9


def _numbered_cells(row: Row, _name: str, content: Any, *, stem: str) -> None:
    row.update(zip(_numbered(stem, len(content)), content, strict=True))


@cache
def _numbered(stem: str, n: int) -> tuple[str, ...]:
    return tuple(f"{stem}{k}" for k in range(1, n + 1))


def _motor_cells(row: Row, _name: str, content: Any) -> None:
    row.update(zip(_motors(row["layout"], len(content)), content, strict=True))


@cache
def _motors(layout: str, n: int) -> tuple[str, ...]:
    """Return the columns of a layout's motors, by their numbers at the device; of an unknown layout by their order."""
    try:
        numbers = find_layout(layout).numbers.tolist()
    except TegaError:
        numbers = list(range(n))
    return tuple(f"m{number}" for number in (numbers if len(numbers) == n else range(n)))


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
