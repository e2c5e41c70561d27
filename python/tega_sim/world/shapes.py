"""Define the primitive shapes that the world is drawn with."""

from __future__ import annotations

from typing import Literal, NamedTuple


class Shape(NamedTuple):
    """A primitive to draw.

    Attributes:
        name: Its name, one of a kind.
        kind: Kind of shape.
        size_m: Half lengths; capsule and cylinder: radius and half length along z; plane: half lengths.
        rgba: Colour.
    """

    name: str
    kind: Literal["sphere", "capsule", "cylinder", "box", "plane"]
    size_m: tuple[float, float, float]
    rgba: tuple[float, float, float, float]
