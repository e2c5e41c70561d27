"""Draw the hand alone, from its joint angles: for runs that have no simulated world to show.

The figure is the simulated hand's own description, with its joints turned as the angles say. Drawn this way it needs no
physics engine; where the angles are modelled, so is the figure.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple, cast
from xml.etree import ElementTree as ET

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tega.arm.rotation import IDENTITY, cross, exp, multiply, rotate, unit
from tega.hand.mjcf import hand_body, joint_names
from tega.ui.view.state import Shape, ShapeKind

EYE_M, LOOK_AT_M = (0.55, 0.36, 0.33), (0.0, 0.01, 0.12)
"""Position of the eye, and the point it looks at, metres."""

_HAND = (0.27, 0.2, 0.5, 1.0)
# The palm stands with its fingers up, so high over the floor.
STANDING: Final = (0.0, 0.0, 0.11, 1.0, 0.0, 0.0, 0.0)
"""Pose of the palm of a figure without a world: position in metres, quaternion w, x, y, z."""


class _Link(NamedTuple):
    parent: int
    place_m: NDArray[np.float64]
    turn: NDArray[np.float64]  # quaternion x, y, z, w
    joint: int  # -1: none
    axis: NDArray[np.float64]


class _Solid(NamedTuple):
    link: int
    place_m: NDArray[np.float64]
    turn: NDArray[np.float64]


class HandFigure:
    """Primitives of an Allegro hand, palm to the front, fingers up.

    Example:
        >>> figure = HandFigure()
        >>> figure.poses(np.zeros(16)).shape == (len(figure.shapes), 7)
        True
    """

    def __init__(self) -> None:
        self.shapes: list[Shape] = []
        self._links: list[_Link] = []
        self._solids: list[_Solid] = []
        root = ET.fromstring(hand_body())
        root.set("pos", "0 0 0")
        self._add(root, -1)

    def poses(
        self,
        angles_rad: Sequence[float] | NDArray[np.float64],
        palm: Sequence[float] | NDArray[np.float64] = STANDING,
    ) -> NDArray[np.float64]:
        """Return the pose of each shape, float64 (n, 7): position in metres, then the quaternion w, x, y, z.

        The angles are in the order of :data:`tega.hand.JOINT_NAMES`; ``palm`` is a row like those returned.
        """
        palm_m, palm_turn = np.array(palm[:3]), _w_last(palm[3:])
        places: list[NDArray[np.float64]] = []
        turns: list[NDArray[np.float64]] = []
        for parent, place, turn, joint, axis in self._links:
            if joint >= 0:
                turn = multiply(turn, exp(angles_rad[joint] * axis))  # noqa: PLW2901
            above_m, above_turn = (palm_m, palm_turn) if parent < 0 else (places[parent], turns[parent])
            place = above_m + rotate(above_turn, place)  # noqa: PLW2901
            turn = multiply(above_turn, turn)  # noqa: PLW2901
            places.append(place)
            turns.append(turn)
        return np.array(
            [
                (*(places[link] + rotate(turns[link], place)), *np.roll(multiply(turns[link], turn), 1))
                for link, place, turn in self._solids
            ]
        )

    def _add(self, body: ET.Element, parent: int) -> None:
        number, joint = len(self._links), body.find("joint")
        axis = np.zeros(3) if joint is None else _numbers(joint.get("axis", "0 0 1"))
        name = "" if joint is None else joint.get("name", "")
        self._links.append(
            _Link(
                parent,
                _numbers(body.get("pos", "0 0 0")),
                _w_last(_numbers(body.get("quat", "1 0 0 0"))),
                joint_names().index(name) if name else -1,
                axis,
            )
        )
        for geom in body.findall("geom"):
            self._add_solid(geom, number)
        for child in body.findall("body"):
            self._add(child, number)

    def _add_solid(self, geom: ET.Element, link: int) -> None:
        a, b, c = [*_numbers(geom.get("size", "")), 0.0, 0.0][:3]
        place, turn = _numbers(geom.get("pos", "0 0 0")), IDENTITY
        if (ends := geom.get("fromto")) is not None:
            start, end = _numbers(ends).reshape(2, 3)
            place, b = (start + end) / 2, float(np.linalg.norm(end - start)) / 2
            turn = _upright_to(end - start)
        red, green, blue, opacity = _HAND if (rgba := geom.get("rgba")) is None else _numbers(rgba)
        kind = cast("ShapeKind", geom.get("type", "sphere"))
        self.shapes.append((geom.get("name", ""), kind, (a, b, c), (red, green, blue, opacity)))
        self._solids.append(_Solid(link, place, turn))


def _numbers(text: str) -> NDArray[np.float64]:
    return np.array([float(part) for part in text.split()])


def _w_last(wxyz: ArrayLike) -> NDArray[np.float64]:
    """Return a quaternion as :mod:`tega.arm.rotation` has it."""
    return np.roll(np.asarray(wxyz, np.float64), -1)


def _upright_to(direction: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the quaternion that turns z to a direction not opposite to it."""
    up, along = np.array([0.0, 0.0, 1.0]), direction / np.linalg.norm(direction)
    return unit(np.append(cross(up, along), 1 + along[2]))
