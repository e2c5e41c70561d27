"""Find the messages of a recording by topic and time, and read only the parts of the file that hold them.

A finished file has an index at its end. An unfinished one has none: it is passed over once, as far as it can be read.
"""

from __future__ import annotations

import math
from array import array
from bisect import bisect_left
from collections import defaultdict
from collections.abc import Callable, Container, Iterator, Mapping
from contextlib import closing
from itertools import accumulate
from operator import itemgetter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega.errors import RecordingError, TegaError
from tega.recording.mcap_reader import (
    MOST_RECORD,
    McapReader,
    Message,
    Plan,
    RawMessage,
    chunk_records,
    open_recording,
    read_ahead,
)
from tega.recording.origin import no_session
from tega.runtime.files.foreign_file import MIB, reports_damage
from tega.runtime.lifecycle import require

PLACE = np.dtype([("log_ns", np.int64), ("part", np.int32), ("number", np.int32)])
"""Place of a message: its log time, nanoseconds since 1970, its part of the file, and its number in there by topic."""


class _Chunk(NamedTuple):
    """Part of a file: where it begins, its log times, and by channel where the list of its messages is."""

    begins: int
    from_ns: int
    until_ns: int
    lists: Mapping[int, int]


_log_ns = itemgetter(1)


@reports_damage
def open_indexed(path: Path) -> IndexedReader:
    """Open a recording for access by topic and time; no message is decoded."""
    return IndexedReader(path)


