"""Turn a level into torques and CAN frames at every tick of the hand."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from tega.hand import ModelledHand
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

    The hand accepts torques only, so the joint angles have to be known. Without a hand they come from a model
    without load, contact or friction: the frames are those that would be sent, not the response of a real
    hand. ``device_id`` is the hand's number on its bus, 0 to 3; ``framed`` is whether there are frames while it
    moves, or angles only; ``angles_rad`` are the model's joint angles, float64 (16,), in radians.
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
