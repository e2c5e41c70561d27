"""Read pictures and arrays of numbers from a ROS 2 bag in MCAP files."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from tega.errors import RecordingError
from tega.runtime.files.foreign_file import MIB, check_file
from tega.runtime.files.picture_stack import sorted_names
from tega.runtime.lifecycle import require

IMAGE, COMPRESSED = "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"
_MOST_MIB: Final = 256 * 1024
_MOST_RECORD: Final = 256 * MIB
_MOST_PIXELS: Final = 1 << 26
# Of each encoding of 8 bits: bytes of a pixel, and which of them are blue, green and red.
_ENCODINGS: Final = {
    "bgr8": (3, (0, 1, 2)),
    "8UC3": (3, (0, 1, 2)),
    "rgb8": (3, (2, 1, 0)),
    "bgra8": (4, (0, 1, 2)),
    "8UC4": (4, (0, 1, 2)),
    "rgba8": (4, (2, 1, 0)),
    "mono8": (1, (0, 0, 0)),
    "8UC1": (1, (0, 0, 0)),
}
_ARRAY_TYPES: Final = ("float32[", "float64[", "int16[", "int32[", "uint16[", "uint32[", "int8[", "uint8[")


class Ros2Bag:
    """One topic of a finished bag: an MCAP file, or a folder with several.

    ``topic`` is ``""`` for the only one that fits: pictures if these are wanted, else arrays of numbers.
    ``kind`` is the type of its messages, ``begin_ns`` the log time of the first message of the bag: its
    topics have one time.
    """

    def __init__(self, path: Path, *, topic: str, pictures: bool) -> None:
        self._reader: Any = require("mcap.reader", driver="ros2", extra="ros2").SeekingReader
        self._factory: Any = require("mcap_ros2.decoder", driver="ros2", extra="ros2").DecoderFactory
        self._path = path
        self._files = _files(path)
        topics: dict[str, tuple[str, int, str]] = {}
        begins: list[int] = []
        for file in self._files:
            for name, kind, n, definition in self._summary(file, begins):
                topics[name] = kind, n + topics.get(name, ("", 0, ""))[1], definition
        fits = [name for name, (kind, _, _) in topics.items() if (kind in {IMAGE, COMPRESSED}) == pictures]
        if not pictures:
            fits = [name for name in fits if any(one in topics[name][2] for one in _ARRAY_TYPES)]
        self.topic = topic or (fits[0] if len(fits) == 1 else "")
        if self.topic not in fits:
            listed = ", ".join(f"{name} {kind} ({n})" for name, (kind, n, _) in sorted(topics.items()))
            subject = "pictures" if pictures else "arrays of numbers"
            which = f"topic {topic!r} is none with" if topic else f"{len(fits)} topics have"
            raise RecordingError(
                f"{path.name}: {which} {subject}; its topics: {listed or 'none'}"[:2000],
                "name one with --topic"
                if fits
                else "name another bag; what `run --record` recorded is re-run with: tega-teleop verify SESSION",
            )
        self.kind, self.n_messages, _ = topics[self.topic]
        self.begin_ns = min(begins, default=0)

    def messages(self) -> Iterator[tuple[int, Any]]:
        """Return the messages with their rising times, nanoseconds from the beginning of the bag.

        The first has its log time; the others are as far from it as by their header's stamps, else by their
        log times.
        """
        first: tuple[int, int] | None = None
        last_ns = -1
        for file in self._files:
            for log_ns, value in self._decoded(file):
                stamp_ns = _stamp_ns(value)
                first = first or (log_ns, stamp_ns)
                stamped = stamp_ns and first[1]
                t_ns = first[0] - self.begin_ns + (stamp_ns - first[1] if stamped else log_ns - first[0])
                if t_ns <= last_ns:
                    raise RecordingError(
                        f"{self._path.name}: {self.topic} goes back at {last_ns / 1e9:.3f} s, to {t_ns / 1e9:.3f} s",
                        "record or cut the bag again",
                    )
                last_ns = t_ns
                yield t_ns, value

    def _decoded(self, path: Path) -> Iterator[tuple[int, Any]]:
        try:
            with path.open("rb") as file:
                reader = self._reader(
                    file, record_size_limit=_MOST_RECORD, decoder_factories=[self._factory()]
                )
                messages = reader.iter_decoded_messages(topics=[self.topic])
                with redirect_stdout(io.StringIO()):  # the parser of definitions prints what it cannot read
                    found = next(messages, None)
                while found is not None:
                    yield found.message.log_time, found.decoded_message
                    found = next(messages, None)
        except RecordingError:
            raise
        except Exception as error:  # of a damaged bag the readers raise what they like
            raise RecordingError(
                f"{path.name}: {self.topic} cannot be decoded: {type(error).__name__}: {str(error)[:200]}",
                "copy the bag again from its source",
            ) from error

    def _summary(self, path: Path, begins: list[int]) -> list[tuple[str, str, int, str]]:
        """Return name, type, number of messages and definition of each topic of a file."""
        try:
            check_file(path, most_mib=_MOST_MIB)
            with path.open("rb") as file:
                summary = self._reader(file, record_size_limit=_MOST_RECORD).get_summary()
            counts = summary.statistics.channel_message_counts
            begins += [summary.statistics.message_start_time] * (summary.statistics.message_count > 0)
            found = []
            for number, channel in summary.channels.items():
                schema = summary.schemas.get(channel.schema_id)
                if schema is not None and schema.encoding == "ros2msg" and channel.message_encoding == "cdr":
                    definition = schema.data.decode(errors="replace").split("====")[0]
                    found.append((channel.topic, schema.name, counts.get(number, 0), definition))
        except RecordingError:
            raise
        except Exception as error:  # as above
            why = error.strerror if isinstance(error, OSError) else "it is no MCAP file, or was not finished"
            raise RecordingError(
                f"{path.name}: is no ROS 2 bag that can be read: {why}", "finish it with: mcap recover"
            ) from error
        return found


def picture_of(value: Any, kind: str, name: str) -> NDArray[np.uint8] | bytes:
    """Return a message's picture: uint8 (H, W, 3) in blue, green, red, or the bytes of a compressed one.

    Refused are encodings of other than 8 bits and another length than the header states.
    """
    if kind == COMPRESSED:
        return bytes(value.data)
    if value.encoding not in _ENCODINGS:
        raise RecordingError(
            f"{name}: pictures encoded as {str(value.encoding)[:40]!r} are not read",
            "publish them as bgr8 or rgb8",
        )
    depth, order = _ENCODINGS[value.encoding]
    height, width, step = int(value.height), int(value.width), int(value.step)
    data = np.frombuffer(bytes(value.data), np.uint8)
    if not 0 < height * width <= _MOST_PIXELS or step < width * depth or len(data) < step * height:
        raise RecordingError(
            f"{name}: {len(data)} bytes are no picture of {width}×{height}, {step} bytes a row",
            "record it again",
        )
    rows = data[: step * height].reshape(height, step)[:, : width * depth]
    return np.ascontiguousarray(rows.reshape(height, width, depth)[..., list(order)])


def rows_of(value: Any, name: str) -> NDArray[np.float64]:
    """Return the samples of a message, float64 (samples, channels), as many as its layout states.

    An array without a layout is one sample of all channels; one with two dimensions is samples by channels,
    or the other way round by their labels.
    """
    data = getattr(value, "data", None)
    if data is None:
        sequences = [getattr(value, field) for field in getattr(value, "__slots__", ())]
        found = [one for one in sequences if isinstance(one, list | tuple) and len(one)]
        data = found[0] if len(found) == 1 else None
    try:
        samples = np.asarray(data, np.float64).reshape(-1)
    except (TypeError, ValueError):
        samples = np.empty(0)
    if not samples.size:
        raise RecordingError(f"{name}: holds no array of numbers", "name another topic with --topic")
    dims = list(getattr(getattr(value, "layout", None), "dim", None) or [])
    sizes = [int(dim.size) for dim in dims]
    if len(dims) != 2:
        return samples.reshape(1, -1)
    if int(np.prod(sizes, dtype=object)) != samples.size:
        raise RecordingError(
            f"{name}: {samples.size} numbers, its layout says {sizes[0]}×{sizes[1]}", "record it again"
        )
    table = samples.reshape(sizes)
    return table.T if str(dims[0].label).casefold().startswith("chan") else table


def _stamp_ns(value: Any) -> int:
    stamp = getattr(getattr(value, "header", None), "stamp", None)
    return 0 if stamp is None else int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


def _files(path: Path) -> list[Path]:
    if not path.is_dir():
        return [path]
    files = sorted_names(list(path.glob("*.mcap")))
    if not files:
        other = next(path.glob("*.db3"), None)
        raise RecordingError(
            f"{path.name}: {'a bag in SQLite' if other else 'holds no .mcap file'}",
            "convert it: ros2 bag convert, or rosbags-convert --dst-storage mcap"
            if other
            else "name the bag's folder",
        )
    return files
