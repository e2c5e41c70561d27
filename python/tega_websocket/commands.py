"""Check the commands of clients: one client leads, and its command expires without renewal."""

from __future__ import annotations

import threading
import time
from collections import Counter
from collections.abc import Callable
from functools import partial
from typing import Any, Final

from tega.arm.pose import StampedPose
from tega.devices.base import Tracker
from tega.hand import nearest_level
from tega.loop.inbox.inputs import Muscles, Prepared, Seat
from tega.loop.inbox.stream import LiveStream
from tega.loop.parts import Part, RunStart
from tega.records import Intent
from tega_link.ends import FarMuscles, FarSwitch, FarTracker, far_muscles
from tega_websocket.messages import Arm, Hand, MessageError

SWITCHES: Final = ("dead_man", "clutch", "recover")


class Commands:
    """Takes commands of the leading client, in the server's thread, and hands them to the loop.

    A command names the newest time of the session that its client has received, so its age is known without a
    common clock: it includes the way there and back. One that is older than the time-to-live is refused, and
    one that waits here longer lapses.

    ``hand`` is whether clients may lead the hand; ``arm`` is the axes of the arm's mapping, ``None`` where they
    may not lead the arm. ``name`` is the settings' table, for messages; ``refused`` counts commands that were not
    obeyed, by reason.
    """

    def __init__(
        self,
        *,
        ttl_ms: float,
        hand: bool,
        arm: str | None,
        clock: Callable[[], int] = time.monotonic_ns,
        name: str = "websocket",
        peer: str = "WebSocket client",
    ) -> None:
        self.name, self._peer = name, peer.rpartition(" ")[2]
        self._ttl_ns, self.hand, self._clock = round(ttl_ms * 1e6), hand, clock
        self._lock = threading.Lock()
        self._start_ns: int | None = None
        self._stamp: Callable[[int, int], None] = lambda _t_ns, _received_ns: None
        self._levels: LiveStream[Intent] = LiveStream(clock=clock)
        label = f"a {peer}"
        self._source = FarMuscles(name, label, f"levels are asked for by {label}")
        self.tracker = None if arm is None else FarTracker(arm, name, label)
        self.n = 0
        self.refused = Counter[str]()
        self._forget()

    def _forget(self) -> None:
        self._leader: int | None = None
        self._last_ns = {"hand": 0, "arm": 0}
        self._newest_ns = {"hand": -1, "arm": -1}
        # The next client has to press the clutch itself.
        self._switches: Arm | None = None
        self._clutch_was_open = False

    # The run's side.

    def muscles(self) -> Muscles:
        """Return the EMG side of a run with levels from a client."""
        return far_muscles(self._source, self._levels)

    def seats(self) -> dict[str, Seat]:
        """Return the switches of an arm that a client leads."""
        if self.tracker is None:
            return {}
        made: dict[str, Any] = {name: FarSwitch(name, partial(self._switch, name)) for name in SWITCHES}
        return {name: Seat(source, None) for name, source in made.items()}

    def begin(self, start_ns: int, stamp: Callable[[int, int], None] | None) -> None:
        """Obey from now on; ``start_ns`` is the session's start on the monotonic clock.

        ``stamp`` receives time and arrival of each level; ``None`` where latency is not traced.
        """
        with self._lock:
            self._start_ns = start_ns
            if stamp is not None:
                self._stamp = stamp

    def end(self) -> None:
        """Obey nothing any more."""
        with self._lock:
            self._start_ns, self._leader = None, None

    def missing(self) -> str:
        """Return why there is no command for the hand, ``""`` if there is one."""
        if not self.hand:
            return ""
        with self._lock:
            leader, last_ns = self._leader, self._last_ns["hand"]
        if leader is None:
            return f"{self.name}: no {self._peer} leads"
        age_ns = self._clock() - last_ns
        if not last_ns:
            return f"{self.name}: {self._peer} {leader} has asked for no level yet"
        if age_ns <= self._ttl_ns:
            return ""
        return f"{self.name}: no level from {self._peer} {leader} for {age_ns / 1e9:.1f} s"

    def _switch(self, name: str) -> tuple[int, bool, bool]:
        """Return when a switch was received, whether that is fresh, and whether it counts as held."""
        with self._lock:
            given, last_ns, was_open = self._switches, self._last_ns["arm"], self._clutch_was_open
        fresh = given is not None and self._clock() - last_ns <= self._ttl_ns
        if given is None:
            return last_ns, False, False
        if name == "clutch":
            # Through a silence it stays as it was: the arm's chain lets go by itself, and wants it pressed again.
            return last_ns, fresh, given.clutch and was_open
        return last_ns, fresh, fresh and (given.dead_man if name == "dead_man" else given.recover)

    # The server's side.

    def obey(self, client: int, command: Hand | Arm) -> None:
        """Hand a command to the loop; :class:`MessageError`, with the reason, if it is not obeyed.

        The first client that commands leads until it releases or is gone.
        """
        stream = "hand" if isinstance(command, Hand) else "arm"
        with self._lock:
            try:
                age_ns = self._accept(client, stream, command)
            except MessageError as error:
                why = str(error).partition(":")[0]
                self.refused[why] += 1
                raise
            self._last_ns[stream], self._newest_ns[stream] = self._clock() - age_ns, command.t_ns
            self.n += 1
            if isinstance(command, Hand):
                self._level(command)
            else:
                self._pose(command)

    def _accept(self, client: int, stream: str, command: Hand | Arm) -> int:
        """Return the age of a command, nanoseconds; refuse it if it is not to be obeyed."""
        if not (self.hand if stream == "hand" else self.tracker is not None):
            raise MessageError(f"not allowed: {self.name}.{stream} is false")
        if self._start_ns is None:
            raise MessageError("not running: the run has not started, or has ended")
        if self._leader is None:
            self._leader = client
        if self._leader != client:
            raise MessageError(f"not leading: {self._peer} {self._leader} leads")
        age_ns = self._clock() - self._start_ns - command.t_ns
        if age_ns < 0:
            raise MessageError("ahead: t_ns is later than the session's time")
        if age_ns > self._ttl_ns:
            raise MessageError(
                f"old: {age_ns / 1e6:.0f} ms since t_ns, {self._ttl_ns / 1e6:g} ms are obeyed ({self.name}.ttl_ms)"
            )
        if command.t_ns < self._newest_ns[stream]:
            raise MessageError("out of order: t_ns is earlier than that of the command before")
        return age_ns

    def _level(self, command: Hand) -> None:
        assert self._start_ns is not None
        now_ns = self._clock()
        level = command.level if command.closure is None else nearest_level(command.closure)
        assert level is not None
        t_ns = max(now_ns - self._start_ns, self._levels.end_ns)
        self._stamp(t_ns, now_ns)
        intent = Intent(t_ns=t_ns, channels=(level,), level=level, closure=command.closure)
        self._levels.put(intent, use_by_ns=self._last_ns["hand"] + self._ttl_ns)

    def _pose(self, command: Arm) -> None:
        self._switches = command
        self._clutch_was_open |= not command.clutch
        if self.tracker is not None:
            at_ns = self._last_ns["arm"]
            pose = StampedPose(at_ns, command.position_m, command.quaternion_xyzw, command.valid)
            self.tracker.observe(pose, use_by_ns=at_ns + self._ttl_ns)

    def release(self, client: int) -> None:
        """End the lead of a client, if it leads: the run holds from now on."""
        with self._lock:
            if self._leader != client:
                return
            self._forget()
            if self.tracker is not None:
                self.tracker.forget()


class CommandedPart(Part):
    """Part of a run whose clients lead hand and arm, where the settings allow it."""

    def __init__(self, commands: Commands) -> None:
        self._commands = commands
        self.endless = self.brings_input = commands.hand

    @property
    def tracker(self) -> Tracker | None:
        """Forearm of the client that leads the arm; ``None`` where none may."""
        tracker: Any = self._commands.tracker
        return tracker  # type: ignore[no-any-return]

    def prepared(self, prepared: Prepared) -> Prepared:
        """Return the inputs, with a client's levels where clients may lead the hand."""
        return prepared._replace(muscles=self._commands.muscles()) if self._commands.hand else prepared

    def begin(self, run: RunStart) -> None:
        """Obey from now on."""
        stamp = run.trace.source("emg") if run.trace is not None and self._commands.hand else None
        self._commands.begin(run.start_ns, stamp)

    def end(self) -> None:
        """Obey nothing any more."""
        self._commands.end()
