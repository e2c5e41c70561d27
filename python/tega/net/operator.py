"""The operator's station: muscles, forearm, switches, vest and page; touch and the robot's state come over the link."""

from __future__ import annotations

import secrets
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any

import msgspec

import tega
from tega.errors import ConfigError, DeviceUnavailableError
from tega.net.ends import FarHand
from tega.net.forearm import Forearm
from tega.net.gate import Gate
from tega.net.link import Channel
from tega.net.messages import (
    ArmCommand,
    Event,
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
from tega.net.station import Station
from tega.net.touch import FarTouch

if TYPE_CHECKING:
    from tega.config import SessionConfig
    from tega.safety.guard import Guard
    from tega.teleop.bell import Bell
    from tega.teleop.inputs import Inputs
    from tega.teleop.latency import LatencyTrace
    from tega.teleop.loop import LoopView
    from tega.teleop.prepare import Prepared
    from tega.teleop.sinks import Sinks

__all__ = ["OperatorStation"]

_ASK_NS = 250_000_000
_ASK_AGAIN_NS = 2_000_000_000
_ASK_S = 1.0


class OperatorStation(Station):
    """The operator's end of the link.

    Args:
        config: The session's settings.
        tell: Told in a sentence what happens.
        stop: Asked while the robot is looked for.
    """

    def __init__(self, config: SessionConfig, tell: Callable[[str], None], stop: Callable[[], bool]) -> None:
        super().__init__(config, tell)
        net = self.net
        self.tick_s = 1 / net.rate_hz
        self._stop = stop
        self._name = net.own_name
        self._lost_ns = round(net.lost_ms * 1e6)
        self._session = 0
        self._joined = False
        self._refusal: Refused | None = None
        self._welcome: Welcome | None = None
        self._answered = threading.Event()
        self._next_ask_ns = 0
        self._end_life: Callable[[], None] = lambda: None
        self._state: State | None = None
        self._state_ns = 0
        self._states, self._events = Gate(ttl_ns=10**12), Gate(ttl_ns=10**12)
        self._touch = FarTouch(net.robot, ttl_ns=round(net.ttl_ms * 1e6))
        self._forearm = Forearm(config)
        self._numbers = {"hand": 0, "arm": 0}
        self._sent: deque[int] = deque(maxlen=1024)
        self._hand: FarHand | None = None
        self._block: tuple[int, tuple[int, ...]] = (0, ())
        self._may_move: Callable[[], bool] = lambda: False
        self._was_lost = False
        self._n_lost = self._n_joined = self._n_commands = 0

    def open(self) -> None:
        """Find the robot and take the lead.

        Raises:
            DeviceUnavailableError: It is not there, or somebody else leads it.
            KeyboardInterrupt: ``stop`` said so.
        """
        link = self._link
        link.open()
        mine = f"cmd/{self._name}"
        self._send_hand = link.sends(f"{mine}/hand", Channel.COMMAND)
        self._send_arm = link.sends(f"{mine}/arm", Channel.COMMAND)
        self._send_ping = link.sends(f"{mine}/clock/ping", Channel.COMMAND)
        self._send_pong = link.sends(f"{mine}/clock/pong", Channel.COMMAND)
        link.hears("state", self._hear_state)
        link.hears("event", self._hear_event)
        link.hears("clock/*", self._hear_clock)
        link.hears("tactile/features/*", self._hear_feature)
        link.hears("tactile/image/*", self._hear_image)
        self._start()
        try:
            self._await_robot()
        except BaseException:
            self.close()
            raise

    def _await_robot(self) -> None:
        until_s = time.monotonic() + self.net.wait_s
        while time.monotonic() < until_s and not self._stop():
            if self._answered.wait(0.05):
                break
        if self._joined:
            return
        if self._stop():
            raise KeyboardInterrupt
        robot = self.net.robot
        if (refused := self._refusal) is not None:
            raise DeviceUnavailableError(refused.why, refused.hint)
        keys = (
            ", and that both stations' keys are from the same folder and name each other"
            if self.net.keys
            else ""
        )
        raise DeviceUnavailableError(
            f"no robot {robot!r} answers at {self.net.connect} within {self.net.wait_s:g} s",
            f"start it there with: tega-teleop robot ROBOT.toml; check its name and address{keys}",
        )

    def end(self) -> None:
        """Let go of hand and arm."""
        self._leaving.set()
        self._touch.end()
        if self._thread is not None:
            self._thread.join(2.0)
        if self._joined and self._thread is not None and not self._error:
            if self._hand is not None:
                self._hand.limp()
            self._say_hand()
            self._send_arm(encode(ArmCommand(**self._stamp("arm"))))  # nothing is held any more
        self._thread = None

    def close(self) -> None:
        """Give the lead back, and end the link."""
        self.end()
        self._end_life()
        super().close()

    # The session's side.

    def prepared(self, prepared: Prepared) -> Prepared:
        """Add the robot's fingertips."""
        welcome = self._welcome
        assert welcome is not None
        robot, preset = self.net.robot, self._config.session.preset
        if welcome.fingers and welcome.preset != preset:
            raise ConfigError(
                f"robot {robot!r} measures touch by the preset {welcome.preset!r}, this station uses {preset!r}",
                "set session.preset alike in both files",
            )
        fingers = self._touch.fingers(welcome)
        if fingers:
            prepared.calibration.check_fits(
                preset=preset, fingers=fingers, emg=None, name=prepared.calibration_name or "the calibration"
            )
        return prepared._replace(fingers=fingers)

    def sinks(self, sinks: Sinks) -> Sinks:
        """Add the robot's hand."""
        if self._welcome is None or not self._welcome.hand:
            return sinks
        hand: Any = FarHand(self.net.robot, answered=self._answered_ns)
        self._hand = hand
        return sinks._replace(steered=hand)

    def inputs(self, stack: ExitStack, inputs: Inputs) -> Inputs:
        """Take note of the switches, and open what sees the forearm."""
        self._forearm.open(stack, inputs)
        return inputs

    def begin(
        self,
        prepared: Prepared,
        *,
        start_ns: int,
        bell: Bell | None,
        trace: LatencyTrace | None,
        guard: Guard,
    ) -> None:
        """Take in touch from now on."""
        self._touch.begin(prepared, start_ns=start_ns, bell=bell, trace=trace)
        self._may_move = lambda: guard.state == "active"
        self._start_ns = start_ns

    def levels(self, t_ns: int, channels: Sequence[int], fused: int) -> None:  # noqa: ARG002  # the guard decides
        """Note the newest block of EMG."""
        if self._start_ns is not None:
            self._block = (self._start_ns + t_ns, tuple(channels))

    def missing(self) -> str:
        """Say that the robot does not answer, or does not want us."""
        if self._error:
            return self._error
        robot = self.net.robot
        if not self._joined:
            why = "" if self._refusal is None else f": {self._refusal.why}"
            return f"link: robot {robot!r} is asked for the lead again{why}"
        away_ns = time.monotonic_ns() - self._state_ns
        if away_ns > self._lost_ns:
            return f"link: no word from robot {robot!r} for {away_ns / 1e9:.1f} s; nothing is sent"
        if (state := self._state) is not None and state.problem:
            return f"link: the robot says: {state.problem.removeprefix('link: ')}"
        return ""

    def alert(self) -> str:
        """Return what the robot's station says is wrong there."""
        state = self._state
        said = () if state is None else [a for a in state.alerts if not a.startswith("link: ")]
        return f"robot: {'; '.join(said)}" if said else ""

    def shown(self, view: LoopView) -> LoopView:
        """Complete a moment with how link and arm are."""
        state = self._state
        return view._replace(link=self.words, arm="" if state is None else state.arm)

    @property
    def words(self) -> str:
        """Which robot is led, how it is, and how the link is."""
        state, robot = self._state, self.net.robot
        if not self._joined:
            return f"robot {robot} does not answer"
        said = f"leads {robot}"
        if state is not None and state.state:
            said += f" ({state.state}: {state.reason})" if state.state != "active" else " (active)"
        if self._way.n:
            said += f", touch on the way {self._way.at(0.5) / 1e6:.1f} ms"
        return f"{said}, {self._clock_words}"

    def summary(self) -> dict[str, Any]:
        """Return what a run says of the link."""
        return self._link_summary() | {
            "robot": self.net.robot,
            "joined": self._n_joined,
            "lost": self._n_lost,
            "commands": self._n_commands,
            **self._touch.summary(),
        }

    def _answered_ns(self, since_ns: int) -> int | None:
        """Return when a command was first handed to the link at or after a time."""
        found = None
        for sent_ns in reversed(self._sent):
            if sent_ns < since_ns:
                break
            found = sent_ns
        return found

    # The link's side.

    def _turn(self, now_ns: int) -> None:
        if not self._joined:
            if now_ns >= self._next_ask_ns:
                refused = self._refusal is not None and self._refusal.final
                self._next_ask_ns = now_ns + (_ASK_AGAIN_NS if refused else _ASK_NS)
                self._ask()
            return
        self._ping(self._session, now_ns)
        lost = now_ns - self._state_ns > self._lost_ns
        if lost != self._was_lost:
            self._was_lost = lost
            self._n_lost += lost
            self._tell(f"robot {self.net.robot!r} {'does not answer' if lost else 'answers again'}")
        self._touch.mind(lost=lost)
        if lost:
            return
        self._say_hand()
        if self._start_ns is not None and self._welcome is not None and self._welcome.arm:
            self._say_arm()

    def _ask(self) -> None:
        if not self._session:
            self._session = secrets.randbits(62) | 1
            self._end_life()
            self._end_life = self._link.lives(f"operator/{self._name}/{self._session:x}")
            with self._lock:
                self._new_peer()
        join = Join(
            self._session,
            self._name,
            tega=str(tega.__version__),
            frame=self._forearm.frame,
            dead_man=self._config.input.dead_man is not None,
            muscles=self._config.emg is not None,
        )
        self._link.asks(f"join/{self._name}", encode(join), self._hear_answer, timeout_s=_ASK_S)

    def _hear_answer(self, data: bytes) -> None:
        now_ns = time.monotonic_ns()
        if self._joined:
            return
        try:
            welcome: Welcome | Refused = decode(Welcome, data)
        except msgspec.DecodeError:
            try:
                welcome = decode(Refused, data)
            except msgspec.DecodeError:
                return
        if isinstance(welcome, Refused):
            self._refusal = welcome
            if welcome.final:
                self._answered.set()
            return
        with self._lock:
            self._states.begin(welcome.station)
            self._events.begin(welcome.station)
            self._touch.welcome(welcome)
            self._new_peer()
        self._numbers = dict.fromkeys(self._numbers, 0)
        self._welcome, self._refusal = welcome, None
        self._state, self._state_ns = None, now_ns
        self._n_joined += 1
        self._joined = True
        self._answered.set()
        if self._n_joined > 1:
            self._tell(f"robot {self.net.robot!r} is led again")

    def _hear_state(self, _key: str, data: bytes) -> None:
        now_ns = time.monotonic_ns()
        try:
            state = decode(State, data)
        except msgspec.DecodeError:
            return
        with self._lock:
            # A time-to-live of its own has no use: a state is what the station says of itself, whenever it came.
            foreign = self._states.refusal(state, now_ns, self._offset_now(now_ns)) not in {"", "no clock"}
        if self._joined and self._welcome is not None and state.session != self._welcome.station:
            self._lose_lead("it was started again")
        elif not self._joined or self._welcome is None or foreign or state.sent_ns < self._welcome.sent_ns:
            return
        elif state.leader != self._session:
            self._lose_lead("it does not listen to this session any more")
        else:
            self._state, self._state_ns = state, now_ns
            if self._hand is not None:
                self._hand.angles = state.angles_rad

    def _lose_lead(self, why: str) -> None:
        self._joined, self._session, self._state = False, 0, None
        self._next_ask_ns = 0
        self._tell(f"robot {self.net.robot!r} is asked for the lead again: {why}")

    def _hear_event(self, _key: str, data: bytes) -> None:
        now_ns = time.monotonic_ns()
        try:
            event = decode(Event, data)
        except msgspec.DecodeError:
            return
        with self._lock:
            refusal = self._events.refusal(event, now_ns, self._offset_now(now_ns))
        if refusal in {"", "no clock"}:
            self._tell(f"robot {self.net.robot!r}: {event.state}: {event.reason}")

    def _hear_clock(self, key: str, data: bytes) -> None:
        now_ns = time.monotonic_ns()
        try:
            if key.endswith("/ping"):
                ping = decode(Ping, data)
                if ping.session == self._session:
                    self._pinged(ping, now_ns)
            else:
                pong = decode(Pong, data)
                if pong.session == self._session:
                    self._ponged(pong, now_ns)
        except msgspec.DecodeError:
            return

    def _hear_feature(self, key: str, data: bytes) -> None:
        now_ns = time.monotonic_ns()
        with self._lock:
            name = key.rpartition("/")[2]
            way_ns = self._touch.feature(name, data, now_ns, self._offset_now(now_ns))
            if way_ns is not None:
                self._way.add(way_ns)

    def _hear_image(self, key: str, data: bytes) -> None:
        with self._lock:
            offset = self._offset_now(time.monotonic_ns())
        self._touch.image(key.rpartition("/")[2], data, offset)

    def _say_hand(self) -> None:
        hand, (block_ns, channels) = self._hand, self._block
        level = None if hand is None else hand.level
        stamp = self._stamp("hand")
        command = HandCommand(**stamp, level=level, channels=channels, block_ns=block_ns)
        self._send_hand(encode(command))
        self._n_commands += 1
        if level is not None:
            self._sent.append(stamp["sent_ns"])

    def _say_arm(self) -> None:
        facts = self._forearm.facts(may_move=self._may_move())
        self._send_arm(encode(ArmCommand(**self._stamp("arm"), **facts)))

    def _stamp(self, stream: str) -> dict[str, Any]:
        number = self._numbers[stream]
        self._numbers[stream] += 1
        return {"session": self._session, "sequence": number, "sent_ns": time.monotonic_ns()}
