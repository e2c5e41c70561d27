"""Run the dual loop: touch back to the wearer, intent forward to the hand, on one clock.

The hand has a tick of 3 ms, the vest one of a thirtieth of a second; if ``by_frame`` is set, a frame between two ticks
wakes the loop, and its change is sent at once.

The loop knows no device by name. Ticks are processed in the order of their deadlines; items stamped at or before a tick
are read before it. With recorded input and a manual clock the same input gives the same output.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial

from msgspec.structs import replace

from tega.errors import TegaError
from tega.hand import joined_level, split_level
from tega.loop.hand import HAND_TICK_NS
from tega.loop.inbox.inputs import Inputs
from tega.loop.inbox.stream import NEVER_NS, Stream
from tega.loop.outputs import HandOutput, VestOutput, attempt
from tega.loop.pacing import LoopReport, Pacer
from tega.loop.snapshot import Moments
from tega.loop.touch import STALE_NS, TouchLoop
from tega.records import Contact, Event, HandLook, Imposed, Intent, Skip
from tega.records.bus import Bus
from tega.safety.guard import Guard

# Before the first block is complete nothing is known of the muscles: the hand keeps its most open pose.
FIRST_LEVEL = 1

# Without EMG there is no need to wake every 3 ms; sources and the wish to stop are still looked at this often.
IDLE_NS = 100_000_000

_ENDED = {"complete": "every source has ended", "duration": "the set time is over", "stopped": "stopped: "}


class DualLoop:
    """Runs both loops until their sources end, the time is over, or ``stop`` returns true.

    On every way out, an exception included, each vest is sent a frame of zeros and each hand zero torque and
    SERVO OFF. Without EMG there are no ticks of the hand, without tactile sources none of the vest, unless a display
    has subscribed to them.

    ``contacts`` are by finger, thumb first, ``levels`` the intents, ``None`` without EMG. Without a ``guard`` it is
    always active. ``poll_hand`` returns at each tick of the hand, by the level of its command, a reading of hand and
    arm from which slips are detected, ``None`` where it is too early for one; without it touch alone detects them.
    """

    def __init__(
        self,
        *,
        pacer: Pacer,
        touch: TouchLoop,
        contacts: Mapping[str, Stream[Contact]],
        levels: Stream[Intent] | None,
        hand: HandOutput,
        vest: VestOutput,
        bus: Bus,
        guard: Guard | None = None,
        inputs: Inputs | None = None,
        moments: Moments | None = None,
        poll_hand: Callable[[int, float], HandLook | None] | None = None,
    ) -> None:
        self._pacer, self._touch = pacer, touch
        self._contacts = list(contacts.items())
        self._levels = levels
        self._streams: list[Stream[Contact] | Stream[Intent]] = list(contacts.values())
        if levels is not None:
            self._streams.append(levels)
        self._hand, self._vest, self._bus, self._guard = hand, vest, bus, guard
        self._inputs = Inputs({}) if inputs is None else inputs
        self._moments = moments
        self._newest: dict[str, Contact] = {}
        self._intent: Intent | None = None
        self._touch_changed = False
        self._due_ns, self._endless = 0, False
        self._wanted: float = FIRST_LEVEL
        self._imposed: float = 0
        self._end_ns = NEVER_NS
        self.report = LoopReport(
            n_contacts=dict.fromkeys(contacts, 0),
            n_stale_ticks=dict.fromkeys(contacts, 0),
            level_ticks=dict.fromkeys(range(1, 6), 0),
        )
        if bus.wants(Event):
            touch.find_events()
        # Displays and recorders that only receive events have them by touch, for nothing.
        self._poll = poll_hand if touch.mapping.wants_events or hand.wants_events else None

    def run(
        self,
        *,
        duration_ns: int | None = None,
        stop: Callable[[], bool] = lambda: False,
        endless: bool = False,
    ) -> LoopReport:
        """Run both loops until they end; :attr:`report` has the counts also when an exception ends the run.

        ``duration_ns`` is ``None`` for the end of the last source; ``stop`` is called before every tick. ``endless`` is
        whether a loop without any source goes on all the same, for an arm or a part.
        """
        self._endless = endless
        report, last_ns, why = self.report, 0, ""
        with_hand = self._levels is not None
        with_vest = bool(self._contacts) or (self._moments is not None and self._moments.wanted)
        step_ns = HAND_TICK_NS if with_hand else IDLE_NS
        try:
            k_step = k_vest = 0
            while True:
                step_at_ns = k_step * step_ns
                vest_at_ns = round(k_vest * 1_000_000_000 / self._vest.rate_hz) if with_vest else NEVER_NS
                t_ns = min(step_at_ns, vest_at_ns)
                if stop():
                    report.ended, why = "stopped", getattr(stop, "reason", "") or "asked to"
                    break
                if duration_ns is not None and t_ns >= duration_ns:
                    self._wait(duration_ns)
                    last_ns = duration_ns
                    last_ns, report.ended = self._drain_final(duration_ns)
                    break
                if self._vest.by_frame and (woken_ns := self._pacer.doze(t_ns)) < t_ns:
                    last_ns = woken_ns if self._take_in(woken_ns) else last_ns
                    self._follow(woken_ns)
                    continue
                in_time = self._wait(t_ns)
                last_ns = t_ns
                self._inputs.check(self._bus, self._pacer)
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
            for problem in self._leave(last_ns, f"stopped: {_text(error)}"):
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
        guard.check(t_ns, late_ns=late_ns, stamps=stamps, counts=counts, unvoted=unvoted, released=released)

    def _drain_final(self, duration_ns: int) -> tuple[int, str]:
        """Read the input up to a set duration, and return when and how the run ended."""
        if self._due_ns < duration_ns:
            self._take_in(duration_ns - 1)
        if self._end_ns < duration_ns:
            return self._end_ns, "complete"
        return duration_ns, "duration"

    def _take_in(self, t_ns: int) -> bool:
        """Take in all that is stamped up to a time, in order, thumb first among equals; false if nothing."""
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
            taken = self._touch_changed = True
        if self._levels is not None:
            while (intent := self._levels.next_until(t_ns)) is not None:
                self._intent = replace(intent, taken_ns=self._pacer.tick_ns)
                self._wanted = joined_level(intent.level, intent.closure)
                taken = True
                self.report.n_blocks += 1
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
        if self._bus.wants(Contact):
            self._bus.publish(taken)
        self._publish_events(self._touch.found)

    def _poll_hand(self, t_ns: int) -> None:
        level = self._hand.level
        hand = None if self._poll is None or not level else self._poll(t_ns, level)
        if hand is None:
            return
        self._bus.publish(hand)
        if slips := self._touch.check(hand):
            self._touch_changed = True
            self._publish_events(slips)

    def _publish_events(self, found: Sequence[Event]) -> None:
        for event in found:
            self._bus.publish(replace(event, taken_ns=self._pacer.tick_ns))

    def _tick(self, t_ns: int, *, hand: bool, vest: bool) -> None:
        if not vest:
            self._follow(t_ns)
        if hand:
            self._tick_hand(t_ns)
        if vest:
            self._tick_vest(t_ns)

    def _tick_hand(self, t_ns: int) -> None:
        self._poll_hand(t_ns)
        wanted = self._wanted
        level = wanted if self._guard is None else self._guard.level(wanted)
        imposed = level if level != wanted else 0
        if imposed != self._imposed:
            self._imposed = imposed
            whole, closure = split_level(imposed)
            self._bus.publish(Imposed(t_ns=self._pacer.tick_ns, level=whole, closure=closure))
        fresh = partial(self._touch.fresh_contacts, t_ns)
        self._hand.step(t_ns, level, fresh, imposed=level != wanted)
        self.report.n_hand_ticks += 1
        self.report.level_ticks[split_level(self._hand.level)[0]] += 1

    def _follow(self, t_ns: int) -> None:
        """Between two ticks, send the vest the newest frame, if that changes anything."""
        if self._vest.by_frame and self._touch_changed:
            self._touch_changed = False
            if self._vest.follow(t_ns):
                self.report.n_vest_between += 1
                self._hand.publish_joints(t_ns)

    def _tick_vest(self, t_ns: int) -> None:
        self._touch_changed = False
        if self._contacts or self._vest.driven:
            self._vest.refresh(t_ns)
            self.report.n_vest_ticks += 1
            self._hand.publish_joints(t_ns)
            for finger, _ in self._contacts:
                newest = self._newest.get(finger)
                if newest is None or t_ns - newest.t_ns > STALE_NS:
                    self.report.n_stale_ticks[finger] += 1
        if self._moments is not None and self._moments.wanted:
            vest = self._vest.confirmed
            self._moments.show(
                t_ns, dict(self._newest), vest, self._intent, self.report, command=self._hand.level
            )

    def _leave(self, t_ns: int, reason: str) -> list[BaseException]:
        """Silence every vest and let go of every hand; one that fails does not keep the others from it."""
        problems = self._hand.limp(t_ns) + self._vest.silence(t_ns)
        attempt(problems, self._hand.publish_command, t_ns)  # the hand and the vest are safe by now
        if self._guard is not None:
            attempt(problems, self._guard.stop, t_ns, reason)
            if self._moments is not None and self._moments.wanted:
                texts = [_text(problem) for problem in problems]
                attempt(problems, self._moments.stopped, self._vest.confirmed, texts)
        return problems


def _text(error: BaseException) -> str:
    return (error.message if isinstance(error, TegaError) else str(error)) or type(error).__name__
