"""Stand in for the devices of the other station: streams and sinks fed over the network link."""

from __future__ import annotations

import contextlib
import queue
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from tega.arm.pose import StampedPose
from tega.config.calibration import EmgMaxima
from tega.devices.base import DeviceInfo, EmgChunk, InputEvent, InputReading, TactileFrame
from tega.hand import split_level
from tega.loop.inbox.inputs import Muscles
from tega.loop.inbox.sources import SourceReport
from tega.loop.inbox.stream import LiveStream
from tega.records import Intent
from tega.runtime.lifecycle import Elsewhere
from tega.wire import CanFrame

_STILL = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
_JOINTS = 16
# Every amplifier's samples become ten levels a second.
_BLOCKS_HZ = 10.0
_MOST_CHUNKS = 64


class FarFinger(Elsewhere):
    """A fingertip at the robot's station: contacts come as a stream, frames for display with lower priority."""

    def __init__(self, name: str, robot: str, *, rate_hz: float) -> None:
        label = f"{name} of {robot!r}"
        how: dict[str, Any] = {"rate_hz": rate_hz or None, "unit": "contact"}
        super().__init__(DeviceInfo(driver="net", kind="tactile", label=label, live=True, **how))
        self._pictures: queue.Queue[tuple[int, int, bytes]] = queue.Queue(1)
        self.ended = False

    def show(self, t_ns: int, number: int, jpeg: bytes) -> None:
        """Replace the newest frame; an unread one is dropped, and the reader decodes it."""
        with contextlib.suppress(queue.Empty):
            self._pictures.get_nowait()
        with contextlib.suppress(queue.Full):
            self._pictures.put_nowait((t_ns, number, jpeg))

    def read(self, timeout_s: float) -> TactileFrame | None:
        """Return the next picture, or ``None`` when none came in time."""
        try:
            t_ns, number, jpeg = self._pictures.get(block=timeout_s > 0, timeout=timeout_s or None)
        except queue.Empty:
            return None
        picture = unpacked(jpeg)
        return None if picture is None else TactileFrame(t_ns, number, picture, "over the link")


def unpacked(packed: bytes) -> NDArray[np.uint8] | None:
    """Return a picture, uint8 (H, W, 3), blue, green, red; ``None`` without OpenCV, or where it is none."""
    try:
        import cv2
    except ImportError:
        return None
    try:
        picture: Any = cv2.imdecode(np.frombuffer(packed, np.uint8), cv2.IMREAD_COLOR)
    except cv2.error:  # there is nothing in it
        return None
    return None if picture is None else np.asarray(picture, np.uint8)


class FarMuscles(Elsewhere):
    """The operator's EMG: levels come as a stream, samples for the recording as they can.

    ``driver`` is the way on which the levels come; ``note`` is about their origin, for the summary.
    """

    def __init__(
        self,
        driver: str = "net",
        label: str = "the operator's station",
        note: str = "levels are made at the operator's station; samples come for the recording, as they can",
    ) -> None:
        self._chunks: queue.Queue[EmgChunk] = queue.Queue(_MOST_CHUNKS)
        how: dict[str, Any] = {
            "rate_hz": _BLOCKS_HZ,
            "channels": ("operator",),
            "unit": "level",
            "notes": (note,),
        }
        super().__init__(DeviceInfo(driver=driver, kind="emg", label=label, live=True, **how))
        self.ended = False

    def give(self, chunk: EmgChunk) -> None:
        """Queue samples, in a thread of the link's; they are lost if they are not read in time."""
        with contextlib.suppress(queue.Full):
            self._chunks.put_nowait(chunk)

    def read(self, timeout_s: float) -> EmgChunk | None:
        """Return the next samples, or ``None`` when none came in time."""
        try:
            return self._chunks.get(block=timeout_s > 0, timeout=timeout_s or None)
        except queue.Empty:
            return None


