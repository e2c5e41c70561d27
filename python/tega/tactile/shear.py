"""Read the shear of a fingertip camera's contact: how far its gel is pulled sideways, and how much of it has slid.

The pattern on the gel moves with it: printed dots if there are any, else the faint grain that every gel has.
:class:`ShearReader` finds the pattern again in each frame, starting from its place in the untouched gel.
``docs/evidence/sim-touch.md`` describes the method and its accuracy.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from tega import _native
from tega.tactile.tracker import nominal_light

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from tega.tactile.contact import Order
    from tega.tactile.tracker import TouchTracker


class ShearReading(NamedTuple):
    """Shear of a contact in one frame; zeros without contact."""

    shear_mm: float
    """How far the deepest part of the contact is pulled sideways, millimetres."""
    direction_rad: float
    """In which direction: 0 to the right in the picture, π/2 down; from -π to π."""
    incipient: float
    """Share of the contact that has slid against the rest, 0 to 1."""
    slip_mm_s: float
    """Slip speed of the contact's rim against its middle, millimetres a second; a smooth object that slides as a
    whole shows no speed."""
    sure: float
    """How well the grain was found again: its correlation with the untouched gel's, -1 to 1."""


class ShearReader:
    """Reads the shear of one fingertip; one object a finger.

    Args:
        baseline: A picture of the untouched gel, uint8 (H, W, 3), better the mean of some frames; it is copied.
        mm_per_px: Scale of a picture of 320 x 240 pixels, 0.001 to 1; ``None`` takes a DIGIT's.
        order: Order of the colour bytes in all images.

    Raises:
        DtypeError: The baseline is not a uint8 array.
        ShapeError: It is not (H, W, 3), is empty or too large.
        InvalidValueError: An option is out of range or not known.

    Example:
        >>> import numpy as np
        >>> from tega.tactile.tracker import TouchTracker
        >>> gel = np.full((320, 240, 3), 90, np.uint8)
        >>> tracker, reader = TouchTracker(gel), ShearReader(gel)
        >>> tracker.update(gel).in_contact, reader.update(gel, tracker).shear_mm
        (False, 0.0)
    """

    def __init__(
        self, baseline: NDArray[np.uint8], *, mm_per_px: float | None = None, order: Order = "bgr"
    ) -> None:
        scale = nominal_light().mm_per_px if mm_per_px is None else mm_per_px
        self._reader = _native.ShearReader(baseline, mm_per_px=scale, order=order)

    def update(
        self, frame: NDArray[np.uint8], tracker: TouchTracker, *, dt_s: float = 1 / 60
    ) -> ShearReading:
        """Read the next frame, which the tracker has just read.

        Args:
            frame: The image, uint8 of the baseline's shape, borrowed.
            tracker: Says where the contact is and how deep.
            dt_s: Time since the frame before, seconds.

        Returns:
            The reading.

        Raises:
            DtypeError: The frame is not a uint8 array.
            ShapeError: It is not of the baseline's shape; the reader is as before.
            InvalidValueError: ``dt_s`` is not from 0 to 1e6.
        """
        return ShearReading._make(self._reader.update(frame, tracker._tracker, dt_s=dt_s))  # noqa: SLF001

    def flow(self) -> NDArray[np.float32]:
        """Return how far each cell is moved, float32 (rows, columns, 2), pixels to the right and down.

        The flow is 0 outside of the contact.
        """
        return self._reader.flow()
