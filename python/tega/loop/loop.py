"""Run the dual loop: touch back to the wearer, intent forward to the hand, on one clock.

The hand has a tick of 3 ms. The vest has one too, 30 times a second; where ``by_frame`` is set, a picture that comes
between wakes the loop, and what it changes goes out at once.

It knows no device by name. Inputs are streams of stamped items, outputs are sinks, time comes from a pacer, and
ticks are taken in the order of their deadlines; what is stamped at or before a tick is taken in before it. With
recorded input and a manual clock it is therefore a function: the same input gives the same output.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Protocol, TypeVar

from msgspec.structs import replace

from tega.errors import TegaError
from tega.hand import joined_level, split_level
from tega.loop.hand import HAND_TICK_NS, Hand
from tega.loop.inbox.inputs import Inputs
from tega.loop.inbox.stream import NEVER_NS, Stream
from tega.loop.loop_report import LoopReport
from tega.loop.moment import LoopView, Moments
from tega.loop.opening import reached
from tega.loop.pacing import Pacer
from tega.loop.touch import STALE_NS, TouchLoop
from tega.loop.vest_output import VestOutput
from tega.records import Contact, Event, HandCommand, HandLook, Imposed, Intent, Joints, Skip, bus_frames
from tega.records.bus import Bus

if TYPE_CHECKING:
    from tega.devices.base import VestSink
    from tega.haptics import MotorLevels
    from tega.loop.latency import LatencyTrace
    from tega.loop.reflex import ReflexArc
    from tega.safety.guard import Guard
    from tega.wire import CanFrame


Sent_contra = TypeVar("Sent_contra", contravariant=True)

# Before the first block is complete nothing is known of the muscles: the hand keeps its most open pose.
FIRST_LEVEL = 1

# Without EMG there is no need to wake every 3 ms; sources and the wish to stop are still looked at this often.
IDLE_NS = 100_000_000

_ENDED = {"complete": "every source has ended", "duration": "the set time is over", "stopped": "stopped: "}


class Sink(Protocol[Sent_contra]):
    """An output of the loop: a vest or a hand's bus, real, recorded or simulated."""

    def write(self, t_ns: int, sent: Sent_contra, /) -> object:
        """Take what the loop sends at a time counted from the start of the session."""
        ...


