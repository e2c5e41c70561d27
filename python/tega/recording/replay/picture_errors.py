"""Measure the pictures of a recording again where the contacts stay those recorded, and compare.

The loop needs nothing of this: it can be run again in another process meanwhile.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from operator import attrgetter
from pathlib import Path

import msgspec

from tega.loop.inbox.stream import NEVER_NS
from tega.recording.replay.feed import RecordFeed
from tega.recording.replay.head import with_changes
from tega.recording.replay.measured import MeasuredFingers
from tega.records import Contact

_STEP_NS = 1_000_000_000
_taken_ns = attrgetter("taken_ns")


class PictureError(msgspec.Struct):
    """Errors of contacts measured in JPEG pictures, or in their cells, against those recorded.

    Attributes:
        finger: Name of the finger.
        compared: Frames compared.
        contact_changed: Frames in which only one of the two has contact.
        eda_mean_px: Mean error of the area over all frames, pixels.
        eda_max_px: The largest.
        cci_mean: Mean error of the concentration.
        cci_max: The largest.
    """

    finger: str
    compared: int = 0
    contact_changed: int = 0
    eda_mean_px: float = 0.0
    eda_max_px: float = 0.0
    cci_mean: float = 0.0
    cci_max: float = 0.0

    def note(self, recorded: Contact, again: Contact) -> None:
        """Compare a contact with that of the compressed picture of the same frame."""
        eda, cci = float(abs(recorded.eda - again.eda)), abs(recorded.cci - again.cci)
        self.compared += 1
        self.contact_changed += recorded.in_contact != again.in_contact
        self.eda_mean_px += (eda - self.eda_mean_px) / self.compared
        self.cci_mean += (cci - self.cci_mean) / self.compared
        self.eda_max_px, self.cci_max = max(self.eda_max_px, eda), max(self.cci_max, cci)


def picture_errors(path: Path, config: Path | None, sets: Sequence[str]) -> list[PictureError]:
    """Return the errors of contacts measured in a recording's pictures, by finger.

    Args:
        path: The recording.
        config: Other settings to measure with, as for :func:`~tega.recording.replay.replay_file`.
        sets: Single settings.

    Raises:
        RecordingError: The recording cannot be read.
        ConfigError: The other settings cannot be used.
    """
    feed = RecordFeed(path)
    feed.head = with_changes(feed.head, config, sets)
    errors = {finger: PictureError(finger) for finger in feed.head.baselines}
    measured, contacts, t_ns = MeasuredFingers(feed), feed.collect(Contact), 0
    while not feed.ended or contacts:
        # A contact may come before its picture, and is compared when the loop took it in.
        t_ns = NEVER_NS if feed.ended else t_ns + _STEP_NS
        feed.read_until(t_ns)
        n_taken = bisect_right(contacts, t_ns, key=_taken_ns)
        for recorded in contacts[:n_taken]:
            if (again := measured.at(recorded)) is not None:
                errors[recorded.finger].note(recorded, again)
        del contacts[:n_taken]
    return list(errors.values())
