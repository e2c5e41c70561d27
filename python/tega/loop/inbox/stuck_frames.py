"""Recognise frames that bring nothing new: delivered a second time, or showing exactly what the one before showed.

No two raw frames of a working sensor are equal: its noise differs in some pixel. Pixels that do not change are
therefore a sign that no picture is being taken any more, whatever the frame's number says.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from tega.records import Contact


# So many equal pictures in a row, the first included, and a live sensor is called stuck. Two may come of a camera
# that is read faster than it exposes.
STUCK_FRAMES = 3

# A grid of pixels this far apart tells two noisy pictures from each other at a thousandth of the cost of all of them.
_SAMPLE_STRIDE = 40


class LastFrame:
    """The newest measured picture, for telling whether the next one differs.

    Attributes:
        contact: Contact in it; ``None`` before the first.
        n_equal: How many pictures in a row showed exactly this, the first included.
    """

    def __init__(self) -> None:
        self.contact: Contact | None = None
        self.n_equal = 0
        self._image: NDArray[np.uint8] | None = None
        self._sample = b""

    def repeat(self, image: NDArray[np.uint8]) -> Contact | None:
        """Compare a picture with the newest one.

        A picture that is the newest one itself, in memory that cannot be written, needs no comparison. Else the
        sample decides where the pictures differ in it, which noise sees to; only where it agrees is every pixel
        compared, so that the answer is exact. The sample is a copy: a driver that wrongly hands out one
        buffer again and again is not taken for a stuck sensor.

        Args:
            image: uint8 (H, W, 3).

        Returns:
            The contact in the newest one if every pixel is equal, and counts it; else ``None``.
        """
        last = self._image
        if last is None or image.shape != last.shape:
            return None
        if not (image is last and _is_constant(image)):
            if _sample(image) != self._sample:
                return None
            if image.tobytes() != last.tobytes():
                return None
        self.n_equal += 1
        return self.contact

    def keep(self, image: NDArray[np.uint8], contact: Contact) -> None:
        """Take a picture that was measured as the newest one."""
        self._image, self._sample = image, _sample(image)
        self.contact, self.n_equal = contact, 1


def _is_constant(image: NDArray[np.uint8]) -> bool:
    """Whether nobody can write into an array: it is read-only, and no part of another one."""
    return not image.flags.writeable and image.base is None


def _sample(image: NDArray[np.uint8]) -> bytes:
    return image[::_SAMPLE_STRIDE, ::_SAMPLE_STRIDE].tobytes()
