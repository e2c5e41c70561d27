"""Decode the pictures of a recording on other cores, ahead of the reader that needs them in order."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TYPE_CHECKING, Final

from tega.recording.mcap_reader import Message, read_picture

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Decoding = Future[NDArray[np.uint8]]

PICTURES: Final = frozenset({"foxglove.RawImage", "foxglove.CompressedImage"})
# Decoded pictures of 640 x 480 that wait are 60 MB at most.
_MOST_AHEAD: Final = 64


def decode_ahead(messages: Iterable[Message]) -> Iterator[tuple[Message, Decoding | None]]:
    """Return each message in order, a picture's with its decoding under way.

    OpenCV decodes without the interpreter's lock, so that every core works. At most 64 pictures are decoded ahead.

    Args:
        messages: Messages of a recording; those of pictures without a value are not decoded.

    Returns:
        Message and the future of its picture, uint8 (H, W, 3) in BGR, or ``None``. The future raises RecordingError
        where the picture is damaged.
    """
    with ThreadPoolExecutor(os.cpu_count(), "tega-decode") as pool:
        waiting: deque[tuple[Message, Decoding | None]] = deque()
        n_pictures = 0
        for message in messages:
            wanted = message.schema in PICTURES and message.value is not None
            waiting.append((message, pool.submit(read_picture, message) if wanted else None))
            n_pictures += wanted
            while n_pictures > _MOST_AHEAD:
                n_pictures -= waiting[0][1] is not None
                yield waiting.popleft()
        yield from waiting
