"""Define the records of the run itself: its states, alerts, markers, delays, end, log lines and recorder."""

from __future__ import annotations

from typing import Annotated, ClassVar

from tega.records.base import Count, Milliseconds, Ns, Record, quantity


class RunState(Record, frozen=True, kw_only=True):
    """The run's state from now on.

    Attributes:
        t_ns: Since the start of the session.
        state: ``preparing``, ``armed``, ``active``, ``hold`` or ``stopped``.
        reason: Why, in words.
    """

    topic: ClassVar[str] = "/run/state"
    schema: ClassVar[str] = "State"

    t_ns: Ns
    state: str
    reason: str


class Alert(Record, frozen=True, kw_only=True):
    """Trouble that does not change the run's state.

    Attributes:
        t_ns: Since the start of the session.
        name: Subject of the alert.
        said: Description of the problem; ``""`` once it has ended.
    """

    topic: ClassVar[str] = "/run/alert"

    t_ns: Ns
    name: str
    said: str


class Marker(Record, frozen=True, kw_only=True):
    """A marked moment, such as a trial's beginning or a pressed pedal.

    Attributes:
        t_ns: Since the start of the session.
        text: Text of the marker.
        source: Origin of the marker.
        received_ns: When it came from another program; 0 for one of this run, like those below.
        stamp_s: The other program's own time.
        correction_s: Offset from that time to this machine's time.
    """

    topic: ClassVar[str] = "/run/marker"

    t_ns: Ns
    text: str
    source: str = ""
    received_ns: Ns = 0
    stamp_s: Annotated[float, quantity("s")] = 0.0
    correction_s: Annotated[float, quantity("s")] = 0.0


class HeardMarker(Marker, frozen=True, kw_only=True):
    """A moment that another program has marked."""

    topic: ClassVar[str] = "/markers"
    schema: ClassVar[str] = "Marker"

    @property
    def log_ns(self) -> int:
        """Time at which the marker was received."""
        return self.received_ns


class Skip(Record, frozen=True, kw_only=True):
    """A tick that was left out because the loop was more than 100 ms late."""

    topic: ClassVar[str] = "/run/skipped"

    t_ns: Ns


class Haptics(Record, frozen=True, kw_only=True):
    """Switch of the vest's motors from now on.

    Attributes:
        t_ns: The tick, since the start of the session.
        n_asked: How often that had been asked before.
        on: Whether they may.
    """

    topic: ClassVar[str] = "/run/haptics"

    t_ns: Ns
    n_asked: Count
    on: bool


class Value(Record, frozen=True, kw_only=True):
    """A stage's delay that has no stream of its own.

    Attributes:
        t_ns: Since the start of the session.
        name: Name of the stage.
        value: How long.
    """

    topic: ClassVar[str] = "/value/{name}"

    t_ns: Ns
    name: str
    value: Milliseconds


class End(Record, frozen=True, kw_only=True):
    """End of the loop, and how it came.

    Attributes:
        end_ns: When, since the start of the session.
        ended: ``complete``, ``duration``, ``stopped`` or ``""`` after an error.
        n_waits: Deadlines that it waited for.
    """

    topic: ClassVar[str] = "/run/end"

    end_ns: Ns
    ended: str
    n_waits: Count

    @property
    def log_ns(self) -> int:
        """Time at which the loop ended."""
        return self.end_ns


class LogLine(Record, frozen=True, kw_only=True):
    """A line of the program's log.

    Attributes:
        t_ns: Since the start of the session.
        level: As the standard library counts: 20 for information, 30 for a warning.
        name: Name of the logger.
        text: The line.
    """

    topic: ClassVar[str] = "/log"
    schema: ClassVar[str] = "foxglove.Log"

    t_ns: Ns
    level: int
    name: str
    text: str

    @property
    def n_bytes(self) -> int:
        """Memory of the line's letters, bytes."""
        return len(self.text)


class RecorderStatus(Record, frozen=True, kw_only=True):
    """Progress of a recording.

    Attributes:
        t_ns: The newest record's time.
        queued: Records that wait.
        queued_bytes: Size of these records.
        written_bytes: Size of the file so far.
        free_bytes: Left on the disk.
        dropped_topics: Topics of which records were dropped.
        dropped_counts: How many of each.
    """

    topic: ClassVar[str] = "/recorder/status"
    schema: ClassVar[str] = "Status"

    t_ns: Ns
    queued: Count
    queued_bytes: Annotated[int, quantity("B")]
    written_bytes: Annotated[int, quantity("B")]
    free_bytes: Annotated[int, quantity("B")]
    dropped_topics: tuple[str, ...]
    dropped_counts: tuple[Count, ...]
