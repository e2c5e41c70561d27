"""Put each picture of a recording together with its numbers and times, with its cells, and decode pictures ahead.

The cells are what the metric ``live`` reads of a picture: sums over 8 x 8 pixels, beside its JPEG. The reading of the
sums is that of the picture, bit for bit, at a thirtieth of its bytes. Pictures are decoded and measured on other cores,
ahead of the reader that needs them in order.
"""

from __future__ import annotations

import math
import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any, Final, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from tega.errors import RecordingError
from tega.recording.mcap_reader import Message

PICTURES: Final = frozenset({"foxglove.RawImage", "foxglove.CompressedImage"})
"""Schemas of images."""

_SIDE: Final = 8
# The tracker divides the diagonal of a picture of any size into so many cells.
_CELLS_PER_DIAGONAL: Final = 50
_SUMS: Final = np.dtype("<i2")

# Decoded pictures of 640 x 480 that wait are 60 MB at most.
_MOST_AHEAD: Final = 64
# Threads take turns at the interpreter once a batch instead of once an item.
_BATCH: Final = 8

Item = TypeVar("Item")
Result = TypeVar("Result")


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


def has_cells(height: int, width: int) -> bool:
    """Return whether a picture of this size, pixels, has sums over cells."""
    whole = not (height % _SIDE or width % _SIDE)
    return whole and round(math.hypot(height, width) / _CELLS_PER_DIAGONAL) == _SIDE


def cell_sums(image: NDArray[np.uint8], cv2: Any) -> bytes:
    """Return the sums of a picture, uint8 (H, W, 3), over its cells, as bytes.

    They are int16, little-endian, (3, cells): the bytes of a pixel, cells row by row. Empty for a picture of
    a size that the metric divides otherwise: only around 320 x 240 are its cells 8 x 8 pixels.
    """
    if not has_cells(*image.shape[:2]):
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


class _Batch(Generic[Item, Result]):
    """Consecutive items of one name, and their results once they are computed."""

    def __init__(self) -> None:
        self.items: list[Item] = []
        self.future: Future[deque[Result | Exception]] | None = None


def compute_ahead(
    items: Iterable[Item],
    name_of: Callable[[Item], str],
    compute: Callable[[Item], Result],
    *,
    quick: Callable[[Item], bool] = lambda _item: False,
) -> Iterator[tuple[Item, Result | None]]:
    """Return each item in order with a result that other threads compute ahead, 64 at most.

    OpenCV decodes and the kernels measure without the interpreter's lock, so that every core works.
    ``name_of`` returns the name of an item, such as its finger; items of one name are computed one after the
    other, in order. For the name ``""`` nothing is computed, and the result is ``None``. A ``quick`` item is
    computed in its turn where none before it waits: another thread would take longer. What ``compute`` raises is
    raised when its item is next.
    """
    with ThreadPoolExecutor(os.cpu_count(), "tega-ahead") as pool:
        waiting: deque[tuple[Item, str, _Batch[Item, Result]]] = deque()
        filling: dict[str, _Batch[Item, Result]] = {}
        newest: dict[str, Future[deque[Result | Exception]] | None] = {}
        n_ahead = 0

        def submit(name: str) -> Future[deque[Result | Exception]]:
            batch = filling.pop(name)
            batch.future = newest[name] = pool.submit(_computed, compute, batch.items, newest.get(name))
            return batch.future

        def first() -> tuple[Item, Result | None]:
            nonlocal n_ahead
            item, name, batch = waiting.popleft()
            if not name:
                return item, None
            n_ahead -= 1
            result = (batch.future or submit(name)).result().popleft()
            if isinstance(result, Exception):
                raise result
            return item, result

        nothing = _Batch[Item, Result]()
        for item in items:
            name = name_of(item)
            if not waiting and (not name or quick(item)):
                yield item, compute(item) if name else None
                continue
            batch = filling.setdefault(name, _Batch()) if name else nothing
            waiting.append((item, name, batch))
            if name:
                n_ahead += 1
                batch.items.append(item)
                if len(batch.items) == _BATCH:
                    submit(name)
            # What has no result to wait for is never kept: a recording may have no pictures at all.
            while n_ahead > _MOST_AHEAD or (waiting and not waiting[0][1]):
                yield first()
        while waiting:
            yield first()


def _computed(
    compute: Callable[[Item], Result], items: Sequence[Item], before: Future[deque[Result | Exception]] | None
) -> deque[Result | Exception]:
    """Compute a batch after the one before it, which has begun earlier."""
    results: deque[Result | Exception] = deque()
    if before is not None:
        before.result()
    for item in items:
        try:
            results.append(compute(item))
        except Exception as error:  # raised when its item is next
            results.append(error)
    return results
