"""Look at hand and arm as the detector of slips does: closure, height of the fingertips, height of the arm's end."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import NDArray

from tega.config import SessionConfig
from tega.devices.base import SteeredHand, optional
from tega.hand.poses import ClosureScale, load_poses
from tega.loop.arm import Steering
from tega.loop.hand import HAND_TICK_NS
from tega.records import HandLook

# The rule was fitted on looks 10 ms apart; a hand's process tells angles every 8 ms.
HAND_POLL_NS: Final = 3 * HAND_TICK_NS


class HandPolls:
    """Looks at hand and arm every 9 ms.

    A look is complete or empty: if hand or arm reports nothing fresh, or a number is not finite, the look is
    empty, and the detector uses touch alone. ``angles_rad`` returns the measured joint angles, float64 (16,),
    rad, ``height_m`` the height of the arm's end, metres; both ``None`` where none is fresh. ``closure``
    reads the closure off the angles, ``now_ns`` returns nanoseconds since the start of the session.
    """

    def __init__(
        self,
        angles_rad: Callable[[], NDArray[np.float64] | None],
        height_m: Callable[[], float | None],
        closure: ClosureScale,
        now_ns: Callable[[], int],
    ) -> None:
        from tega.hand.mjcf import tip_heights_mm  # a run without looks begins without it

        self._angles_rad, self._height_m, self._closure, self._now_ns = angles_rad, height_m, closure, now_ns
        self._tips_mm = tip_heights_mm
        self._due_ns = 0

    def __call__(self, t_ns: int, level: float) -> HandLook | None:
        """Return the look of a tick, ``None`` where it is too early; ``level`` is with the reflex."""
        now_ns = self._now_ns()
        if now_ns < self._due_ns:
            return None
        # Ticks that are made up for see one and the same hand: looked at once, at its own time. Half a tick of lateness
        # does not put off the next look.
        self._due_ns = now_ns + HAND_POLL_NS - HAND_TICK_NS // 2
        angles_rad, height_m = self._angles_rad(), self._height_m()
        if angles_rad is None or height_m is None:
            return HandLook(t_ns=t_ns, seen_ns=now_ns)
        if not (math.isfinite(height_m) and np.isfinite(angles_rad).all()):
            return HandLook(t_ns=t_ns, seen_ns=now_ns)
        return HandLook(
            t_ns=t_ns,
            seen_ns=now_ns,
            level=level,
            closure=self._closure(angles_rad),
            height_m=height_m,
            tips_mm=self._tips_mm(angles_rad),
        )


def hand_closure(config: SessionConfig) -> ClosureScale:
    """Return the closure scale for the joint angles of the settings' hand."""
    poses = getattr(config.hand.options, "poses", None)
    return ClosureScale(None if poses is None else load_poses(poses))


def fresh_angles_rad(hand: SteeredHand) -> NDArray[np.float64] | None:
    """Return a hand's joint angles, float64 (16,), rad; ``None`` while it is silent or they are not finite."""
    if optional(hand, "silent"):
        return None
    angles_rad = np.asarray(hand.angles_rad, np.float64)
    return angles_rad if angles_rad.shape == (16,) and np.isfinite(angles_rad).all() else None


def open_hand_polls(
    config: SessionConfig, *, hand: SteeredHand | None, arm: Steering | None, now_ns: Callable[[], int]
) -> HandPolls | None:
    """Make a run's looks; ``None`` where hand or arm is not measured, or the settings want touch alone."""
    if hand is None or arm is None or config.stages.slips == "touch":
        return None
    return HandPolls(lambda: fresh_angles_rad(hand), arm.height_m, hand_closure(config), now_ns)
