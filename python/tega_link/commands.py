"""Check the leader's commands for hand and arm: when they come, and again when they are used."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable
from typing import Literal, TypeVar

import msgspec

from tega.arm.pose import StampedPose
from tega.loop.inbox.histogram import Histogram
from tega.loop.inbox.stream import LiveStream
from tega.records import Intent
from tega_link.clock import Offset, StampGate, refused_by
from tega_link.ends import FarTracker
from tega_link.messages import ArmMessage, HandMessage

_Command = TypeVar("_Command", HandMessage, ArmMessage)
_RATE_NS = 1_000_000_000


class Commands:
    """Checks levels for the hand, poses and switches for the arm; called with the station's lock held.

    Nothing is used of which it is not sure that it was sent no longer ago than the time-to-live: what has
    come may lie here while this program stands still, so each item lapses by itself.

    ``offset`` returns how far apart the clocks are at a time. ``tracker`` is where poses go; ``None`` without
    an arm. ``route`` is how long commands took, by the clock's estimate; ``n`` counts commands for the hand
    that were taken in, ``rate_hz`` is their recent rate; ``refused_in_all`` counts those of sessions that are over that
    were not obeyed, by why.
    """

    def __init__(
        self,
        *,
        ttl_ns: int,
        offset: Callable[[int], Offset | None],
        hand: bool,
        tracker: FarTracker | None,
        clock: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        self._ttl_ns, self._offset, self._clock = ttl_ns, offset, clock
        self._has_hand, self._tracker = hand, tracker
        self._gates = {"hand": StampGate(ttl_ns=ttl_ns), "arm": StampGate(ttl_ns=ttl_ns)}
        self.refused_in_all = Counter[str]()
        self._start_ns: int | None = None
        self._stamp: Callable[[int, int], None] = lambda _t_ns, _received_ns: None
        self._hand_ns = self._arm_ns = 0
        self._switches: ArmMessage | None = None
        self._clutch_was_open = False
        self._pose_ns = self._block_ns = 0
        self._level: tuple[int, float | None] = (0, None)
        self._counted = (0, 0)
        self.blocks: LiveStream[Intent] = LiveStream(clock=clock)
        self.route = Histogram()
        self.n = 0
        self.rate_hz = 0.0

    def start(self, start_ns: int, stamp: Callable[[int, int], None] | None) -> None:
        """Give the loop what comes from now on."""
        self._start_ns = start_ns
        if stamp is not None:
            self._stamp = stamp

    def begin(self, session: int | None) -> None:
        """Listen to a session from its beginning; to none with ``None``."""
        self.keep_counts()
        for gate in self._gates.values():
            gate.begin(session)
        self._hand_ns = self._arm_ns = self._pose_ns = self._block_ns = 0
        self._level = (0, None)
        if session is not None:
            # Not before: with the clutch pressed, the chain goes on from holding to letting go to a stop, as it would
            # at one machine whose operator's devices all went silent.
            self._switches, self._clutch_was_open = None, False
        if self._tracker is not None:
            self._tracker.forget()

    def foreign(self, stream: Literal["hand", "arm"]) -> None:
        """Count a command from a station that does not lead."""
        self._gates[stream].foreign()

    def hand(self, data: bytes) -> HandMessage | None:
        """Take in a command for the hand; return it if it is obeyed."""
        found = self._accepted("hand", HandMessage, data)
        if found is None:
            return None
        command, now_ns, offset = found
        self.route.add(now_ns - offset.ours(command.sent_ns))
        self.n += 1
        self._hand_ns = offset.earliest(command.sent_ns)
        self._pass_on(command, offset.ours(0 if command.intent is None else command.intent.t_ns), now_ns)
        return command

    def _pass_on(self, command: HandMessage, block_ns: int, now_ns: int) -> None:
        start_ns, requested = self._start_ns, command.intent
        if start_ns is None or requested is None or not self._has_hand:
            return
        t_ns = self.blocks.end_ns
        level = requested.level, requested.closure
        if requested.t_ns > self._block_ns:
            self._block_ns = requested.t_ns
            # Never in the future, whatever the other clock says, nor back where its estimate has moved a little.
            t_ns = max(min(block_ns, now_ns) - start_ns, t_ns)
            self._stamp(t_ns, now_ns)
        elif level == self._level or not self._block_ns:
            return  # else the operator's guard has another level for that block
        self._level = level
        # One channel, as the source has it: the level itself.
        intent = msgspec.structs.replace(requested, t_ns=t_ns, taken_ns=0, channels=level[:1])
        self.blocks.put(intent, use_by_ns=self._hand_ns + self._ttl_ns)

    def arm(self, data: bytes) -> ArmMessage | None:
        """Take in a command for the arm; return it if it is obeyed."""
        found = self._accepted("arm", ArmMessage, data)
        if found is None:
            return None
        command, _, offset = found
        self._arm_ns, self._switches = offset.earliest(command.sent_ns), command
        self._clutch_was_open |= not command.clutch
        tracker, pose = self._tracker, command.pose
        if tracker is not None and pose is not None and pose.t_ns > self._pose_ns:
            self._pose_ns = pose.t_ns
            seen = StampedPose(offset.ours(pose.t_ns), pose.position, pose.quaternion, pose.valid)
            tracker.observe(seen, use_by_ns=self._arm_ns + self._ttl_ns)
        return command

    def _accepted(
        self, stream: str, kind: type[_Command], data: bytes
    ) -> tuple[_Command, int, Offset] | None:
        """Return a command if it is to be obeyed, when that was found, and the clocks' offset it was found with."""
        gate = self._gates[stream]
        if (command := gate.read(kind, data)) is None:
            return None
        now_ns = self._clock()  # as late as can be: a command that waited for the lock has grown older
        offset = self._offset(now_ns)
        if gate.refusal(command, now_ns, offset) or offset is None:
            return None
        return command, now_ns, offset

    def switch(self, name: str) -> tuple[int, bool, bool]:
        """Return when a switch was last received, whether that is fresh, and whether it counts as held."""
        text, received_ns = self._switches, self._arm_ns
        if text is None:
            return received_ns, False, False
        fresh = self._clock() - received_ns <= self._ttl_ns
        if name == "clutch":
            # Through a silence it stays as it was: the chain lets go by itself, and wants it pressed again. A session
            # that begins with it pressed has nobody who took hold.
            return received_ns, fresh, text.clutch and self._clutch_was_open
        return received_ns, fresh, fresh and (text.dead_man if name == "dead_man" else text.recover)

    def missing(self, name: str) -> str:
        """Return that there is no command of the leader's that may be used, ``""`` if there is."""
        received_ns, refused = self._hand_ns, self._gates["hand"].last
        now_ns = self._clock()
        if received_ns and now_ns - received_ns <= self._ttl_ns:
            return ""
        why = f"; the newest was refused: {refused}" if refused else ""
        offset = self._offset(now_ns)
        if refused == "old" and offset is not None and offset.round_trip_ns >= self._ttl_ns:
            why += (
                f", since the way there and back takes {offset.round_trip_ns / 1e6:.0f} ms "
                f"and net.ttl_ms is {self._ttl_ns / 1e6:g}"
            )
        if not received_ns:
            return f"link: no command from {name!r} yet{why}"
        return f"link: no command from {name!r} for {(now_ns - received_ns) / 1e9:.1f} s{why}"

    def count_rate(self, now_ns: int) -> None:
        """Count how many commands come a second."""
        then_ns, n = self._counted
        if now_ns - then_ns >= _RATE_NS:
            self.rate_hz = (self.n - n) * 1e9 / (now_ns - then_ns)
            self._counted = now_ns, self.n

    @property
    def refused(self) -> dict[str, int]:
        """Commands of this session that were not obeyed, by why."""
        return refused_by(self._gates.values())

    def keep_counts(self) -> None:
        """Take over the counts of a session that is over, and listen to none."""
        self.refused_in_all.update(self.refused)
        for gate in self._gates.values():
            gate.begin(None)
