"""Draw the simulated objects in 3-D as a bottle, a box and a soft bag.

Fingers touch the upright cylinder that an object is in the simulated world, whatever is drawn: a look stays within a
quarter of its radius around it where the hand grasps.
"""

from __future__ import annotations

from typing import Final, Literal, NamedTuple

__all__ = ["LOOKS", "LookPart"]


class LookPart(NamedTuple):
    """A primitive of a look.

    Attributes:
        primitive: Unit ``box``, ``ball`` or ``tube``, of half length 1 in each direction.
        middle: Position along the object's own z, as a share of its half height.
        wide: Its half width, as a share of the object's radius.
        tall: Its half height, as a share of the object's.
        shade: Factor for the object's colour.
    """

    primitive: Literal["box", "ball", "tube"]
    middle: float
    wide: float
    tall: float
    shade: float = 1.0


LOOKS: Final[dict[str, tuple[LookPart, ...]]] = {
    "bottle": (
        LookPart("tube", -0.31, 1.0, 0.69),
        LookPart("ball", 0.38, 1.0, 0.3),
        LookPart("tube", 0.74, 0.34, 0.2),
        LookPart("tube", 0.91, 0.42, 0.09, 0.45),
        LookPart("tube", -0.62, 1.01, 0.16, 1.2),
    ),
    "container": (
        LookPart("box", -0.08, 0.86, 0.92),
        LookPart("box", 0.91, 0.93, 0.09, 0.8),
    ),
    "bag": (
        LookPart("ball", -0.3, 1.06, 0.7),
        LookPart("ball", 0.05, 0.97, 0.75),
        LookPart("tube", 0.8, 0.26, 0.06, 0.45),
        LookPart("ball", 0.9, 0.5, 0.1),
    ),
}
"""By the name of a cylinder in the scene."""
