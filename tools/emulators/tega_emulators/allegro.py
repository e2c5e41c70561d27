"""An Allegro Hand v4 as a CAN node: what its bytes say, and joints that move as motors with friction do.

Written from the published messages alone; it shares no code with the driver it is there to try. Emulated: the
messages of version 4 firmware, joints between stops, encoder noise, warming, and the faults below. Not emulated:
contact, gravity, coupling of fingers, the timing of a real bus.
"""

from __future__ import annotations

import math
import struct
from typing import Final

import numpy as np
from numpy.typing import NDArray

__all__ = ["FAULTS", "AllegroNode"]

Frame = tuple[int, bytes]

FAULTS: Final = {
    "silence": "sends nothing and receives nothing; the motors keep their last duty",
    "freeze": "sends the same angles for ever",
    "half": "the ring finger's positions are missing",
    "drop": "every tenth position frame is missing",
    "duplicate": "sends every frame twice",
    "slow": "sends positions every 9 ms",
    "hot": "every joint is at 85 °C",
    "overheated": "reports a temperature fault in its status bits",
    "babble": "adds frames of unknown kinds and wrong lengths",
    "jump": "one joint's angle flickers by a radian",
    "foreign": "another program's torques are on the bus",
    "power-cycle": "off for half a second, then as after switching on",
}
"""What can be switched on, and what it does."""

_RAD_PER_COUNT: Final = math.radians(333.3) / 65536
_FULL_SPEED_RAD_S: Final = math.radians(60) / 0.11
_TIME_CONSTANT_S: Final = 0.07
_STICTION: Final = 0.01
_LOW: Final = np.array([-0.57, -0.296, -0.274, -0.327] * 3 + [0.163, -0.205, -0.289, -0.262])
_HIGH: Final = np.array([0.57, 1.71, 1.809, 1.718] * 3 + [1.496, 1.263, 1.744, 1.819])
_REST: Final = np.array([0.02, 0.15, 0.2, 0.15] * 3 + [0.7, 0.1, 0.15, 0.2])
_ROOM_C: Final = 25.0
_WARM_C: Final = 36.0
_OFF_S: Final = 0.5
_COUNT: Final = 1 / 1200
_CYCLE_S: Final = 0.003
_LEAST_STEP_S: Final = 0.0005
_MOST_CYCLES: Final = 10


