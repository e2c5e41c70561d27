"""Read one topic of a recording as records, columns and pictures, each message when it is asked for."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import Any, Final, NamedTuple, overload

import numpy as np
from numpy.typing import NDArray

from tega.devices.base import DeviceInfo
from tega.errors import RecordingError
from tega.recording.export import message_columns
from tega.recording.mcap_index import IndexedReader
from tega.recording.mcap_reader import Message, read_picture
from tega.recording.record_columns import (
    arrays_of,
    channel_columns,
    column_names,
    find_kind,
    record_of,
    row_of,
    units_of,
)
from tega.records import EmgSamples, HandExchange, Record
from tega.runtime.lifecycle import require

NEVER_NS: Final = 2**63 - 1
"""Time after every other, nanoseconds."""
# Many small arrays leave a heap that stays as large as they were.
_MOST_BLOCKS: Final = 1024
_OF_SAMPLES: Final = ("t_s", "log_s", "file", "index")


class RecordedFile(NamedTuple):
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
        self, name: str, schema: str, files: tuple[RecordedFile, ...], from_ns: int, to_ns: int, *, clock: str
    ) -> None:
        self.name, self.schema, self.clock = name, schema, clock
        found = find_kind(name, schema)
        self.kind: type[Record] | None = None if found is None else found[0]
        self._named = {} if found is None else found[1]
        self._files, self._from_ns, self._to_ns = files, from_ns, to_ns

    @cached_property
    def _places(self) -> list[NDArray[Any]]:
        found = []
        for file in self._files:
            zero_ns = file.zero_ns - file.shift_ns
            from_ns, to_ns = (min(max(t + zero_ns, 0), NEVER_NS) for t in (self._from_ns, self._to_ns))
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
        """Read the record of a number, or a list for a slice; a slice of seconds is the recording's."""
        requested = (index.start, index.stop, index.step) if isinstance(index, slice) else (index,)
        if any(isinstance(one, (str, float)) for one in requested):
            raise RecordingError(
                f"{self.name}: messages are numbered, not found by {index}",
                "a column: topic.to_numpy()[name]; seconds: recording[10.0:20.0][topic]",
            )
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

    def _messages(self) -> Iterator[tuple[int, RecordedFile, Message]]:
        for number, (file, places) in enumerate(zip(self._files, self._places, strict=True)):
            for place in places:
                yield number, file, file.reader.message(self.name, place)

    def _item(self, number: int, file: RecordedFile, message: Message) -> Any:  # noqa: ARG002  # for rows
        if self.kind is None:
            return message.value
        return self._read(file, message)

    def _read(self, file: RecordedFile, message: Message) -> Record:
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
        units = dict.fromkeys(("t_s", "log_s"), "s")
        if self.kind is EmgSamples:
            return units | {n: f.emg.unit for f in self._files if f.emg is not None for n in f.channels}
        return units if self.kind is None else units | units_of(self.kind)

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

    def _row(self, number: int, file: RecordedFile, message: Message) -> dict[str, Any]:
        if self.kind is None:
            row = {name: cells[0] for name, cells in message_columns([message.value]).items()}
        else:
            # An exchange with a hand is stamped with the machine's monotonic clock, not the session's.
            shift_ns = file.shift_ns - (file.start_ns if self.kind is HandExchange else 0)
            row = row_of(self._read(file, message), shift_ns=shift_ns, channels=file.channels)
        first = {"t_s": row.pop("t_s")} if "t_s" in row else {}
        first |= {"log_s": (message.log_ns - file.zero_ns + file.shift_ns) / 1e9}
        return first | ({"file": number} if len(self._files) > 1 else {}) | row

    def _sample_columns(self) -> dict[str, NDArray[Any]]:
        """Return one row per sample; earlier samples of a chunk are dated back by the source's period."""
        parts: list[NDArray[np.float64]] = []
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
            if len(blocks) >= _MOST_BLOCKS:
                parts.append(np.concatenate(blocks))
                blocks.clear()
        parts += blocks
        table = np.concatenate(parts) if parts else np.empty((0, 4))
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

    def _item(self, number: int, file: RecordedFile, message: Message) -> NDArray[np.uint8]:  # noqa: ARG002
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
        table = np.empty((0, 0, 0, 3), np.uint8)
        shapes: set[tuple[int, ...]] = set()
        for number, picture in enumerate(self):
            if not shapes:
                table = np.empty((len(self), *picture.shape), np.uint8)
            shapes.add(picture.shape)
            if len(shapes) == 1:
                table[number] = picture
        if len(shapes) != 1:
            sizes = ", ".join(sorted(map(str, shapes))) or "none"
            raise RecordingError(f"{self.name}: no pictures of one size: {sizes}", "use an index")
        return table
