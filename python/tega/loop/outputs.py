"""Write to the outputs of the loop: vest frames to every vest and file, a level's frames to every bus of the hand."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol, TypeVar

from tega import records
from tega.devices.base import VestSink, WatchedHand, optional
from tega.hand import split_level
from tega.haptics import MotorLevels
from tega.loop.hand import Hand, fresh_angles_rad
from tega.loop.latency import LatencyTrace
from tega.loop.reflex import ReflexArc
from tega.loop.touch import TouchLoop
from tega.records import Contact, Event, HandCommand, Joints, bus_frames
from tega.records.bus import Bus
from tega.wire import CanFrame


def attempt(problems: list[BaseException], call: Callable[..., Any], *arguments: Any) -> Any:
    """Return what a call on the way out returns; its error, a panic of native code included, is put to the others."""
    try:
        return call(*arguments)
    except BaseException as error:  # reported by the caller
        problems.append(error)
        return None


class HandOutput:
    """Steers one hand at every tick of the loop; commands and joint angles are published on the bus.

    ``model`` turns levels into frames for every sink. ``level`` is the closure of the newest command, with the reflex;
    0 before the first and after the last.
    """

    def __init__(
        self,
        model: Hand,
        sinks: Sequence[Sink[Sequence[CanFrame]]] = (),
        *,
        bus: Bus,
        reflex: ReflexArc | None = None,
        trace: LatencyTrace | None = None,
    ) -> None:
        self._model, self._sinks, self._bus = model, sinks, bus
        self._reflex, self._trace = reflex, trace
        if isinstance(model, WatchedHand):
            model.watched = True  # a loop that hangs must not leave it pushing
        self._frames: Sequence[CanFrame] = ()
        self.level: float = 0
        self.wants_events = reflex is not None and reflex.reflex.wants_events
        if reflex is not None and self.wants_events:
            bus.subscribe(Event, reflex.on_event, name="reflex", vital=True)

    def step(
        self, t_ns: int, level: float, contacts: Callable[[], Mapping[str, Contact]], *, imposed: bool
    ) -> None:
        """Send the hand the frames of a tick; ``level`` is without the reflex, ``imposed`` if not the muscles' own."""
        added = 0.0 if self._reflex is None else self._reflex.step(t_ns, level, contacts)
        self.level = level + added
        self._frames = self._model.step(level, added)
        for sink in self._sinks:
            sink.write(t_ns, self._frames)
        self.publish_command(t_ns)
        if self._trace is not None:
            self._trace.commanded(None if imposed else level)

    def limp(self, t_ns: int) -> list[BaseException]:
        """Leave the hand without force, whatever happens; return the errors. The caller publishes the command."""
        problems: list[BaseException] = []
        self.level, self._frames = 0, ()
        self._frames = attempt(problems, self._model.limp) or ()
        for sink in self._sinks:
            attempt(problems, sink.write, t_ns, self._frames)
        return problems

    def publish_command(self, t_ns: int) -> None:
        """Publish the newest command."""
        if self._bus.wants(HandCommand):
            whole, closure = split_level(self.level)
            self._bus.publish(
                HandCommand(t_ns=t_ns, level=whole, frames=bus_frames(self._frames), closure=closure)
            )

    def publish_joints(self, t_ns: int) -> None:
        """Publish the joint angles, unless no command stands or the hand is silent."""
        if not (self.level and self._bus.wants(Joints)):
            return
        if (angles_rad := fresh_angles_rad(self._model)) is not None:
            self._bus.publish(Joints(t_ns=t_ns, angles_rad=tuple(angles_rad.tolist())))


Sent_contra = TypeVar("Sent_contra", contravariant=True)


class Sink(Protocol[Sent_contra]):
    """Output of the loop: a vest or a hand's bus, real, recorded or simulated."""

    def write(self, t_ns: int, sent: Sent_contra, /) -> object:
        """Write an output of the loop, with its time since the start of the session."""


class MotorTrials(Protocol):
    """Changes frames on their way to the vest while it is ``active``: motors are tried, or frames are as recorded."""

    @property
    def active(self) -> bool: ...  # noqa: D102  # above

    def frame(self, t_ns: int, frame: MotorLevels) -> MotorLevels:
        """Return the frame of a tick, changed."""

    def sent(self, t_ns: int, sent: MotorLevels | None) -> None:
        """Note the frame that a real vest sent; ``None`` without a vest."""


