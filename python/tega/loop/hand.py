"""Turn a level into torques and CAN frames at every tick of the hand, and look at it for the detector of slips."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from tega.config import SessionConfig
from tega.devices.base import SteeredHand, optional
from tega.hand import ModelledHand
from tega.hand.poses import ClosureScale, load_poses
from tega.records import HandLook
from tega.wire import CanFrame, allegro_limp_frames, allegro_torque_frames

# The Allegro v4 reports its joints every 3 ms and wants one torque set for each.
HAND_TICK_NS = 3_000_000


class Hand(Protocol):
    """Turns levels into frames for a hand, tick by tick, as :class:`tega.devices.base.SteeredHand` does."""

    @property
    def angles_rad(self) -> NDArray[np.float64]:
        """The hand's joint angles as last known, float64 (16,), in radians."""

    def step(self, level: float, added: float = 0.0) -> Sequence[CanFrame]:
        """Advance by one tick of 3 ms; ``added``, levels of the reflex, 0 to 1, is removed as soon as it is 0."""

    def limp(self) -> Sequence[CanFrame]:
        """Return the frames that leave the hand without force."""


class ModelledAllegro:
    """The frames that would go to an Allegro Hand v4 if its joints moved as an ideal model's do.

    The model has no load, contact or friction. ``device_id`` is the hand's number on its bus, 0 to 3; ``framed`` is
    whether there are frames while it moves, or angles only; ``angles_rad`` is float64 (16,), radians.
    """

    label = "modelled: torques from an ideal joint model, no hand's angles were read"

    def __init__(self, *, device_id: int = 0, framed: bool = True) -> None:
        self._device_id, self._framed = device_id, framed
        self._hand = ModelledHand()
        self.angles_rad: NDArray[np.float64] = self._hand.model.angles_rad

    @property
    def target_rad(self) -> NDArray[np.float64] | None:
        """Joint targets of the last tick, float64 (16,), in radians; ``None`` before the first."""
        return self._hand.controller.target_rad

    def step(self, level: float, added: float = 0.0) -> list[CanFrame]:
        """Go on by one tick of 3 ms; ``level`` is 1 to 5, with fractions between two poses."""
        self.angles_rad, torques = self._hand.step(level, added)
        return allegro_torque_frames(torques, device_id=self._device_id) if self._framed else []

    def limp(self) -> list[CanFrame]:
        """Return zero torque for every finger, then SERVO OFF."""
        return allegro_limp_frames(device_id=self._device_id)


# The rule was fitted on looks 10 ms apart; a hand's process reports angles every 8 ms.
HAND_POLL_NS: Final = 3 * HAND_TICK_NS


class HandPolls:
    """Looks at hand and arm every 9 ms.

    A look is empty, and the detector uses touch alone, if hand or arm reports nothing fresh or a number is not
    finite. ``angles_rad`` returns the joint angles, float64 (16,), rad, ``height_m`` the height of the arm's end,
    metres; both ``None`` where none is fresh. ``now_ns`` returns nanoseconds since the start of the session.
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
        if angles_rad is None or height_m is None or not np.isfinite([*angles_rad, height_m]).all():
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


def fresh_angles_rad(hand: SteeredHand | Hand) -> NDArray[np.float64] | None:
    """Return a hand's joint angles, float64 (16,), rad; ``None`` while it is silent or they are not finite."""
    if optional(hand, "silent"):
        return None
    angles_rad = np.asarray(hand.angles_rad, np.float64)
    return angles_rad if angles_rad.shape == (16,) and np.isfinite(angles_rad).all() else None


def open_hand_polls(
    config: SessionConfig,
    *,
    hand: SteeredHand | None,
    height_m: Callable[[], float | None] | None,
    now_ns: Callable[[], int],
) -> HandPolls | None:
    """Make a run's looks; ``None`` where hand or arm is not measured, or the settings want touch alone."""
    if hand is None or height_m is None or config.stages.slips == "touch":
        return None
    return HandPolls(lambda: fresh_angles_rad(hand), height_m, hand_closure(config), now_ns)
