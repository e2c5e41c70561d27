"""Joint targets, torques and the joint model in exact fractions: what the fast versions are judged by; a stuck hand."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from fractions import Fraction

from tega.hand.link import Received

HELLO = Received(0x200, struct.pack("<HHBBB", 0x0402, 0x0406, 0, 45, 1))


def stuck_hand(k: int) -> list[Received]:
    """Return exchange k of a hand that begins at 20 and is stuck half open, with the noise of its encoders."""
    angles = [(first + k % 3, 2000, 2000, 2000) for first in (0, 0, 0, 9000)]
    stuck = [Received(0x80 + 4 * finger, struct.pack("<4h", *four)) for finger, four in enumerate(angles)]
    return stuck if k > 20 else [HELLO] if k == 20 else []


LEVELS = 5
MOVE_TICKS = 200
SPACING_TICKS = 67
TICK = Fraction(3, 1000)


def minimum_jerk(share: Fraction) -> Fraction:
    s = min(Fraction(1), max(Fraction(0), share))
    return 10 * s**3 - 15 * s**4 + 6 * s**5


def shares(levels: Sequence[int], start: int) -> list[list[Fraction]]:
    """Share of each pose at every tick, for poses that are one default step apart."""
    starts: list[tuple[int, int, int]] = []
    out = []
    at = start
    for tick, level in enumerate(levels):
        if level != at and (not starts or tick - starts[-1][0] >= SPACING_TICKS):
            step = 1 if level > at else -1
            starts.append((tick, at, at + step))
            at += step
        row = [Fraction(0)] * LEVELS
        row[start - 1] = Fraction(1)
        for begun, source, target in starts:
            moved = minimum_jerk(Fraction(tick - begun, MOVE_TICKS))
            row[source - 1] -= moved
            row[target - 1] += moved
        out.append(row)
    return out


def mix(row: Sequence[Fraction], poses: Sequence[Sequence[float]]) -> list[Fraction]:
    joints = zip(*poses, strict=True)
    return [sum((s * Fraction(a) for s, a in zip(row, joint, strict=True)), Fraction(0)) for joint in joints]


def clamp(value: Fraction, low: Fraction, high: Fraction) -> Fraction:
    return min(high, max(low, value))


def torque(
    error: Fraction, velocity: Fraction, last: Fraction, *, kp: float, kd: float, limit: Fraction
) -> Fraction:
    bounded = clamp(error, Fraction(-0.3), Fraction(0.3))
    wanted = Fraction(kp) * bounded - Fraction(kd) * velocity
    slewed = clamp(wanted, last - Fraction(0.05), last + Fraction(0.05))
    return clamp(slewed, -limit, limit)


def joint(
    angle: Fraction, torques: Sequence[float], *, low: float, high: float, speed: float, constant: float
) -> list[Fraction]:
    stops = Fraction(low) - Fraction(1, 10), Fraction(high) + Fraction(1, 10)
    share = TICK / Fraction(constant)
    velocity = Fraction(0)
    out = []
    for duty in torques:
        driven = Fraction(speed) * clamp(Fraction(duty), Fraction(-1), Fraction(1))
        velocity = (velocity + share * driven) / (1 + share)
        free = angle + TICK * velocity
        angle = clamp(free, *stops)
        if angle != free:
            velocity = Fraction(0)
        out.append(angle)
    return out