class DualLoop:
    """Runs both loops until their sources end, the time is over, or it is told to stop.

    On every way out, an exception included, each vest is sent a frame of zeros and each hand zero torque and
    SERVO OFF.

    What is not there costs nothing: without EMG there are no ticks of the hand, without tactile sources none of the
    vest, unless somebody wants to see them pass.

    Args:
        pacer: Deadlines on the session's clock.
        touch: The back loop; ``None`` without tactile sources.
        contacts: Stream of measured frames, by finger, thumb first.
        levels: Stream of intents; ``None`` without EMG.
        hand: What turns levels into frames.
        vests: Where vest frames go, every one.
        hands: Where CAN frames go.
        bus: Told of all that comes in and goes out; see :mod:`tega.records`.
        live_vests: Real vests, which get every frame, too; what they were sent is published.
        vest_rate_hz: Ticks of the vest per second.
        by_frame: Whether a picture between two ticks wakes the loop; the pacer needs a bell that its source rings.
        haptics: Asked once per vest tick; every motor rests while it says no.
        inputs: The operator's input devices, looked at in every turn.
        guard: Knows the run's state; without one it is as if always active.
        trace: Follows frames and blocks through the loop.
        complete: Add to what displays see what the loop does not know, one after the other.
        endless: Whether a loop without any source goes on all the same, since something else does.
        tried: Given each vest frame; returns it with the motor that somebody tries.
        sent: Told what a real vest was sent of a frame; ``None`` where there is none.
        reflex: What it adds the hand is told beside the level that the person asks for; ``None`` without a reflex.
        look: Gives at each tick of the hand, by the level asked for, a look at hand and arm for the slips that mapping
            or reflex are told; ``None`` where it is too early for one. Without it slips are told by touch alone.
    """

    def __init__(
        self,
        *,
        pacer: Pacer,
        touch: TouchLoop,
        contacts: Mapping[str, Stream[Contact]],
        levels: Stream[Intent] | None,
        hand: Hand,
        vests: Sequence[Sink[MotorLevels]],
        hands: Sequence[Sink[Sequence[CanFrame]]],
        bus: Bus | None = None,
        live_vests: Sequence[VestSink] = (),
        vest_rate_hz: float = 30.0,
        by_frame: bool = False,
        haptics: Callable[[], bool] = lambda: True,
        inputs: Inputs | None = None,
        guard: Guard | None = None,
        trace: LatencyTrace | None = None,
        complete: Sequence[Callable[[LoopView], LoopView]] = (),
        endless: bool = False,
        tried: Callable[[int, MotorLevels], MotorLevels] = lambda _t_ns, frame: frame,
        sent: Callable[[int, MotorLevels | None], None] = lambda _t_ns, _sent: None,
        reflex: ReflexArc | None = None,
        look: Callable[[int, float], HandLook | None] | None = None,
    ) -> None:
        self._pacer = pacer
        self._touch = touch
        self._contacts = list(contacts.items())
        self._levels = levels
        self._streams: list[Stream[Contact] | Stream[Intent]] = list(contacts.values())
        if levels is not None:
            self._streams.append(levels)
        self._hand = hand
        self._hands = hands
        self._bus = Bus() if bus is None else bus
        self._vest_rate_hz = vest_rate_hz
        self._by_frame = by_frame
        self._inputs = Inputs({}) if inputs is None else inputs
        self._guard = guard
        self._trace = trace
        self._endless = endless
        self.reflex = reflex
        self._newest: dict[str, Contact] = {}
        self._intent: Intent | None = None
        self._felt_anew = False
        self._due_ns = 0
        self._wanted: float = FIRST_LEVEL
        self._imposed: float = 0
        self._asked: float = 0
        self._end_ns = NEVER_NS
        self.report = LoopReport(
            n_contacts=dict.fromkeys(contacts, 0),
            n_stale_ticks=dict.fromkeys(contacts, 0),
            level_ticks=dict.fromkeys(range(1, 6), 0),
        )
        self._moments = Moments(
            self._bus,
            None if levels is None else hand,
            self.report,
            inputs=self._inputs,
            guard=guard,
            trace=trace,
            complete=complete if reflex is None else [reflex.shown, *complete],
        )
        reflexive = reflex is not None and reflex.reflex.wants_events
        if self._moments.wanted or self._bus.wants(Event) or reflexive:
            touch.find_events()
        # Whoever only shows or records events has them by touch, for nothing.
        self._look = look if touch.mapping.wants_events or reflexive else None
        self._vest = VestOutput(
            touch,
            self.report,
            vests=vests,
            live_vests=live_vests,
            haptics=haptics,
            trace=trace,
            bus=self._bus,
            now_ns=pacer.elapsed_ns,
            tried=tried,
            sent=sent,
        )

    def run(self, *, duration_ns: int | None = None, stop: Callable[[], bool] = lambda: False) -> LoopReport:
        """Run both loops until they end.

        Args:
            duration_ns: End after this long; ``None`` when the last source ends.
            stop: Asked before every tick; the loop ends when it says so.

        Returns:
            What was done; also in :attr:`report` when an exception ends the run.
        """
        report, last_ns, why = self.report, 0, ""
        with_hand = self._levels is not None
        with_vest = bool(self._contacts) or self._moments.wanted
        step_ns = HAND_TICK_NS if with_hand else IDLE_NS
        reached("first tick")
        try:
            k_step = k_vest = 0
            while True:
                step_at_ns = k_step * step_ns
                vest_at_ns = round(k_vest * 1_000_000_000 / self._vest_rate_hz) if with_vest else NEVER_NS
                t_ns = min(step_at_ns, vest_at_ns)
                if stop():
                    report.ended, why = "stopped", getattr(stop, "reason", "") or "asked to"
                    break
                if duration_ns is not None and t_ns >= duration_ns:
                    self._wait(duration_ns)
                    last_ns = duration_ns
                    last_ns, report.ended = self._drain_final(duration_ns)
                    break
                if self._by_frame and (woken_ns := self._pacer.doze(t_ns)) < t_ns:
                    last_ns = woken_ns if self._take_in(woken_ns) else last_ns
                    self._follow(woken_ns)
                    continue
                in_time = self._wait(t_ns)
                last_ns = t_ns
                self._inputs.look(self._bus, self._pacer)
                if t_ns >= self._due_ns:
                    self._take_in(t_ns)
                if t_ns >= self._end_ns:
                    last_ns, report.ended = self._end_ns, "complete"
                    break
                self._update_guard(t_ns)
                if step_at_ns == t_ns:
                    k_step += 1
                if vest_at_ns == t_ns:
                    k_vest += 1
                if in_time:
                    self._tick(t_ns, hand=with_hand and step_at_ns == t_ns, vest=vest_at_ns == t_ns)
        except BaseException as error:
            report.end_ns = last_ns
            for problem in self._leave(last_ns, _told(error)):
                error.add_note(f"on the way out: {problem}")
            raise
        report.end_ns = last_ns
        for problem in self._leave(last_ns, f"{_ENDED[report.ended]}{why}"):
            raise problem
        return report

    def _wait(self, t_ns: int) -> bool:
        """Wait for a deadline; return whether its tick is to be carried out."""
        in_time = self._pacer.wait(t_ns)
        if not in_time:
            self._bus.publish(Skip(t_ns=t_ns))
        return in_time

    def _update_guard(self, t_ns: int) -> None:
        """Have the guard look at what came in."""
        guard, late_ns = self._guard, self._pacer.late_ns
        if guard is None or not guard.due(t_ns, late_ns):
            return
        stamps = {finger: contact.t_ns for finger, contact in self._newest.items()}
        counts = dict(self.report.n_contacts)
        unvoted = None
        if (intent := self._intent) is not None:
            stamps["emg"], unvoted = intent.t_ns, None if any(intent.channels) else self._wanted
            counts["emg"] = self.report.n_blocks
        released = ""
        if (dead_man := self._inputs.seen.get("dead_man")) is not None and not dead_man.held:
            released = f"dead-man: {dead_man.words('dead_man')}"
        guard.look(t_ns, late_ns=late_ns, stamps=stamps, counts=counts, unvoted=unvoted, released=released)

    def _drain_final(self, duration_ns: int) -> tuple[int, str]:
        """Take in what came before a set time was over, and tell when and how the run ended."""
        if self._due_ns < duration_ns:
            self._take_in(duration_ns - 1)
        if self._end_ns < duration_ns:
            return self._end_ns, "complete"
        return duration_ns, "duration"

    def _take_in(self, t_ns: int) -> bool:
        """Take in everything stamped up to a time, in the order of the stamps, thumb first among equals.

        Returns:
            Whether there was anything.
        """
        taken = False
        heads: dict[str, Contact] = {}
        while True:
            for finger, stream in self._contacts:
                if finger not in heads and (head := stream.next_until(t_ns)) is not None:
                    heads[finger] = head
            if not heads:
                break
            first = min((f for f, _ in self._contacts if f in heads), key=lambda f: heads[f].t_ns)
            self._feel(first, heads.pop(first))
            taken = self._felt_anew = True
        if self._levels is not None:
            while (intent := self._levels.next_until(t_ns)) is not None:
                self._intent = replace(intent, taken_ns=self._pacer.tick_ns)
                self._wanted = joined_level(intent.level, intent.closure)
                taken = True
                self.report.n_blocks += 1
                if self._trace is not None:
                    self._trace.taken("emg", intent.t_ns)
                self._bus.publish(self._intent)
        self._note_next_due()
        return taken

    def _note_next_due(self) -> None:
        """Note when there is something to take in again, and when the last source ended once all have."""
        due_ns, ended = NEVER_NS, True
        for stream in self._streams:
            due_ns = min(due_ns, stream.due_ns)
            ended = ended and stream.ended
        self._due_ns = due_ns
        if ended and (self._streams or not self._endless):
            self._end_ns = max((stream.end_ns for stream in self._streams), default=0)

    def _feel(self, finger: str, contact: Contact) -> None:
        felt = self._touch.update(finger, contact)
        taken = replace(felt, taken_ns=self._pacer.tick_ns, known_ns=self._pacer.elapsed_ns())
        self._newest[finger] = taken
        self.report.n_contacts[finger] += 1
        if self._trace is not None:
            self._trace.taken(finger, taken.t_ns)
        if self._bus.wants(Contact):
            self._bus.publish(taken)
        self._tell_events(self._touch.found)

    def _look_at_hand(self, t_ns: int) -> None:
        """Tell the slips that hand and arm show."""
        look = None if self._look is None or not self._asked else self._look(t_ns, self._asked)
        if look is None:
            return
        self._bus.publish(look)
        if slips := self._touch.look(look):
            self._felt_anew = True
            self._tell_events(slips)

    def _tell_events(self, found: Sequence[Event]) -> None:
        if self.reflex is not None:
            self.reflex.heard(found)
        for event in found:
            told = replace(event, taken_ns=self._pacer.tick_ns)
            self._moments.event = told
            self._bus.publish(told)

    def _tick(self, t_ns: int, *, hand: bool, vest: bool) -> None:
        if not vest:
            self._follow(t_ns)
        if hand:
            self._tick_hand(t_ns)
        if vest:
            self._tick_vest(t_ns)

    def _tick_hand(self, t_ns: int) -> None:
        self._look_at_hand(t_ns)
        wanted = self._wanted
        level = wanted if self._guard is None else self._guard.level(wanted)
        imposed = level if level != wanted else 0
        if imposed != self._imposed:
            self._imposed = imposed
            whole, closure = split_level(imposed)
            self._bus.publish(Imposed(t_ns=self._pacer.tick_ns, level=whole, closure=closure))
        added = 0.0
        if self.reflex is not None:
            level, added = self.reflex.step(t_ns, level, partial(self._touch.fresh_contacts, t_ns))
        self._asked = level + added
        frames = self._hand.step(level, added)
        for sink in self._hands:
            sink.write(t_ns, frames)
        self._tell_hand(t_ns, frames)
        if self._trace is not None:
            self._trace.commanded(level if level == wanted else None)
        self.report.n_hand_ticks += 1
        self.report.level_ticks[split_level(self._asked)[0]] += 1

    def _tell_hand(self, t_ns: int, frames: Sequence[CanFrame]) -> None:
        if self._bus.wants(HandCommand):
            whole, closure = split_level(self._asked)
            self._bus.publish(HandCommand(t_ns=t_ns, level=whole, frames=bus_frames(frames), closure=closure))

    def _tell_joints(self, t_ns: int) -> None:
        """Tell where the joints are beside every frame of the vest, once the hand was asked for something."""
        if self._asked and self._bus.wants(Joints):
            self._bus.publish(Joints(t_ns=t_ns, angles_rad=tuple(self._hand.angles_rad.tolist())))

    def _follow(self, t_ns: int) -> None:
        """Between two ticks, tell the vest what has come, if that changes anything."""
        if self._by_frame and self._felt_anew:
            self._felt_anew = False
            if self._vest.follow(t_ns):
                self._tell_joints(t_ns)

    def _tick_vest(self, t_ns: int) -> None:
        self._felt_anew = False
        if self._contacts:
            self._vest.refresh(t_ns)
            self._tell_joints(t_ns)
            if self._trace is not None and self._guard is not None:
                self._guard.alert("latency", self._trace.warning)
            for finger, _ in self._contacts:
                newest = self._newest.get(finger)
                if newest is None or t_ns - newest.t_ns > STALE_NS:
                    self.report.n_stale_ticks[finger] += 1
        if self._moments.wanted:
            self._moments.show(t_ns, dict(self._newest), self._vest.frame, self._intent)

    def _leave(self, t_ns: int, reason: str) -> list[BaseException]:
        """Silence every vest and let go of every hand; one that fails does not keep the others from it."""
        problems: list[BaseException] = []
        frames: Sequence[CanFrame] = ()
        try:
            frames = self._hand.limp()
        except BaseException as error:  # a panic of native code, too; reported by the caller
            problems.append(error)
        self._asked = 0
        for hand in self._hands:
            try:
                hand.write(t_ns, frames)
            except BaseException as error:  # likewise
                problems.append(error)
        problems += self._vest.silence(t_ns)
        try:
            self._tell_hand(t_ns, frames)
        except Exception as error:  # of a vital subscriber; the hand and the vest are safe by now
            problems.append(error)
        if self._guard is not None:
            try:
                self._guard.stop(t_ns, reason)
                self._moments.stopped()
            except BaseException as error:  # of a vital subscriber; reported by the caller
                problems.append(error)
        return problems


def _told(error: BaseException) -> str:
    said = error.message if isinstance(error, TegaError) else str(error)
    return f"stopped: {said or type(error).__name__}"
