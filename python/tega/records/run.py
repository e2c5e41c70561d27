"""Define the records of the run itself, of its delays and of the operator's input devices."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, ClassVar, Final

from tega.records.base import Count, Milliseconds, Ns, Record, Share, quantity

TOUCH_STAGES: Final = ("camera", "contact", "wait", "map", "held", "hand-over", "own", "in-hand", "whole")
INTENT_STAGES: Final = ("sample", "levels", "wait", "report", "hand-over", "own", "whole")
MOTION_STAGES: Final = ("sample", "levels", "wait", "joint", "whole")

# Recordings of before there was a greatest rate do not say when it let a frame go.
_STAMPS_WITHOUT_HELD: Final = 6
# Older recordings do not say when the hand reported, either.
_STAMPS_WITHOUT_REPORT: Final = 5


class RunState(Record, frozen=True, kw_only=True):
    """The run's state from now on.

    Attributes:
        state: ``preparing``, ``armed``, ``active``, ``hold`` or ``stopped``.
    """

    topic: ClassVar[str] = "/run/state"
    schema: ClassVar[str] = "State"

    t_ns: Ns
    state: str
    reason: str


class Alert(Record, frozen=True, kw_only=True):
    """Trouble that does not change the run's state.

    Attributes:
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
    logged: ClassVar[str] = "received_ns"


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
    """A stage's delay that has no stream of its own."""

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
    logged: ClassVar[str] = "end_ns"

    end_ns: Ns
    ended: str
    n_waits: Count


class LogLine(Record, frozen=True, kw_only=True):
    """A line of the program's log.

    Attributes:
        level: As the standard library counts: 20 for information, 30 for a warning.
    """

    topic: ClassVar[str] = "/log"
    schema: ClassVar[str] = "foxglove.Log"
    bulk: ClassVar[str] = "text"

    t_ns: Ns
    level: int
    name: str
    text: str


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


class Latency(Record, frozen=True, kw_only=True):
    """The way of one camera frame to the vest, or of one block of EMG to the hand or to the first motion of a joint.

    Attributes:
        path: ``touch``, ``intent`` or ``motion``.
        source: The finger, or ``emg``.
        stamps_ns: Times since the start of the session: captured, received, measured. Then, for touch: taken up,
            made, let go and handed over. For intent: command to the hand, arrival of the report that the torques
            answer, and hand-over. For motion: command to the hand, and first observed motion of a joint.
    """

    topic: ClassVar[str] = "/latency/{path}"

    path: str
    source: str
    stamps_ns: tuple[Ns, ...]

    @property
    def log_ns(self) -> int:
        """Time at which the frame or block arrived."""
        return self.stamps_ns[-1]

    def stages_ns(self) -> dict[str, int]:
        """Return the delay of each stage, by :data:`TOUCH_STAGES`, :data:`INTENT_STAGES` or :data:`MOTION_STAGES`."""
        stamps = self.stamps_ns
        if self.path == "touch" and len(stamps) == _STAMPS_WITHOUT_HELD:
            stamps = (*stamps[:5], stamps[4], stamps[5])
        elif self.path == "intent" and len(stamps) == _STAMPS_WITHOUT_REPORT:
            stamps = (*stamps[:4], stamps[3], stamps[4])
        steps = [later - sooner for sooner, later in pairwise(stamps)]
        whole = stamps[-1] - stamps[0]
        if self.path == "touch":
            own = steps[1] + steps[3] + steps[5]
            return dict(zip(TOUCH_STAGES, (*steps, own, whole - steps[0], whole), strict=True))
        if self.path == "motion":
            return dict(zip(MOTION_STAGES, (*steps, whole), strict=True))
        return dict(zip(INTENT_STAGES, (*steps, steps[1] + steps[4], whole), strict=True))


class InputState(Record, frozen=True, kw_only=True):
    """State of an input device from now on.

    Attributes:
        seat: Purpose of the device, such as ``dead_man``.
        t_ns: When it was seen, since the start of the session.
        live: False is "no data".
        motion: Speed asked for along x, y, z and about them, each a share of full deflection.
        held: Names of the buttons that are down, in alphabetic order.
    """

    topic: ClassVar[str] = "/input/{seat}"
    schema: ClassVar[str] = "Input"
    unwritten: ClassVar[tuple[str, ...]] = ("seat",)

    seat: str
    t_ns: Ns
    live: bool
    motion: tuple[Share, ...]
    held: tuple[str, ...]


class Button(Record, frozen=True, kw_only=True):
    """A button that went down or up.

    Attributes:
        seq: The event's number from the device.
    """

    topic: ClassVar[str] = "/input/{seat}/button"
    unwritten: ClassVar[tuple[str, ...]] = ("seat",)

    seat: str
    t_ns: Ns
    seq: int
    button: str
    pressed: bool
