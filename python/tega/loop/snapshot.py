"""Show the newest moment of a loop, once per vest tick, to displays that have subscribed to it."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import NamedTuple

from tega.devices.base import optional
from tega.haptics import FINGERS, MotorLevels
from tega.loop.arm_records import ArmView
from tega.loop.hand import Hand, fresh_angles_rad
from tega.loop.inbox.inputs import Inputs, SeatSeen
from tega.loop.latency import LatencyTrace
from tega.loop.pacing import LoopReport
from tega.loop.touch import STALE_NS
from tega.records import Contact, Event, Intent, Record
from tega.records.bus import Bus
from tega.safety.guard import Guard

_EVENT_NS = 3_000_000_000


class LoopView(NamedTuple):
    """View of the loop, once per vest tick, and where there is a guard once more when it has stopped.

    Attributes:
        t_ns: Time since the start of the session.
        contacts: The newest contact of each finger, however old; a finger without a frame yet is missing.
        vest: The newest frame that the vest confirmed as sent; the computed frame where no vest is connected; ``None``
            before the first.
        intent: The newest intent; ``None`` before the first.
        angles_rad: The hand's 16 joint angles as reported, modelled where no hand is connected; ``None`` without EMG,
            and while the hand is silent.
        counts: Counts since the start: frames of one finger (mean), EMG blocks, hand ticks, vest frames.
        inputs: State of the operator's input devices, by seat.
        state: State of the run, with its reason; ``""`` without a guard.
        alerts: Current problems, one sentence each.
        latency: Latency of touch and motion, in one line; ``""`` if it is not traced.
        arm: State of the arm and its reason, in one line; ``""`` without an arm.
        seen_arm: Full view of the arm; ``None`` if it is unknown.
        link: State of the link to the other station, in one line; ``""`` on one machine.
        arm_height_m: Height of the arm's end as measured, metres over its base; ``None`` where that is not known.
        event: The newest event of touch; ``None`` before the first.
        target_rad: The 16 joint angles that the hand steers to; ``None`` if it does not report them.
        vest_condition: Status reported by the vest, such as name, link and battery; ``""`` for none.
        reflex: Addition to the participant's own closure, and its reason; ``""`` without a reflex.
        command: Closure level of the newest command to the hand, including the reflex, 1 to 5; 0 if there is none.
        devices: Connected devices, out of ``emg``, ``hand`` and ``vest``; without files and models.
        fingers: Fingers to display, with or without a sensor.
        troubled: Names of the current problems, such as ``vest`` and ``link``.
    """

    t_ns: int
    contacts: Mapping[str, Contact]
    vest: MotorLevels | None
    intent: Intent | None
    angles_rad: Sequence[float] | None
    counts: Mapping[str, int]
    inputs: Mapping[str, SeatSeen] = {}
    state: str = ""
    reason: str = ""
    alerts: Sequence[str] = ()
    latency: str = ""
    arm: str = ""
    seen_arm: ArmView | None = None
    link: str = ""
    arm_height_m: float | None = None
    event: Event | None = None
    target_rad: Sequence[float] | None = None
    vest_condition: str = ""
    reflex: str = ""
    command: float = 0.0
    devices: frozenset[str] = frozenset()
    fingers: Sequence[str] = FINGERS
    troubled: frozenset[str] = frozenset()

    @property
    def t_s(self) -> float:
        """Time since the start of the session, seconds."""
        return self.t_ns / 1e9

    @property
    def felt(self) -> dict[str, Contact]:
        """The contacts that are not too old to be felt, by finger."""
        return {name: one for name, one in self.contacts.items() if self.t_ns - one.t_ns <= STALE_NS}

    @property
    def picture_to_vest_ms(self) -> dict[str, float]:
        """Mean age of the fresh pictures in this tick's vest frame, ms, by the delay's name; empty without one."""
        ages_ms = [(self.t_ns - contact.t_ns) / 1e6 for contact in self.felt.values()]
        return {"picture to vest": sum(ages_ms) / len(ages_ms)} if ages_ms else {}

    @property
    def newest_event(self) -> str:
        """The newest event of touch in words, ``""`` once it is three seconds old."""
        if self.event is None or (age_ns := self.t_ns - self.event.t_ns) > _EVENT_NS:
            return ""
        return f"{self.event.words}, {max(age_ns, 0) / 1e9:.1f} s ago"


class Snapshot(Record, frozen=True, kw_only=True):
    """View of the loop at a tick of the vest; it has no topic, for it is made of records that have one."""

    t_ns: int
    view: LoopView


class Moments:
    """Makes the view of a loop for displays, and publishes it on the bus.

    ``hand`` has the joints' angles, ``None`` without EMG. ``devices`` are the connected ones, out of ``emg``, ``hand``
    and ``vest``; the functions ``complete`` add to the view, one after the other. ``fingers`` are the session's:
    displays show them, or the vest's four if all are among those.
    """

    def __init__(
        self,
        bus: Bus,
        hand: Hand | None = None,
        *,
        inputs: Inputs | None = None,
        guard: Guard | None = None,
        trace: LatencyTrace | None = None,
        devices: frozenset[str] = frozenset(),
        fingers: Collection[str] = (),
        complete: Sequence[Callable[[LoopView], LoopView]] = (),
    ) -> None:
        self._bus, self._hand = bus, hand
        self._inputs, self._guard, self._trace, self._complete = inputs, guard, trace, complete
        self._devices = devices
        self._fingers = FINGERS if set(fingers) <= set(FINGERS) else tuple(fingers)
        self._displayed: Snapshot | None = None
        self._event: Event | None = None
        if self.wanted:
            bus.subscribe(Event, self._note_event, name="display", vital=True)

    @property
    def wanted(self) -> bool:
        """Whether a display has subscribed."""
        return self._bus.wants(Snapshot)

    def show(
        self,
        t_ns: int,
        newest: Mapping[str, Contact],
        vest: MotorLevels | None,
        intent: Intent | None,
        report: LoopReport,
        *,
        command: float,
    ) -> None:
        """Publish the view at a tick."""
        guard, trace = self._guard, self._trace
        angles_rad = None if self._hand is None else fresh_angles_rad(self._hand)
        target_rad = optional(self._hand, "target_rad")
        view = LoopView(
            t_ns,
            newest,
            vest,
            intent,
            None if angles_rad is None else angles_rad.tolist(),
            {
                "touch": sum(report.n_contacts.values()) // max(len(report.n_contacts), 1),
                "levels": report.n_blocks,
                "hand": report.n_hand_ticks,
                "vest": report.n_vest_ticks + report.n_vest_between,
            },
            inputs={} if self._inputs is None else self._inputs.seen,
            event=self._event,
            target_rad=None if target_rad is None else target_rad.tolist(),
            command=command,
            devices=self._devices,
            fingers=self._fingers,
        )
        if guard is not None:
            view = view._replace(
                state=guard.state,
                reason=guard.reason,
                alerts=tuple(guard.alerts.values()),
                troubled=frozenset(guard.alerts),
                latency="" if trace is None else trace.line,
            )
        for complete in self._complete:
            view = complete(view)
        self._displayed = Snapshot(t_ns=t_ns, view=view)
        self._bus.publish(self._displayed)

    def stopped(self, vest: MotorLevels | None, problems: Sequence[str]) -> None:
        """Publish the last view as stopped, with errors on the way out: a display must not show that things move.

        ``vest`` is the newest frame that the vest confirmed; not zeros if it did not confirm them.
        """
        if self._displayed is not None and self._guard is not None:
            view = self._displayed.view
            view = view._replace(
                state="stopped",
                reason=self._guard.reason,
                vest=vest,
                command=0.0,
                target_rad=None,
                arm=view.arm and "the run has ended",
                seen_arm=None,
                reflex="",
                alerts=(*view.alerts, *(f"on the way out: {problem}" for problem in problems)),
            )
            self._bus.publish(Snapshot(t_ns=self._displayed.t_ns, view=view))

    def _note_event(self, event: Event) -> None:
        self._event = event
