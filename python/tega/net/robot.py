"""The robot's station: hand, arm, fingertips, recorder, and everything that keeps them safe.

It trusts nothing that comes: whatever is not of the operator who leads, in order and young, is not used, and the
session's own guard, the arm's chain and the arm's process each hold whatever the link does.
"""

from __future__ import annotations

import secrets
import time
from collections.abc import Callable
from contextlib import ExitStack
from functools import partial
from typing import TYPE_CHECKING, Any

import msgspec

import tega
from tega.arm.pose import StampedPose
from tega.net.ends import FarMuscles, FarSwitch, FarTracker
from tega.net.gate import Gate
from tega.net.leader import Leadership
from tega.net.link import Channel
from tega.net.messages import (
    ArmCommand,
    Event,
    Feature,
    HandCommand,
    Join,
    Ping,
    Pong,
    Refused,
    State,
    Welcome,
    decode,
    encode,
)
from tega.net.pictures import PictureSender
from tega.net.station import Station
from tega.net.streams import InboxStream
from tega.teleop.inputs import Inputs, Seat

if TYPE_CHECKING:
    from tega.config import SessionConfig
    from tega.devices.base import Tracker
    from tega.safety.guard import Guard
    from tega.safety.states import Transition
    from tega.tactile import ContactMetrics
    from tega.teleop.bell import Bell
    from tega.teleop.latency import LatencyTrace
    from tega.teleop.prepare import Prepared
    from tega.teleop.sources import Block

__all__ = ["RobotStation"]

# Every amplifier's samples become ten levels a second.
_BLOCKS_HZ = 10.0
_STATE_NS = 100_000_000


