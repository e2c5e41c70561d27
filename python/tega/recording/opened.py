"""Read a recording as NumPy arrays, data frames and pictures: ``tega.open_recording``.

Example:
    >>> import tega
    >>> recording = tega.open_recording("examples/recorded-lift")
    >>> touch = recording["/tactile/thumb/contact"].to_numpy()
    >>> touch["t_s"].shape, round(float(touch["force_n"].max()), 1) > 0
    ((276,), True)
    >>> recording["/tactile/thumb/image"][100].shape
    (320, 240, 3)
    >>> recording[1.0:2.0]["/emg/samples"].to_numpy().dtype.names[:2]
    ('t_s', 'log_s')
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from datetime import UTC, datetime
from functools import cached_property
from html import escape
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple, overload

import numpy as np

import tega.haptics  # noqa: F401  # draws vest frames
from tega.devices.base import DeviceInfo
from tega.errors import RecordingError
from tega.recording.column_names import channel_columns, emg_source
from tega.recording.export import message_columns
from tega.recording.mcap_folder import session_files
from tega.recording.mcap_index import IndexedReader, open_indexed
from tega.recording.mcap_reader import read_picture, table_ns
from tega.recording.record_columns import (
    arrays_of,
    column_names,
    find_kind,
    machine_clock,
    record_of,
    row_of,
    units_of,
)
from tega.records import EmgSamples, Record
from tega.runtime.lifecycle import require

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tega.recording.mcap_reader import Message

__all__ = ["PictureTopic", "RecordedTopics", "Topic", "open_recording"]

_PICTURES: Final = ("foxglove.RawImage", "foxglove.CompressedImage")
_NEVER_NS: Final = 2**63 - 1
_OF_SAMPLES: Final = ("t_s", "log_s", "file", "index")


class _File(NamedTuple):
    """File of a recording, with its zero on the wall clock, the machine's and the first file's, and its EMG source."""

    reader: IndexedReader
    zero_ns: int
    start_ns: int
    shift_ns: int
    emg: DeviceInfo | None

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the EMG channels; empty if they are not known."""
        return () if self.emg is None else tuple(self.emg.channels)


def open_recording(*paths: str | PathLike[str]) -> RecordedTopics:
    """Open recordings, without loading them.

    Args:
        paths: A recording, the folder of a session, or several of them, which are read as one.

    Returns:
        The topics by name.

    Raises:
        RecordingError: There is no recording, or one of them cannot be read or was not recorded by TEGA.
        MissingExtraError: A package of the extra ``record`` is not installed.
    """
    found = list(dict.fromkeys(file for path in paths for file in session_files(Path(path))))
    if not found:
        raise RecordingError("no recording is named", "give a file, or the folder of a session")
    readers = [open_indexed(path) for path in found]
    zeros = [table_ns(reader.metadata.get("tega", {}), "epoch_ns") for reader in readers]
    known = [zero for zero in zeros if zero is not None]
    files = []
    for reader, zero in zip(readers, zeros, strict=True):
        if zero is None and reader.until_ns:
            raise RecordingError(
                f"{reader.path.name}: gives no time of its start", "inspect shows its tables"
            )
        zero_ns = zero or 0
        start_ns = table_ns(reader.metadata.get("tega", {}), "start_ns") or 0
        files.append(
            _File(
                reader,
                zero_ns,
                start_ns,
                zero_ns - min(known, default=0) if zero is not None else 0,
                emg_source(reader),
            )
        )
    files.sort(key=lambda file: file.zero_ns)
    return RecordedTopics(tuple(files), -_NEVER_NS, _NEVER_NS)


