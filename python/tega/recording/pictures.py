"""Put each picture of a recording together with its numbers and times, a message behind it, and with its cells.

The cells are what the metric ``live`` reads of a picture: sums over 8 x 8 pixels, beside its JPEG. The reading of the
sums is that of the picture, bit for bit, at a thirtieth of its bytes.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from tega.errors import RecordingError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tega.recording.mcap_reader import Message

PICTURES: Final = frozenset({"foxglove.RawImage", "foxglove.CompressedImage"})
"""Schemas of images."""

_SIDE: Final = 8
# The tracker divides the diagonal of a picture of any size into so many cells.
_CELLS_PER_DIAGONAL: Final = 50
_SUMS: Final = np.dtype("<i2")


def paired(messages: Iterable[Message]) -> Iterator[Message]:
    """Yield the messages of a recording but images: those are in the messages of their numbers and times."""
    images: dict[str, Message] = {}
    for message in messages:
        if message.schema in PICTURES:
            if message.value is not None:
                images[message.topic] = message
        elif message.schema == "tega.Frame":
            yield message._replace(image=images.pop(f"{message.topic.removesuffix('/frame')}/image", None))
        else:
            yield message


def cell_sums(image: NDArray[np.uint8], cv2: Any) -> bytes:
    """Return the sums of a picture, uint8 (H, W, 3), over its cells, as bytes.

    They are int16, little-endian, (3, cells): the bytes of a pixel, cells row by row. Empty for a picture of
    a size that the metric divides otherwise: only around 320 x 240 are its cells 8 x 8 pixels.
    """
    height, width = image.shape[:2]
    if height % _SIDE or width % _SIDE or round(math.hypot(height, width) / _CELLS_PER_DIAGONAL) != _SIDE:
        return b""
    corners = cv2.integral(image)[::_SIDE, ::_SIDE]
    sums = np.diff(np.diff(corners, axis=0), axis=1)
    cells: bytes = np.moveaxis(sums, 2, 0).astype(_SUMS).tobytes()
    return cells


def read_sums(cells: bytes) -> NDArray[np.int16]:
    """Return a picture's sums as :meth:`tega.stages.Metric.update_sums` takes them, int16 (3, cells)."""
    if len(cells) % (3 * _SUMS.itemsize):
        raise RecordingError(
            f"the cells of a picture are damaged: {len(cells)} bytes are no sums of three colours"
        )
    return np.frombuffer(cells, _SUMS).reshape(3, -1).astype(np.int16, copy=False)
