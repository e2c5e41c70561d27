"""Estimate the offset of two machines' monotonic clocks, and refuse messages that are old by it, or out of order."""

from __future__ import annotations

import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Iterable
from typing import Literal, NamedTuple, TypeVar

import msgspec

from tega_link.messages import ArmMessage, Feature, HandMessage, Ping, Pong, Samples, Stamped, decode, encode

_PERIOD_NS = 200_000_000
_MOST_REQUESTS = 100
WINDOW_NS = 10_000_000_000

_Message = TypeVar("_Message", HandMessage, ArmMessage, Feature, Samples)

Refusal = Literal["foreign", "repeated", "reordered", "no clock", "old", "ahead", "malformed"]

# So far a message may seem to come from the future, besides half the round trip.
_AHEAD_NS = 20_000_000


class Offset(NamedTuple):
    """Offset of the other machine's clock from ours: theirs minus ours.

    It is wrong by at most half of ``round_trip_ns``, that of the ping that it is from.
    """

    offset_ns: int
    round_trip_ns: int

    def ours(self, theirs_ns: int) -> int:
        """Return our clock's time for one of theirs."""
        return theirs_ns - self.offset_ns

    def earliest(self, theirs_ns: int) -> int:
        """Return the earliest that one of their times can be on our clock, however unlike the ways are."""
        return theirs_ns - self.offset_ns - (self.round_trip_ns + 1) // 2


class ClockEstimate:
    """Keeps the question with the shortest way of the last ten seconds.

    A question leaves us at t0, arrives at t1 and is answered at t2 on their clock, and the answer is here at
    t3. With equal ways their clock is ahead by ((t1 - t0) + (t2 - t3))/2; a way that is longer than the other
    moves this by half the difference.
    """

    def __init__(self) -> None:
        # Each has a longer way than the one before it, so the first is the best: what a longer one before a shorter
        # one could say is not of interest any more.
        self._kept: deque[tuple[int, Offset]] = deque()

    def add(self, t0_ns: int, t1_ns: int, t2_ns: int, t3_ns: int) -> None:
        """Process an answer; one with contradictory times is ignored."""
        round_trip_ns = (t3_ns - t0_ns) - (t2_ns - t1_ns)
        if t2_ns < t1_ns or round_trip_ns < 0:
            return
        offset = Offset(((t1_ns - t0_ns) + (t2_ns - t3_ns)) // 2, round_trip_ns)
        while self._kept and self._kept[-1][1].round_trip_ns >= round_trip_ns:
            self._kept.pop()
        self._kept.append((t3_ns, offset))

    def best(self, now_ns: int) -> Offset | None:
        """Return the best of the window; ``None`` where there is none."""
        while self._kept and now_ns - self._kept[0][0] > WINDOW_NS:
            self._kept.popleft()
        return self._kept[0][1] if self._kept else None

    def forget(self) -> None:
        """Restart the estimate, with another machine."""
        self._kept.clear()


class PeerClock:
    """Asks the other station's time five times a second, and answers when it asks; for any thread.

    ``last`` is the newest estimate there was, also where there is none any more.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._estimate = ClockEstimate()
        self._requested: dict[int, None] = {}
        self._next_ns = 0
        self._send_ping: Callable[[bytes], None] = lambda _message: None
        self._send_pong: Callable[[bytes], None] = lambda _message: None
        self.last: Offset | None = None

    def open(self, send_ping: Callable[[bytes], None], send_pong: Callable[[bytes], None]) -> None:
        """Take note of what sends questions and answers."""
        self._send_ping, self._send_pong = send_ping, send_pong

    def ask(self, session: int, now_ns: int) -> None:
        """Ask for the other station's time, if it is time to."""
        if now_ns < self._next_ns:
            return
        self._next_ns = now_ns + _PERIOD_NS
        with self._lock:
            t0_ns = time.monotonic_ns()
            self._requested[t0_ns] = None
            while len(self._requested) > _MOST_REQUESTS:
                del self._requested[next(iter(self._requested))]
        self._send_ping(encode(Ping(session, t0_ns)))

    def receive(self, key: str, data: bytes, session: int) -> None:
        """Process a ping or pong of a session; those of another session or unreadable ones are ignored."""
        now_ns = time.monotonic_ns()
        try:
            received = decode(Ping, data) if key.endswith("/ping") else decode(Pong, data)
        except msgspec.DecodeError:
            return
        if received.session != session:
            return
        if isinstance(received, Ping):
            self._send_pong(encode(Pong(session, received.t0_ns, now_ns, time.monotonic_ns())))
            return
        with self._lock:
            if received.t0_ns in self._requested:  # what we asked, and only once
                del self._requested[received.t0_ns]
                self._estimate.add(received.t0_ns, received.t1_ns, received.t2_ns, now_ns)

    def forget(self) -> None:
        """Restart the estimate, with another machine."""
        with self._lock:
            self._estimate.forget()
            self._requested.clear()
            self._next_ns = 0

    def offset(self, now_ns: int) -> Offset | None:
        """Return how far apart the clocks are; ``None`` where that is not known."""
        with self._lock:
            best = self._estimate.best(now_ns)
        if best is not None:
            self.last = best
        return best

    @property
    def words(self) -> str:
        """The clocks' offset, and by how much that may be wrong, in words."""
        offset = self.offset(time.monotonic_ns())
        if offset is None:
            return "clock not known"
        return f"clock {offset.offset_ns / 1e6:+.1f} ms ± {offset.round_trip_ns / 2e6:.1f}"

    def summary(self) -> dict[str, float] | None:
        """Return the offset for a run's summary; ``None`` where it was never known."""
        if (offset := self.last) is None:
            return None
        return {
            "offset_ms": round(offset.offset_ns / 1e6, 3),
            "round_trip_ms": round(offset.round_trip_ns / 1e6, 3),
        }


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
        self.counts = Counter[str]()
        self.last: Refusal | Literal[""] = ""

    @property
    def refused(self) -> dict[str, int]:
        """Messages refused, by why."""
        counts = dict(self.counts)  # others look on while a thread of the link's counts something new
        return {why: n for why, n in counts.items() if why}

    def begin(self, session: int | None) -> None:
        """Listen to a session from its beginning; to none with ``None``."""
        self._session, self._newest, self.counts, self.last = session, -1, Counter[str](), ""

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
        """Return why a message is not used, ``""`` if it is."""
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
        self.counts[""] += 1
        self.last = ""
        return ""

    def _count(self, why: Refusal) -> Refusal:
        self.counts[why] += 1
        self.last = why
        return why


def refused_by(gates: Iterable[StampGate]) -> dict[str, int]:
    """Return how many messages several gates have refused together, by why."""
    return dict(sum((Counter(gate.refused) for gate in gates), Counter[str]()))
