"""Describe an arm for displays: its state, the position of its hand, and the switches held."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple, cast

from tega.arm.messages import Health
from tega.arm.pose import ArmCommand, ArmState
from tega.arm.turn import Turn
from tega.devices.arm.base import ArmDriver
from tega.records import ArmTurn


class ArmView(NamedTuple):
    """View of an arm at one moment.

    Attributes:
        state: State of the tracking chain.
        clutch: Whether the clutch is pressed.
        dead_man: Whether the dead-man switch is held.
        hand_m: Position of the hand, base's axes; ``None`` before it is known.
        behind_mm: Distance from the target; ``None`` without one.
    """

    state: ArmState
    reason: str
    phase: str
    clutch: bool
    dead_man: bool
    hand_m: tuple[float, float, float] | None
    behind_mm: float | None
    health: Health

    @property
    def words(self) -> str:
        """Summary of the arm in one line: state, reason and timing of its loop."""
        health = self.health
        took = "" if health.success_rate is None else f", robot took {100 * health.success_rate:.0f} %"
        return (
            f"{self.state}: {self.reason} "
            f"({self.phase}, {health.rate_hz:.0f} Hz, worst {health.worst_ms:.0f} ms{took})"
        )

    @property
    def place(self) -> str:
        """Words for the hand's place, and how far it is behind its target."""
        if self.hand_m is None:
            return "not known yet"
        x, y, z = self.hand_m
        behind = "" if self.behind_mm is None else f", {self.behind_mm:.0f} mm from its target"
        return f"{x:+.3f} {y:+.3f} {z:+.3f} m{behind}"

    @property
    def switches(self) -> str:
        """Words for the switches that the operator holds."""
        return (
            f"clutch {'pressed' if self.clutch else 'open'}, dead-man {'held' if self.dead_man else 'let go'}"
        )


def check(turn: Turn, command: ArmCommand, arm: ArmDriver) -> ArmView:
    """Return the view of an arm's turn."""
    measured = () if turn.measured is None else tuple(map(float, turn.measured.position_m))
    target = () if command.target is None else command.target.position_m.tolist()
    switches = turn.clutch, turn.dead_man
    return ArmView(
        command.state, command.reason, arm.phase, *switches, *_placed(measured, target), arm.health
    )


def recorded_check(turn: ArmTurn) -> ArmView:
    """Return the view of a recorded turn of an arm."""
    measured = turn.measured[0].position if turn.measured else ()
    state, switches = cast("ArmState", turn.state), (turn.clutch, turn.dead_man)
    return ArmView(state, turn.reason, turn.phase, *switches, *_placed(measured, turn.target[:3]), Health())


def _placed(
    measured: Sequence[float], target: Sequence[float]
) -> tuple[tuple[float, float, float] | None, float | None]:
    """Return the position of the hand, metres, and its distance from the target, millimetres."""
    if len(measured) != 3:
        return None, None
    x, y, z = measured
    return (x, y, z), 1e3 * math.dist(measured, target) if len(target) == 3 else None
