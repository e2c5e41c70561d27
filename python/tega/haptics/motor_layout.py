"""Describe where the motors of a vest, a sleeve or a belt sit, one table a layout, and draw them as inline SVG.

A layout is a stage of the group ``tega.layouts``: an object of :class:`MotorLayout`, found by its name through an entry
point. Rows count from the top, columns from the wearer's left, each from 0 and for each face by itself.

Example:
    >>> from tega.haptics.motor_layout import find_layout
    >>> x16 = find_layout("x16")
    >>> len(x16.motors), x16.motors[0]
    (16, Motor(face='front', row=0, column=0, number=0, place_mm=None))
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import lru_cache
from html import escape
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega import _native
from tega.errors import ConfigError, DeviceUnavailableError, InvalidValueError
from tega.records.base import DRAWINGS
from tega.records.outputs import VestRecord

__all__ = ["PAPER32", "SHIPPED", "X16", "X40", "Face", "Mirror", "Motor", "MotorLayout", "find_layout"]

Face = Literal["front", "back"]
Mirror = Literal["none", "back", "all"]

# A frame reaches a device as the motors of a 40-motor vest; a layout says which of them are its own.
MOST_MOTORS = 40


class Motor(NamedTuple):
    """One motor and its place.

    Attributes:
        face: ``"front"`` or ``"back"``; a sleeve or a belt may have one face only.
        row: Row on its face, 0 at the top.
        column: Column on its face, 0 at the wearer's left.
        number: Its number at the device, 0 to 39.
        place_mm: Place on its face, (right, down) from its upper left corner, mm; ``None`` where it is not known.
    """

    face: Face
    row: int
    column: int
    number: int
    place_mm: tuple[float, float] | None = None


class MotorLayout:
    """The motors of a layout, in the order of a frame's intensities.

    It has the name that settings give it, a summary in one line, 1 to 40 motors, and ``numbers``: that of each motor at
    the device, uint8 (n,), read-only.

    Raises:
        InvalidValueError: There is no motor or more than 40, two have one number or one place, or a face, row, column
            or number is out of range.

    Example:
        >>> belt = MotorLayout("belt", "four motors", [Motor("front", 0, c, c) for c in range(4)])
        >>> belt.columns("front"), belt.columns("back")
        (4, 0)
    """

    def __init__(self, name: str, summary: str, motors: tuple[Motor, ...] | list[Motor]) -> None:
        self.name = name
        self.summary = summary
        self.motors = tuple(Motor(*motor) for motor in motors)
        _check(name, self.motors)
        self.numbers: NDArray[np.uint8] = np.array([motor.number for motor in self.motors], np.uint8)
        self.numbers.flags.writeable = False

    def __repr__(self) -> str:
        """Name and size."""
        return f"MotorLayout({self.name!r}, {len(self.motors)} motors)"

    def columns(self, face: Face) -> int:
        """Return the number of columns of a face."""
        return 1 + max((motor.column for motor in self.motors if motor.face == face), default=-1)

    def rows(self, face: Face) -> int:
        """Return the number of rows of a face."""
        return 1 + max((motor.row for motor in self.motors if motor.face == face), default=-1)

    def mirrored(self, mirror: Mirror) -> MotorLayout:
        """Return the same motors with the columns of the back, or of all faces, reversed."""
        faces = {"none": set[str](), "back": {"back"}, "all": {"front", "back"}}.get(mirror)
        if faces is None:
            raise InvalidValueError(f'mirror = "{mirror}" is not known: choose none, back or all')
        motors = [
            motor._replace(column=self.columns(motor.face) - 1 - motor.column)
            if motor.face in faces
            else motor
            for motor in self.motors
        ]
        return MotorLayout(self.name, self.summary, motors)


def _check(name: str, motors: tuple[Motor, ...]) -> None:
    text = f"layout {name!r}"
    if not 1 <= len(motors) <= MOST_MOTORS:
        raise InvalidValueError(f"{text} has {len(motors)} motors: 1 to {MOST_MOTORS} are possible")
    for index, motor in enumerate(motors):
        if motor.face not in {"front", "back"}:
            raise InvalidValueError(f"{text}, motor {index}: face {motor.face!r} is neither front nor back")
        if not all(0 <= place < MOST_MOTORS for place in (motor.row, motor.column, motor.number)):
            raise InvalidValueError(f"{text}, motor {index}: row, column and number are 0 to 39: {motor}")
    for subject, seen in (
        ("number", [motor.number for motor in motors]),
        ("place", [(motor.face, motor.row, motor.column) for motor in motors]),
    ):
        if len(set(seen)) < len(seen):
            raise InvalidValueError(f"{text}: two motors have one {subject}")


def _shipped(name: Literal["paper32", "x40", "x16"], summary: str) -> MotorLayout:
    numbers = _native.layout_motors(name).tolist()
    half = len(numbers) // 2
    motors = [
        Motor("front" if i < half else "back", i % half // 4, i % 4, number)
        for i, number in enumerate(numbers)
    ]
    return MotorLayout(name, summary, motors)


PAPER32 = _shipped("paper32", "4 × 4 motors on each face of a 40-motor vest (the paper's)")
X40 = _shipped("x40", "all 40 motors of a vest: 5 rows of 4 on each face")
X16 = _shipped("x16", "a 16-motor vest: 2 rows of 4 on each face")

SHIPPED: dict[str, MotorLayout] = {layout.name: layout for layout in (PAPER32, X40, X16)}
"""The layouts that come with TEGA, by name."""


@lru_cache(maxsize=64)
def find_layout(name: str) -> MotorLayout:
    """Return the layout of a name.

    Raises:
        InvalidValueError: No installed package brings one of that name.
        MissingExtraError: Its module needs a package that is not installed.
        DeviceUnavailableError: The object registered under the name is not a layout, or has another name.
    """
    if name in SHIPPED:
        return SHIPPED[name]
    from tega.runtime.features import find_plugin, load_plugin

    try:
        entry = find_plugin("tega.layouts", "layout", name)
    except ConfigError as error:
        raise InvalidValueError(f'layout = "{name}" is not known: {error.message}', error.hint) from None
    found = load_plugin(entry, "layout")
    if not isinstance(found, MotorLayout) or found.name != name:
        raise DeviceUnavailableError(
            f"layout {name!r} is registered as {entry.value!r}, which is no MotorLayout of that name",
            "register an object of tega.haptics.motor_layout.MotorLayout whose name is the entry point's",
        )
    return found


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
