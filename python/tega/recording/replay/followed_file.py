"""Follow the playhead through an MCAP file: read on as it moves, from elsewhere in the file where it jumps."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Mapping
from heapq import heappop, heappush
from typing import TYPE_CHECKING, NamedTuple, Protocol

from tega.errors import TegaError

if TYPE_CHECKING:
    from tega.recording.mcap_index import IndexedReader
    from tega.recording.mcap_reader import Message

NEVER_NS = 2**63 - 1


class PlayedMoment(NamedTuple):
    """Moment of a recording that is played.

    Attributes:
        n_jumps: Number of the playhead's jumps so far.
        at_ns: Time of the recording.
        shift_ns: Time of the run minus time of the recording.
    """

    n_jumps: int
    at_ns: int
    shift_ns: int


class StreamFollower(Protocol):
    """Takes the messages of some topics, and publishes their content in the run.

    Attributes:
        name: Name for reports about unusable messages.
        since_ns: Messages that came before are not given to it; set by :meth:`begin` and :meth:`skip`.
        n_told: Number of times that it published something.
    """

    name: str
    since_ns: int
    n_told: int

    def begin(self, at_ns: int, *, jumped: bool) -> None:
        """Go on at a time of the recording, to which the playhead has jumped, or which reading is behind."""
        ...

    def take(self, message: Message, known_ns: int, moment: PlayedMoment) -> None:
        """Take the next message, which came at a time of the recording that the playhead has reached."""
        ...

    def settle(self, moment: PlayedMoment) -> None:
        """Publish pending content: there are no more messages before this moment."""
        ...

    def skip(self, known_ns: int) -> None:
        """Go on after a message that cannot be used."""
        ...


class FollowedFile:
    """A file that is read as far as the playhead is, a part of the file at a time.

    Args:
        reader: Reads the file.
        zero_ns: Log time at the beginning of the recording.
        followers: Follower of each topic to read.
        behind_ns: Reading that is further behind than this skips ahead, time of the recording.
        delays_ns: Delay of a topic's messages, by topic; 0 unless given.

    Attributes:
        zero_ns: As given.
        problems: Problems by the follower's name.
    """

    def __init__(
        self,
        reader: IndexedReader,
        zero_ns: int,
        followers: Mapping[str, StreamFollower],
        *,
        behind_ns: int,
        delays_ns: Mapping[str, int] | None = None,
    ) -> None:
        self._reader, self.zero_ns, self._followers = reader, zero_ns, dict(followers)
        self.followers = list({id(one): one for one in followers.values()}.values())
        self._behind_ns = behind_ns
        self._delays_ns = dict(delays_ns or {})
        delays = [self._delays_ns.get(topic, 0) for topic in followers] or [0]
        # Taking delays off brings messages out of order by as much as they differ.
        self._disorder_ns, self._least_delay_ns = max(delays) - min(delays), min(delays)
        self._n_jumps = -1
        self._messages: Iterator[Message] = iter(())
        # What was read and waits for its time, as a heap.
        self._waiting: list[tuple[int, int, Message]] = []
        self._n_read, self._newest_ns, self._ended = 0, -NEVER_NS, False
        self._n_unusable: dict[str, int] = {}
        self.problems: dict[str, str] = {}

    def follow(self, moment: PlayedMoment, closing: threading.Event) -> None:
        """Pass on the messages up to a moment, and have the followers publish them."""
        if jumped := moment.n_jumps != self._n_jumps:
            self._n_jumps = moment.n_jumps
        if jumped or (self._waiting and moment.at_ns - self._waiting[0][0] > self._behind_ns):
            self._place(moment.at_ns, jumped=jumped)
        while not closing.is_set():
            if self._waiting and self._waiting[0][0] <= moment.at_ns and self._is_next():
                self._take(moment)
            elif self._ended or self._newest_ns > moment.at_ns + self._disorder_ns:
                break
            else:
                self._read()
        for follower in self.followers:
            try:
                follower.settle(moment)
            except Exception as error:  # as above
                self._pass_over(follower, error, moment.at_ns)

    def _place(self, at_ns: int, *, jumped: bool) -> None:
        """Go to where the followers want to go on; to where reading is already, if that is not behind it."""
        for follower in self.followers:
            follower.begin(at_ns, jumped=jumped)
        since_ns = min((one.since_ns for one in self.followers), default=NEVER_NS)
        if jumped or since_ns > (self._waiting[0][0] if self._waiting else self._newest_ns):
            self._messages = self._reader.in_order(
                lambda _schema, topic: topic in self._followers,
                since_ns=max(self.zero_ns + since_ns + self._least_delay_ns, 0),
            )
            self._waiting, self._newest_ns, self._ended = [], -NEVER_NS, False

    def _is_next(self) -> bool:
        """Whether nothing that is not read yet can be earlier than the first that waits."""
        return self._ended or self._waiting[0][0] + self._disorder_ns <= self._newest_ns

    def _read(self) -> None:
        try:
            found = next((one for one in self._messages if one.topic in self._followers), None)
        except TegaError as error:  # the file is there no more
            found = None
            self.problems[self._reader.path.name] = error.message
        if found is None:
            self._ended, self._messages = True, iter(())
            return
        at_ns = found.log_ns - self.zero_ns - self._delays_ns.get(found.topic, 0)
        self._newest_ns, self._n_read = max(self._newest_ns, at_ns), self._n_read + 1
        heappush(self._waiting, (at_ns, self._n_read, found))

    def _take(self, moment: PlayedMoment) -> None:
        at_ns, _, message = heappop(self._waiting)
        follower = self._followers[message.topic]
        if at_ns < follower.since_ns:
            return
        try:
            follower.take(message, at_ns, moment)
        except Exception as error:  # whatever a file leads to that others may have made
            self._pass_over(follower, error, at_ns)

    def _pass_over(self, follower: StreamFollower, error: Exception, at_ns: int) -> None:
        n = self._n_unusable[follower.name] = self._n_unusable.get(follower.name, 0) + 1
        why = error.message if isinstance(error, TegaError) else f"{type(error).__name__}: {str(error)[:200]}"
        self.problems[follower.name] = f"{follower.name}: {n} of its messages cannot be shown, at last: {why}"
        follower.skip(at_ns)