class AllegroNode:
    """One hand. It has no clock: every call has the time, which never goes back.

    ``hardware`` is the version as the hand sends it, 0x0402 for 4.2; ``side`` is ``right`` or ``left``,
    ``device_id`` 0 to 3; ``seed`` is of the encoders' noise.
    """

    def __init__(
        self, *, hardware: int = 0x0402, side: str = "right", device_id: int = 0, seed: int = 0
    ) -> None:
        """A hand that has just been switched on, its fingers half open."""
        self._hardware, self._side, self._device = hardware, side, device_id
        self._random = np.random.default_rng(seed)
        self._angles, self._speeds = _REST.copy(), np.zeros(16)
        self._joint_c = np.full(16, _WARM_C)
        self._t_s: float | None = None
        self._back_s = -1.0
        self._n_frames = 0
        self._frozen: list[Frame] | None = None
        self.torque_limits: NDArray[np.float64] | None = None
        """What no torque is to be above, (16,), vendor's units; ``None`` not to look."""
        self.slew_limit = math.inf
        """By how much none is to grow in 3 ms."""
        self._allowed = np.zeros((4, 4))
        self._received_s = np.zeros(4)
        self.n_over = 0
        """Torque frames that were above either."""
        self.n_torques = 0
        """Torque frames received."""
        self.pushed_s = self.zero_s = self.off_s = -math.inf
        """Times of the last torque that was not zero, of the last change to zero torque, and of the last SERVO OFF."""
        self.answers_s: list[float] = []
        """How long after each set of positions the torques that answer it were complete, while the servo is on."""
        self._unanswered_s: list[float] = []
        self.faults: set[str] = set()
        """Faults that are on now; see :data:`FAULTS`."""
        self._switch_on()

    def _switch_on(self) -> None:
        self.servo_on = False
        self.duties = np.zeros(16)
        self._position_s = self._temperature_s = 0.0
        self._next_position_s = self._next_temperature_s = math.inf

    @property
    def angles_rad(self) -> list[float]:
        """Where the joints really are, rad."""
        return [float(angle) for angle in self._angles]

    def command(self, words: str) -> None:
        """Switch a fault on (its name) or all of them off (``clear``); :class:`ValueError`: no such fault."""
        if words == "clear":
            self.faults.clear()
            self._frozen = None
        elif words in FAULTS:
            self.faults.add(words)
            if words == "power-cycle":
                self._switch_on()
                self._back_s = -1.0
        else:
            raise ValueError(f"no fault is called {words!r}; there are {', '.join(FAULTS)}, clear")

    def receive(self, can_id: int, data: bytes, *, remote: bool, t_s: float) -> list[Frame]:
        """Take a frame and return the answers."""
        self._pass(t_s)
        if self._dead(t_s) or can_id & 3 != self._device:
            return []
        message = can_id >> 2
        if remote:
            return self._answer(message)
        if message == 0x40 and not data:
            self.servo_on = True
        elif message == 0x41 and not data:
            self.servo_on = False
            self.off_s = t_s
            self._unanswered_s.clear()
        elif 0x60 <= message <= 0x63 and len(data) == 8:
            first = 4 * (message - 0x60)
            duties = np.array(struct.unpack("<4h", data)) / 1200
            self.n_torques += 1
            self._check(first, duties, t_s)
            pushed = bool(self.duties.any())
            self.duties[first : first + 4] = duties
            if duties.any():
                self.pushed_s = t_s
            if pushed and not self.duties.any():
                self.zero_s = t_s
            if message == 0x63:
                self.answers_s += [t_s - sent_s for sent_s in self._unanswered_s]
                self._unanswered_s.clear()
        elif message == 0x81 and len(data) in {6, 8}:
            position_ms, _, temperature_ms = struct.unpack_from("<3H", data)
            self._position_s = 1e-3 * position_ms
            self._temperature_s = 1e-3 * temperature_ms
            self._next_position_s = t_s + self._position_s if position_ms else math.inf
            self._next_temperature_s = t_s + self._temperature_s if temperature_ms else math.inf
        return []

    def due(self, t_s: float) -> list[Frame]:
        """Return what the hand sends by itself until now."""
        self._pass(t_s)
        if self._dead(t_s):
            self._next_position_s = max(self._next_position_s, t_s)
            return []
        out: list[Frame] = []
        if t_s >= self._next_position_s:
            slowed = 3 if "slow" in self.faults else 1
            step_s = slowed * self._position_s
            # A node that was held up does not send what it has missed.
            self._next_position_s = max(self._next_position_s + step_s, t_s - 5 * step_s)
            out += self._positions()
            if self.servo_on:
                self._unanswered_s.append(t_s)
        if t_s >= self._next_temperature_s:
            self._next_temperature_s = max(self._next_temperature_s + self._temperature_s, t_s)
            out += [self._temperature(finger) for finger in range(4)]
        if out and "babble" in self.faults:
            out += [
                (0x3C0, bytes(8)),
                (0x040, b"\x01"),
                (0x080, b"\x01\x02"),
                (0x001, bytes(4)),
                (0x2FC, b""),
            ]
        if out and "foreign" in self.faults:
            out.append((0x180 | self._device, bytes(8)))
        return [frame for frame in out for _ in range(2)] if "duplicate" in self.faults else out

    def _check(self, first: int, duties: NDArray[np.float64], t_s: float) -> None:
        if self.torque_limits is None:
            return
        sizes, before = np.abs(duties), np.abs(self.duties[first : first + 4])
        # The allowance grows with time, whatever comes late and then at once, and does not grow for ever.
        share = self._allowed[first // 4] + self.slew_limit * (t_s - self._received_s[first // 4]) / _CYCLE_S
        share = np.minimum(share, _MOST_CYCLES * self.slew_limit)
        rise = np.maximum(sizes - before, 0.0)
        over = (sizes > self.torque_limits[first : first + 4] + _COUNT) | (
            rise > share + self.slew_limit + 2 * _COUNT
        )
        self._allowed[first // 4], self._received_s[first // 4] = np.maximum(share - rise, 0.0), t_s
        self.n_over += bool(over.any())

    def next_s(self) -> float:
        """Return when something is due again; infinity before a period is set."""
        return min(self._next_position_s, self._next_temperature_s)

    def _dead(self, t_s: float) -> bool:
        if "power-cycle" in self.faults:
            if self._back_s < 0:
                self._back_s = t_s + _OFF_S
            if t_s >= self._back_s:
                self.faults.discard("power-cycle")
        return bool(self.faults & {"silence", "power-cycle"})

    def _pass(self, t_s: float) -> None:
        """Let the joints move on to now, in steps of at most a millisecond."""
        if self._t_s is None:
            self._t_s = t_s
        if t_s - self._t_s < _LEAST_STEP_S:
            return  # the frames of one cycle come within less
        left_s = min(t_s - self._t_s, 0.1)
        self._t_s = max(t_s, self._t_s)
        while left_s > 0:
            step_s = min(left_s, 1e-3)
            left_s -= step_s
            self._move(step_s)

    def _move(self, step_s: float) -> None:
        duty = self.duties if self.servo_on else np.zeros(16)
        stuck = (np.abs(duty) < _STICTION) & (np.abs(self._speeds) < 0.02)
        pull = np.where(stuck, 0.0, _FULL_SPEED_RAD_S * duty)
        self._speeds = (self._speeds + step_s / _TIME_CONSTANT_S * pull) / (1 + step_s / _TIME_CONSTANT_S)
        self._speeds[stuck] = 0.0
        angles = self._angles + step_s * self._speeds
        self._angles = np.clip(angles, _LOW, _HIGH)
        self._speeds[angles != self._angles] = 0.0
        # Warms by the square of the duty, cools in minutes.
        self._joint_c += step_s * (0.5 * duty * duty - (self._joint_c - _ROOM_C - 11 * self.servo_on) / 300)

    def _positions(self) -> list[Frame]:
        if "freeze" in self.faults and self._frozen is not None:
            return self._frozen
        noise = self._random.normal(0.0, 0.7, 16)
        counts = np.rint(self._angles / _RAD_PER_COUNT + noise).astype(int)
        if "jump" in self.faults and self._n_frames % 8 < 4:
            counts[5] += 11266
        counts = np.clip(counts, -32768, 32767)
        frames = []
        for finger in range(4):
            self._n_frames += 1
            half = "half" in self.faults and finger == 2
            dropped = "drop" in self.faults and self._n_frames % 10 == 0
            if not (half or dropped):
                words = [int(c) for c in counts[4 * finger : 4 * finger + 4]]
                frames.append(self._frame(0x20 + finger, struct.pack("<4h", *words)))
        self._frozen = frames
        return frames

    def _temperature(self, finger: int) -> Frame:
        warm = np.full(16, 85.0) if "hot" in self.faults else self._joint_c
        return self._frame(0x38 + finger, bytes(int(c) for c in warm[4 * finger : 4 * finger + 4]))

    def _answer(self, message: int) -> list[Frame]:
        if message == 0x80:
            status = int(self.servo_on) | (0b10 if "overheated" in self.faults else 0)
            words = struct.pack("<HHBBB", self._hardware, 0x0406, self._side == "left", 45, status)
            return [self._frame(0x80, words)]
        if message == 0x88:
            return [self._frame(0x88, b"A080" + (b"L" if self._side == "left" else b"R") + bytes(3))]
        if 0x20 <= message <= 0x23:
            return [f for f in self._positions() if f[0] >> 2 == message]
        if 0x38 <= message <= 0x3B:
            return [self._temperature(message - 0x38)]
        return []

    def _frame(self, message: int, data: bytes) -> Frame:
        return (message << 2) | self._device, data