def far_muscles(source: Any, blocks: LiveStream[Intent]) -> Muscles:
    """Return the EMG side of a run with samples and levels that come over the link."""
    report = SourceReport()
    blocks.on_loss = report.drop
    # One channel, whose sample is the level itself: 5 is as far as it goes.
    maxima = EmgMaxima(kind="envelope", rate_hz=_BLOCKS_HZ, tau=1, channels=("operator",), maxima=(5.0,))
    return Muscles(source, maxima, None, report, blocks)


class FarHand(Elsewhere):
    """The robot's hand, seen from the operator's station: keeps the requested closure, for the link to send.

    ``answered`` is called with a monotonic time; it returns it and when a command was first sent at or after
    it, ``None`` before that.
    """

    label: ClassVar[str] = "at the robot's station: angles as it reports them"

    def __init__(self, robot: str, *, answered: Callable[[int], tuple[int, int] | None]) -> None:
        super().__init__(DeviceInfo(driver="net", kind="hand", label=f"hand of {robot!r}", live=True))
        self.requested: tuple[int, float | None] | None = None
        self.angles: tuple[float, ...] = ()
        self.answered_ns = answered

    @property
    def angles_rad(self) -> NDArray[np.float64]:
        """The newest reported joint angles, float64 (16,), rad; NaN before the first."""
        angles = self.angles
        return np.array(angles, np.float64) if len(angles) == _JOINTS else np.full(_JOINTS, np.nan)

    def step(self, level: float, added: float = 0.0) -> Sequence[CanFrame]:
        """Ask for a closure level, or a closure between two; the frames are made at the other station.

        A reflex's addition is sent with the level, as one move: the fast reflex is at the other station.
        """
        self.requested = split_level(level + added)
        return ()

    def limp(self) -> Sequence[CanFrame]:
        """Ask for nothing any more; the robot's station holds, and then does what its settings say."""
        self.requested = None
        return ()


class FarSwitch(Elsewhere):
    """A switch that the operator holds.

    ``check`` returns when it was last received, whether that is fresh, and whether it is held.
    """

    def __init__(self, name: str, check: Callable[[], tuple[int, bool, bool]]) -> None:
        self._name, self._check = name, check
        self._was_held, self._sequence = False, 0
        super().__init__(DeviceInfo(driver="net", kind="input", label=f"the operator's {name}", live=True))

    def state(self) -> InputReading:
        """Return the state of the switch now."""
        t_ns, live, held = self._check()
        return InputReading(t_ns, live, _STILL, frozenset({self._name}) if held else frozenset())

    def events(self) -> Sequence[InputEvent]:
        """Return whether it went down or up since the last call."""
        t_ns, _, held = self._check()
        if held == self._was_held:
            return ()
        self._was_held = held
        self._sequence += 1
        return (InputEvent(t_ns, self._sequence - 1, self._name, held),)


class FarTracker(Elsewhere):
    """The operator's forearm, as it was seen at the other station.

    ``frame`` is the axes of the poses: the link refuses an operator with others. ``driver`` names the way on
    which the poses come.
    """

    problem = ""  # the link itself reports what is wrong with it

    def __init__(self, frame: str, driver: str = "net", label: str = "the operator's station") -> None:
        self.frame = frame
        self._poses: deque[tuple[StampedPose, int]] = deque(maxlen=16)
        super().__init__(DeviceInfo(driver=driver, kind="tracker", label=label, live=True, unit="m"))

    def observe(self, pose: StampedPose, *, use_by_ns: int) -> None:
        """Take in a pose that may be used until some time of our clock; in a thread of the link's."""
        self._poses.append((pose, use_by_ns))

    def forget(self) -> None:
        """Drop unread poses, when another operator takes the lead."""
        self._poses.clear()

    def read(self, now_ns: int) -> Sequence[StampedPose]:
        """Return the poses that came since the last call and have not lapsed, oldest first."""
        came = [self._poses.popleft() for _ in range(len(self._poses))]
        return [pose for pose, use_by_ns in came if now_ns <= use_by_ns]
