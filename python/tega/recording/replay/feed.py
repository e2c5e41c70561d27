"""Publish the records of a recording by type, in the order of their times, only as far ahead as a replay needs it."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, TypeVar

import numpy as np

from tega import records
from tega.errors import RecordingError
from tega.recording.compute_ahead import PICTURES, compute_ahead
from tega.recording.mcap_index import open_indexed
from tega.recording.mcap_reader import Message, Progress, read_picture
from tega.recording.mcap_schemas import PACKAGE
from tega.recording.replay.head import lead_in, read_head
from tega.records import Contact, HandCommand, Intent, Picture, Record, VestFrame
from tega.records.bus import Bus
from tega.records.schema import own_schema, read, schema_name
from tega.records.types import record_types

if TYPE_CHECKING:
    from tega.loop.inbox.stream import StampedRecord

# So much earlier than its time a record is taken from the file, since it may be needed by what was stamped before it.
_AHEAD_NS = 2_000_000_000
# Ticks are replayed one after the other: over a longer gap a damaged time would keep a replay busy for hours.
_LONGEST_NS = 600_000_000_000

Stamped = TypeVar("Stamped", bound="StampedRecord")
Kind = TypeVar("Kind", bound=Record)


@cache
def kind_of(schema: str, topic: str) -> type[Record] | None:
    """Return the record type of a message of the file; ``None`` for a schema that is not TEGA's."""
    found = [
        kind for kind in record_types() if own_schema(kind) and f"{PACKAGE}.{schema_name(kind)}" == schema
    ]
    return next((kind for kind in found if kind.topic == topic), found[-1] if found else None)


def record_of(message: Message, **more: Any) -> Record | None:
    """Return the record of a message, with the fields that it does not hold; ``None`` for a schema not of TEGA's."""
    kind = kind_of(message.schema, message.topic)
    return None if kind is None else read(kind, message.value, **_named(kind, message.topic), **more)


@cache
def _named(kind: type[Record], topic: str) -> dict[str, str]:
    """Return the fields of a record that its topic names, such as its finger."""
    parts = zip(kind.topic.split("/"), topic.split("/"), strict=False)
    return {field[1:-1]: name for field, name in parts if field.startswith("{")}


class _Read(NamedTuple):
    """A message, and of a picture's number and times the message of its image."""

    message: Message
    image: Message | None = None


class _Computed(NamedTuple):
    """What other threads made of a picture."""

    picture: Picture | None  # if anything subscribes to it
    finish: list[Callable[[], object]]


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
        """Return the record of exactly this time, or ``None``."""
        newest = self.until(t_ns)
        return newest if newest is not None and newest.t_ns == t_ns else None


