"""Run the arm's process: ``python -m tega.devices.arm.robot.process SETTINGS``.

:mod:`tega.devices.arm.robot.driver` starts it.

At a steady rate the process reads the newest command, checks it, moves the arm and reports its pose; it does nothing
else that could delay it. The end of its standard input means that the run has ended: the arm then rests at once.
"""

from __future__ import annotations

import contextlib
import importlib
import math
import os
import select
import socket
import sys
import time
from collections import deque
from typing import Any

import msgspec
import numpy as np

from tega.arm.messages import (
    ArmShutdown,
    ArmStatusWords,
    ArmTargetWords,
    Failed,
    HandSeen,
    Health,
    Message,
    Phase,
    Quaternion,
    Ready,
    Recover,
    Triple,
    decode,
    encode,
)
from tega.arm.rotation import between, exp, multiply, unit
from tega.devices.arm.robot.leash import Leash, RobotBody
from tega.errors import TegaError


class Slew:
    """Moves a target towards the requested pose, along the straight line and the shortest rotation."""

    def __init__(self, speed_m_s: float, turn_rad_s: float, place: Triple, turn: Quaternion) -> None:
        self._speed_m_s, self._turn_rad_s = speed_m_s, turn_rad_s
        self.place, self.turn = place, turn

    def toward(self, place: Triple, turn: Quaternion, dt_s: float) -> bool:
        """Go on for a time; return whether it is there."""
        route, left = np.subtract(place, self.place), self._speed_m_s * dt_s
        length = math.hypot(*route.tolist())
        arc = between(unit(np.array(self.turn)), unit(np.array(turn)))
        angle, left_rad = math.hypot(*arc.tolist()), self._turn_rad_s * dt_s
        there = length <= left and angle <= left_rad
        new = np.array(place) if length <= left else np.array(self.place) + route * (left / length)
        q = np.array(turn)
        if angle > left_rad:
            q = multiply(exp(arc * (left_rad / angle)), np.array(self.turn))
        x, y, z = new.tolist()
        qx, qy, qz, qw = unit(q).tolist()
        self.place, self.turn = (x, y, z), (qx, qy, qz, qw)
        return there


_MOST_BYTES = 4096
_WINDOW_S = 1.0
_REST_S = 3.0


class ProcessSettings(msgspec.Struct, frozen=True):
    """Settings of the arm's process, from its command line.

    ``link`` is an inherited file descriptor, the socket. Commands of any other ``session`` are refused.
    ``body`` is module and class of the arm, ``options`` those of its driver.
    """

    link: int
    session: int
    body: str
    options: dict[str, Any]


