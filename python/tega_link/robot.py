"""Run the robot's station: hand, arm, fingertips, recorder, and everything that keeps them safe.

The station trusts nothing that comes: whatever is not of the operator who leads, in order and young, is not used, and
the session's own guard, the arm's chain and the arm's process each hold whatever the link does.
"""

from __future__ import annotations

import secrets
import time
from collections.abc import Callable
from contextlib import ExitStack
from functools import partial
from typing import Any

import tega
from tega.config import SessionConfig
from tega.devices.base import Tracker
from tega.loop.inbox.inputs import Inputs, Prepared, Seat
from tega.loop.inbox.reader import Reader, read_items
from tega.loop.inbox.sources import samples_of
from tega.loop.parts import RunStart
from tega.records import Contact, Picture, RunState
from tega.records.bus import Bus
from tega.runtime.device_items import EmgChunk
from tega_link.behind import PictureSender, SampleReceiver
from tega_link.commands import Commands
from tega_link.ends import FarMuscles, FarSwitch, FarTracker, far_muscles
from tega_link.leader import Reception
from tega_link.link import Channel
from tega_link.messages import Change, Feature, State, Welcome, encode
from tega_link.station import Station

_STATE_NS = 100_000_000


class RobotStation(Station):
    """The robot's end of the link."""

    origin = "the maxima are at the operator's station"

    def __init__(self, config: SessionConfig, bus: Bus) -> None:
        self._session = secrets.randbits(62) | 1
        super().__init__(config, bus, lambda: self._session)
        bus.subscribe(Contact, self._contact, name="link")
        net, arm = self.net, config.arm
        frame = "" if arm is None else arm.mapping.frame
        self._has_hand = config.hand.driver is not None
        self._reception = Reception(
            net.own_name,
            self._lock,
            operators=net.operators,
            frame=frame,
            hand=self._has_hand,
            begin=self._begin_session,
            notify=self._notify,
        )
        self._tracker = FarTracker(frame) if arm is not None else None
        self._commands = Commands(
            ttl_ns=round(net.ttl_ms * 1e6),
            offset=self._clock.offset,
            hand=self._has_hand,
            tracker=self._tracker,
        )
        self._records = config.recording.dir is not None
        self._muscles = FarMuscles()
        self._samples = SampleReceiver(self._muscles)
        self._reader: Reader[EmgChunk] | None = None
        self._n_leaders = 0
        self._features: dict[str, Callable[[bytes], None]] = {}
        self._pictures: PictureSender | None = None
        self._next_state_ns = 0

    def open(self) -> None:
        """Wait for operators; errors are those of :class:`tega_link.link.Link`."""
        link = self._link
        link.open()
        self._send_state = link.sends("state", Channel.STATE)
        self._send_event = link.sends("event", Channel.EVENT)
        self._clock.open(link.sends("clock/ping", Channel.COMMAND), link.sends("clock/pong", Channel.COMMAND))
        for finger in self._config.tactile:
            self._features[finger] = link.sends(f"tactile/features/{finger}", Channel.FEATURES)
        link.receives("cmd/*/hand", self._receive_command)
        link.receives("cmd/*/arm", self._receive_command)
        link.receives("cmd/*/emg", self._receive_samples)
        link.receives("cmd/*/clock/*", self._receive_clock)
        link.watches("operator/*/*", self._reception.watch)
        link.answers("join/*", self._reception.join)
        self._start()
        self._notify(f"robot {self.net.own_name!r} waits for an operator at {self.net.listen}")

    def end(self) -> None:
        """Hand nothing more to the recording."""
        if self._reader is not None:
            self._reader.close()

    def close(self) -> None:
        """End the link."""
        self.end()
        if self._pictures is not None:
            self._pictures.close()
        super().close()

    # The session's side.

    def prepared(self, prepared: Prepared) -> Prepared:
        """Add the operator's levels, and send pictures as they are read."""
        if self.net.images_hz > 0 and prepared.fingers:
            self._pictures = PictureSender(
                self._link,
                self._session,
                prepared.fingers,
                rate_hz=self.net.images_hz,
                quality=self.net.jpeg_quality,
                wanted=lambda: self._reception.session != 0,
            )
            self._bus.subscribe(Picture, self._pictures.observe, name="link")
        if self._has_hand:
            prepared = prepared._replace(muscles=far_muscles(self._muscles, self._commands.blocks))
        return prepared

    def inputs(self, stack: ExitStack, inputs: Inputs) -> Inputs:  # noqa: ARG002
        """Return the operator's switches, where there is an arm for them."""
        if self._tracker is None:
            return inputs
        seats = {}
        for name in ("dead_man", "clutch", "recover"):
            source: Any = FarSwitch(name, partial(self._commands.switch, name))
            seats[name] = Seat(source, None)
        return Inputs(seats)

    @property
    def tracker(self) -> Tracker | None:
        """The operator's forearm."""
        far: Any = self._tracker
        return far  # type: ignore[no-any-return]

    def begin(self, run: RunStart) -> None:
        """Let operators lead from now on."""
        prepared, start_ns, trace = run.prepared, run.start_ns, run.trace
        pictures = self._pictures
        self._reception.welcome = Welcome(
            station=self._session,
            fingers={name: f.source.info.rate_hz or 0.0 for name, f in prepared.fingers.items()},
            hand=self._has_hand,
            arm=self._tracker is not None,
            tega=str(tega.__version__),
            preset=self._config.session.preset,
            baselines={} if pictures is None else pictures.baselines(prepared),
            records=self._records,
            touch={f: full for f in prepared.fingers if (full := prepared.calibration.touch(f)) is not None},
        )
        if self._records and prepared.muscles is not None:
            source = prepared.muscles.source
            self._reader = Reader(
                "emg-read",
                partial(read_items, source),
                lambda chunk: self._bus.publish(samples_of(chunk, live=source.info.live, start_ns=start_ns)),
            )
        if pictures is not None:
            pictures.start(start_ns)
        stamp = trace.source("emg") if trace is not None and prepared.muscles is not None else None
        self._commands.start(start_ns, stamp)
        self._start_ns = start_ns

    def missing(self) -> str:
        """Return that no operator leads, or that the leader's commands do not come."""
        if self._error:
            return self._error
        if self._reception.session == 0:
            return "link: no operator leads"
        return self._commands.missing(self._reception.name)

    def _contact(self, contact: Contact) -> None:
        """Send what was measured in one picture, in the loop's thread."""
        if self._start_ns is None or self._reception.session == 0:
            return
        stamp = self._stamp(contact.finger)
        feature = Feature(**stamp, t_ns=self._start_ns + contact.t_ns, contact=contact)
        self._features[contact.finger](encode(feature))

    def changed(self, change: RunState) -> None:
        """Report a change of the run's state, here and to the operator."""
        super().changed(change)
        stamp = self._stamp("event")
        self._send_event(encode(Change(**stamp, change=change)))
        self._next_state_ns = 0

    @property
    def words(self) -> str:
        """The leader, the commands and the clock, in one line."""
        if not self._reception.session:
            return "waits for an operator"
        commands = self._commands
        text = f"led by {self._reception.name}, {commands.rate_hz:.0f} commands/s"
        if commands.route.n:
            text += f", way {commands.route.at(0.5) / 1e6:.1f} ms"
        text += f", {self._clock.words}"
        if refused := commands.refused:
            text += ", refused: " + ", ".join(f"{n} {why}" for why, n in refused.items())
        return text

    def _summary(self) -> dict[str, Any]:
        commands = self._commands
        with self._lock:
            commands.keep_counts()
        return self._link_summary() | {
            "way_ms": commands.route.summary_ms() if commands.route.n else None,
            "leaders": self._n_leaders,
            "commands": commands.n,
            "refused_commands": dict(commands.refused_in_all),
            "features": {f: self._numbers.get(f, -1) + 1 for f in self._features},
            "images": {} if self._pictures is None else self._pictures.sent,
        }

    # The link's side: in Zenoh's threads.

    def _begin_session(self, session: int | None) -> None:
        """Listen to a session, or to none; with the lock held."""
        self._commands.begin(session)
        self._samples.begin(session)
        self._clock.forget()
        self._n_leaders += session is not None
        self._next_state_ns = 0

    def _receive_clock(self, key: str, data: bytes) -> None:
        if self._reception.is_leader(key):
            self._clock.receive(key, data, self._reception.session)

    def _receive_samples(self, key: str, data: bytes) -> None:
        if self._records and self._reception.is_leader(key):
            now_ns = time.monotonic_ns()
            self._samples.take(data, now_ns, self._clock.offset(now_ns))

    def _receive_command(self, key: str, data: bytes) -> None:
        commands, for_arm = self._commands, key.endswith("/arm")
        with self._lock:
            if not self._reception.is_leader(key):
                commands.foreign("arm" if for_arm else "hand")
            elif for_arm:
                commands.arm(data)
            else:
                commands.hand(data)

    def _turn(self, now_ns: int) -> None:
        session = self._reception.check(now_ns)
        if session:
            self._clock.ask(session, now_ns)
        self._commands.count_rate(now_ns)
        if now_ns >= self._next_state_ns:
            self._next_state_ns = now_ns + _STATE_NS
            self._send_state_now(session)

    def _send_state_now(self, session: int) -> None:
        facts: dict[str, Any] = self._stamp("state")
        if (view := self._view) is not None:
            facts |= {"state": view.state, "reason": view.reason, "alerts": tuple(view.alerts)}
            facts |= {"arm": view.arm, "angles_rad": tuple(view.angles_rad or ())}
        report = State(
            **facts,
            leader=session,
            refused=self._commands.refused,
            problem=self.missing() if session else "",
        )
        self._send_state(encode(report))
