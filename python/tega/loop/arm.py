"""Steer the arm in a run: forearm poses go through the chain to the arm's process, in a thread of its own.

The thread shares nothing with the dual loop but the run's state, so neither keeps the other waiting.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack
from typing import Any

from tega.arm.chain import ArmChain, Turn, lead
from tega.arm.pose import ArmCommand, PoseSource, StampedPose
from tega.config import ArmConfig, SessionConfig
from tega.devices.base import ArmDriver, DeviceInfo, Tracker
from tega.devices.registry import driver_class
from tega.devices.tracker.sources import RatePoses
from tega.errors import ConfigError
from tega.loop.arm_records import ArmRecords, ArmView, arm_row, arm_view
from tega.loop.inbox.inputs import Inputs, Seat
from tega.loop.snapshot import LoopView
from tega.loop.touch import STALE_NS
from tega.records.bus import Bus

_LEAVE_S = 5.0


class Steering:
    """Leads an arm for as long as a run lasts."""

    def __init__(
        self,
        config: ArmConfig,
        arm: ArmDriver,
        source: PoseSource,
        *,
        tracker: Tracker | None,
        led_by: DeviceInfo,
        seats: dict[str, Seat],
    ) -> None:
        self._config, self._arm, self._source = config, arm, source
        self._tracker, self._led_by, self._seats = tracker, led_by, seats
        self._records: ArmRecords | None = None
        self._chain = ArmChain(config.chain)
        self._leaving = threading.Event()
        self._thread: threading.Thread | None = None
        self._command: ArmCommand | None = None
        self._view: ArmView | None = None
        self._measured: StampedPose | None = None
        self._error = ""
        self._was_pressed = self._wants_clear = False
        self._state_s: dict[str, float] = dict.fromkeys(("idle", "following", "holding", "stopped"), 0.0)
        self._turns = self._late = self._start_ns = 0
        self._worst_ms = 0.0
        # Squares of the hand's distance from the target while it follows: their number, sum and greatest.
        self._off_m2 = (0, 0.0, 0.0)
        self._last_ns: int | None = None

    def start(self, bus: Bus, start_ns: int, *, may_move: Callable[[], bool]) -> None:
        """Begin to lead the arm in a thread; ``start_ns`` is the session's start on the monotonic clock.

        Every turn is published. The arm holds while ``may_move``, called at every turn, is false.
        """
        self._start_ns, self._records = start_ns, ArmRecords(bus, start_ns, self._config.mapping)
        self._thread = threading.Thread(target=self._run, args=(may_move,), name="tega-arm", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Have the arm rest, and end."""
        self._leaving.set()
        if self._thread is not None:
            self._thread.join(_LEAVE_S)
            self._thread = None

    @property
    def problem(self) -> str:
        """Problems of the arm, its tracker or another pose source; ``""`` for none."""
        doubt = f"arm: {self._chain.doubt}" if self._chain.doubt else ""
        tracker = "" if self._tracker is None else self._tracker.problem
        problems = [self._error, self._arm.problem, tracker, doubt]
        if not any(problems) and self._command is not None and self._command.state == "stopped":
            problems = [f"arm: stopped: {self._command.reason}"]
        return "; ".join(s for s in problems if s)

    def displayed(self, view: LoopView) -> LoopView:
        """Return a view of the loop with the arm's state added."""
        seen = self._view
        height_m = None if seen is None or seen.hand_m is None else seen.hand_m[2]
        words = "not yet" if seen is None else seen.words
        return view._replace(arm=words, seen_arm=seen, arm_height_m=height_m)

    def height_m(self) -> float | None:
        """Return the height of the arm's end, metres over its base; ``None`` unless measured in the last 100 ms."""
        seen = self._measured
        if seen is None or time.monotonic_ns() - seen.t_ns > STALE_NS:
            return None
        return float(seen.position_m[2])

    @property
    def infos(self) -> dict[str, DeviceInfo]:
        """Descriptions of arm and tracker, by the name of their part."""
        return {"arm": self._arm.info, "forearm": self._led_by}

    def summary(self) -> dict[str, Any]:
        """Return a run's summary of the arm."""
        info, health = self._arm.info, self._arm.health
        holds = 0 if self._command is None else self._command.engagements
        n, all_m2, most_m2 = self._off_m2
        off_m2 = {"rms": all_m2 / n, "worst": most_m2} if n else {}
        return {
            "driver": info.driver,
            "source": info.label,
            "led_by": self._led_by.label,
            "holds": holds,
            "state_s": {state: round(s, 3) for state, s in self._state_s.items()},
            "commands": self._turns,
            "late_commands": self._late,
            "worst_ms": round(self._worst_ms, 3),
            "off_target_mm": {name: round(1e3 * math.sqrt(m2), 2) for name, m2 in off_m2.items()},
            "arm_hz": round(health.rate_hz, 1),
            "arm_late_ticks": health.late,
            "refused_commands": health.refused,
            "ended": self._error or ("" if self._command is None else self._command.reason),
        }

    def notes(self) -> list[str]:
        """Return notes for readers of the results."""
        return [*self._arm.info.notes, *(() if self._tracker is None else self._tracker.info.notes)]

    def _run(self, may_move: Callable[[], bool]) -> None:
        period_s = 1 / self._config.rate_hz
        next_s = time.monotonic()
        try:
            while not self._leaving.wait(max(0.0, next_s - time.monotonic())):
                next_s = max(next_s + period_s, time.monotonic() - period_s)
                self.turn(time.monotonic_ns(), self._arm.measured(), may_move=may_move())
        except BaseException as error:  # reported while the run lasts; the arm rests by itself
            self._error = f"arm: no longer led: {error}"
        is_stopped = self._command is not None and self._command.state == "stopped"
        self._take(
            Turn(time.monotonic_ns(), stopped="" if is_stopped else self._error or "the run has ended")
        )

    def turn(self, now_ns: int, measured: StampedPose | None, *, may_move: bool) -> ArmCommand:
        """Take in poses and switches, and send one command."""
        arm = self._arm
        self._count(now_ns)
        dead_man, pressed = self._held("dead_man"), self._held("recover")
        if pressed and not self._was_pressed and not dead_man:
            self._wants_clear = True
            if arm.phase == "faulted":
                arm.recover()
        self._was_pressed = pressed
        stopped, cleared = "", False
        if arm.phase in {"faulted", "gone"} and (text := arm.problem):
            # With the clutch still pressed it must not go on by itself once the fault is cleared.
            if self._command is None or self._command.state != "stopped":
                stopped = text
        elif self._wants_clear:
            self._wants_clear, cleared = False, True
        return self._take(
            Turn(
                now_ns,
                tuple(self._source.read(now_ns)),
                clutch=self._held("clutch") if "clutch" in self._seats else dead_man,
                dead_man=dead_man,
                may_move=may_move,
                measured=measured,
                stopped=stopped,
                cleared=cleared,
            )
        )

    def _take(self, turn: Turn) -> ArmCommand:
        command = lead(self._chain, turn)
        self._arm.follow(command)
        row = arm_row(turn, command, self._arm, self._start_ns)
        self._command, self._view = command, arm_view(row, self._arm.health)
        self._measured = turn.measured
        if command.state == "following" and command.target is not None and turn.measured is not None:
            off_m2 = math.dist(command.target.position_m, turn.measured.position_m) ** 2
            n, all_m2, most_m2 = self._off_m2
            self._off_m2 = (n + 1, all_m2 + off_m2, max(most_m2, off_m2))
        if self._records is not None:
            self._records.turn(row, self._arm)
        return command

    def _held(self, name: str) -> bool:
        if (seat := self._seats.get(name)) is None:
            return False
        held = seat.source.state().held
        return bool(held) if seat.button is None else seat.button in held

    def _count(self, now_ns: int) -> None:
        self._turns += 1
        if self._last_ns is not None:
            away_ms = (now_ns - self._last_ns) / 1e6
            self._worst_ms = max(self._worst_ms, away_ms)
            self._late += away_ms > 2e3 / self._config.rate_hz
            if self._command is not None:
                self._state_s[self._command.state] += away_ms / 1e3
        self._last_ns = now_ns


