"""Publish the records of a recording by type, in the order of their times, only as far ahead as a replay needs it."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import cache, cached_property, partial
from itertools import chain
from pathlib import Path
from typing import Any, Generic, TypeVar

import numpy as np

from tega import records
from tega.errors import RecordingError
from tega.loop.inbox.stream import StampedRecord
from tega.recording.mcap_index import open_indexed
from tega.recording.mcap_reader import Message, Progress, read_picture
from tega.recording.pictures import PICTURES, compute_ahead, paired
from tega.recording.record_columns import find_kind, record_of
from tega.recording.replay.head import lead_in, read_head
from tega.records import Contact, HandCommand, Intent, Picture, Record, VestFrame
from tega.records.bus import Bus
from tega.records.schema import read

# So much earlier than its time a record is taken from the file, since it may be needed by what was stamped before it.
_AHEAD_NS = 2_000_000_000
# And so much is read at once.
_STEP_NS = 100_000_000
# Logged at the tick at which the loop took it in or made it.
_TICKED = {Contact, Intent, VestFrame, HandCommand}
# Ticks are replayed one after the other: over a longer gap a damaged time would keep a replay busy for hours.
_LONGEST_NS = 600_000_000_000

Stamped = TypeVar("Stamped", bound="StampedRecord")
Kind = TypeVar("Kind", bound=Record)


@cache
def _kind_of(schema: str, topic: str) -> tuple[type[Record] | None, dict[str, str]]:
    """Return the record type that a message belongs to, and the fields that its topic names; none if unknown."""
    return (Picture, {}) if schema in PICTURES else find_kind(topic, schema) or (None, {})


class Newest(Generic[Stamped]):
    """Records of one type in the order of their times; those that a newer one has replaced are forgotten."""

    def __init__(self) -> None:
        self.rows: deque[Stamped] = deque()

    def until(self, t_ns: int) -> Stamped | None:
        """Return the last record up to a time, which may not be before that of the last call."""
        rows = self.rows
        while len(rows) > 1 and rows[1].t_ns <= t_ns:
            rows.popleft()
        return rows[0] if rows and rows[0].t_ns <= t_ns else None

    def at(self, t_ns: int) -> Stamped | None:
        """Return the next record of exactly this time, or ``None``: two of one time are returned in turn."""
        rows = self.rows
        while rows and rows[0].t_ns < t_ns:
            rows.popleft()
        return rows.popleft() if rows and rows[0].t_ns == t_ns else None


class RecordFeed:
    """Reads a recording once, in the order of its times; only types with a subscriber are decoded.

    Attributes:
        head: Facts that are known before the first message; a file cut off before its head is refused.
        bus: Every record is published here as it was recorded; subscribe before reading begins.
        ahead: Functions called with every picture, in another thread unless only its cells are needed, those of
            one finger in order. Each returns a function that is called in the reader's thread when the picture is
            published.
        by_cells: Whether the functions need the pictures' cells alone: images are not read, but empty.
        unread: Fields that nobody reads, with what stands for them, of types whose topic names no field.
        epoch_ns: Log time at the start of the session.
        last_tick_ns: Newest tick of any record so far.
        newest_ns: Time of the newest message so far that somebody wants, since the start of the session; of any
            message once all of a whole file has been read.
    """

    def __init__(self, path: Path, *, progress: Progress | None = None) -> None:
        self.reader = open_indexed(path)
        self.reader.progress = progress or self.reader.progress
        self.head = read_head(self.reader)
        self.bus = Bus()
        self.ahead: list[Callable[[Picture], Callable[[], object]]] = []
        self.by_cells = False
        self.unread: dict[type[Record], dict[str, Any]] = {}
        self.last_tick_ns, self.newest_ns, self.ended = 0, self.head.from_ns, False
        self._status = deque[records.RecorderStatus](maxlen=1)
        self.epoch_ns = int(self.head.facts["epoch_ns"])
        self._early = lead_in(self.reader, self.head.from_ns)
        if not (self._early or self.reader.until_ns):
            raise RecordingError(f"{path.name}: holds nothing but its settings", "the run had not begun")
        self._next: tuple[Message, list[Callable[[], object]] | None] | None = None
        self._read_ns = -1
        self._end = next(reversed(self.beforehand(records.End)), None)
        self.bus.subscribe(records.RecorderStatus, self._status.append, vital=True)

    def collect(self, kind: type[Kind]) -> list[Kind]:
        """Return a list to which the records of a type and its subclasses are added as they are read."""
        rows: list[Kind] = []
        self.bus.subscribe(kind, rows.append, vital=True)
        return rows

    def beforehand(self, kind: type[Kind]) -> list[Kind]:
        """Return all records of a type with a fixed topic now, each once, as far as the file can be read."""
        found = [one for one in self._early if one.topic == kind.topic]
        with suppress(RecordingError):
            places = self.reader.places(kind.topic, from_ns=0, to_ns=self.reader.until_ns + 1)
            found.extend(self.reader.message(kind.topic, place) for place in places)
        # What was received before a trimmed span and reported in it stands in both.
        return list(dict.fromkeys(read(kind, one.value) for one in found if one.value is not None))

    def holds(self, kind: type[Record]) -> bool:
        """Return whether there is any record of a type with a fixed topic, in the lead-in or later."""
        return any(one.topic == kind.topic for one in self._early) or self.reader.holds(kind.topic)

    @property
    def end(self) -> records.End | None:
        """End of the loop; ``None`` where the recording was cut, as far as that is known yet."""
        return None if self.reader.cut else self._end

    @property
    def lost(self) -> dict[str, int]:
        """Number of records lost while recording, by topic, once everything is read."""
        reported = (zip(one.dropped_topics, one.dropped_counts, strict=True) for one in self._status)
        lost = {topic: int(count) for topic, count in self.reader.metadata.get("dropped", {}).items()}
        return dict(chain.from_iterable(reported)) | lost

    def read_until(self, t_ns: int) -> None:
        """Read on until everything is there that may be needed up to a time since the start of the session."""
        if t_ns <= self._read_ns:  # asked at every tick
            return
        self._read_ns = t_ns + _STEP_NS
        next_ns = self._read_to(self.epoch_ns + self._read_ns + _AHEAD_NS)
        if (gap_ns := next_ns - self.newest_ns) > _LONGEST_NS:
            raise RecordingError(
                f"{self.reader.path.name}: nothing was recorded for {gap_ns / 1e9:.0f} s after "
                f"{self.newest_ns / 1e9:.1f} s",
                "the file is damaged, or the computer slept; trim copies the part before",
            )
        if self.ended:
            self.newest_ns = max(self.newest_ns, next_ns)

    def read_rest(self) -> None:
        """Read the rest of the file, however long nothing was recorded in it: no ticks follow."""
        self.newest_ns = max(self.newest_ns, self._read_to(2**63))

    def _read_to(self, until_ns: int) -> int:
        """Publish what was logged until then; return when the next or last message was, from the session's start."""
        self._next = self._next or next(self._messages, None)
        while self._next is not None and (log_ns := self._next[0].log_ns) <= until_ns:
            self.newest_ns = max(self.newest_ns, log_ns - self.epoch_ns)
            self._take(*self._next)
            self._next = next(self._messages, None)
        self.ended = self._next is None
        # Nobody may want the last messages; of a cut file they are not known.
        next_ns = log_ns if self._next is not None else self.reader.until_ns * (not self.reader.cut)
        return next_ns - self.epoch_ns

    @cached_property
    def _messages(self) -> Iterator[tuple[Message, list[Callable[[], object]] | None]]:
        """The messages, each with what is to be called in its turn; made when everybody has subscribed."""
        messages = paired(chain(self._early, self.reader.in_order(self._wanted)))
        return compute_ahead(messages, self._finger_of, self._compute, quick=lambda _message: self.by_cells)

    def _wanted(self, schema: str, topic: str) -> bool:
        kind = None if self.by_cells and schema in PICTURES else _kind_of(schema, topic)[0]
        return kind is not None and (self.bus.wants(kind) or (kind is Picture and bool(self.ahead)))

    def _compute(self, message: Message) -> list[Callable[[], object]]:
        """Decode a picture and call the functions for it, as a rule ahead; return those to call in its turn."""
        pixels = np.empty((0, 0, 3), np.uint8) if message.image is None else read_picture(message.image)
        named = _kind_of(message.schema, message.topic)[1]
        picture = read(Picture, message.value, image=pixels, **named)
        finish = [function(picture) for function in self.ahead]
        return [*finish, partial(self.bus.publish, picture)] if self.bus.wants(Picture) else finish

    def _finger_of(self, message: Message) -> str:
        """Return the finger of a picture; ``""`` of everything else, and of one whose image is missing."""
        there = message.image is not None or (self.by_cells and message.schema == "tega.Frame")
        return _kind_of(message.schema, message.topic)[1].get("finger", "") if there else ""

    def _take(self, message: Message, computed: list[Callable[[], object]] | None) -> None:
        kind, named = _kind_of(message.schema, message.topic)
        if kind in _TICKED:
            self.last_tick_ns = self.newest_ns
        if kind is Picture:
            for finish in computed or ():
                finish()
        elif message.value is not None and kind is not None:
            self.bus.publish(record_of(kind, message, self.unread.get(kind, named), self.epoch_ns))