class RobotStation(Station):
    """The robot's end of the link."""

    def __init__(self, config: SessionConfig, tell: Callable[[str], None]) -> None:
        super().__init__(config, tell)
        net, arm = self.net, config.arm
        self._session = secrets.randbits(62) | 1
        self._ttl_ns = round(net.ttl_ms * 1e6)
        frame = "" if arm is None else arm.mapping.frame
        self._has_hand = config.hand.driver is not None
        self._leader = Leadership(net.own_name, operators=net.operators, frame=frame, hand=self._has_hand)
        self._gates = {"hand": Gate(ttl_ns=self._ttl_ns), "arm": Gate(ttl_ns=self._ttl_ns)}
        self._refused: dict[str, int] = {}
        self._heard_ns = self._arm_ns = 0
        self._switches: ArmCommand | None = None
        self._clutch_was_open = False
        self._pose_ns = self._block_ns = 0
        self._level = 0
        self._n_commands = self._n_leaders = 0
        self._rate: tuple[int, int, float] = (0, 0, 0.0)
        self._tracker = FarTracker(frame) if arm is not None else None
        self._blocks: InboxStream[Block] = InboxStream()
        self._stamp: Callable[[int, int], None] = lambda _t_ns, _received_ns: None
        self._welcome: Welcome | None = None
        self._sequences: dict[str, int] = {}
        self._features: dict[str, Callable[[bytes], None]] = {}
        self._pictures: PictureSender | None = None
        self._next_state_ns = 0
        self._closing = False

    def open(self) -> None:
        """Wait for operators.

        Raises:
            TegaError: See :class:`tega.net.link.Link`.
        """
        link = self._link
        link.open()
        self._send_state = link.sends("state", Channel.STATE)
        self._send_event = link.sends("event", Channel.EVENT)
        self._send_ping = link.sends("clock/ping", Channel.COMMAND)
        self._send_pong = link.sends("clock/pong", Channel.COMMAND)
        for finger in self._config.tactile.in_use():
            self._features[finger] = link.sends(f"tactile/features/{finger}", Channel.FEATURES)
        link.hears("cmd/*/hand", self._hear_hand)
        link.hears("cmd/*/arm", self._hear_arm)
        link.hears("cmd/*/clock/*", self._hear_clock)
        link.watches("operator/*/*", self._watch)
        link.answers("join/*", self._join)
        self._start()
        self._tell(f"robot {self.net.own_name!r} waits for an operator at {self.net.listen}")

    def close(self) -> None:
        """End the link."""
        if self._pictures is not None:
            self._pictures.close()
        super().close()

    # The session's side.

    def prepared(self, prepared: Prepared) -> Prepared:
        """Add the operator's levels, and look at the pictures as they are read."""
        from tega.calibration import EmgMaxima
        from tega.teleop.prepare import Muscles
        from tega.teleop.sources import SourceReport

        if self.net.images_hz > 0 and prepared.fingers:
            self._pictures = PictureSender(
                self._link,
                self._session,
                rate_hz=self.net.images_hz,
                quality=self.net.jpeg_quality,
                wanted=lambda: self._leader.session != 0,
            )
            prepared = self._pictures.watch(prepared)
        if self._has_hand:
            # One channel, whose sample is the level itself: 5 is as far as it goes.
            maxima = EmgMaxima(
                kind="envelope", rate_hz=_BLOCKS_HZ, tau=1, channels=("operator",), maxima=(5.0,)
            )
            source: Any = FarMuscles(rate_hz=_BLOCKS_HZ)
            report = SourceReport()
            self._blocks = InboxStream(on_loss=report.drop)
            prepared = prepared._replace(muscles=Muscles(source, maxima, None, report, self._blocks))
        return prepared

    def inputs(self, stack: ExitStack, inputs: Inputs) -> Inputs:  # noqa: ARG002
        """Return the operator's switches, where there is an arm for them."""
        if self._tracker is None:
            return inputs
        seats = {}
        for name in ("dead_man", "clutch", "recover"):
            source: Any = FarSwitch(name, partial(self._switch, name))
            seats[name] = Seat(source, None)
        return Inputs(seats)

    @property
    def tracker(self) -> Tracker | None:
        """The operator's forearm."""
        far: Any = self._tracker
        return far  # type: ignore[no-any-return]

    def begin(
        self,
        prepared: Prepared,
        *,
        start_ns: int,
        bell: Bell | None,
        trace: LatencyTrace | None,
        guard: Guard,
    ) -> None:
        """Let operators lead from now on."""
        del bell, guard  # the loop is woken by its own pictures
        if trace is not None and prepared.muscles is not None:
            self._stamp = trace.source("emg")
        pictures = self._pictures
        self._welcome = Welcome(
            station=self._session,
            fingers={name: f.source.info.rate_hz or 0.0 for name, f in prepared.fingers.items()},
            hand=self._has_hand,
            arm=self._tracker is not None,
            tega=str(tega.__version__),
            preset=self._config.session.preset,
            baselines={} if pictures is None else pictures.baselines(prepared),
        )
        if pictures is not None:
            pictures.start(start_ns)
        self._start_ns = start_ns

    def missing(self) -> str:
        """Say that nobody leads, or that the leader's commands do not come."""
        if self._error:
            return self._error
        if self._leader.session == 0:
            return "link: no operator leads"
        away_ns = time.monotonic_ns() - self._heard_ns
        if away_ns <= self._ttl_ns and self._heard_ns:
            return ""
        name, refused = self._leader.name, self._gates["hand"].last
        why = f"; the newest was refused: {refused}" if refused else ""
        if not self._heard_ns:
            return f"link: no command from {name!r} yet{why}"
        return f"link: no command from {name!r} for {away_ns / 1e9:.1f} s{why}"

    def contact(self, t_ns: int, finger: str, metrics: ContactMetrics) -> None:
        """Send what one picture says."""
        if self._start_ns is None or self._leader.session == 0:
            return
        feature = Feature(
            session=self._session,
            sequence=self._number(finger),
            sent_ns=time.monotonic_ns(),
            t_ns=self._start_ns + t_ns,
            metrics=metrics,
        )
        self._features[finger](encode(feature))

    def changed(self, change: Transition) -> None:
        """Tell that the run's state has changed, here and to the operator."""
        super().changed(change)
        event = Event(
            session=self._session,
            sequence=self._number("event"),
            sent_ns=time.monotonic_ns(),
            state=change.state,
            reason=change.reason,
        )
        self._send_event(encode(event))
        self._next_state_ns = 0

    def _number(self, stream: str) -> int:
        number = self._sequences[stream] = self._sequences.get(stream, -1) + 1
        return number

    @property
    def words(self) -> str:
        """Who leads, and how commands and clock are."""
        if not self._leader.session:
            return "waits for an operator"
        said = f"led by {self._leader.name}, {self._rate[2]:.0f} commands/s"
        if self._way.n:
            said += f", way {self._way.at(0.5) / 1e6:.1f} ms"
        said += f", {self._clock_words}"
        refused = self._refused_now()
        if refused:
            said += ", refused: " + ", ".join(f"{n} {why}" for why, n in refused.items())
        return said

    def _refused_now(self) -> dict[str, int]:
        refused: dict[str, int] = {}
        for gate in self._gates.values():
            for why, n in gate.refused.items():
                refused[why] = refused.get(why, 0) + n
        return refused

    def summary(self) -> dict[str, Any]:
        """Return what a run says of the link."""
        with self._lock:
            self._keep_counts()
        return self._link_summary() | {
            "leaders": self._n_leaders,
            "commands": self._n_commands,
            "refused_commands": self._refused,
            "features": {f: self._sequences.get(f, -1) + 1 for f in self._features},
            "images": {} if self._pictures is None else self._pictures.sent,
        }

    def _keep_counts(self) -> None:
        """Take over the gates' counts of a session that is over, and close them; with the lock held."""
        for gate in self._gates.values():
            for why, n in gate.refused.items():
                self._refused[why] = self._refused.get(why, 0) + n
            gate.begin(None)

    # The link's side: in Zenoh's threads.

    def _join(self, key: str, asked: bytes) -> bytes:
        now_ns = time.monotonic_ns()
        try:
            join = decode(Join, asked)
        except msgspec.DecodeError:
            return encode(Refused("this question cannot be read", "install the same version of TEGA on both"))
        if key != f"join/{join.name}":  # who asks is known by the key, which the certificate allows
            return encode(Refused(f"{join.name!r} asked as somebody else"))
        if self._welcome is None:
            return encode(Refused(f"robot {self.net.own_name!r} is still preparing", final=False))
        with self._lock:
            before = self._leader.session
            refused = self._leader.ask(join, now_ns)
            if refused is None and before != join.session:
                self._begin_session(join.session)
        if refused is not None:
            self._tell(f"operator {join.name!r} was refused: {refused.why}")
            return encode(refused)
        if before != join.session:
            self._tell(f"operator {join.name!r} leads")
        return encode(msgspec.structs.replace(self._welcome, sent_ns=now_ns))

    def _begin_session(self, session: int | None) -> None:
        """Listen to a session, or to none; with the lock held."""
        self._keep_counts()
        for gate in self._gates.values():
            gate.begin(session)
        self._new_peer()
        self._n_leaders += session is not None
        self._heard_ns = self._arm_ns = self._pose_ns = self._block_ns = self._level = 0
        if session is not None:
            # Not before: with the clutch pressed, the chain goes on from holding to letting go to a stop, as it would
            # at one machine whose operator's devices all went silent.
            self._switches, self._clutch_was_open = None, False
        if self._tracker is not None:
            self._tracker.forget()
        self._next_state_ns = 0

    def _watch(self, key: str, alive: bool) -> None:  # noqa: FBT001  # the link's signature
        _, name, number = key.split("/")
        try:
            session = int(number, 16)
        except ValueError:
            return
        with self._lock:
            gone = self._leader.sign(name, session, alive=alive)
            if gone:
                self._begin_session(None)
        if gone:
            self._tell(f"operator {name!r} is gone")

    def _hear_clock(self, key: str, data: bytes) -> None:
        now_ns = time.monotonic_ns()
        if not self._is_leader(key):
            return
        try:
            if key.endswith("/ping"):
                ping = decode(Ping, data)
                if ping.session == self._leader.session:
                    self._pinged(ping, now_ns)
            else:
                pong = decode(Pong, data)
                if pong.session == self._leader.session:
                    self._ponged(pong, now_ns)
        except msgspec.DecodeError:
            return

    def _is_leader(self, key: str) -> bool:
        return self._leader.session != 0 and key.split("/")[1] == self._leader.name

    def _hear_hand(self, key: str, data: bytes) -> None:
        now_ns = time.monotonic_ns()
        with self._lock:
            command = self._accepted("hand", HandCommand, key, data, now_ns)
            if command is None or (offset := self._offset_now(now_ns)) is None:
                return
            self._way.add(now_ns - offset.ours(command.sent_ns))
            self._n_commands += 1
            self._heard_ns = offset.ours(command.sent_ns)
            self._pass_on(command, offset.ours(command.block_ns), now_ns)

    def _pass_on(self, command: HandCommand, block_ns: int, now_ns: int) -> None:
        """Give a new block of EMG to the loop; with the lock held."""
        start_ns, level = self._start_ns, command.level
        if start_ns is None or level is None or not self._has_hand:
            return
        t_ns = self._blocks.end_ns
        if command.block_ns > self._block_ns:
            self._block_ns = command.block_ns
            # Never in the future, whatever the other clock says, nor back where its estimate has moved a little.
            t_ns = max(min(block_ns, now_ns) - start_ns, t_ns)
            self._stamp(t_ns, now_ns)
        elif (
            level == self._level or not self._block_ns
        ):  # else the operator's guard has another level for that block
            return
        self._level = level
        self._blocks.put((t_ns, (level,), level))

    def _hear_arm(self, key: str, data: bytes) -> None:
        now_ns = time.monotonic_ns()
        with self._lock:
            command = self._accepted("arm", ArmCommand, key, data, now_ns)
            if command is None or (offset := self._offset_now(now_ns)) is None:
                return
            self._arm_ns, self._switches = offset.ours(command.sent_ns), command
            self._clutch_was_open |= not command.clutch
            tracker, pose = self._tracker, command.pose
            if tracker is not None and pose is not None and pose.t_ns > self._pose_ns:
                self._pose_ns = pose.t_ns
                tracker.see(StampedPose(offset.ours(pose.t_ns), pose.place, pose.turn, pose.valid))

    def _accepted(self, name: str, kind: Any, key: str, data: bytes, now_ns: int) -> Any:
        """Return a command if it is to be obeyed; with the lock held."""
        gate = self._gates[name]
        if not self._is_leader(key):
            gate.foreign()
            return None
        try:
            command = decode(kind, data)
        except msgspec.DecodeError:
            gate.malformed()
            return None
        if command.malformed():
            gate.malformed()
            return None
        return None if gate.refusal(command, now_ns, self._offset_now(now_ns)) else command

    def _switch(self, name: str) -> tuple[int, bool, bool]:
        """Return when a switch was heard, whether that is fresh, and whether it counts as held."""
        said, heard_ns = self._switches, self._arm_ns
        if said is None:
            return heard_ns, False, False
        fresh = time.monotonic_ns() - heard_ns <= self._ttl_ns
        if name == "clutch":
            # Through a silence it stays as it was: the chain lets go by itself, and wants it pressed anew. A session
            # that begins with it pressed has nobody who took hold.
            return heard_ns, fresh, said.clutch and self._clutch_was_open
        return heard_ns, fresh, fresh and (said.dead_man if name == "dead_man" else said.recover)

    def _turn(self, now_ns: int) -> None:
        with self._lock:
            name = self._leader.name
            gone = self._leader.look(now_ns)
            if gone:
                self._begin_session(None)
            session = self._leader.session
        if gone:
            self._tell(f"operator {name!r} asked and then went")
        if session:
            self._ping(session, now_ns)
        self._count_rate(now_ns)
        if now_ns >= self._next_state_ns:
            self._next_state_ns = now_ns + _STATE_NS
            self._say_state(session)

    def _count_rate(self, now_ns: int) -> None:
        then_ns, n, _ = self._rate
        if now_ns - then_ns >= 1_000_000_000:
            self._rate = now_ns, self._n_commands, (self._n_commands - n) * 1e9 / (now_ns - then_ns)

    def _say_state(self, session: int) -> None:
        view = self._view
        said = State(
            session=self._session,
            sequence=self._number("state"),
            sent_ns=time.monotonic_ns(),
            leader=session,
            leader_name=self._leader.name,
            refused=self._refused_now(),
            problem=self.missing() if session else "",
        )
        if view is not None:
            said = msgspec.structs.replace(
                said,
                state=view.state,
                reason=view.reason,
                alerts=tuple(view.alerts),
                arm=view.arm,
                angles_rad=tuple(view.angles_rad or ()),
            )
        self._send_state(encode(said))
