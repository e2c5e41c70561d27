"""Stamp samples that arrive in bunches, measure the true sample rate, and refuse rates that are wrong.

A USB serial adapter delivers several samples at once, up to 16 ms late. A sample cannot arrive before it was taken,
so the earliest arrivals are the true ones: stamps lie on a line of one period per sample, laid under the arrivals. An
early arrival pulls the line down at once; once a second it is raised to the earliest of that second.
"""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

from tega.errors import SampleRateError

# The line is looked over this often, and the rate is fitted over this long.
_POLL_NS = 1_000_000_000
_FIT_NS = 10_000_000_000
# A sample that seems to come from further in the future than this has a wrong number.
_FUTURE_NS = 50_000_000
# A fit over less than this says nothing.
_LEAST_FIT_NS = 200_000_000
# A USB serial adapter holds samples back for up to this long.
_LATE_S = 0.016


class Stamp(NamedTuple):
    """Time of a chunk, and the losses before it.

    ``t_ns`` is when its last sample was complete, on the clock of the arrivals; it never decreases.
    ``n_lost``, in samples, are whole turns of the packet counter that elapsed time shows to be missing before
    it.
    """

    t_ns: int
    n_lost: int


class SampleClock:
    """Stamps samples that are counted, and measures how fast they really come.

    The device's counter wraps after ``counter_turn`` samples, needed to detect a loss of whole turns from the
    elapsed time; ``None`` for a device that does not count, where time reveals no losses.

    Example:
        >>> clock = SampleClock(250.0)
        >>> clock.take(4, 16_000_000).t_ns, clock.take(4, 48_000_000).t_ns, clock.take(4, 48_000_000).t_ns
        (16000000, 32000000, 48000000)
    """

    def __init__(self, rate_hz: float, *, counter_turn: int | None = None) -> None:
        self._period_ns = 1e9 / rate_hz
        self._turn = counter_turn
        self._n = 0
        self._line: tuple[int, float] | None = None
        self._points: deque[tuple[int, int]] = deque()
        self._earliest_ns = math.inf
        self._check_ns = 0
        self._arrival_ns = 0
        self._pauses_ns = (0, 0)
        self._last_ns = 0

    def take(self, n_samples: int, arrival_ns: int, n_missing: int = 0) -> Stamp:
        """Count samples in, and return the time of the last of them and the losses that only time shows.

        ``arrival_ns`` is monotonic; ``n_missing`` samples are missing before these by the device's counter.
        """
        self._n += n_missing + n_samples
        self._points.append((self._n, arrival_ns))
        while arrival_ns - self._points[0][1] > _FIT_NS:
            self._points.popleft()
        n_lost = 0
        if self._line is None:
            self._line, self._check_ns = (self._n, float(arrival_ns)), arrival_ns + _POLL_NS
            self._arrival_ns = arrival_ns
        before, now = self._pauses_ns
        self._pauses_ns, self._arrival_ns = (before, max(now, arrival_ns - self._arrival_ns)), arrival_ns
        late_ns = arrival_ns - self._on_line()
        if late_ns < 0:
            self._line, late_ns = (self._n, float(arrival_ns)), 0.0
        self._earliest_ns = min(self._earliest_ns, late_ns)
        if arrival_ns >= self._check_ns:
            n_lost = self._check(arrival_ns)
        self._last_ns = max(self._last_ns, min(round(self._on_line()), arrival_ns))
        return Stamp(self._last_ns, n_lost)

    def room(self, n_samples: int, arrival_ns: int) -> int:
        """Return how many samples can be missing before those that arrive, if none of them is from the future."""
        if self._line is None:
            return 2**31
        ahead_ns = self._on_line() + n_samples * self._period_ns - arrival_ns
        return max(0, math.floor((_FUTURE_NS - ahead_ns) / self._period_ns))

    @property
    def measured_hz(self) -> float | None:
        """Samples per second over the last ten seconds, the missing ones counted in; ``None`` before 0.2 s."""
        # A copy, since another thread may ask while samples arrive.
        points = list(self._points)
        if len(points) < 3 or points[-1][1] - points[0][1] < _LEAST_FIT_NS:
            return None
        n0, t0 = points[0]
        # Least squares of the number of samples against the time of arrival.
        times = [(t - t0) * 1e-9 for _, t in points]
        mean_t = sum(times) / len(times)
        mean_n = sum(n - n0 for n, _ in points) / len(times)
        spread = sum((t - mean_t) ** 2 for t in times)
        slope = sum((t - mean_t) * (n - n0 - mean_n) for t, (n, _) in zip(times, points, strict=True))
        return slope / spread if spread > 0 else None

    def proves(self, rate_hz: float, tolerance: float) -> bool:
        """Return whether the true rate is within a tolerance of a rate, however late samples were delivered.

        Each may have come up to 16 ms late, or as late as the arrivals themselves show, if that is more. From
        the first to the last, so much more or less time may have passed than between their arrivals: 5 % are
        proven in a third of a second.
        """
        points, seconds = list(self._points), self.measured_s
        if seconds <= _LATE_S or points[-1][0] == points[0][0]:
            return False
        (n0, first_ns), n = points[0], points[-1][0] - points[0][0]
        off_line_s = [(t - first_ns) * 1e-9 - (k - n0) * seconds / n for k, t in points]
        late_s = max(_LATE_S, max(off_line_s) - min(off_line_s))
        least, most = n / (seconds + late_s), math.inf if seconds <= late_s else n / (seconds - late_s)
        return rate_hz * (1 - tolerance) <= least and most <= rate_hz * (1 + tolerance)

    @property
    def measured_s(self) -> float:
        """Time over which the rate was measured, seconds."""
        return (self._points[-1][1] - self._points[0][1]) * 1e-9 if self._points else 0.0

    def restart(self) -> None:
        """Count and stamp afresh from the next arrival on, at the rate known so far."""
        self._period_ns = 1e9 / (self.measured_hz or 1e9 / self._period_ns)
        self._n, self._line, self._pauses_ns, self._earliest_ns = 0, None, (0, 0), math.inf
        self.forget_rate()

    def forget_rate(self) -> None:
        """Restart the measurement: the number of samples between the arrivals so far is unknown."""
        self._points.clear()

    def _on_line(self) -> float:
        n, t_ns = self._line or (0, 0.0)
        return t_ns + (self._n - n) * self._period_ns

    def _check(self, arrival_ns: int) -> int:
        """Raise the line to the earliest arrival of the last second, and count whole turns that went missing."""
        n_lost, late_ns = 0, self._earliest_ns
        if self._turn is not None:
            # While packets were lost none arrived; a stream that has only become slow has no such pause.
            lost_ns = min(late_ns, max(self._pauses_ns))
            n_lost = math.floor(lost_ns / self._period_ns / self._turn + 0.25) * self._turn
        if n_lost:
            self._n += n_lost
            self.forget_rate()
        elif (rate_hz := self.measured_hz) is not None and rate_hz > 0:
            on_line_ns, self._period_ns = self._on_line(), 1e9 / rate_hz
            self._line = (self._n, on_line_ns + late_ns)
        self._earliest_ns, self._check_ns = math.inf, arrival_ns + _POLL_NS
        self._pauses_ns = (0 if n_lost else self._pauses_ns[1], 0)
        return n_lost


