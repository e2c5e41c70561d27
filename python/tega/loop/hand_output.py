"""Steer the hand: turn a level and the reflex's addition into frames for every bus; end without force."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from tega.hand import split_level
from tega.loop.hand import Hand
from tega.loop.latency import LatencyTrace
from tega.loop.reflex import ReflexArc
from tega.loop.sink import Sink
from tega.records import Contact, Event, HandCommand, Joints, bus_frames
from tega.records.bus import Bus
from tega.wire import CanFrame


class HandOutput:
    """Steers one hand at every tick of the loop; commands and joint angles are published on the bus.

    ``model`` turns levels into frames for every sink. ``reflex`` adds to the person's level and receives
    events of touch from the bus. ``trace`` follows blocks of EMG to the hand. ``level`` is the closure of the
    newest command, with the reflex; 0 before the first and after the last.
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
        self._frames: Sequence[CanFrame] = ()
        self.level: float = 0
        self.wants_events = reflex is not None and reflex.reflex.wants_events
        if reflex is not None and self.wants_events:
            bus.subscribe(Event, reflex.on_event, name="reflex", vital=True)

    def step(
        self, t_ns: int, level: float, contacts: Callable[[], Mapping[str, Contact]], *, imposed: bool
    ) -> None:
        """Send the hand the frames of a tick; ``level`` is without the reflex, 1 to 5 with fractions.

        ``contacts`` returns the newest contact of each finger with a fresh frame; ``imposed`` is whether the
        level is not the muscles' own.
        """
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
        try:
            self._frames = self._model.limp()
        except BaseException as error:  # a panic of native code, too; reported by the caller
            problems.append(error)
        for sink in self._sinks:
            try:
                sink.write(t_ns, self._frames)
            except BaseException as error:  # likewise
                problems.append(error)
        return problems

    def publish_command(self, t_ns: int) -> None:
        """Publish the newest command."""
        if self._bus.wants(HandCommand):
            whole, closure = split_level(self.level)
            self._bus.publish(
                HandCommand(t_ns=t_ns, level=whole, frames=bus_frames(self._frames), closure=closure)
            )

    def publish_joints(self, t_ns: int) -> None:
        """Publish the joint angles, unless no command stands."""
        if self.level and self._bus.wants(Joints):
            self._bus.publish(Joints(t_ns=t_ns, angles_rad=tuple(self._model.angles_rad.tolist())))
