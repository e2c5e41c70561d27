"""Draw the motors of a vest on the torso that wears it, as inline SVG for notebooks."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from html import escape
from typing import NamedTuple

from tega.haptics.motor_layout import MotorLayout, find_layout
from tega.records.base import DRAWINGS
from tega.records.outputs import VestRecord

WIDTH, HEIGHT = 120.0, 140.0
"""Size of a face in the drawing."""
RADIUS = 5.0
"""Radius of a motor in it."""


class Spot(NamedTuple):
    """Place of a motor in the drawing, the two faces side by side: x to the right, y down."""

    x: float
    y: float
    percent: int


def spots(layout: MotorLayout, intensities: Sequence[int]) -> Iterator[Spot]:
    """Return the place of every motor."""
    for motor, percent in zip(layout.motors, intensities, strict=True):
        begins = 0.0 if motor.face == "front" else WIDTH
        x = begins + WIDTH * (0.22 + 0.56 * (motor.column + 0.5) / layout.columns(motor.face))
        yield Spot(x, HEIGHT * (0.2 + 0.7 * (motor.row + 0.5) / layout.rows(motor.face)), int(percent))


def torso_svg(layout: str, intensities: Sequence[int]) -> str:
    """Return a vest frame, percent, as SVG: each motor a circle, the darker the harder it vibrates."""
    drawn = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {2 * WIDTH:g} {HEIGHT:g}" width="360">']
    for begins, face in ((0.0, "front"), (WIDTH, "back")):
        drawn.append(
            f'<path d="M{begins + 18:g} 22 q18 8 26 -14 h32 q8 22 26 14 q-6 40 2 112 h-88 q8 -72 2 -112z" fill="none" '
            f'stroke="#888"/><text x="{begins + WIDTH / 2:g}" y="{HEIGHT - 2:g}" font-size="8" fill="#888" '
            f'text-anchor="middle">{face}</text>'
        )
    drawn += [
        f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{RADIUS:g}" fill="#0a7e74" '
        f'fill-opacity="{percent / 100:g}" stroke="#888">'
        f"<title>{number}: {percent} %</title></circle>"
        for number, (x, y, percent) in enumerate(spots(find_layout(layout), intensities))
    ]
    return "".join(drawn) + f"<title>{escape(layout)}</title></svg>"


def _record_html(frame: VestRecord) -> str:
    try:
        return torso_svg(frame.layout, frame.intensities)
    except Exception as error:  # of a recording from anywhere: a notebook shows the rest of it
        return f"<p>{escape(repr(frame))}: {escape(str(error))}</p>"


DRAWINGS[VestRecord] = _record_html
