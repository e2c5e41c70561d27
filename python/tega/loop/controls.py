"""Define the controls of a run: the loop polls them at every tick; a page, terminal or program answers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from tega.loop.motor_tests import MotorTests


def _no() -> bool:
    return False


def _yes() -> bool:
    return True


def _as_set() -> None:
    return None


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

    stop: Callable[[], bool] = _no
    go: Callable[[], bool] = _yes
    haptics: Callable[[], bool] = _yes
    authority: Callable[[], float | None] = _as_set
    level: Callable[[], float | None] = _as_set
    motor_tests: MotorTests = field(default_factory=MotorTests)
