"""Track the recent course of fingertips and hand in a few numbers, at any frame rate.

Each quantity goes through a quick and a slow exponential mean. Their difference is how it has changed over about the
slow mean's time, without a buffer and whatever the interval between frames.
"""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple


class TouchFrame(NamedTuple):
    """Contact in one frame of a fingertip, in a picture of 240 x 320: the rules were fitted on such.

    Attributes:
        in_contact: Whether something is touched.
        eda: Contact area, pixels (Eq 5).
        mass: Sum of the pressure map, grey values.
        peak: Its largest value, grey values.
        x: Centroid, pixels.
        y: Centroid, pixels.
    """

    in_contact: bool
    eda: float
    mass: float
    peak: float
    x: float
    y: float

    def resized(self, width: int, height: int) -> TouchFrame:
        """Return what the same touch of the same gel is in a picture of 240 x 320 instead of this size."""
        by = 400.0 / math.hypot(width, height)
        return self._replace(eda=self.eda * by**2, mass=self.mass * by**2, x=self.x * by, y=self.y * by)


class TwoMeans:
    """A quantity's quick and slow mean; NaN before the first value, and from a NaN to the next value."""

    def __init__(self, quick_s: float, slow_s: float) -> None:
        self._quick_s, self._slow_s = quick_s, slow_s
        self.quick = self.slow = math.nan
        self._t_s = 0.0

    def add(self, t_s: float, value: float) -> None:
        """Take in a value; the first one is both means."""
        dt_s, self._t_s = max(t_s - self._t_s, 0.0), t_s
        if math.isnan(self.quick):
            self.quick = self.slow = value
        else:
            self.quick -= (value - self.quick) * math.expm1(-dt_s / self._quick_s)
            self.slow -= (value - self.slow) * math.expm1(-dt_s / self._slow_s)

    @property
    def change(self) -> float:
        """Change of the quantity lately; 0 before the first value."""
        return 0.0 if math.isnan(self.quick) else self.quick - self.slow


class Low:
    """Tracks how far a quantity has fallen since a moment, and whether it was ever so low before.

    A value counts as now up to an age of ``before_s``, as before from then on.
    """

    def __init__(self, before_s: float) -> None:
        self._before_s = before_s
        self._young: deque[tuple[float, float]] = deque()
        self._first = self._lowest = self._now = math.nan

    def add(self, t_s: float, value: float) -> None:
        """Take in a value; the first is the moment's."""
        if math.isnan(self._first):
            self._first = self._lowest = value
        self._now = value
        self._young.append((t_s, value))
        while self._young[0][0] <= t_s - self._before_s:
            self._lowest = min(self._lowest, self._young.popleft()[1])

    @property
    def fallen(self) -> float:
        """Fall below the first value; 0 before that."""
        return 0.0 if math.isnan(self._first) else self._first - self._now

    @property
    def below(self) -> float:
        """Fall below the lowest value before; 0 where it is not below."""
        return 0.0 if math.isnan(self._first) else max(self._lowest - self._now, 0.0)


class SinkTrack:
    """One fingertip's way down against the palm, by the hand's joints, for at most ``longest_s`` back."""

    def __init__(self, longest_s: float) -> None:
        self._longest_s = longest_s
        self._heights: deque[tuple[float, float]] = deque()

    def add(self, t_s: float, height_mm: float) -> None:
        """Take in its height over the palm, millimetres."""
        self._heights.append((t_s, height_mm))
        while len(self._heights) > 2 and self._heights[1][0] <= t_s - self._longest_s:
            self._heights.popleft()

    def speed_mm_s(self, over_s: float) -> float:
        """Return how fast it has sunk in the mean over so long, millimetres a second; 0 before that."""
        now_s, now_mm = self._heights[-1]
        for t_s, height_mm in reversed(self._heights):
            # A step that ends a rounding error short of the time has reached it.
            if now_s - t_s >= over_s - 1e-6:
                return (height_mm - now_mm) / (now_s - t_s)
        return 0.0


class FingerTrack:
    """One fingertip's contact: ``mass`` is the logarithm of the map's sum, ``area`` the root of the area, pixels.

    ``since_s`` is when touching began or ended, minus infinity before the first frame.
    """

    def __init__(self, quick_s: float, slow_s: float) -> None:
        self.touching = False
        self.since_s = self.seen_s = -math.inf
        self._courses = [TwoMeans(quick_s, slow_s) for _ in range(5)]
        self.mass, self.peak, self.area, self.x, self.y = self._courses

    def add(self, t_s: float, touch: TouchFrame) -> None:
        """Take in a frame."""
        if touch.in_contact != self.touching:
            self.touching, self.since_s = touch.in_contact, t_s
        values = math.log(max(touch.mass, 1.0)), touch.peak, math.sqrt(touch.eda), touch.x, touch.y
        for course, value in zip(self._courses, values, strict=True):
            course.add(t_s, value if touch.in_contact else math.nan)
        self.seen_s = t_s

    @property
    def flow_px(self) -> float:
        """Distance that the contact's middle has moved lately, pixels."""
        return math.hypot(self.x.change, self.y.change)
