"""Simulate both ends of the hand's cable: the controller that knows its angles, and the bus for its frames."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from struct import Struct

import numpy as np
from numpy.typing import NDArray

from tega.hand import HandController
from tega.wire import (
    ALLEGRO_RAD_PER_COUNT,
    AllegroServo,
    CanFrame,
    allegro_decode,
    allegro_limp_frames,
    allegro_torque_frames,
)

COUNTS_PER_TORQUE = 1200.0
# Torques come a thousand times as often as anything else, and in sets: the firmware takes their words as they lie.
_FINGER, _WORD, _SET_BYTES = Struct("<4h"), np.dtype("<i2"), 32
_tuple = tuple.__new__


def encoded(angles_rad: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return joint angles as the hand's encoders show them, in whole counts, radians."""
    angles: NDArray[np.float64] = np.rint(angles_rad / ALLEGRO_RAD_PER_COUNT) * ALLEGRO_RAD_PER_COUNT
    return angles


class SimulatedAllegro:
    """The real controller on the angles that the simulated hand's encoders show: steps of 0.0888 mrad.

    ``read_angles_rad`` returns the true angles, float64 (16,), as they are now.
    """

    label = "simulated: torques from the angles of a simulated hand"

    def __init__(
        self, controller: HandController, read_angles_rad: Callable[[], NDArray[np.float64]]
    ) -> None:
        self._controller = controller
        self._read = read_angles_rad

    @property
    def angles_rad(self) -> NDArray[np.float64]:
        """The joint angles as the encoders show them now, float64 (16,), in radians."""
        return encoded(self._read())

    @property
    def target_rad(self) -> NDArray[np.float64] | None:
        """Joint targets of the last tick, float64 (16,), in radians; ``None`` before the first."""
        return self._controller.target_rad

    def step(self, level: float, added: float = 0.0) -> list[CanFrame]:
        """Go on by one tick of 3 ms. ``level`` is 1 to 5; ``added`` are levels that a reflex adds."""
        frames = self._controller.step_encoded(self._read(), level, added=added)
        return [_tuple(CanFrame, frame) for frame in frames]

    def limp(self) -> list[CanFrame]:
        """Return zero torque for every finger, then SERVO OFF."""
        return allegro_limp_frames()


class SimulatedBus:
    """Stands in for the firmware on the hand's bus: torques move the joints, SERVO OFF lets go.

    ``apply_torques`` takes float64 (16,), in the unit of ``full_duty``, a motor's torque at full duty.
    ``n_rejected`` counts frames that were no message for this hand.
    """

    def __init__(self, apply_torques: Callable[[NDArray[np.float64]], object], *, full_duty: float) -> None:
        self._apply = apply_torques
        self._scale = full_duty / COUNTS_PER_TORQUE
        fingers = allegro_torque_frames(np.zeros(16))
        self._set_ids = [frame.id for frame in fingers]
        self._counts: NDArray[np.int16] = np.zeros(16, _WORD)
        self.n_rejected = 0

    def write(self, t_ns: int, frames: Sequence[CanFrame]) -> Sequence[CanFrame]:  # noqa: ARG002  # a bus has no clock
        """Act on frames in their order."""
        words = b"".join([frame.data for frame in frames])
        if len(words) == _SET_BYTES and [frame.id for frame in frames] == self._set_ids:
            self._counts = np.frombuffer(words, _WORD)
        else:
            for frame in frames:
                self._take(frame)
        self._apply(np.multiply(self._counts, self._scale, dtype=np.float64))
        return frames

    def _take(self, frame: CanFrame) -> None:
        if frame.id in self._set_ids and len(frame.data) == _FINGER.size:
            first = 4 * self._set_ids.index(frame.id)
            self._counts = self._counts.copy()
            self._counts[first : first + 4] = _FINGER.unpack(frame.data)
            return
        message = allegro_decode(frame)
        if isinstance(message, AllegroServo) and not message.on:
            self._counts = np.zeros(16, _WORD)
        else:
            self.n_rejected += 1