class Loop:
    """Judges commands and leads the arm at every tick, without the process around it."""

    def __init__(self, settings: ProcessSettings, body: RobotBody, leash: Leash) -> None:
        self._o, self._body, self._leash = settings.options, body, leash
        self._slew: Slew | None = None
        self._held: HandSeen | None = None
        self._fault = ""
        self._resting = False
        self._ticks: deque[tuple[float, float]] = deque()
        self._last_s: float | None = None
        self._late = 0

    def take(self, message: Message, now_ns: int) -> bool:
        """Process a message from the run; return whether the run is leaving."""
        if isinstance(message, ArmTargetWords):
            self._leash.take(message, now_ns)
        elif isinstance(message, Recover) and self._fault:
            self._fault = self._body.recover()
        return isinstance(message, ArmShutdown)

    def tick(self, now_ns: int) -> ArmStatusWords:
        """Advance one tick, and return the status to report."""
        dt_s = self._count(now_ns / 1e9)
        body = self._body
        seen = body.observe()
        order = self._leash.order(now_ns)
        fault = body.fault()
        if fault and not self._fault:
            # What was asked before must not go on by itself once it is cleared.
            self._leash.lose()
            self._slew, self._resting = None, False
            if body.in_control:
                body.rest()
        self._fault = fault or self._fault
        if self._fault:
            return self._reported(seen, "faulted", self._fault)
        if self._resting and body.in_control:
            return self._reported(seen, "resting", order.reason)
        self._resting = False
        if order.kind == "rest":
            if body.in_control:
                body.rest()
                self._resting = True
            self._slew = self._held = None
            return self._reported(seen, "resting" if self._resting else "ready", order.reason)
        if self._slew is None:
            body.begin()
            self._slew = Slew(self._o["speed_m_s"], self._o["turn_rad_s"], seen.place, seen.turn)
        velocities = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        goal = order.requested
        if goal is not None and goal.place is not None and goal.turn is not None:
            self._held = None
            if self._slew.toward(goal.place, goal.turn, dt_s):
                velocities = (goal.velocity_m_s, goal.velocity_rad_s)
        else:
            # Where the arm is, not where it was going: whatever it pressed against is let alone.
            self._held = self._held or seen
            self._slew.toward(self._held.place, self._held.turn, dt_s)
        body.lead(self._slew.place, self._slew.turn, *velocities)
        led = HandSeen(now_ns, self._slew.place, self._slew.turn)
        return self._reported(seen, "following", order.reason, led)

    def _reported(
        self, seen: HandSeen, phase: Phase, reason: str, led: HandSeen | None = None
    ) -> ArmStatusWords:
        return ArmStatusWords(seen, phase, reason, self._leash.refusal, self._health(), led)

    def _count(self, now_s: float) -> float:
        """Take note of a tick and return how long ago the last one was."""
        period_s: float = 1 / self._o["rate_hz"]
        dt_s = period_s if self._last_s is None else now_s - self._last_s
        self._last_s = now_s
        self._late += dt_s > 2 * period_s
        self._ticks.append((now_s, dt_s))
        while self._ticks[0][0] < now_s - _WINDOW_S:
            self._ticks.popleft()
        # After a pause the slew makes up for no more than two ticks.
        return min(dt_s, 2 * period_s)

    def _health(self) -> Health:
        times = [dt_s for _, dt_s in self._ticks]
        return Health(
            rate_hz=len(times) / max(sum(times), 1e-9),
            worst_ms=1e3 * max(times),
            late=self._late,
            refused=self._leash.refused,
            success_rate=self._body.success_rate,
        )


def _run(settings: ProcessSettings, link: socket.socket, body: RobotBody) -> None:
    loop = Loop(settings, body, Leash(settings.session))
    period_s = 1 / settings.options["rate_hz"]
    next_s = time.monotonic()
    while True:
        left_s = next_s - time.monotonic()
        ready, _, _ = select.select([sys.stdin, link], [], [], max(left_s, 0))
        if left_s <= 0:
            next_s = max(next_s, time.monotonic() - period_s)
        if sys.stdin in ready and not os.read(sys.stdin.fileno(), _MOST_BYTES):
            return
        if link in ready and _receive(link, loop):
            return
        if time.monotonic() >= next_s:
            next_s += period_s
            _notify(link, loop.tick(time.monotonic_ns()))


def _receive(link: socket.socket, loop: Loop) -> bool:
    """Take in all that waits; return whether the run leaves."""
    while True:
        try:
            data = link.recv(_MOST_BYTES)
        except BlockingIOError:
            return False
        except OSError:
            return True
        with contextlib.suppress(msgspec.DecodeError):
            if loop.take(decode(data), time.monotonic_ns()):
                return True


def _notify(link: socket.socket, message: Message) -> None:
    # A run that does not read is not waited for.
    with contextlib.suppress(OSError):
        link.send(encode(message))


def main(words: list[str]) -> int:
    """Run the arm's process; return 1 if the arm could not be opened or broke off."""
    settings = msgspec.json.decode(words[0], type=ProcessSettings)
    link = socket.socket(fileno=settings.link)
    link.settimeout(0)
    module, name = settings.body.split(":")
    try:
        body: RobotBody = getattr(importlib.import_module(module), name)(settings.options)
        body.open()
    except TegaError as error:
        _notify(link, Failed(type(error).__name__, error.message, error.hint))
        return 1
    try:
        _notify(link, Ready(body.facts))
        _run(settings, link, body)
    finally:
        body.close()
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
