"""Run the operator's station: muscles, switches, vest, page; touch and robot state come over the link."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import ExitStack
from functools import partial
from typing import Any

import msgspec

import tega
from tega.config import SessionConfig
from tega.errors import ConfigError
from tega.loop.inbox.inputs import Inputs, Prepared
from tega.loop.parts import RunStart
from tega.loop.sinks import Sinks
from tega.loop.snapshot import LoopView
from tega.records import EmgSamples, Intent
from tega.records.bus import Bus
from tega_link.behind import SampleSender
from tega_link.clock import StampGate
from tega_link.ends import FarHand
from tega_link.intent import ForearmReader, IntentSender
from tega_link.leader import Lead
from tega_link.link import Channel
from tega_link.messages import Change, Join, State, Welcome, decode
from tega_link.station import Station
from tega_link.touch import FarTouch, with_touch


class OperatorStation(Station):
    """The operator's end of the link."""

    def __init__(self, config: SessionConfig, bus: Bus, stop: Callable[[], bool]) -> None:
        super().__init__(config, bus, lambda: self._lead.session)
        net = self.net
        self.tick_s = 1 / net.rate_hz
        self._stop = stop
        self._lost_ns = round(net.lost_ms * 1e6)
        self._forearm = ForearmReader(config)
        join = Join(
            0,
            net.own_name,
            tega=str(tega.__version__),
            frame=self._forearm.frame,
            dead_man=config.input.dead_man is not None,
            muscles=config.emg is not None,
        )
        self._lead = Lead(self._link, join, renewed=self._clock.forget, given=self._welcomed)
        self._state: State | None = None
        self._state_ns = 0
        self._states, self._events = StampGate(ttl_ns=10**12), StampGate(ttl_ns=10**12)
        self._touch = FarTouch(net.robot, ttl_ns=round(net.ttl_ms * 1e6))
        self._was_lost = False
        self._n_lost = 0

    def open(self) -> None:
        """Find the robot and take the lead.

        No robot, or one that another operator leads, raises :class:`DeviceUnavailableError`; ``stop`` makes
        it :class:`KeyboardInterrupt`.
        """
        link = self._link
        link.open()
        mine = f"cmd/{self.net.own_name}"
        hand, arm = (link.sends(f"{mine}/{stream}", Channel.COMMAND) for stream in ("hand", "arm"))
        self._intent = IntentSender(self._forearm, self._stamp, hand, arm)
        self._samples = SampleSender(
            link.sends(f"{mine}/emg", Channel.RECORD),
            partial(self._stamp, "emg"),
            lambda: self._lead.is_recorded,
        )
        self._bus.subscribe(EmgSamples, self._samples.take, name="link")
        self._bus.subscribe(Intent, self._levels, name="link")
        self._clock.open(
            link.sends(f"{mine}/clock/ping", Channel.COMMAND),
            link.sends(f"{mine}/clock/pong", Channel.COMMAND),
        )
        link.receives("state", self._receive_state)
        link.receives("event", self._receive_event)
        link.receives("clock/*", lambda key, data: self._clock.receive(key, data, self._lead.session))
        link.receives("tactile/features/*", self._receive_feature)
        link.receives("tactile/image/*", self._receive_image)
        self._start()
        try:
            self._lead.await_yes(self.net, self._stop)
        except BaseException:
            self.close()
            raise

    def end(self) -> None:
        """Let go of hand and arm."""
        self._leaving.set()
        self._touch.end()
        if self._thread is not None:
            self._thread.join(2.0)
        if self._lead.has and self._thread is not None and not self._error:
            self._intent.let_go()
        self._thread = None

    def close(self) -> None:
        """Give the lead back, and end the link."""
        self.end()
        self._lead.end()
        super().close()

    # The session's side.

    def prepared(self, prepared: Prepared) -> Prepared:
        """Add the robot's fingertips."""
        welcome = self._lead.welcome
        assert welcome is not None
        robot, preset = self.net.robot, self._config.session.preset
        if welcome.fingers and welcome.preset != preset:
            raise ConfigError(
                f"robot {robot!r} measures touch by the preset {welcome.preset!r}, this station uses {preset!r}",
                "set session.preset alike in both files",
            )
        fingers = self._touch.fingers(welcome)
        prepared = prepared._replace(calibration=with_touch(prepared.calibration, welcome, robot=robot))
        return prepared._replace(fingers=fingers)

    def sinks(self, sinks: Sinks) -> Sinks:
        """Add the robot's hand."""
        welcome = self._lead.welcome
        if welcome is None or not welcome.hand:
            return sinks
        hand: Any = FarHand(self.net.robot, answered=self._intent.answered_ns)
        self._intent.hand = hand
        return sinks._replace(steered=hand)

    def inputs(self, stack: ExitStack, inputs: Inputs) -> Inputs:
        """Take note of the switches, and open what sees the forearm."""
        self._forearm.open(stack, inputs)
        return inputs

    def begin(self, run: RunStart) -> None:
        """Take in touch from now on."""
        prepared, start_ns, trace = run.prepared, run.start_ns, run.trace
        self._touch.begin(prepared, self._bus, start_ns=start_ns, bell=run.bell, trace=trace)
        self._intent.guard = run.guard
        self._samples.begin(start_ns)
        self._start_ns = start_ns

    def _levels(self, intent: Intent) -> None:
        """Store the newest block of EMG; the guard decides which level the hand gets."""
        if self._start_ns is not None:
            t_ns = self._start_ns + intent.t_ns
            self._intent.newest = msgspec.structs.replace(intent, t_ns=t_ns, taken_ns=0)

    def missing(self) -> str:
        """Return why the robot's station is out of reach, or refuses us; ``""`` while all is well."""
        if self._error:
            return self._error
        robot = self.net.robot
        if not self._lead.has:
            refusal = self._lead.refusal
            why = "" if refusal is None else f": {refusal.why}"
            return f"link: robot {robot!r} is asked for the lead again{why}"
        away_ns = time.monotonic_ns() - self._state_ns
        if away_ns > self._lost_ns:
            return f"link: no word from robot {robot!r} for {away_ns / 1e9:.1f} s; nothing is sent"
        if (state := self._state) is not None and state.problem:
            return f"link: the robot says: {state.problem.removeprefix('link: ')}"
        return ""

    def alert(self) -> str:
        """Return the problem that the robot's station reports."""
        state = self._state
        alerts = () if state is None else [a for a in state.alerts if not a.startswith("link: ")]
        return f"robot: {'; '.join(alerts)}" if alerts else ""

    def displayed(self, view: LoopView) -> LoopView:
        """Complete a moment with how link and arm are."""
        arm, view = "" if self._state is None else self._state.arm, view._replace(link=self.words)
        if self._is_lost:
            return view._replace(arm=arm and "no word from the robot", angles_rad=None)
        return view._replace(arm=arm)

    @property
    def _is_lost(self) -> bool:
        """Whether the robot's newest state is too old to say how it is."""
        return time.monotonic_ns() - self._state_ns > self._lost_ns

    @property
    def words(self) -> str:
        """The led robot, its state and the link's, in one line."""
        state, robot = self._state, self.net.robot
        if not self._lead.has:
            return f"robot {robot} does not answer"
        text = f"leads {robot}"
        if self._is_lost:
            text += " (no word from it)"
        elif state is not None and state.state:
            text += f" ({state.state}: {state.reason})" if state.state != "active" else " (active)"
        if (route := self._touch.route).n:
            text += f", touch on the way {route.at(0.5) / 1e6:.1f} ms"
        return f"{text}, {self._clock.words}"

    def _summary(self) -> dict[str, Any]:
        return self._link_summary() | {
            "robot": self.net.robot,
            "joined": self._lead.n,
            "lost": self._n_lost,
            "commands": self._intent.n,
            **self._touch.summary(),
        }

    # The link's side.

    def _turn(self, now_ns: int) -> None:
        lead = self._lead
        if not lead.has:
            lead.ask(now_ns)
            return
        self._clock.ask(lead.session, now_ns)
        lost = now_ns - self._state_ns > self._lost_ns
        if lost != self._was_lost:
            self._was_lost = lost
            self._n_lost += lost
            self._notify(f"robot {self.net.robot!r} {'does not answer' if lost else 'answers again'}")
        self._touch.mind(lost=lost)
        if lost:
            return
        self._intent.lead_hand()
        if self._start_ns is not None and lead.welcome is not None and lead.welcome.arm:
            self._intent.lead_arm()

    def _welcomed(self, welcome: Welcome) -> None:
        now_ns = time.monotonic_ns()
        with self._lock:
            self._states.begin(welcome.station)
            self._events.begin(welcome.station)
            self._touch.welcome(welcome)
            self._clock.forget()
        self._numbers.clear()
        self._state, self._state_ns = None, now_ns
        if self._lead.n:
            self._notify(f"robot {self.net.robot!r} is led again")

    def _receive_state(self, _key: str, data: bytes) -> None:
        now_ns = time.monotonic_ns()
        try:
            state = decode(State, data)
        except msgspec.DecodeError:
            return
        lead = self._lead
        with self._lock:
            # A time-to-live of its own has no use: a state is what the station says of itself, whenever it came.
            refusal = self._states.refusal(state, now_ns, self._clock.offset(now_ns))
        if self._leaving.is_set():  # the lead was given back
            return
        if lead.has and lead.welcome is not None and state.session != lead.welcome.station:
            self._lose_lead("it was started again")
        elif not lead.has or lead.welcome is None or refusal not in {"", "no clock"}:
            return
        elif state.sent_ns < lead.welcome.sent_ns:
            return  # from before we led
        elif state.leader != lead.session:
            self._lose_lead("it does not listen to this session any more")
        else:
            self._state, self._state_ns = state, now_ns
            if (hand := self._intent.hand) is not None:
                hand.angles = state.angles_rad

    def _lose_lead(self, why: str) -> None:
        self._lead.lose()
        self._state = None
        self._notify(f"robot {self.net.robot!r} is asked for the lead again: {why}")

    def _receive_event(self, _key: str, data: bytes) -> None:
        now_ns = time.monotonic_ns()
        try:
            event = decode(Change, data)
        except msgspec.DecodeError:
            return
        with self._lock:
            refusal = self._events.refusal(event, now_ns, self._clock.offset(now_ns))
        if refusal in {"", "no clock"}:
            self._notify(f"robot {self.net.robot!r}: {event.change.state}: {event.change.reason}")

    def _receive_feature(self, key: str, data: bytes) -> None:
        with self._lock:
            now_ns = time.monotonic_ns()
            self._touch.feature(key.rpartition("/")[2], data, now_ns, self._clock.offset(now_ns))

    def _receive_image(self, key: str, data: bytes) -> None:
        self._touch.image(key.rpartition("/")[2], data, self._clock.offset(time.monotonic_ns()))
