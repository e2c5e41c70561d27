"""Collect a tracker's poses from a thread of its own, and convert a device's times to the monotonic clock."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Sequence
from typing import ClassVar, Final

import msgspec

from tega.arm.pose import StampedPose
from tega.devices.base import DeviceInfo, Kind
from tega.devices.drained import Drained
from tega.errors import DeviceUnavailableError

RESTART_NS: Final = 350_000_000
"""After a reconnection the same numbers may be another place. So long, together with the pause before, poses are not
valid, so that the operator sees "lost" and takes hold again."""

SILENT_S: Final = 0.25
"""A tracker that has said nothing for so long is in trouble."""

_MOST_POSES: Final = 256
_MANY: Final = 0.1


class TrackerCounts(msgspec.Struct, kw_only=True):
    """Counts of a tracker's answers, and of connections to it.

    Attributes:
        poses: Answers in all, without a pose too.
        lost: Answers that had no pose of the subject.
        guessed: Answers with a pose that was only guessed.
        repeated: Answers with the pose of the previous one; they are skipped.
        silent: Connections dropped since nothing came.
        broken: Connections closed after data that is no answer, or half of one.
        recentred: Changes of the origin that were announced.
    """

    poses: int = 0
    lost: int = 0
    guessed: int = 0
    repeated: int = 0
    connections: int = 0
    silent: int = 0
    broken: int = 0
    recentred: int = 0


class ThreadedTracker(Drained):
    """A tracker whose driver's ``open`` starts a thread, which puts poses into ``_poses`` under ``_lock``.

    The thread reports to the operator with ``_say``.
    ``frame`` names the axes of the poses in :data:`tega.arm.FRAMES`.
    """

    kind: ClassVar[Kind] = "tracker"
    driver: ClassVar[str]
    frame: ClassVar[str] = "openxr"

    def __init__(self, subject: str, rate_hz: float) -> None:
        super().__init__()
        self._subject, self._rate_hz = subject, rate_hz
        self.counts = TrackerCounts()
        self._lock = threading.Lock()
        self._poses: deque[StampedPose] = deque(maxlen=_MOST_POSES)

    def _describe(self, label: str, notes: Sequence[str]) -> DeviceInfo:
        c, counted = self.counts, []
        if c.guessed > _MANY * c.poses:
            counted.append(f"{c.guessed} of {c.poses} poses were only guessed")
        if c.lost > _MANY * c.poses:
            counted.append(f"{c.lost} of {c.poses} times the {self._subject} was not seen")
        if c.recentred:
            counted.append(f"its origin was moved {c.recentred} times")
        return DeviceInfo(
            driver=self.driver,
            kind="tracker",
            label=label,
            live=True,
            rate_hz=self._rate_hz,
            unit="m",
            notes=(*counted, *notes),
        )

    def _forget(self) -> None:
        self.counts = TrackerCounts()
        self._poses.clear()
        self._trouble = ""

    def read(self, now_ns: int) -> Sequence[StampedPose]:  # noqa: ARG002  # poses carry their own times
        """Return the poses that came since the last call, oldest first; never waits."""
        if self._thread is None:
            raise DeviceUnavailableError(f"{self.driver}: it is not open", "use it in a with block")
        with self._lock:
            poses = list(self._poses)
            self._poses.clear()
        return poses

    def _say(self, trouble: str) -> None:
        with self._lock:
            self._trouble = trouble


# A window long enough to hold a packet that was not held up, and short enough that two crystals do not part by 1 ms.
_WINDOW_NS = 10_000_000_000
# A device whose clock leaps by more than this against ours has been restarted.
_LEAP_NS = 1_000_000_000


class DeviceClock:
    """Turns a device's times into those of the monotonic clock.

    ``offset = min(arrival - device time)`` over the last 10 s: the packet with the shortest delay gives the clocks'
    difference, and packets that arrive later than that were delayed. The shortest delay itself cannot be measured
    from one end, so the age does not include it: 2 to 10 ms on a good wireless network.

    ``delay_ns`` is how much longer the newest packet was on its way than the quickest one, ``n_leaps`` the number
    of times that the device's clock was set.

    Example:
        >>> clock = DeviceClock()
        >>> clock.to_host_ns(0, 1_000), clock.to_host_ns(100, 1_500), clock.delay_ns
        (1000, 1100, 400)
    """

    def __init__(self) -> None:
        self._lowest: deque[tuple[int, int]] = deque()  # (arrival, offset), offsets rising
        self._last_ns: int | None = None
        self._reported_ns = 0
        self.delay_ns = 0
        self.n_leaps = 0

    def forget(self) -> None:
        """Reset, as after a lost connection."""
        self._lowest.clear()
        self._last_ns = None

    def to_host_ns(self, device_ns: int, arrival_ns: int) -> int:
        """Return the monotonic time of a device's stamp; never less than before, never after the arrival.

        ``arrival_ns`` is when the packet was read here; it must never be less than before.
        """
        offset = arrival_ns - device_ns
        if self._lowest and abs(offset - self._lowest[0][1]) > _LEAP_NS and self._leapt(device_ns):
            self.n_leaps += 1
            self.forget()
        self._last_ns = device_ns
        while self._lowest and self._lowest[-1][1] >= offset:
            self._lowest.pop()
        self._lowest.append((arrival_ns, offset))
        while self._lowest[0][0] < arrival_ns - _WINDOW_NS:
            self._lowest.popleft()
        self.delay_ns = offset - self._lowest[0][1]
        self._reported_ns = max(self._reported_ns, device_ns + self._lowest[0][1])
        return self._reported_ns

    def _leapt(self, device_ns: int) -> bool:
        """Return whether the clock was set; the stamps of a merely delayed burst continue evenly."""
        return self._last_ns is None or not 0 <= device_ns - self._last_ns <= _LEAP_NS