def open_arm(
    stack: ExitStack, config: SessionConfig, inputs: Inputs, *, tracker: Tracker | None = None
) -> Steering:
    """Open the arm and its tracker, or the one given; ``ConfigError`` where something is not set, or does not fit."""
    c, seats = config.arm, dict(inputs.seats)
    if c is None:
        raise ConfigError("no arm is set", "set arm.driver")
    if config.session.pace == "fast":
        raise ConfigError("session.pace = 'fast', but an arm moves in real time", "set session.pace = 'real'")
    if "dead_man" not in seats:
        raise ConfigError(
            "arm: no dead-man switch is set, and without one nothing would stop the arm at once",
            "set [input.dead_man], such as a pedal or a SpaceMouse's button",
        )
    if tracker is None and c.tracker is None and "motion" not in seats:
        raise ConfigError(
            "arm: nothing leads it: neither arm.tracker nor input.motion is set",
            "set [arm.tracker], or [input.motion] with a SpaceMouse",
        )
    if c.mapping.absolute and tracker is None:
        raise ConfigError(
            "arm.mapping.absolute is for programs, which give places to go to; a forearm's poses are no such places",
            "take it out, or let a program lead the arm",
        )
    source: PoseSource
    if tracker is None and c.tracker is not None:
        tracker = driver_class(c.tracker.driver, "tracker")(c.tracker.options)
    if tracker is not None:
        source, led_by, frame = tracker, tracker.info, tracker.frame
    else:
        motion = seats["motion"].source
        source, led_by, frame = RatePoses(motion.state), motion.info, RatePoses.frame
    if frame != c.mapping.frame:
        raise ConfigError(
            f"arm.mapping.frame is {c.mapping.frame!r}, but {led_by.label} gives poses in the axes {frame!r}",
            f"set arm.mapping.frame = {frame!r}",
        )
    arm = stack.enter_context(driver_class(c.driver, "arm")(c.options))
    if tracker is not None:
        stack.enter_context(tracker)
    switches = {name: seat for name, seat in seats.items() if name in {"dead_man", "clutch", "recover"}}
    return Steering(c, arm, source, tracker=tracker, led_by=led_by, seats=switches)
