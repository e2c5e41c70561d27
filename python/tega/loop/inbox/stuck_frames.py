"""Recognise frames without new data: delivered twice, or identical to the frame before.

No two raw frames of a working sensor are equal: its noise differs in some pixel. Pixels that do not change are
therefore a sign that no picture is being taken any more, whatever the frame's number says.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega.records import Contact

# So many equal pictures in a row, the first included, and a live sensor is called stuck. Two may come of a camera
# that is read faster than it exposes.
STUCK_FRAMES = 3

# A grid of pixels this far apart tells two noisy pictures from each other at a thousandth of the cost of all of them.
_SAMPLE_STRIDE = 40


class KeptPicture(NamedTuple):
    """The newest measured picture.

    Attributes:
        image: uint8 (H, W, 3).
        sample: Copy of some of its pixels: a driver that wrongly gives one buffer again and again is not taken for a
            stuck sensor.
    """

    image: NDArray[np.uint8]
    sample: bytes
    contact: Contact


def kept_picture(image: NDArray[np.uint8], contact: Contact) -> KeptPicture:
    """Return a measured picture, to be compared with the next one."""
    return KeptPicture(image, _sample(image), contact)


def is_repeat(image: NDArray[np.uint8], last: KeptPicture) -> bool:
    """Return whether every pixel of a picture equals the newest one's.

    A picture that is the newest one itself, in memory that cannot be written, needs no comparison. Else the sample
    decides where the pictures differ in it, which noise sees to; only where it agrees is every pixel compared, so that
    the answer is exact.

    Args:
        image: uint8 (H, W, 3).
        last: The newest measured picture.
    """
    if image.shape != last.image.shape:
        return False
    if image is last.image and _is_constant(image):
        return True
    return _sample(image) == last.sample and image.tobytes() == last.image.tobytes()


def _is_constant(image: NDArray[np.uint8]) -> bool:
    """Whether an array cannot be written to: it is read-only and not a view."""
    return not image.flags.writeable and image.base is None


def _sample(image: NDArray[np.uint8]) -> bytes:
    return image[::_SAMPLE_STRIDE, ::_SAMPLE_STRIDE].tobytes()