LEAST_RATE_HZ = 125.0
"""Below it the 50 Hz low-pass would lie above 0.4 of the rate, where it filters next to nothing."""

RATE_TOLERANCE = 0.05
"""A rate further off than this is not the one the filter was made and calibrated for."""

LOST_TOLERANCE = 0.2
"""A running source this far off is given up: its levels would come late and from the wrong band."""


def too_slow(who: str, rate_hz: float | None, how: str) -> SampleRateError:
    """Return the error for a source below the minimum rate; ``how``: stated or measured."""
    text = "no rate at all" if rate_hz is None else f"{rate_hz:.4g} samples/s"
    return SampleRateError(
        f"{who} {how} {text}; the 50 Hz filter needs {LEAST_RATE_HZ:g}",
        "make the board send faster: no delay() in its loop, a higher baud rate, fewer characters a line",
    )


def wrong_rate(who: str, measured_hz: float, rate_hz: float) -> SampleRateError:
    """Return the error of a source whose rate is not the stated one."""
    if measured_hz < LEAST_RATE_HZ:
        return too_slow(who, measured_hz, "really sends")
    return SampleRateError(
        f"{who} really sends {measured_hz:.1f} samples/s, {rate_hz:g} were expected",
        f"set the board to {rate_hz:g}, or rate_hz to its real rate and calibrate again",
    )
