"""Simulate a fingertip camera: from what presses the gel to the picture and the true contact.

Rigid shapes go into a skin on springs until the springs carry their forces; slopes become colours by a light field
that was fitted to one real sensor, and noise has the statistics of its camera frames. ``docs/evidence/sim-touch.md``
says how close that comes to real frames and what is not modelled. Seed, settings, indenters and frame number
determine a frame to the last bit; with ``memory``, earlier presses and their durations do, too.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega import _native
from tega_sim.seams import Indenter

HEIGHT: Final = 320
WIDTH: Final = 240
PX_PER_MM: Final = _native.GEL_PX_PER_MM
"""Scale of the picture at the gel's top; what lies lower is nearer to the camera and looks larger."""
CAMERA_HZ: Final = 60.0
"""Frames a second: what turns a frame's number into a time."""


class GelTruth(NamedTuple):
    """True contact, whatever the picture shows; of the part of the gel that is in the picture."""

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
    """One unit: its own gel, background, light and noise.

    Args:
        seed: Seed of all differences between units and of each frame's noise; 0 to 2⁶⁴ - 1.
        spread: How much gel, light, background and noise differ from those of the fitted sensor: 0 not at all, 1 as
            sensors may differ, at most 2.
        shape: ``digit``, rounded across the finger as the published drawing, or ``flat`` as a GelSight's.
        memory: Whether the gel creeps under a load and keeps an imprint after release, and its colours drift for
            minutes, as in recordings. A press then lasts until the next call, and times may not decrease; the truth
            has the total displacement of the gel, and the shapes that touch.

    Raises:
        InvalidValueError: ``spread`` is out of range, or ``shape`` not known.

    Example:
        >>> gel = Gel(seed=1)
        >>> image = gel.frame([ball(force_n=3.0)], index=0)
        >>> image.shape, image.dtype, 0.7 < gel.truth.depth_mm < 1.2
        ((320, 240, 3), dtype('uint8'), True)
    """

    def __init__(
        self,
        seed: int,
        *,
        spread: float = 1.0,
        shape: Literal["digit", "flat"] = "digit",
        memory: bool = False,
    ) -> None:
        self._gel = _native.Gel(seed, spread=spread, shape=shape, memory=memory)

    def frame(
        self, indenters: Sequence[Indenter], index: int, *, t_s: float | None = None
    ) -> NDArray[np.uint8]:
        """Return the picture of these shapes pressed in; :attr:`truth` is then of this press.

        Where nothing touches nothing is solved, and nothing shaded unless something is left of an earlier
        press: the picture is the still one and new noise, so that no two frames are equal. Ask :meth:`press`
        first to leave such frames out altogether.

        Args:
            indenters: At most 8; one with a force of 0 does not press. ``pose_mm``'s z does not matter: each
                shape goes in until the gel carries its force.
            index: Number of the frame: picks its noise and how far the colours have drifted (60 frames a
                second).
            t_s: When, for a gel with ``memory``, never before the latest one; ``None`` is ``index`` / 60.

        Returns:
            uint8 (320, 240, 3), BGR, upright.
        """
        image = np.empty((HEIGHT, WIDTH, 3), np.uint8)
        t_s = index / CAMERA_HZ if t_s is None else t_s
        self._gel.frame(_poses(indenters), index, t_s=t_s, out=image)
        return image

    def sums(self, indenters: Sequence[Indenter], index: int) -> NDArray[np.int16]:
        """Return the sums over cells of 8 x 8 pixels of the picture of :meth:`frame`, equal to the bit.

        int16 (3, 1200): blue, green and red, each 40 rows of 30 cells, one after the other. What does not
        hang on single pixels is not worked out pixel by pixel: it takes a fraction of the time.
        """
        return self._gel.sums(_poses(indenters), index, t_s=index / CAMERA_HZ)

    def press(self, indenters: Sequence[Indenter], *, t_s: float | None = None) -> GelTruth:
        """Press shapes in, making no picture; :attr:`truth` and the arrays below are then of this press.

        Arguments are those of :meth:`frame`; without ``t_s`` no time passes.
        """
        t_s = (self._gel.last_s() or 0.0) if t_s is None else t_s
        self._gel.press(_poses(indenters), t_s)
        return self.truth

    def remains(self, t_s: float) -> bool:
        """Return whether the gel would show anything at a time, seconds, if nothing pressed it from then on."""
        return self._gel.remains(t_s)

    def forget(self) -> None:
        """Forget what pressed and when, as a new gel of the same unit."""
        self._gel.forget()

    @property
    def truth(self) -> GelTruth:
        """True contact of the latest press, measured when asked for."""
        return GelTruth._make(self._gel.touch())

    @property
    def in_view(self) -> float:
        """Share of the latest press's touching area that is in the picture, 0 to 1; NaN where no cell touches.

        Computed on cells of 8 x 8 pixels, coarser than the frame: where planes overlap, none of them may touch. Cells
        more than 3.4 mm outside the frame are not counted.
        """
        return self._gel.in_view()

    def still(self, index: int = 0) -> NDArray[np.uint8]:
        """Return the untouched gel without noise, as it is by frame ``index``, uint8 (320, 240, 3), BGR."""
        return self._gel.still(index)

    def contact_mask(self) -> NDArray[np.bool_]:
        """Return the touching pixels of the latest press, bool (320, 240); their number is ``truth.area_px``."""
        return self._gel.contact_mask()

    def displacement_mm(self) -> NDArray[np.float32]:
        """Return how far the latest press displaces the gel, float32 (80, 60), one value for 4 x 4 pixels."""
        return self._gel.displacement_mm()

    def surface_mm(self) -> NDArray[np.float32]:
        """Return where the untouched gel lies that 4 x 4 pixels each show, float32 (80, 60, 4).

        x, y and z in the pad frame, z 0 at the gel's top, millimetres; and its area, square millimetres.
        """
        return self._gel.surface()


def ball(
    *,
    force_n: float,
    radius_mm: float = 4.4,
    centre_xy: tuple[float, float] = (119.5, 159.5),
) -> Indenter:
    """Return a ball that presses at a place of the picture, ``centre_xy`` in pixels (column, row).

    A radius of 4.4 is that of the recorded presses. On a rounded gel a ball beside the middle touches nearer to the
    middle than its own is.
    """
    x, y = ((at - middle) / PX_PER_MM for at, middle in zip(centre_xy, (119.5, 159.5), strict=True))
    pose = np.array([[1.0, 0.0, 0.0, x], [0.0, 1.0, 0.0, y], [0.0, 0.0, 1.0, radius_mm]])
    return Indenter("sphere", (radius_mm, 0.0, 0.0), pose, force_n)


def board(*, force_n: float) -> Indenter:
    """Return a flat board, larger than the finger, that presses."""
    pose = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0]])
    return Indenter("plane", (0.0, 0.0, 0.0), pose, force_n)


def _poses(
    indenters: Sequence[Indenter],
) -> list[tuple[str, tuple[float, float, float], NDArray[np.float64], float]]:
    return [(i.shape, i.size_mm, np.asarray(i.pose_mm, np.float64), i.force_n) for i in indenters]
