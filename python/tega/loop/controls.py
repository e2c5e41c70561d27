"""Define the controls of a run, which the loop polls at every tick, and tests of single motors while it is armed."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final, NamedTuple

import numpy as np

from tega.haptics import MotorLevels
from tega.records import TriedMotor
from tega.records.bus import Bus

TEST_PERCENT: Final = 50
"""Intensity of a motor test, percent; less if the motor's limits allow less."""

_LASTS_NS: Final = 500_000_000
_ANSWER_S: Final = 1.0


class MotorAnswer(NamedTuple):
    """Answer to a click on a motor: whether it vibrates, and the intensity or the reason for a refusal."""

    done: bool
    words: str


def lit_frame(silence: MotorLevels, motor: int, percent: int) -> MotorLevels:
    """Return a frame in which one motor is on."""
    lit = np.zeros_like(silence.intensities)
    lit[motor] = percent
    lit.flags.writeable = False
    return MotorLevels(silence.layout, lit)


class MotorTests:
    """Wishes to feel a motor, one at a time, while the run is armed.

    The frame takes the way of every frame: through the driver's limits and into the wearer's daily dose.
    """

    def __init__(self) -> None:
        self._one = threading.Lock()
        self._answered = threading.Event()
        self._wanted: int | None = None
        self._answer = MotorAnswer(done=False, words="")
        self._running: tuple[int, int] | None = None  # motor, and until when
        self._refused: Callable[[], str] = lambda: "no run has begun"
        self._bus = Bus()

    def begin(self, refused: Callable[[], str], bus: Bus) -> None:
        """Join a run, whose bus gets the tests; ``refused`` returns why no motor may be tried now."""
        self._refused, self._bus = refused, bus

    def ask(self, motor: int) -> MotorAnswer:
        """Ask for a motor, and wait until the loop has answered; for any thread but the loop's."""
        if not self._one.acquire(blocking=False):
            return MotorAnswer(done=False, words="not tried: another motor is")
        try:
            self._answered.clear()
            self._wanted = motor
            if not self._answered.wait(_ANSWER_S):
                self._wanted = None
                return MotorAnswer(done=False, words="not tried: the run drives no vest now")
            return self._answer
        finally:
            self._one.release()

    @property
    def active(self) -> bool:
        """Whether a motor vibrates or is asked for."""
        return self._running is not None or self._wanted is not None

    def frame(self, t_ns: int, frame: MotorLevels) -> MotorLevels:
        """Return the frame of a tick, with the motor that is tried in it; called by the loop."""
        why, n_motors = self._refused(), len(frame.intensities)
        wanted, self._wanted = self._wanted, None
        if self._running is not None and (why or t_ns >= self._running[1]):
            self.end(t_ns)
        if wanted is not None:
            if self._running is not None:
                why = "another motor is"
            elif not why and not 0 <= wanted < n_motors:
                why = f"motor {wanted} is none of 0 to {n_motors - 1} of {frame.layout}"
            if why:
                self._answer_with(done=False, words=f"not tried: {why}")
            else:
                self._running = wanted, t_ns + _LASTS_NS
                self._bus.publish(TriedMotor(t_ns=t_ns, motor=wanted, percent=TEST_PERCENT))
        return frame if self._running is None else lit_frame(frame, self._running[0], TEST_PERCENT)

    def sent(self, t_ns: int, sent: MotorLevels | None) -> None:
        """Answer the request from the frame that the vest was sent; ``None`` without a vest."""
        if self._running is None or self._answered.is_set():
            return
        motor = self._running[0]
        percent = 0 if sent is None else int(sent.intensities[motor])
        words = f"motor {motor} vibrates at {percent} %"
        if not percent:
            self.end(t_ns)
            unreached = "the vest is not reached, or its limits allow it no more"
            words = f"not tried: {'the run has no vest' if sent is None else unreached}"
        self._answer_with(done=bool(percent), words=words)

    def end(self, t_ns: int) -> None:
        """End a test, if there is one."""
        running, self._running = self._running, None
        if running is not None:
            self._bus.publish(TriedMotor(t_ns=t_ns, motor=running[0], percent=0))

    def _answer_with(self, *, done: bool, words: str) -> None:
        self._answer = MotorAnswer(done=done, words=words)
        self._answered.set()


@dataclass(frozen=True, kw_only=True)
class Controls:
    """Controls of a run, each called at every tick.

    Attributes:
        stop: Whether the run is to end; every output is then left silent.
        go: Whether an armed run may become active.
        haptics: Whether the vest's motors may run.
        authority: Authority of the reflex, 0 to 1; ``None`` for the settings' and the button's.
        level: Closure level of a program, 1 to 5; ``None`` for that of the muscles.
        motor_tests: Takes wishes to feel one motor of the vest while the run is armed.
    """

    stop: Callable[[], bool] = lambda: False
    go: Callable[[], bool] = lambda: True
    haptics: Callable[[], bool] = lambda: True
    authority: Callable[[], float | None] = lambda: None
    level: Callable[[], float | None] = lambda: None
    motor_tests: MotorTests = field(default_factory=MotorTests)
