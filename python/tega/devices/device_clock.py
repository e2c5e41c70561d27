"""Convert the times that a device stamps to the monotonic clock, by when its packets arrive."""

from __future__ import annotations

from collections import deque

# A window long enough to hold a packet that was not held up, and short enough that two crystals do not part by 1 ms.
_WINDOW_NS = 10_000_000_000
# A device whose clock leaps by more than this against ours has been restarted.
_LEAP_NS = 1_000_000_000


class DeviceClock:
    """Turns a device's times into those of the monotonic clock.

    ``offset = min(arrival - device time)`` over the last 10 s: the packet with the shortest delay gives the clocks'
    difference, and packets that arrive later than that were delayed. The shortest delay itself cannot be measured
    from one end, so the age does not include it: 2 to 10 ms on a good wireless network.

    Attributes:
        delay_ns: How much longer the newest packet was on its way than the quickest one.
        n_leaps: Number of times that the device's clock was set.

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
