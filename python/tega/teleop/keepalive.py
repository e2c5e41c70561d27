"""A vest that is told what changed, and the rest only as often as it has to hear from us."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tega.devices.base import VestSink
    from tega.haptics import VestFrame

__all__ = ["KeepAlive"]


class KeepAlive:
    """Sends a vest every frame that it would show otherwise than the last one sent, and any before that grows old.

    A vest is reached over a radio link that carries 20 to 50 frames a second, and its driver or the vendor's
    software lets a frame lapse that is not renewed. An equal frame therefore goes out again so early that, with
    one offer per period, no two frames are further apart than the keep-alive (or than one period, where that is
    longer). What a vest can show is known by its driver.

    Args:
        sink: The vest.
        keep_alive_ns: The longest an unchanged frame may stand; 0 sends every frame.
        period_ns: Time between two offers, at the most.
        in_steps: Whether the vest shows the 16 steps of :attr:`tega.haptics.VestFrame.levels` and nothing between;
            frames with the same steps are equal then, if the same motors rest.

    Attributes:
        in_steps: The same.
        sent: The newest frame as the vest says it was sent.
    """

    def __init__(self, sink: VestSink, *, keep_alive_ns: int, period_ns: int, in_steps: bool = False) -> None:
        self.sink = sink
        self.in_steps = in_steps
        self._leave_out_ns = keep_alive_ns - period_ns
        self._last: VestFrame | None = None
        self.sent: VestFrame
        self._last_ns = 0

    @property
    def reached(self) -> bool:
        """Whether the vest can be reached, as far as its driver knows."""
        return bool(getattr(self.sink, "reached", True))

    def offer(self, t_ns: int, frame: VestFrame) -> bool:
        """Send a frame if it has to be sent.

        Args:
            t_ns: Time since the start of the session.
            frame: The frame of this tick.

        Returns:
            Whether it was sent.
        """
        if t_ns - self._last_ns <= self._leave_out_ns and self.shows(frame):
            return False
        self.write(t_ns, frame)
        return True

    def shows(self, frame: VestFrame) -> bool:
        """Whether the vest looks as if this frame had been the last one sent."""
        last = self._last
        if last is None or not self.in_steps:
            return frame == last
        return (
            frame.layout == last.layout
            and bool((frame.levels == last.levels).all())
            # Nobody knows how others round: a motor that is to rest is told at once.
            and bool(((frame.intensities == 0) == (last.intensities == 0)).all())
        )

    def write(self, t_ns: int, frame: VestFrame) -> None:
        """Send a frame whatever was sent before."""
        self.sent = self.sink.write(t_ns, frame)
        self._last, self._last_ns = frame, t_ns