class IndexedReader(McapReader):
    """Reads messages of a recording by their places; ``topics`` is the schema's name by topic.

    ``from_ns`` and ``until_ns`` are the log times of its first and last message, nanoseconds since 1970; 0
    without a message. ``indexed`` is whether it has an index.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        begun = self.begin()  # refuses a file that is no recording
        if begun is None and not (self.metadata or self._channels):
            raise no_session(path, ())
        self._chunks: list[_Chunk] = []
        self._passed: dict[str, NDArray[Any]] = {}
        self._newest: tuple[int, dict[str, list[Any]]] = (-1, {})
        self.indexed = begun is not None and self._read_summary()
        if not self.indexed:
            self._pass_over()
        self.topics: dict[str, str] = {}
        for channel in self._channels.values():
            self.topics[channel.topic] = self._schema_name(channel)
        self.from_ns = min((chunk.from_ns for chunk in self._chunks), default=0)
        self.until_ns = max((chunk.until_ns for chunk in self._chunks), default=0)

    def __reduce__(self) -> tuple[Callable[[Path], IndexedReader], tuple[Path]]:
        """Open the file again in another process, such as a loader of pictures."""
        return open_indexed, (self.path.absolute(),)

    def holds(self, topic: str) -> bool:
        """Return whether there is any message of a topic; no list of them is read."""
        if self._passed:
            return topic in self._passed
        ids = {number for number, channel in self._channels.items() if channel.topic == topic}
        return any(ids & chunk.lists.keys() for chunk in self._chunks)

    def middle(self) -> int | None:
        """Return where in the file the second half of its parts begins; ``None`` where no index leads there."""
        if self._passed or not self._chunks:
            return None
        chunk = self._chunks[len(self._chunks) // 2]
        try:
            with open_recording(self.path) as file:
                found = self._record_at(file, chunk.begins)
        except Exception:  # whatever damage makes the reader say
            return None
        return chunk.begins if getattr(found, "message_start_time", None) == chunk.from_ns else None

    def places(self, topic: str, *, from_ns: int, to_ns: int) -> NDArray[Any]:
        """Return a topic's places, of :data:`PLACE`, in a span of log time, in the file's order."""
        found = self._passed.get(topic) if self._passed else self._listed(topic, from_ns, to_ns)
        if found is None:
            return np.empty(0, PLACE)
        return found[(found["log_ns"] >= from_ns) & (found["log_ns"] < to_ns)]

    def message(self, topic: str, place: Any) -> Message:
        """Return a topic's message at a place; the part of the file that was read last stays in memory."""
        begins = self._chunks[place["part"]].begins
        try:
            if self._newest[0] != begins:
                self._newest = begins, self._read_chunk(begins)
            record = self._newest[1][topic][place["number"]]
            return self.plan_of(self._channels[record.channel_id], decode=True).message(record)
        except Exception as error:  # whatever damage makes the reader say
            raise self._damaged(error) from error

    def in_order(
        self, wanted: Callable[[str, str], bool] = lambda _schema, _topic: True, *, since_ns: int = 0
    ) -> Iterator[Message]:
        """Return the messages in the order of the log times, those of one time as they were written.

        ``wanted`` is asked by schema and topic, as the first message is read, for which channels. Parts of the
        file that end before ``since_ns`` are skipped; the first messages may still be earlier.
        """
        # A message is next once no later part of the file begins before it.
        chunks = [chunk for chunk in self._chunks if chunk.until_ns >= since_ns]
        earliest_ns = [*accumulate((chunk.from_ns for chunk in reversed(chunks)), min)]
        waiting: list[RawMessage] = []
        plans: dict[int, Plan] = {}
        passed = {
            number
            for number, channel in self._channels.items()
            if not wanted(self._schema_name(channel), channel.topic)
        }
        mib = self.path.stat().st_size // MIB
        records = (self._records_of(chunk.begins, passed) for chunk in chunks)
        with closing(read_ahead(records)) as parts:
            for chunk, next_ns in zip(chunks, [*earliest_ns[-2::-1], math.inf], strict=False):
                self.progress(self.path.name, chunk.begins // MIB, mib)
                safe_ns: float = next_ns
                try:
                    waiting += next(parts)
                except TegaError:
                    raise
                except Exception as error:  # whatever damage makes the reader say: all before it is good
                    self.cut, safe_ns = type(error).__name__, math.inf
                waiting.sort(key=_log_ns)
                n_safe = bisect_left(waiting, safe_ns, key=_log_ns)
                for raw in waiting[:n_safe]:
                    try:
                        plan = plans.get(raw.channel_id)
                        if plan is None:
                            plan = self.plan_of(self._channels[raw.channel_id], decode=True)
                            plans[raw.channel_id] = plan
                        message = plan.message(raw)
                    except Exception as error:  # of a damaged schema or message, or one of an unknown channel
                        self.cut = type(error).__name__
                        return
                    yield message
                if self.cut:
                    return
                del waiting[:n_safe]
        self.progress(self.path.name, mib, mib)

    def _schema_name(self, channel: Any) -> str:
        schema = self._schemas.get(channel.schema_id)
        return "" if schema is None else schema.name

    def _damaged(self, error: Exception) -> RecordingError:
        return RecordingError(
            f"{self.path.name}: damaged: {type(error).__name__}: {str(error)[:200]}",
            "inspect says how far it can be read; trim copies the part before the damage",
        )

    def _read_summary(self) -> bool:
        """Read the index at the file's end; return whether there is one."""
        reading = require("mcap.reader", driver="recording", extra="record")
        with open_recording(self.path) as file:
            try:
                reader = reading.SeekingReader(file, record_size_limit=MOST_RECORD)
                summary = reader.get_summary()
                if summary is None or summary.statistics is None or not summary.chunk_indexes:
                    return False
                for table in reader.iter_metadata():
                    self.metadata.setdefault(table.name, {}).update(table.metadata)
            except Exception:  # cut short, or damaged there: the messages may be good
                return False
        self._channels, self._schemas = summary.channels, summary.schemas
        self._chunks = [
            _Chunk(
                one.chunk_start_offset,
                one.message_start_time,
                one.message_end_time,
                one.message_index_offsets,
            )
            for one in sorted(summary.chunk_indexes, key=lambda one: one.chunk_start_offset)
        ]
        return True

    def _pass_over(self) -> None:
        """Note the place of every message as far as the file can be read."""
        found: dict[str, tuple[array[int], array[int], array[int]]] = {}
        numbers: dict[str, int] = defaultdict(int)
        begins = -1
        for message in self.messages(lambda _topic: False):
            if self.part_begins != begins:
                begins = self.part_begins
                numbers.clear()
                self._chunks.append(_Chunk(begins, message.log_ns, message.log_ns, {}))
            newest = self._chunks[-1]
            self._chunks[-1] = newest._replace(
                from_ns=min(newest.from_ns, message.log_ns), until_ns=max(newest.until_ns, message.log_ns)
            )
            columns = found.setdefault(message.topic, (array("q"), array("q"), array("q")))
            numbered = (message.log_ns, len(self._chunks) - 1, numbers[message.topic])
            for column, value in zip(columns, numbered, strict=True):
                column.append(value)
            numbers[message.topic] += 1
        for topic, columns in found.items():
            places = np.empty(len(columns[0]), PLACE)
            for name, column in zip(PLACE.names or (), columns, strict=True):
                places[name] = column
            self._passed[topic] = places

    def _listed(self, topic: str, from_ns: int, to_ns: int) -> NDArray[Any] | None:
        """Read the places of a topic's messages off the lists that follow each part of the file."""
        ids = {number for number, channel in self._channels.items() if channel.topic == topic}
        found = []
        with open_recording(self.path) as file:
            for number, chunk in enumerate(self._chunks):
                if chunk.until_ns < from_ns or chunk.from_ns >= to_ns:
                    continue
                entries: list[tuple[int, int]] = []
                for channel in ids & chunk.lists.keys():
                    try:
                        entries += self._record_at(file, chunk.lists[channel]).records
                    except Exception as error:  # whatever damage makes the reader say
                        raise self._damaged(error) from error
                if entries:
                    times = np.array(sorted(entries, key=lambda entry: entry[1]), np.uint64)[:, 0]
                    places = np.empty(len(times), PLACE)
                    places["log_ns"], places["part"] = times, number
                    places["number"] = np.arange(len(times))
                    found.append(places)
        return np.concatenate(found) if found else None

    def _read_chunk(self, begins: int) -> dict[str, list[Any]]:
        found: dict[str, list[Any]] = defaultdict(list)
        for one in self._records_of(begins):
            found[self._channels[one.channel_id].topic].append(one)
        return found

    def _records_of(self, begins: int, passed: Container[int] = ()) -> list[RawMessage]:
        """Return the messages of a part of the file, in its order, but for those of the channels ``passed``."""
        with open_recording(self.path) as file:
            chunk = self._record_at(file, begins)
        return [one for one in chunk_records(chunk, passed=passed) if type(one) is RawMessage]

    @staticmethod
    def _record_at(file: Any, begins: int) -> Any:
        reading = require("mcap.stream_reader", driver="recording", extra="record")
        file.seek(begins)
        reader = reading.StreamReader(file, skip_magic=True, emit_chunks=True, record_size_limit=MOST_RECORD)
        return next(iter(reader.records))
