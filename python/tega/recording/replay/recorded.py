"""Read a whole recording: its input with the times of reading, and its output."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import msgspec

from tega.hand import joined_level
from tega.recording.mcap_reader import Message
from tega.recording.replay.feed import RecordFeed
from tega.recording.replay.head import Head
from tega.recording.replay.players import Player, players
from tega.records import Contact, End, HandLook, Imposed, Record
from tega.runtime.files.foreign_file import tells_damage

if TYPE_CHECKING:
    from tega.devices.base import EmgChunk, TactileFrame
    from tega.recording.mcap_index import IndexedReader

Kind = TypeVar("Kind", bound=Record)


class Recorded(msgspec.Struct):
    """Content of a recording, pictures and samples left out.

    Attributes:
        head: Facts that are known before the first message.
        contacts: Contacts by finger, in order.
        records: Records of each type, in order, those of the lead-in first; see :meth:`of`.
        complete: Whether the file was finished, or else recovered or cut.
        last_tick_ns: Newest tick of any record.
        n_early: Number of contacts of the lead-in, by finger.
        reader: Passes over the file again; ``None`` of a run that is in no file.
        players: Players of features, which have noted their messages.
    """

    head: Head
    contacts: dict[str, list[Contact]]
    records: dict[type[Record], list[Any]] = {}
    complete: bool = False
    last_tick_ns: int = 0
    n_early: dict[str, int] = {}
    reader: IndexedReader | None = None
    players: list[Player] = []

    def of(self, kind: type[Kind]) -> list[Kind]:
        """Return the records of a type, in order."""
        return self.records.get(kind, [])

    @property
    def end(self) -> End | None:
        """End of the loop; ``None`` where the recording was cut."""
        return next(reversed(self.of(End)), None)

    @property
    def looks(self) -> dict[int, HandLook]:
        """Looks at hand and arm, by tick; empty in recordings with slips detected by touch."""
        return {look.t_ns: look for look in self.of(HandLook)}

    @property
    def imposed(self) -> list[tuple[int, float]]:
        """Levels that were set against the muscles: time, level (0 for no longer)."""
        return [(one.t_ns, joined_level(one.level, one.closure)) for one in self.of(Imposed)]


@tells_damage
def read_recorded(
    path: Path,
    *,
    begin: Callable[[Head], None] = lambda _head: None,
    frame: Callable[[str, TactileFrame, Any], None] = lambda _finger, _frame, _told: None,
    chunk: Callable[[EmgChunk], None] = lambda _chunk: None,
    pictures_wanted: Callable[[Head], bool] = lambda _head: True,
) -> Recorded:
    """Read a recording.

    Args:
        path: The file.
        begin: Called with the head, before the first message.
        frame: Given every picture, one at a time (all together they do not fit into memory), and its ``tega.Frame``
            message: the checksum that its pixels had when they were taken, and whether another finger was loaded.
        chunk: Given the EMG samples as they came.
        pictures_wanted: Asked whether ``frame`` is to be given them; else they are passed over.

    Raises:
        RecordingError: The file is no recording of a session, or is cut off before its head.
        MissingExtraError: A package of the extra ``record`` is not installed.
    """
    recorded: Recorded | None = None

    def other(message: Message) -> None:
        if recorded is not None:
            for player in recorded.players:
                player.note(message)

    feed = RecordFeed(path, frame=frame, chunk=chunk, other=other, pictures_wanted=pictures_wanted)
    head = feed.head
    recorded = Recorded(
        head, {finger: [] for finger in head.baselines}, reader=feed.reader, players=players()
    )
    begin(head)

    def take(record: Record) -> None:
        if isinstance(record, Contact):
            recorded.contacts[record.finger].append(record)
        else:
            recorded.records.setdefault(type(record), []).append(record)

    feed.bus.subscribe(Record, take, vital=True)
    feed.read_rest()
    recorded.n_early = {
        finger: sum(contact.taken_ns < head.from_ns for contact in contacts)
        for finger, contacts in recorded.contacts.items()
    }
    recorded.complete, recorded.last_tick_ns = feed.complete, feed.last_tick_ns
    return recorded
