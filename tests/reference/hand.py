"""Joint targets, torques and the joint model in exact fractions: what the fast versions are judged by."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

LEVELS = 5
MOVE_TICKS = 200
SPACING_TICKS = 67
TICK = Fraction(3, 1000)


def minimum_jerk(share: Fraction) -> Fraction:
    """Position of a unit move at a share of its duration."""
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
    """Poses weighted by their shares."""
    joints = zip(*poses, strict=True)
    return [sum((s * Fraction(a) for s, a in zip(row, joint, strict=True)), Fraction(0)) for joint in joints]


def clamp(value: Fraction, low: Fraction, high: Fraction) -> Fraction:
    """Hold within two bounds."""
    return min(high, max(low, value))


def torque(
    error: Fraction, velocity: Fraction, last: Fraction, *, kp: float, kd: float, limit: Fraction
) -> Fraction:
    """One joint's torque by the stated law and default limits."""
    bounded = clamp(error, Fraction(-0.3), Fraction(0.3))
    wanted = Fraction(kp) * bounded - Fraction(kd) * velocity
    slewed = clamp(wanted, last - Fraction(0.05), last + Fraction(0.05))
    return clamp(slewed, -limit, limit)


def joint(
    angle: Fraction, torques: Sequence[float], *, low: float, high: float, speed: float, constant: float
) -> list[Fraction]:
    """Angles of one modelled joint, from rest, after each torque."""
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