class RecordFeed:
    """Reads a recording once, in the order of its times; only types with a subscriber are decoded.

    Attributes:
        reader: Reads the file; for further passes.
        head: Facts that are known before the first message.
        bus: Every record is published here as it was recorded; subscribe before reading begins.
        others: Functions called with every message whose schema is not TEGA's; without any these are not decoded.
        ahead: Functions called with every picture in another thread, those of one finger in order. Each returns a
            function that is called in the reader's thread when the picture is published.
        cells_suffice: Whether the functions need no image where the picture's cells are recorded; it is empty then.
        epoch_ns: Log time at the start of the session.
        last_tick_ns: Newest tick of any record so far.
        newest_ns: Time of the newest message so far, since the start of the session.
        ended: Whether everything has been read.

    Raises:
        RecordingError: The file is no recording of a session, or is cut off before its head.
        MissingExtraError: A package of the extra ``record`` is not installed.
    """

    def __init__(self, path: Path, *, progress: Progress | None = None) -> None:
        self.reader = open_indexed(path)
        self.reader.progress = progress or self.reader.progress
        self.head = read_head(self.reader)
        self.bus = Bus()
        self.others: list[Callable[[Message], None]] = []
        self.ahead: list[Callable[[Picture], Callable[[], object]]] = []
        self.cells_suffice = False
        self.last_tick_ns, self.newest_ns, self.ended = 0, self.head.from_ns, False
        self._dropped = dict[str, int]()
        self.epoch_ns = int(self.head.facts["epoch_ns"])
        self._early = lead_in(self.reader, self.head.from_ns)
        if not (self._early or self.reader.until_ns):
            raise RecordingError(f"{path.name}: holds nothing but its settings", "the run had not begun")
        self._early_kinds = {kind_of(one.schema, one.topic) for one in self._early}
        self._messages: Iterator[tuple[_Read, _Computed | None]] | None = None
        self._next: tuple[_Read, _Computed | None] | None = None
        self._end = self._read_end()
        ticked: tuple[type[Record], ...] = (Contact, Intent, VestFrame, HandCommand)
        for kind in ticked:
            self.bus.subscribe(kind, self._note_tick, vital=True)
        self.bus.subscribe(records.RecorderStatus, self._note_status, vital=True)

    def _read_end(self) -> records.End | None:
        places = self.reader.places(records.End.topic, from_ns=0, to_ns=self.reader.until_ns + 1)
        record = record_of(self.reader.message(records.End.topic, places[-1])) if len(places) else None
        return record if isinstance(record, records.End) else None

    def _note_tick(self, record: Any) -> None:
        # No tick is far after the message that reports it, but in a damaged file.
        tick_ns = min(getattr(record, "taken_ns", record.t_ns), self.newest_ns + _AHEAD_NS)
        self.last_tick_ns = max(self.last_tick_ns, tick_ns)

    def _note_status(self, status: records.RecorderStatus) -> None:
        self._dropped = dict(zip(status.dropped_topics, status.dropped_counts, strict=True))

    def collect(self, kind: type[Kind]) -> list[Kind]:
        """Return a list to which the records of a type and its subclasses are added as they are read."""
        rows: list[Kind] = []
        self.bus.subscribe(kind, rows.append, vital=True)
        return rows

    def holds(self, kind: type[Record]) -> bool:
        """Return whether there is any record of a type with a fixed topic, in the lead-in or later."""
        return kind in self._early_kinds or self.reader.holds(kind.topic)

    @property
    def end(self) -> records.End | None:
        """End of the loop; ``None`` where the recording was cut, as far as that is known yet."""
        return None if self.reader.cut else self._end

    @property
    def lost(self) -> dict[str, int]:
        """Number of records lost while recording, by topic, once everything is read."""
        lost = {topic: int(count) for topic, count in self.reader.metadata.get("dropped", {}).items()}
        return self._dropped | lost

    @property
    def complete(self) -> bool:
        """Whether the file was finished, or else recovered or cut."""
        return not self.reader.cut and "end" in self.reader.metadata

    def read_until(self, t_ns: int) -> None:
        """Read on until everything is there that may be needed up to a time since the start of the session."""
        if self._messages is None:
            messages = chain(self._early, self.reader.in_order(self._wanted))
            self._messages = compute_ahead(self._paired(messages), _finger_of, self._compute)
            self._next = next(self._messages, None)
        until_ns, following = self.epoch_ns + t_ns + _AHEAD_NS, self._next
        while following is not None and (log_ns := following[0].message.log_ns) <= until_ns:
            self.newest_ns = max(self.newest_ns, log_ns - self.epoch_ns)
            self._take(following[0].message, following[1])
            following = self._next = next(self._messages, None)
        self.ended = following is None
        if (
            following is not None
            and following[0].message.log_ns - self.epoch_ns > self.newest_ns + _LONGEST_NS
        ):
            gap_s = (following[0].message.log_ns - self.epoch_ns - self.newest_ns) / 1e9
            raise RecordingError(
                f"{self.reader.path.name}: nothing was recorded for {gap_s:.0f} s after {self.newest_ns / 1e9:.1f} s",
                "the file is damaged, or the computer slept; trim copies the part before",
            )

    def read_rest(self) -> None:
        """Read the rest of the file."""
        self.read_until(2**62)

    def _wanted(self, schema: str, topic: str) -> bool:
        kind = Picture if schema in PICTURES else kind_of(schema, topic)
        if kind is Picture:
            return bool(self.ahead) or self.bus.wants(Picture)
        return bool(self.others) if kind is None else self.bus.wants(kind)

    def _paired(self, messages: Iterable[Message]) -> Iterator[_Read]:
        """Yield the messages; an image is with its number and times, which follow it."""
        images: dict[str, Message] = {}
        for message in messages:
            if message.schema in PICTURES:
                if message.value is not None:
                    images[_place(message.topic)] = message
            elif message.value is not None and kind_of(message.schema, message.topic) is Picture:
                yield _Read(message, images.pop(_place(message.topic), None))
            else:
                yield _Read(message)

    def _compute(self, one: _Read) -> _Computed:
        """Decode a picture and call the functions for it, in another thread."""
        message, image = one
        assert image is not None
        published = self.bus.wants(Picture)
        skipped = self.cells_suffice and not published and bool(getattr(message.value, "cells", b""))
        pixels = np.empty((0, 0, 3), np.uint8) if skipped else read_picture(image)
        picture = read(Picture, message.value, **_named(Picture, message.topic), image=pixels)
        finish = [function(picture) for function in self.ahead]
        return _Computed(picture if published else None, finish)

    def _take(self, message: Message, computed: _Computed | None) -> None:
        if computed is not None:
            for finish in computed.finish:
                finish()
            if computed.picture is not None:
                self.bus.publish(computed.picture)
            return
        kind = None if message.value is None else kind_of(message.schema, message.topic)
        if message.value is None or kind is Picture:
            return
        if kind is None:
            for other in self.others:
                other(message)
            return
        self.bus.publish(read(kind, message.value, **_named(kind, message.topic)))


def _place(topic: str) -> str:
    """Return the finger that a topic of pictures names."""
    return topic.split("/")[2]


def _finger_of(one: _Read) -> str:
    """Return the finger of a picture; ``""`` of everything else."""
    return "" if one.image is None else _place(one.message.topic)
