"""What the wearer is told: the touch loop's frames, to every sink that wants them, when they want them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from tega.haptics import VestFrame
    from tega.teleop.keepalive import KeepAlive
    from tega.teleop.latency import LatencyTrace
    from tega.teleop.loop_report import LoopReport
    from tega.teleop.touch import TouchLoop

__all__ = ["VestOutput"]


class _Sink(Protocol):
    def write(self, t_ns: int, sent: VestFrame, /) -> object: ...


class VestOutput:
    """Makes vest frames and hands them on.

    Args:
        touch: What the fingers feel.
        report: Counted up along the way.
        vests: Where every frame goes.
        kept: Vests that are sent what changed, and what did not as a keep-alive.
        haptics: Asked for each frame; every motor rests while it says no.
        trace: Follows camera frames through the loop.

    Attributes:
        frame: The newest frame; ``None`` before the first.
    """

    def __init__(
        self,
        touch: TouchLoop,
        report: LoopReport,
        *,
        vests: Sequence[_Sink],
        kept: Sequence[KeepAlive] = (),
        haptics: Callable[[], bool] = lambda: True,
        trace: LatencyTrace | None = None,
    ) -> None:
        self._touch = touch
        self._report = report
        self._vests = vests
        self._kept = kept
        self._haptics = haptics
        self._trace = trace
        self.frame: VestFrame | None = None

    def refresh(self, t_ns: int) -> None:
        """Make the frame of a tick, and give it to everyone."""
        self._make(t_ns, only_news=False)
        self._report.n_vest_ticks += 1

    def follow(self, t_ns: int) -> None:
        """Make a frame because something new is felt, and give it on unless it equals the one before."""
        self._report.n_vest_between += self._make(t_ns, only_news=True)

    def silence(self, t_ns: int) -> list[Exception]:
        """Let every motor rest, whatever happens; return what went wrong."""
        problems: list[Exception] = []
        sinks: list[_Sink] = [*self._kept, *self._vests]
        for sink in sinks:
            try:
                sink.write(t_ns, self._touch.silence())
            except Exception as error:  # reported by the caller
                problems.append(error)
        return problems

    def _make(self, t_ns: int, *, only_news: bool) -> bool:
        trace = self._trace
        began_ns = 0 if trace is None else trace.now_ns()
        frame = self._touch.frame(t_ns) if self._haptics() else self._touch.silence()
        made_ns = 0 if trace is None else trace.now_ns()
        before, changed = self.frame, False
        if news := before is None or not only_news or frame != before:
            self.frame = frame
            for kept in self._kept:
                changed = changed or not kept.shows(frame)
                if kept.offer(t_ns, frame):
                    self._report.n_vest_sent += 1
                else:
                    self._report.n_vest_skipped += 1
        if trace is not None:
            trace.vest(t_ns, began_ns, made_ns, changed=changed)
        if news:
            for sink in self._vests:
                sink.write(t_ns, frame)
        return news