class RecordedTopics(Mapping[str, "Topic"]):
    """Topics of a recording, or of several that are read as one.

    Times are seconds since the start of the first file. A slice of seconds, such as ``recording[10.0:20.0]``, has the
    same topics with the messages of that time by their log time, when the loop received the record.

    Attributes:
        clock: Clock of the times, in words.
        complete: Whether every file was finished.
        files: The files, in the order of their starts.
    """

    def __init__(self, files: tuple[_File, ...], from_ns: int, to_ns: int) -> None:
        self._files, self._from_ns, self._to_ns = files, from_ns, to_ns
        self.files = tuple(file.reader.path for file in files)
        self.complete = all("end" in file.reader.metadata and not file.reader.cut for file in files)
        self._names = sorted({name for file in files for name in file.reader.topics})
        self.clock = (
            f"seconds since the session's start, {self.start.isoformat()}, on the monotonic clock of the recording "
            "machine" + ("; files are placed by their start on its wall clock" if len(files) > 1 else "")
        )

    @property
    def start(self) -> datetime:
        """Start of the session on the wall clock of the recording machine."""
        zero_ns = self._files[0].zero_ns
        with suppress(OverflowError, OSError, ValueError):
            return datetime.fromtimestamp(zero_ns / 1e9, UTC)
        raise RecordingError(f"{self.files[0].name}: start at {zero_ns} ns since 1970 is no time")

    @property
    def duration_s(self) -> float:
        """Time of the last message, seconds since the start."""
        ends = [
            file.reader.until_ns - file.zero_ns + file.shift_ns
            for file in self._files
            if file.reader.until_ns
        ]
        return min(max(ends, default=0), self._to_ns) / 1e9

    def between(self, from_s: float, to_s: float) -> RecordedTopics:
        """Return the part from ``from_s`` to before ``to_s``, seconds; its times count from the same start.

        Raises:
            RecordingError: The times are not numbers, or the end is before the beginning.
        """
        if not from_s <= to_s:
            raise RecordingError(f"from {from_s} s to {to_s} s is no span", "give two times in rising order")
        from_ns, to_ns = (round(min(max(t, -9e9), 9e9) * 1e9) for t in (from_s, to_s))
        return RecordedTopics(self._files, max(self._from_ns, from_ns), min(self._to_ns, to_ns))

    @overload
    def __getitem__(self, key: str, /) -> Topic: ...
    @overload
    def __getitem__(self, key: slice, /) -> RecordedTopics: ...
    def __getitem__(self, key: str | slice, /) -> Topic | RecordedTopics:
        """Return a topic by its name, or the part between two times in seconds."""
        if isinstance(key, slice):
            if key.step is not None:
                raise RecordingError(
                    f"a step of {key.step} has no meaning", "give two times: recording[10.0:20.0]"
                )
            begin = -9e9 if key.start is None else key.start
            return self.between(begin, 9e9 if key.stop is None else key.stop)
        if key not in self._names:
            raise KeyError(f"{key}: no such topic; there are {', '.join(self._names)}")
        files = tuple(file for file in self._files if key in file.reader.topics)
        schema = files[0].reader.topics[key]
        kind = PictureTopic if schema in _PICTURES else Topic
        return kind(key, schema, self._files, self._from_ns, self._to_ns, clock=self.clock)

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names of the topics."""
        return iter(self._names)

    def __len__(self) -> int:
        """Return the number of topics."""
        return len(self._names)

    def __repr__(self) -> str:
        """Return files, length and topics."""
        names = ", ".join(path.name for path in self.files)
        state = "" if self.complete else ", unfinished"
        return f"<recording {names}: {self.duration_s:.1f} s, {len(self)} topics{state}>"

    def _repr_html_(self) -> str:
        rows = "".join(
            f"<tr><td>{escape(name)}</td><td>{escape(topic.schema)}</td><td>{len(topic)}</td></tr>"
            for name, topic in self.items()
        )
        return f"<p>{escape(repr(self)[1:-1])}; {escape(self.clock)}</p><table>{rows}</table>"


class Topic(Sequence[Any]):
    """Records of one topic in their order, each read when it is asked for.

    A topic of an unknown type, such as of a feature that is not installed, gives its protobuf messages.

    Attributes:
        name: Its name, such as ``/tactile/thumb/contact``.
        schema: Name of its messages' schema.
        kind: Type of its records; ``None`` if it is not known.
        clock: Clock of its times, in words.
    """

    def __init__(
        self, name: str, schema: str, files: tuple[_File, ...], from_ns: int, to_ns: int, *, clock: str
    ) -> None:
        self.name, self.schema, self.clock = name, schema, clock
        found = find_kind(name, schema)
        self.kind: type[Record] | None = None if found is None else found[0]
        self._named = {} if found is None else found[1]
        self._files, self._from_ns, self._to_ns = files, from_ns, to_ns

    @cached_property
    def _places(self) -> list[NDArray[Any]]:
        """Places of the messages, file by file."""
        found = []
        for file in self._files:
            zero_ns = file.zero_ns - file.shift_ns
            limits = (min(max(t_ns + zero_ns, 0), _NEVER_NS) for t_ns in (self._from_ns, self._to_ns))
            from_ns, to_ns = limits
            found.append(file.reader.places(self.name, from_ns=from_ns, to_ns=to_ns))
        return found

    @property
    def log_s(self) -> NDArray[np.float64]:
        """Time of each message at which the loop knew it, float64 (n,), seconds; no message is read for it."""
        return np.concatenate(
            [
                (places["log_ns"] - file.zero_ns + file.shift_ns) / 1e9
                for file, places in zip(self._files, self._places, strict=True)
            ]
        )

    def __len__(self) -> int:
        """Return the number of messages."""
        return sum(map(len, self._places))

    def __iter__(self) -> Iterator[Any]:
        """Read the records one after the other."""
        for number, file, message in self._messages():
            yield self._item(number, file, message)

    @overload
    def __getitem__(self, index: int) -> Any: ...
    @overload
    def __getitem__(self, index: slice) -> list[Any]: ...
    def __getitem__(self, index: int | slice) -> Any:
        """Read the record of a number; of a slice, a list of them."""
        n = len(self)
        if isinstance(index, slice):
            return [self[k] for k in range(*index.indices(n))]
        if not -n <= index < n:
            raise IndexError(f"{self.name}: message {index} of {n}")
        number = index % n
        for file_number, (file, places) in enumerate(zip(self._files, self._places, strict=True)):
            if number < len(places):
                return self._item(file_number, file, file.reader.message(self.name, places[number]))
            number -= len(places)
        raise IndexError(index)

    def _messages(self) -> Iterator[tuple[int, _File, Message]]:
        for number, (file, places) in enumerate(zip(self._files, self._places, strict=True)):
            for place in places:
                yield number, file, file.reader.message(self.name, place)

    def _item(self, number: int, file: _File, message: Message) -> Any:  # noqa: ARG002  # for rows
        if self.kind is None:
            return message.value
        return self._read(file, message)

    def _read(self, file: _File, message: Message) -> Record:
        assert self.kind is not None
        try:
            return record_of(self.kind, message, self._named, file.zero_ns)
        except Exception as error:  # a valid file can hold anything
            raise RecordingError(
                f"{file.reader.path.name}: {self.name}: damaged: {type(error).__name__}: {str(error)[:200]}",
                "trim copies the part before the damage",
            ) from error

    @property
    def units(self) -> dict[str, str]:
        """Units of the columns that have one, by column; a list's under the name of its field."""
        if self.kind is EmgSamples:
            return {name: f.emg.unit for f in self._files if f.emg is not None for name in f.channels}
        return {} if self.kind is None else units_of(self.kind)

    def columns(self) -> dict[str, NDArray[Any]]:
        """Return the columns, named as in tables and exports; :attr:`units` has their units.

        ``log_s`` is the time at which the loop knew the fact. EMG has a row a sample, spaced by the source's rate. Of
        several files, ``file`` is the number of each row's file. A missing number is NaN.
        """
        if self.kind is EmgSamples:
            return self._sample_columns()
        if not len(self) and self.kind is not None:
            return {name: np.empty(0) for name in dict.fromkeys(("t_s", "log_s", *column_names(self.kind)))}
        return arrays_of(self._row(*read) for read in self._messages())

    def _row(self, number: int, file: _File, message: Message) -> dict[str, Any]:
        if self.kind is None:
            row = message_columns(message.value)
        else:
            shift_ns = file.shift_ns - (file.start_ns if machine_clock(self.kind) else 0)
            row = row_of(self._read(file, message), shift_ns=shift_ns, channels=file.channels)
        first = {"t_s": row.pop("t_s")} if "t_s" in row else {}
        first |= {"log_s": (message.log_ns - file.zero_ns + file.shift_ns) / 1e9}
        return first | ({"file": number} if len(self._files) > 1 else {}) | row

    def _sample_columns(self) -> dict[str, NDArray[Any]]:
        """Return one row per sample; earlier samples of a chunk are dated back by the source's period."""
        blocks: list[NDArray[np.float64]] = []
        names: list[str] = []
        for number, file, message in self._messages():
            chunk = self._read(file, message)
            assert isinstance(chunk, EmgSamples)
            given = channel_columns(file.channels, chunk.n_channels, _OF_SAMPLES)
            if (names or given) != given or chunk.n_channels < 1 or chunk.samples.size % chunk.n_channels:
                raise RecordingError(
                    f"{file.reader.path.name}: {self.name}: channels {', '.join(given)} after {', '.join(names)}",
                    "open files with the same channels together, others one by one",
                )
            names = given
            samples = chunk.samples.reshape(-1, chunk.n_channels)
            period_s = 1 / file.emg.rate_hz if file.emg is not None and file.emg.rate_hz else 0.0
            before = np.arange(len(samples) - 1, -1, -1)
            block = np.empty((len(samples), 4 + chunk.n_channels))
            block[:, 0] = (chunk.t_ns + file.shift_ns) / 1e9 - before * period_s
            block[:, 1] = (message.log_ns - file.zero_ns + file.shift_ns) / 1e9
            block[:, 2], block[:, 3], block[:, 4:] = number, chunk.first_index + before[::-1], samples
            blocks.append(block)
        table = np.concatenate(blocks) if blocks else np.empty((0, 4))
        columns = {"t_s": table[:, 0], "log_s": table[:, 1]}
        columns |= {"file": table[:, 2].astype(np.int64)} if len(self._files) > 1 else {}
        columns |= {"index": table[:, 3].astype(np.int64)}
        return columns | {name: table[:, 4 + k] for k, name in enumerate(names)}

    def to_numpy(self) -> NDArray[Any]:
        """Return the columns as one structured array (n,); a field a column, see :meth:`columns`."""
        columns = self.columns()
        n = len(next(iter(columns.values()), ()))
        table = np.empty(n, np.dtype([(name, column.dtype) for name, column in columns.items()]))
        for name, column in columns.items():
            table[name] = column
        return table

    def to_pandas(self) -> Any:
        """Return the columns as a ``pandas.DataFrame``; its ``attrs`` hold topic, clock and units.

        Raises:
            MissingExtraError: pandas is not installed.
        """
        pandas = require("pandas", driver="recording", extra="pandas")
        frame = pandas.DataFrame(self.columns())
        frame.attrs = {"topic": self.name, "clock": self.clock, "units": self.units}
        return frame

    def to_arrow(self) -> Any:
        """Return the columns as a ``pyarrow.Table``; its schema's metadata hold topic and clock.

        Raises:
            MissingExtraError: pyarrow is not installed.
        """
        arrow = require("pyarrow", driver="recording", extra="parquet")
        columns = {name: arrow.array(column.tolist()) for name, column in self.columns().items()}
        return arrow.table(columns).replace_schema_metadata({"topic": self.name, "clock": self.clock})

    def __repr__(self) -> str:
        """Return name, schema and number of messages."""
        return f"<{self.name}: {len(self)} × {self.schema}>"


class PictureTopic(Topic):
    """Pictures of a fingertip, uint8 (H, W, 3), blue, green, red, each decoded when it is asked for.

    Their numbers and times are the topic ``/tactile/FINGER/frame``.
    """

    def _item(self, number: int, file: _File, message: Message) -> NDArray[np.uint8]:  # noqa: ARG002
        return read_picture(message)

    def columns(self) -> dict[str, NDArray[Any]]:
        """Refuse: pictures are no columns.

        Raises:
            RecordingError: Always.
        """
        frames = f"{self.name.rpartition('/')[0]}/frame"
        raise RecordingError(
            f"{self.name}: pictures are no columns", f"use to_numpy, an index, or the topic {frames}"
        )

    def to_numpy(self) -> NDArray[np.uint8]:
        """Return all pictures as one array, uint8 (n, H, W, 3).

        Raises:
            RecordingError: There are none, or they differ in size.
        """
        pictures = list(self)
        if len({picture.shape for picture in pictures}) != 1:
            sizes = ", ".join(sorted({str(picture.shape) for picture in pictures})) or "none"
            raise RecordingError(f"{self.name}: no pictures of one size: {sizes}", "use an index")
        return np.stack(pictures)
