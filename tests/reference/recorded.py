"""Read whole recordings, for tests."""

from __future__ import annotations

from pathlib import Path
from typing import Any, TypeVar

from tega.recording.replay.feed import RecordFeed
from tega.records import Contact, EmgSamples, Picture, Record
from tega.records.schema import own_schema
from tega.records.types import record_types
from tega.runtime.files.foreign_file import reports_damage

Kind = TypeVar("Kind", bound=Record)


class Recorded:
    """Records of some types that a recording holds."""

    def __init__(self, feed: RecordFeed, kinds: tuple[type[Record], ...]) -> None:
        self.head = feed.head
        self._records: dict[type[Record], list[Any]] = {kind: feed.collect(kind) for kind in kinds}
        feed.read_rest()

    def of(self, kind: type[Kind]) -> list[Kind]:
        """Return the records of a type, in order."""
        return self._records.get(kind, [])

    @property
    def contacts(self) -> dict[str, list[Contact]]:
        """Contacts by finger, in order."""
        return {f: [one for one in self.of(Contact) if one.finger == f] for f in self.head.baselines}


@reports_damage
def read_recorded(path: Path, *kinds: type[Record]) -> Recorded:
    """Return the records of a recording: those of some types, or else all but pictures and samples."""
    large = {EmgSamples, Picture}
    every = tuple(kind for kind in record_types() if own_schema(kind) and kind not in large)
    return Recorded(RecordFeed(path), kinds or every)
