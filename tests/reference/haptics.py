"""The vest columns in integers: what the fast version is judged by."""

from __future__ import annotations

from fractions import Fraction

FINGERS = 4


def percent(value: float) -> int:
    """Nearest integer, halves to the even one, within 0 to 100."""
    exact = Fraction(value)
    low = exact.numerator // exact.denominator
    rest = exact - low
    up = rest > Fraction(1, 2) or (rest == Fraction(1, 2) and low % 2 == 1)
    return min(100, max(0, low + up))


def wearer_grid(front: list[float], back: list[float], layout: str, mirror: str) -> dict[int, int]:
    """Percent by vendor index (front 0 to 19, back 20 to 39) for the motors of the layout."""
    rows = {"paper32": [0, 1, 2, 3], "x40": [0, 1, 2, 3, 4], "x16": [0, 2]}[layout]
    out = {}
    for face, values in enumerate([front, back]):
        mirrored = mirror == "all" or (mirror == "back" and face == 1)
        for row in rows:
            for finger, value in enumerate(values):
                column = FINGERS - 1 - finger if mirrored else finger
                out[20 * face + 4 * row + column] = percent(value)
    return out
