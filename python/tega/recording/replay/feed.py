"""Give the content of a recording in the order of its times, only as far ahead as a replay needs it."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar, cast

from tega.devices.base import EmgChunk, TactileFrame
from tega.errors import RecordingError
from tega.recording.decode_ahead import PICTURES, decode_ahead
from tega.recording.mcap_index import open_indexed
from tega.recording.mcap_reader import Message, Progress
from tega.recording.replay.head import Head, lead_in, read_head
from tega.recording.replay.kinds import (
    EMG_SAMPLES,
    FRAME,
    STATUS,
    chunk_of,
    dropped_of,
    kind_of,
    record_of,
)
from tega.records import Contact, End, HandCommand, Intent, Record, VestFrame
from tega.records.bus import Bus

if TYPE_CHECKING:
    from tega.loop.inbox.stream import StampedRecord
    from tega.recording.decode_ahead import Decoding

# So much earlier than its time a record is taken from the file, since it may be needed by what was stamped before it.
_AHEAD_NS = 2_000_000_000

Kind = TypeVar("Kind", bound="StampedRecord")


class Newest(Generic[Kind]):
    """Records of one type in the order of their times; those that a newer one has replaced are forgotten.

    Attributes:
        rows: Those that are still kept.
    """

    def __init__(self) -> None:
        self.rows: deque[Kind] = deque()

    def until(self, t_ns: int) -> Kind | None:
        """Return the last record up to a time, which may not be before that of the last call."""
        rows = self.rows
        while len(rows) > 1 and rows[1].t_ns <= t_ns:
            rows.popleft()
        return rows[0] if rows and rows[0].t_ns <= t_ns else None

    def at(self, t_ns: int) -> Kind | None:
        """Return the record of exactly this time, or ``None``."""
        newest = self.until(t_ns)
        return newest if newest is not None and newest.t_ns == t_ns else None


def newest(feed: RecordFeed, kind: type[Kind]) -> Newest[Kind]:
    """Return the records of a type as the recording is read."""
    found, record_kind = Newest[Kind](), cast("type[Record]", kind)
    feed.bus.subscribe(record_kind, cast("Any", found.rows.append), vital=True)
    return found


class RecordFeed:
    """Reads a recording once, in the order of its times.

    Args:
        path: The file.
        frame: Given every picture and its ``tega.Frame`` message, which has the checksum of the pixels as taken.
        chunk: Given the EMG samples as they came.
        other: Given every message whose type no replay reads; without it those are not decoded.
        pictures_wanted: Asked whether ``frame`` is to be given pictures; else they are not decoded.
        progress: Called as the file is read.

    Attributes:
        reader: Has the file open for further passes.
        head: Facts that are known before the first message.
        bus: Every record is published here as it was recorded.
        dropped: Number of records lost, by topic.
        n_frames: Number of pictures so far, by finger.
        last_tick_ns: Newest tick of any record so far.
        ended: Whether everything has been read.

    Raises:
        RecordingError: The file is no recording of a session, or is cut off before its head.
        MissingExtraError: A package of the extra ``record`` is not installed.
    """

    def __init__(
        self,
        path: Path,
        *,
        frame: Callable[[str, TactileFrame, Any], None],
        chunk: Callable[[EmgChunk], None],
        other: Callable[[Message], None] | None = None,
        pictures_wanted: Callable[[Head], bool] = lambda _head: True,
        progress: Progress | None = None,
    ) -> None:
        self.reader = open_indexed(path)
        self.reader.progress = progress or self.reader.progress
        self._frame, self._chunk, self._other = frame, chunk, other
        self.head = read_head(self.reader)
        self.bus = Bus()
        self.dropped: dict[str, int] = {}
        self.n_frames = dict.fromkeys(self.head.baselines, 0)
        self.last_tick_ns, self.ended = 0, False
        self._epoch_ns = int(self.head.facts["epoch_ns"])
        early_reader = lead_in(self.reader, self.head.from_ns)
        early = [] if early_reader is None else sorted(early_reader.messages(), key=lambda one: one.log_ns)
        self._early = {kind_of(message.schema, message.topic) for message in early}
        self._pictures: dict[str, Decoding] = {}
        self._messages = self._in_order(early, pictures=pictures_wanted(self.head))
        self._next = next(self._messages, None)
        if self._next is None:
            raise RecordingError(f"{path.name}: holds nothing but its settings", "the run had not begun")
        self._end = self._read_end()

    def _in_order(self, early: list[Message], *, pictures: bool) -> Iterator[tuple[Message, Decoding | None]]:
        special, others = {EMG_SAMPLES, STATUS, FRAME}, self._other is not None

        def wanted(schema: str, topic: str) -> bool:
            if schema in PICTURES:
                return pictures
            return others or schema in special or kind_of(schema, topic) is not None

        return decode_ahead(chain(early, self.reader.in_order(wanted)))

    def _read_end(self) -> End | None:
        places = self.reader.places(End.topic, from_ns=0, to_ns=self.reader.until_ns + 1)
        message = self.reader.message(End.topic, places[-1]) if len(places) else None
        record = None if message is None else record_of(message)
        return record if isinstance(record, End) else None

    def holds(self, kind: type[Record]) -> bool:
        """Return whether there is any record of a type with a fixed topic, in the lead-in or later."""
        return kind in self._early or self.reader.holds(kind.topic)

    @property
    def end(self) -> End | None:
        """End of the loop; ``None`` where the recording was cut, as far as that is known yet."""
        return None if self.reader.cut else self._end

    @property
    def lost(self) -> dict[str, int]:
        """Number of records lost while recording, by topic, once everything is read."""
        lost = {topic: int(count) for topic, count in self.reader.metadata.get("dropped", {}).items()}
        return self.dropped | lost

    @property
    def complete(self) -> bool:
        """Whether the file was finished, or else recovered or cut."""
        return not self.reader.cut and "end" in self.reader.metadata

    def read_until(self, t_ns: int) -> None:
        """Read on until everything is there that may be needed up to a time since the start of the session."""
        until_ns = self._epoch_ns + t_ns + _AHEAD_NS
        while self._next is not None and self._next[0].log_ns <= until_ns:
            self._take(*self._next)
            self._next = next(self._messages, None)
        self.ended = self._next is None

    def read_rest(self) -> None:
        """Read the rest of the file."""
        while self._next is not None:
            self.read_until(self._next[0].log_ns - self._epoch_ns)

    def _take(self, message: Message, decoding: Decoding | None) -> None:
        if message.value is None:
            return
        if message.schema in PICTURES:
            if decoding is not None:
                self._pictures[message.topic.split("/")[2]] = decoding
        elif message.schema == FRAME:
            finger, value = message.topic.split("/")[2], message.value
            picture = self._pictures.pop(finger, None)
            if picture is not None:
                self._frame(finger, TactileFrame(value.t_ns, value.seq, picture.result(), value.name), value)
                self.n_frames[finger] = self.n_frames.get(finger, 0) + 1
        elif message.schema == EMG_SAMPLES:
            self._chunk(chunk_of(message))
        elif message.schema == STATUS:
            self.dropped = dropped_of(message)
        elif (record := record_of(message)) is None:
            if self._other is not None:
                self._other(message)
        else:
            if isinstance(record, Contact | Intent):
                self.last_tick_ns = max(self.last_tick_ns, record.taken_ns)
            elif isinstance(record, VestFrame | HandCommand):
                self.last_tick_ns = max(self.last_tick_ns, record.t_ns)
            self.bus.publish(record)
