"""Send the touch loop's frames to every vest and file, each at its own rate."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Protocol

from tega import records
from tega.devices.base import optional

if TYPE_CHECKING:
    from tega.devices.base import VestSink
    from tega.haptics import MotorLevels
    from tega.loop.latency import LatencyTrace
    from tega.loop.loop_report import LoopReport
    from tega.loop.touch import TouchLoop
    from tega.records.bus import Bus


class _Writes(Protocol):
    def write(self, t_ns: int, sent: MotorLevels, /) -> object: ...


class VestOutput:
    """Makes vest frames and hands them on.

    Args:
        touch: What the fingers feel.
        report: Counted up along the way.
        vests: Where every frame goes.
        live_vests: Real vests, which get every frame, too; what they were sent is published.
        haptics: Asked for each frame; every motor rests while it says no.
        trace: Follows camera frames through the loop.
        bus: Told of every frame, of what real vests were sent, and of when motors may turn.
        now_ns: Time since the start of the session.
        tried: Given each frame; returns it with the motor that somebody tries.
        sent: Told what a real vest was sent of a frame; ``None`` where there is none.

    Attributes:
        frame: The newest frame; ``None`` before the first.
    """

    def __init__(
        self,
        touch: TouchLoop,
        report: LoopReport,
        *,
        vests: Sequence[_Writes],
        live_vests: Sequence[VestSink] = (),
        haptics: Callable[[], bool] = lambda: True,
        trace: LatencyTrace | None = None,
        bus: Bus,
        now_ns: Callable[[], int],
        tried: Callable[[int, MotorLevels], MotorLevels] = lambda _t_ns, frame: frame,
        sent: Callable[[int, MotorLevels | None], None] = lambda _t_ns, _sent: None,
    ) -> None:
        self._touch = touch
        self._report = report
        self._vests = vests
        self._live_vests = live_vests
        self._in_steps = bool(live_vests) and all(optional(vest, "in_steps") for vest in live_vests)
        self._haptics = haptics
        self._trace = trace
        self._bus = bus
        self._now_ns = now_ns
        self._tried, self._sent = tried, sent
        self._n_asked, self._on = 0, True
        self.frame: MotorLevels | None = None

    def refresh(self, t_ns: int) -> None:
        """Make the frame of a tick, and give it to everyone."""
        self._make(t_ns, only_news=False)
        self._report.n_vest_ticks += 1

    def follow(self, t_ns: int) -> bool:
        """Make a frame because something new is felt, and give it on unless it equals the one before.

        Returns:
            Whether it was given on.
        """
        news = self._make(t_ns, only_news=True)
        self._report.n_vest_between += news
        return news

    def silence(self, t_ns: int) -> list[BaseException]:
        """Let every motor rest, whatever happens; return what went wrong."""
        problems: list[BaseException] = []
        silence = self._touch.silence()
        for vest in self._live_vests:
            try:
                self._tell(records.SentFrame, t_ns, vest.write(t_ns, silence))
            except BaseException as error:  # a panic of native code, too; reported by the caller
                problems.append(error)
        for sink in self._vests:
            try:
                sink.write(t_ns, silence)
            except BaseException as error:  # likewise
                problems.append(error)
        try:
            self._tell(records.VestFrame, t_ns, silence)
        except Exception as error:  # of a vital subscriber
            problems.append(error)
        return problems

    def _allowed(self, t_ns: int) -> bool:
        """Ask whether motors may turn, and tell when the answer changes."""
        on = self._haptics()
        if on != self._on:
            self._on = on
            self._bus.publish(records.Haptics(t_ns=t_ns, n_asked=self._n_asked, on=on))
        self._n_asked += 1
        return on

    def _changes(self, before: MotorLevels | None, frame: MotorLevels) -> bool:
        """Whether a real vest shows something else with a frame than with the one before."""
        if before is None or not self._live_vests:
            return bool(self._live_vests)
        return frame != before and not (self._in_steps and _same_steps(frame, before))

    def _tell(self, kind: type[records.VestRecord], t_ns: int, frame: MotorLevels) -> None:
        if self._bus.wants(kind):
            percent = tuple(frame.intensities.tolist())
            self._bus.publish(
                kind(t_ns=t_ns, layout=frame.layout, intensities=percent, handed_ns=self._now_ns())
            )

    def _make(self, t_ns: int, *, only_news: bool) -> bool:
        trace = self._trace
        began_ns = 0 if trace is None else trace.now_ns()
        frame = self._touch.frame(t_ns) if self._allowed(t_ns) else self._touch.silence()
        frame = self._tried(t_ns, frame)
        made_ns = 0 if trace is None else trace.now_ns()
        before = self.frame
        if news := before is None or not only_news or frame != before:
            self.frame = frame
            sent = None
            for vest in self._live_vests:
                sent = vest.write(t_ns, frame)
                self._tell(records.SentFrame, t_ns, sent)
            self._sent(t_ns, sent)
        if trace is not None:
            trace.vest(t_ns, began_ns, made_ns, changed=self._changes(before, frame))
        if news:
            for sink in self._vests:
                sink.write(t_ns, frame)
            self._tell(records.VestFrame, t_ns, frame)
        return news


def _same_steps(one: MotorLevels, other: MotorLevels) -> bool:
    """Whether a vest that shows 16 steps shows the same, with the same motors at rest."""
    return (
        one.layout == other.layout
        and one.levels.tobytes() == other.levels.tobytes()
        and (one.intensities == 0).tobytes() == (other.intensities == 0).tobytes()
    )
