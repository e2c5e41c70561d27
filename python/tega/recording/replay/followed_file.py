"""Follow the playhead through an MCAP file: read on as it moves, from elsewhere in the file where it jumps."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Mapping
from heapq import heappop, heappush
from itertools import count
from pathlib import Path
from typing import Final, NamedTuple, Protocol

from msgspec.structs import replace

from tega.config.calibration import EmgMaxima
from tega.errors import RecordingError, TegaError
from tega.loop.inbox.frames import FrameMeter
from tega.loop.inbox.stream import NEVER_NS
from tega.recording.mcap_index import IndexedReader
from tega.recording.mcap_reader import Message, read_picture
from tega.recording.pictures import paired
from tega.recording.replay.head import Head
from tega.recording.replay.measured import finger_meter, measure
from tega.records import EmgSamples, Picture
from tega.records.bus import Bus
from tega.records.schema import read
from tega.stages.base import MeasuredPicture

# A metric with a memory looks at so much before the first picture that is shown after a jump.
_WARM_NS: Final = 1_000_000_000


class PlayedMoment(NamedTuple):
    """Position in a recording that is played, for the threads that follow it."""

    n_jumps: int  # of the playhead so far
    at_ns: int  # time of the recording
    shift_ns: int  # time of the run minus time of the recording
    behind_ns: int = NEVER_NS  # reading that is further behind than this skips ahead, time of the recording


class Follower:
    """Takes the messages of some topics, and publishes their content in the run.

    Attributes:
        name: For reports about unusable messages.
        delay_ns: Delay of its messages after what they show, nanoseconds.
        since_ns: Messages that came before are not given to it; set by :meth:`begin` and :meth:`skip`.
        n_published: Number of times that it published something.
    """

    def __init__(self, name: str, *, delay_ns: int = 0) -> None:
        self.name, self.delay_ns = name, delay_ns
        self.since_ns = self.n_published = 0

    def begin(self, at_ns: int, *, jumped: bool) -> None:  # noqa: ARG002  # for those with a memory
        """Go on at a time of the recording, to which the playhead has jumped, or which reading is behind."""
        self.since_ns = at_ns

    def take(self, message: Message, known_ns: int, snapshot: PlayedMoment) -> None:
        """Take the next message, which came at a time of the recording that the playhead has reached."""
        raise NotImplementedError

    def settle(self, snapshot: PlayedMoment) -> None:
        """Publish pending content: there are no more messages before this position."""

    def skip(self, known_ns: int) -> None:
        """Go on after a message that cannot be used."""


class Player(Protocol):
    """Plays the topics of one feature, on a bus; made for each recording that is read. Times are nanoseconds."""

    def listen(self, bus: Bus) -> None:
        """Subscribe to records of the recording's first pass."""
        ...

    def topics(self, path: Path, bus: Bus) -> Mapping[str, Follower]:
        """Return the follower of each topic of the recording to play."""
        ...

    def beside(self, path: Path, bus: Bus, *, start_ns: int, end_ns: int) -> FollowedFile | None:
        """Return a file to be played beside a recording of a beginning (machine's clock) and length, if wanted."""
        ...


