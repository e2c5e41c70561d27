"""A simulated fingertip camera: what presses the gel, to the picture and to what is true of the contact.

Simulated. Rigid shapes go into a skin on springs until the springs carry their forces; slopes become colours by a
light field that was fitted to one real sensor, and noise has the statistics of its pictures. ``docs/sim-touch.md``
says how close that comes to real pictures and what is not modelled. Seed, spread, indenters and frame number alone
decide what a frame shows, to the last bit.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega import _native
from tega.sim.seams import Indenter

__all__ = [
    "DOME_MM",
    "HEIGHT",
    "LENGTH_MM",
    "PX_PER_MM",
    "STIFFNESS_N_MM3",
    "WIDTH",
    "Gel",
    "GelTruth",
    "ball",
]

HEIGHT: Final = 320
WIDTH: Final = 240
PX_PER_MM: Final = _native.GEL_PX_PER_MM
"""Scale of the picture."""
LENGTH_MM: Final = _native.GEL_LENGTH_MM
"""How far the gel is pulled down beside a contact: its slope dies away over this length."""
STIFFNESS_N_MM3: Final = _native.GEL_STIFFNESS_N_MM3
"""Pressure a displacement, newtons per cubic millimetre."""
DOME_MM: Final = _native.GEL_DOME_MM
"""Radius of the untouched gel."""


class GelTruth(NamedTuple):
    """What is true of a contact, whatever the picture shows; of the part of the gel that is in the picture."""

    touches: bool
    """Whether anything lies against the gel, in the picture or beside it."""
    area_px: int
    """Touching area, pixels; found on cells of 4 x 4."""
    area_mm2: float
    """The same, square millimetres."""
    depth_mm: float
    """Largest displacement of the gel, millimetres."""
    centre_xy: tuple[float, float]
    """Middle of the displacement of what touches, pixels (column, row); NaN where nothing does."""


class Gel:
    """One unit: its own background, light and noise.

    Args:
        seed: Of everything that differs between units, and of which noise each frame shows; 0 to 2⁶⁴ - 1.
        spread: How much light and background differ from those of the fitted sensor: 0 not at all, 1 as sensors may
            differ, at most 2.

    Raises:
        InvalidValueError: ``spread`` is out of range.

    Example:
        >>> gel = Gel(seed=1)
        >>> image = gel.frame([ball(force_n=3.0)], index=0)
        >>> image.shape, image.dtype, 0.7 < gel.truth.depth_mm < 1.1
        ((320, 240, 3), dtype('uint8'), True)
    """

    def __init__(self, seed: int, *, spread: float = 1.0) -> None:
        self._gel = _native.Gel(seed, spread=spread)

    def frame(
        self, indenters: Sequence[Indenter], index: int, *, out: NDArray[np.uint8] | None = None
    ) -> NDArray[np.uint8]:
        """Return the picture of these shapes pressed in; :attr:`truth` is then of this press.

        Where nothing touches nothing is solved and nothing shaded: the picture is the still one and new noise, so
        that no two frames are equal. Ask :meth:`press` first to leave such frames out altogether.

        Args:
            indenters: What presses, at most 8; one with a force of 0 does not. ``pose_mm``'s z does not matter: each
                shape goes in until the gel carries its force.
            index: Number of the frame: picks its noise and how far the colours have drifted (60 frames a second).
            out: Where to write, uint8 (320, 240, 3) without gaps; ``None`` makes a new array.

        Returns:
            uint8 (320, 240, 3), BGR, upright; ``out`` where given.

        Raises:
            InvalidValueError: A shape is not known, a number is out of range, or ``out`` cannot be written.
            ShapeError: ``pose_mm`` is not (3, 4) or ``out`` not as above.
        """
        if out is None:
            out = np.empty((HEIGHT, WIDTH, 3), np.uint8)
        self._gel.frame(_poses(indenters), index, out=out)
        return out

    def press(self, indenters: Sequence[Indenter]) -> GelTruth:
        """Press shapes in without making a picture; :attr:`truth` and the arrays below are then of this press.

        Args and errors are those of :meth:`frame`.
        """
        self._gel.press(_poses(indenters))
        return self.truth

    @property
    def truth(self) -> GelTruth:
        """What is true of the latest press, measured when asked for."""
        return GelTruth._make(self._gel.touch())

    def still(self, index: int = 0) -> NDArray[np.uint8]:
        """Return the untouched gel without noise, as it is by frame ``index``, uint8 (320, 240, 3), BGR."""
        return self._gel.still(index)

    def contact_mask(self) -> NDArray[np.bool_]:
        """Return the touching pixels of the latest press, bool (320, 240); their number is ``truth.area_px``."""
        return self._gel.contact_mask()

    def displacement_mm(self) -> NDArray[np.float32]:
        """Return how far the latest press displaces the gel, float32 (80, 60), one value for 4 x 4 pixels."""
        return self._gel.displacement_mm()


def ball(
    *, force_n: float, radius_mm: float = 4.4, centre_xy: tuple[float, float] = (119.5, 159.5)
) -> Indenter:
    """Return a ball that presses at a place of the picture.

    Args:
        force_n: Normal force, newtons.
        radius_mm: The ball's radius; 4.4 is that of the recorded presses.
        centre_xy: Where, pixels (column, row).
    """
    x, y = ((at - middle) / PX_PER_MM for at, middle in zip(centre_xy, (119.5, 159.5), strict=True))
    pose = np.array([[1.0, 0.0, 0.0, x], [0.0, 1.0, 0.0, y], [0.0, 0.0, 1.0, radius_mm]])
    return Indenter("sphere", (radius_mm, 0.0, 0.0), pose, force_n)


def _poses(
    indenters: Sequence[Indenter],
) -> list[tuple[str, tuple[float, float, float], NDArray[np.float64], float]]:
    return [(i.shape, i.size_mm, np.asarray(i.pose_mm, np.float64), i.force_n) for i in indenters]
