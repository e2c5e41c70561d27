"""Refuse network messages that are old, out of order or of another session."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final, Literal, TypeVar

import msgspec

from tega_link.clock import Offset
from tega_link.messages import ArmMessage, Feature, HandMessage, Samples, Stamped, decode

_Message = TypeVar("_Message", HandMessage, ArmMessage, Feature, Samples)

Refusal = Literal["foreign", "repeated", "reordered", "no clock", "old", "ahead", "malformed"]
REFUSALS: Final = ("foreign", "repeated", "reordered", "no clock", "old", "ahead", "malformed")

# So far a message may seem to come from the future, besides half the round trip.
_AHEAD_NS = 20_000_000


class StampGate:
    """Checks the stamp of every message of a stream.

    A message is refused as ``foreign`` (of another session, or while there is none), ``repeated`` or
    ``reordered`` (its number is the newest one's, or smaller), ``no clock`` (its age is still unknown),
    ``old`` (it may be older than the time-to-live: its age as estimated, and half the round trip as error
    bound) or ``ahead`` (sent after it was received, by more than the error bound of the clock).

    ``ttl_ns`` is how old a message may be at most, truly; the clocks' drift within ten seconds is not
    counted. ``counts`` are messages since the start of the session by why they were refused, ``last`` is that
    of the newest; ``""`` is for those that were not refused.
    """

    def __init__(self, *, ttl_ns: int) -> None:
        self._ttl_ns = ttl_ns
        self._session: int | None = None
        self._newest = -1
        self.counts: dict[str, int] = {}
        self.last: Refusal | Literal[""] = ""

    @property
    def refused(self) -> dict[str, int]:
        """Messages refused, by why."""
        counts = dict(self.counts)  # others look on while a thread of the link's counts something new
        return {why: n for why, n in counts.items() if why}

    def begin(self, session: int | None) -> None:
        """Listen to a session from its beginning; to none with ``None``."""
        self._session, self._newest, self.counts, self.last = session, -1, {}, ""

    def read(self, kind: type[_Message], data: bytes) -> _Message | None:
        """Return a message; ``None`` for one that cannot be read or used, which is counted."""
        try:
            message = decode(kind, data)
        except msgspec.DecodeError:
            message = None
        if message is None or message.malformed():
            self._count("malformed")
            return None
        return message

    def foreign(self) -> Refusal:
        """Count a message from another session."""
        return self._count("foreign")

    def refusal(self, stamp: Stamped, now_ns: int, clock: Offset | None) -> Refusal | Literal[""]:
        """Return why a message is not used, ``""`` if it is.

        ``clock`` is how far apart the clocks are; ``None`` where that is not known.
        """
        if stamp.session != self._session:
            return self._count("foreign")
        if stamp.sequence <= self._newest:
            return self._count("repeated" if stamp.sequence == self._newest else "reordered")
        # An older one that comes after this one is late, whatever becomes of this one.
        self._newest = stamp.sequence
        if clock is None:
            return self._count("no clock")
        if now_ns - clock.earliest(stamp.sent_ns) > self._ttl_ns:
            return self._count("old")
        if now_ns - clock.ours(stamp.sent_ns) < -(_AHEAD_NS + clock.round_trip_ns // 2):
            return self._count("ahead")
        self.counts[""] = self.counts.get("", 0) + 1
        self.last = ""
        return ""

    def _count(self, why: Refusal) -> Refusal:
        self.counts[why] = self.counts.get(why, 0) + 1
        self.last = why
        return why


def refused_by(gates: Iterable[StampGate]) -> dict[str, int]:
    """Return how many messages several gates have refused together, by why."""
    refused: dict[str, int] = {}
    for gate in gates:
        for why, n in gate.refused.items():
            refused[why] = refused.get(why, 0) + n
    return refused
