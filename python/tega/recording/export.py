"""Export a recording as tables and pictures, for programs that do not read MCAP."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

from tega.errors import ConfigError
from tega.recording.copies import note_copy
from tega.recording.mcap_reader import McapReader, Message
from tega.recording.origin import LEAD_IN
from tega.runtime.files.csv_writer import CsvWriter, cell_text
from tega.runtime.files.foreign_file import tells_damage
from tega.runtime.files.plain_name import plain_name
from tega.runtime.lifecycle import require

Row = dict[str, Any]


@tells_damage
def export_file(
    path: Path, folder: Path, *, kind: Literal["csv", "parquet"] = "csv", pictures: bool = False
) -> list[Path]:
    """Write one table per topic, and the attached files as they are.

    Columns are the fields of the messages, in their units; a list becomes columns that count from 1, CAN frames become
    text such as ``180#0A0B``, an arm's forearm poses such as ``t_ns x y z qx qy qz qw valid``. ``log_ns`` is the time
    of reception since the start of the session. EMG has a row per sample.

    Args:
        path: The recording.
        folder: Where to; new or empty.
        kind: ``csv``, or ``parquet`` (extra ``parquet``).
        pictures: Also write every picture, as PNG or the JPEG that it is, in a folder per finger named by its number.

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
    tables: dict[str, list[Row]] = {}
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
        tables.setdefault(name, []).extend(_rows(message, message.log_ns - epoch_ns))
    attached = [
        plain_name(name, what="attachment", source=path.name) for name in reader.files if name != LEAD_IN
    ]
    for name in attached:
        (folder / name).write_bytes(reader.files[name])
    write = _write_csv if kind == "csv" else _write_parquet
    return [write(folder / f"{name}.{kind}", rows) for name, rows in sorted(tables.items()) if rows]


def _rows(message: Message, log_ns: int) -> Iterator[Row]:
    value = message.value
    if message.schema == "tega.EmgSamples":
        n = value.n_channels
        for k in range(len(value.samples) // n):
            samples = value.samples[k * n : (k + 1) * n]
            row: Row = {"log_ns": log_ns, "chunk_t_ns": value.t_ns, "index": value.first_index + k}
            yield row | {f"ch{c + 1}": sample for c, sample in enumerate(samples)}
        return
    if message.schema == "foxglove.JointStates":
        yield {"log_ns": log_ns} | {joint.name: joint.position for joint in value.joints}
        return
    if message.schema == "foxglove.PoseInFrame":
        place, turn = value.pose.position, value.pose.orientation
        row = {"log_ns": log_ns, "frame_id": value.frame_id, "x": place.x, "y": place.y, "z": place.z}
        yield row | {f"q{axis}": getattr(turn, axis) for axis in "xyzw"}
        return
    yield {"log_ns": log_ns} | dict(message_columns(value))


def message_columns(value: Any) -> Iterator[tuple[str, Any]]:
    """Return the fields of a message as columns; a list becomes columns that count from 1."""
    for field in value.DESCRIPTOR.fields:
        content = getattr(value, field.name)
        if field.containing_oneof is not None and not value.HasField(field.name):
            continue
        if field.message_type is not None and field.message_type.name == "NamedValue":
            # One that is named as a column of the record is not that column.
            own = {"log_ns", *value.DESCRIPTOR.fields_by_name}
            yield from ((f"more.{one.name}" if one.name in own else one.name, one.value) for one in content)
        elif not hasattr(content, "extend"):
            yield field.name, str(content) if field.message_type is not None else content
        elif field.message_type is not None and field.message_type.name == "ArmPose":
            yield field.name, "; ".join(_pose_text(pose) for pose in content)
        elif field.message_type is not None:
            yield (
                field.name,
                " ".join(f"{f.id:03X}#{'R' if f.remote else f.data.hex().upper()}" for f in content),
            )
        elif field.type == field.TYPE_STRING:
            yield field.name, " ".join(content)
        else:
            yield from ((f"{field.name}_{k}", item) for k, item in enumerate(content, 1))


def _pose_text(pose: Any) -> str:
    """Return a pose as its time, place, turn and validity."""
    return " ".join(map(str, (pose.t_ns, *pose.position, *pose.quaternion, int(pose.valid))))


def _names(rows: Sequence[Row]) -> list[str]:
    names: Row = {}
    for row in rows:
        names |= dict.fromkeys(row)
    return list(names)


def _write_csv(path: Path, rows: Sequence[Row]) -> Path:
    names = _names(rows)
    file = CsvWriter(path, names)
    try:
        file.write(*[",".join(cell_text(row.get(name)) for name in names) + "\n" for row in rows])
    finally:
        file.close()
    return path


def _write_parquet(path: Path, rows: Sequence[Row]) -> Path:
    arrow = require("pyarrow", driver="export", extra="parquet")
    parquet = require("pyarrow.parquet", driver="export", extra="parquet")
    columns: Mapping[str, list[Any]] = {name: [row.get(name) for row in rows] for name in _names(rows)}
    parquet.write_table(arrow.table(dict(columns)), path)
    return path


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