class FollowedFile:
    """A file that is read as far as the playhead is, a part of the file at a time.

    ``zero_ns`` is the log time at the recording's beginning; ``topics`` has the follower of each topic to
    read.
    """

    def __init__(self, reader: IndexedReader, zero_ns: int, topics: Mapping[str, Follower]) -> None:
        self._reader, self.zero_ns, self._topics = reader, zero_ns, topics
        self.followers = list(dict.fromkeys(topics.values()))
        self._least_delay_ns = min((one.delay_ns for one in self.followers), default=0)
        self._most_delay_ns = max((one.delay_ns for one in self.followers), default=0)
        self._n_jumps, self._numbers = -1, count()
        self._messages: Iterator[Message] = iter(())
        # Messages that have been read, by the time that they wait for and their number, as a heap.
        self._waiting: list[tuple[int, int, Follower, Message]] = []
        self._read_ns = -NEVER_NS  # time of the recording at which the newest message was logged
        self._n_unusable: dict[str, int] = {}
        self.problems: dict[str, str] = {}  # by the follower's name

    def follow(self, snapshot: PlayedMoment, closing: threading.Event) -> None:
        """Pass on the messages up to a position, and have the followers publish them."""
        jumped, self._n_jumps = snapshot.n_jumps != self._n_jumps, snapshot.n_jumps
        until_ns = snapshot.at_ns + self._most_delay_ns
        if jumped or until_ns - self._read_ns > snapshot.behind_ns:
            self._place(snapshot.at_ns, jumped=jumped)
        self._pass_on(snapshot)
        while self._read_ns <= until_ns and not closing.is_set():
            self._read()
            self._pass_on(snapshot)
        for follower in self.followers:
            try:
                follower.settle(snapshot)
            except Exception as error:  # whatever a file leads to that others may have made
                self._pass_over(follower, error, snapshot.at_ns)

    def _place(self, at_ns: int, *, jumped: bool) -> None:
        """Go to where the followers want to go on; to where reading is already, if that is not behind it."""
        for follower in self.followers:
            follower.begin(at_ns, jumped=jumped)
        since_ns = min((one.since_ns for one in self.followers), default=NEVER_NS) + self._least_delay_ns
        if jumped or since_ns > self._read_ns:
            since_ns = max(self.zero_ns + since_ns, 0)
            self._messages = paired(
                self._reader.in_order(lambda _schema, topic: topic in self._topics, since_ns=since_ns)
            )
            self._read_ns, self._waiting = -NEVER_NS, []

    def _read(self) -> None:
        try:
            found = next(self._messages, None)
        except TegaError as error:  # the file is there no more
            found = None
            self.problems[self._reader.path.name] = error.message
        if found is None:
            self._read_ns, self._messages = NEVER_NS, iter(())
            return
        self._read_ns, follower = found.log_ns - self.zero_ns, self._topics[found.topic]
        heappush(self._waiting, (self._read_ns - follower.delay_ns, next(self._numbers), follower, found))

    def _pass_on(self, snapshot: PlayedMoment) -> None:
        while self._waiting and self._waiting[0][0] <= snapshot.at_ns:
            at_ns, _, follower, message = heappop(self._waiting)
            if at_ns >= follower.since_ns:
                try:
                    follower.take(message, at_ns, snapshot)
                except Exception as error:  # as above
                    self._pass_over(follower, error, at_ns)

    def _pass_over(self, follower: Follower, error: Exception, at_ns: int) -> None:
        n = self._n_unusable[follower.name] = self._n_unusable.get(follower.name, 0) + 1
        why = error.message if isinstance(error, TegaError) else f"{type(error).__name__}: {str(error)[:200]}"
        self.problems[follower.name] = f"{follower.name}: {n} of its messages cannot be shown, at last: {why}"
        follower.skip(at_ns)


class PlayedFinger(Follower):
    """Measures a finger's recorded pictures again for displays; the vest does not depend on it."""

    def __init__(self, finger: str, head: Head, bus: Bus) -> None:
        super().__init__(finger)
        self._head, self._bus = head, bus
        self._meter: FrameMeter
        self._displayed_ns = 0

    def begin(self, at_ns: int, *, jumped: bool) -> None:
        """Begin a second before a position, or skip the pictures before it."""
        self._displayed_ns, self.since_ns = at_ns, at_ns
        if jumped:
            self._meter, self.since_ns = finger_meter(self._head, self.name), at_ns - _WARM_NS

    def take(self, message: Message, known_ns: int, snapshot: PlayedMoment) -> None:
        """Measure the next picture."""
        if message.image is None:
            return
        picture = read(Picture, message.value, finger=self.name, image=read_picture(message.image))
        contact = measure(self._meter, picture)
        if contact is not None and known_ns >= self._displayed_ns:
            contact = replace(contact, t_ns=contact.t_ns + snapshot.shift_ns)
            metric = self._meter.metric
            self._bus.publish(MeasuredPicture(image=picture.image, contact=contact, metric=metric))
            self.n_published += 1


class PlayedSamples(Follower):
    """Publishes the recorded samples of the muscles, numbered by the run's time, which a jump does not change."""

    def __init__(self, maxima: EmgMaxima, bus: Bus) -> None:
        super().__init__("emg")
        self._n_channels, self._rate_hz, self._bus = len(maxima.channels), maxima.rate_hz, bus
        self._offset: int | None = None

    def begin(self, at_ns: int, *, jumped: bool) -> None:
        """Go on at a position, with new numbers."""
        super().begin(at_ns, jumped=jumped)
        self._offset = None

    def take(self, message: Message, known_ns: int, snapshot: PlayedMoment) -> None:
        """Publish the next samples; another number of channels is ``RecordingError``."""
        given = read(EmgSamples, message.value)
        n, more = divmod(given.samples.size, self._n_channels)
        if given.n_channels != self._n_channels or more:
            raise RecordingError(f"{given.n_channels} channels, and the maxima are of {self._n_channels}")
        t_ns = given.t_ns + snapshot.shift_ns
        if self._offset is None:
            self._offset = round(t_ns * 1e-9 * self._rate_hz) - given.first_index - n
        number, received_ns = given.first_index + self._offset, known_ns + snapshot.shift_ns
        self._bus.publish(replace(given, t_ns=t_ns, received_ns=received_ns, first_index=number))
        self.n_published += 1
