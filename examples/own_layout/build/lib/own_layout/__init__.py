"""A layout of one's own: a sleeve with four rows of four motors around the upper arm."""

from __future__ import annotations

from tega.stages import Motor, MotorLayout

SPACING_MM = 35.0

SLEEVE16 = MotorLayout(
    "sleeve16",
    "a sleeve: 4 × 4 motors on one face",
    [
        Motor("front", row, column, 4 * row + column, (SPACING_MM * column, SPACING_MM * row))
        for row in range(4)
        for column in range(4)
    ],
)