class VestOutput:
    """Makes vest frames and writes them to every vest; ``frame`` is the newest computed, ``None`` before one.

    ``live_vests`` are real; the frames that they sent are published, as are frames and changes of ``haptics``. That is
    called for each frame; every motor rests while it returns false. ``now_ns`` returns the time since the start of the
    session, ``rate_hz`` is ticks per second. ``by_frame`` is whether a picture between two ticks wakes the loop.
    """

    def __init__(
        self,
        touch: TouchLoop,
        vests: Sequence[Sink[MotorLevels]] = (),
        *,
        live_vests: Sequence[VestSink] = (),
        bus: Bus,
        now_ns: Callable[[], int],
        rate_hz: float = 30.0,
        by_frame: bool = False,
        haptics: Callable[[], bool] = lambda: True,
        tests: MotorTrials | None = None,
        trace: LatencyTrace | None = None,
    ) -> None:
        self._touch, self._vests, self._live_vests = touch, vests, live_vests
        self._in_steps = bool(live_vests) and all(optional(vest, "in_steps") for vest in live_vests)
        self._haptics, self._trace, self._bus, self._now_ns = haptics, trace, bus, now_ns
        self.rate_hz, self.by_frame, self._tests = rate_hz, by_frame, tests
        self._n_requested, self._on = 0, True
        self._sent: MotorLevels | None = None
        self.frame: MotorLevels | None = None

    @property
    def driven(self) -> bool:
        """Whether frames are due without a finger: a motor is tried, or a program sends them."""
        return self._tests is not None and self._tests.active

    @property
    def confirmed(self) -> MotorLevels | None:
        """The newest frame that the real vest confirmed as sent; the computed frame where there is no real vest."""
        return self._sent if self._live_vests else self.frame

    def refresh(self, t_ns: int) -> None:
        """Make the frame of a tick, and write it to every vest."""
        self._make(t_ns, only_news=False)

    def follow(self, t_ns: int) -> bool:
        """Make a frame between two ticks; write it unless it equals the one before, and return whether."""
        return self._make(t_ns, only_news=True)

    def silence(self, t_ns: int) -> list[BaseException]:
        """Stop every motor in any case; return the error in words."""
        problems: list[BaseException] = []
        silence = self._touch.silence()
        self.frame = None if self.frame is None else silence
        for vest in self._live_vests:
            attempt(problems, self._send, vest, t_ns, silence)
        for sink in self._vests:
            attempt(problems, sink.write, t_ns, silence)
        attempt(problems, self._publish, records.VestFrame, t_ns, silence)
        return problems

    def _send(self, vest: VestSink, t_ns: int, frame: MotorLevels) -> None:
        self._sent = vest.write(t_ns, frame)
        self._publish(records.SentFrame, t_ns, self._sent)

    def _allowed(self, t_ns: int) -> bool:
        """Return whether motors may turn, and publish a change."""
        on = self._haptics()
        if on != self._on:
            self._on = on
            self._bus.publish(records.Haptics(t_ns=t_ns, n_asked=self._n_requested, on=on))
        self._n_requested += 1
        return on

    def _changes(self, before: MotorLevels | None, frame: MotorLevels) -> bool:
        """Whether a real vest shows something else with a frame than with the one before."""
        if before is None or not self._live_vests:
            return bool(self._live_vests)
        return frame != before and not (self._in_steps and _same_steps(frame, before))

    def _publish(self, kind: type[records.VestRecord], t_ns: int, frame: MotorLevels) -> None:
        if self._bus.wants(kind):
            percent = tuple(frame.intensities.tolist())
            self._bus.publish(
                kind(t_ns=t_ns, layout=frame.layout, intensities=percent, handed_ns=self._now_ns())
            )

    def _make(self, t_ns: int, *, only_news: bool) -> bool:
        trace = self._trace
        began_ns = 0 if trace is None else trace.now_ns()
        frame = self._touch.frame(t_ns) if self._allowed(t_ns) else self._touch.silence()
        trial = self._tests if self._tests is not None and self._tests.active else None
        if trial is not None:
            frame = trial.frame(t_ns, frame)
        made_ns = 0 if trace is None else trace.now_ns()
        before = self.frame
        if news := before is None or not only_news or frame != before:
            self.frame = frame
            for vest in self._live_vests:
                self._send(vest, t_ns, frame)
            if trial is not None:
                trial.sent(t_ns, self._sent)
        if trace is not None:
            trace.vest(t_ns, began_ns, made_ns, changed=self._changes(before, frame))
        if news:
            for sink in self._vests:
                sink.write(t_ns, frame)
            self._publish(records.VestFrame, t_ns, frame)
        return news


def _same_steps(one: MotorLevels, other: MotorLevels) -> bool:
    """Whether a vest that shows 16 steps shows the same, with the same motors at rest."""
    return (
        one.layout == other.layout
        and one.levels.tobytes() == other.levels.tobytes()
        and (one.intensities == 0).tobytes() == (other.intensities == 0).tobytes()
    )
