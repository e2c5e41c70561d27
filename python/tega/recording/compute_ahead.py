"""Decode and measure the pictures of a recording on other cores, ahead of the reader that needs them in order."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Final, Generic, TypeVar

# Decoded pictures of 640 x 480 that wait are 60 MB at most.
_MOST_AHEAD: Final = 64
# Threads take turns at the interpreter once a batch instead of once an item.
_BATCH: Final = 8

Item = TypeVar("Item")
Result = TypeVar("Result")


class _Batch(Generic[Item, Result]):
    """Consecutive items of one name, and their results once they are computed."""

    def __init__(self) -> None:
        self.items: list[Item] = []
        self.future: Future[deque[Result | Exception]] | None = None

    def next_result(self) -> Result:
        assert self.future is not None
        result = self.future.result().popleft()
        if isinstance(result, Exception):
            raise result
        return result


def compute_ahead(
    items: Iterable[Item], name_of: Callable[[Item], str], compute: Callable[[Item], Result]
) -> Iterator[tuple[Item, Result | None]]:
    """Return each item in order with a result that other threads compute ahead, 64 at most.

    OpenCV decodes and the kernels measure without the interpreter's lock, so that every core works.
    ``name_of`` returns the name of an item, such as its finger; items of one name are computed one after the
    other, in order. For the name ``""`` nothing is computed, and the result is ``None``. What ``compute``
    raises is raised when its item is next.
    """
    with ThreadPoolExecutor(os.cpu_count(), "tega-ahead") as pool:
        waiting: deque[tuple[Item, str, _Batch[Item, Result]]] = deque()
        filling: dict[str, _Batch[Item, Result]] = {}
        newest: dict[str, Future[deque[Result | Exception]] | None] = {}
        n_ahead = 0

        def submit(name: str) -> None:
            batch = filling.pop(name)
            batch.future = newest[name] = pool.submit(_computed, compute, batch.items, newest.get(name))

        def first() -> tuple[Item, Result | None]:
            nonlocal n_ahead
            item, name, batch = waiting.popleft()
            if not name:
                return item, None
            n_ahead -= 1
            if batch.future is None:
                submit(name)
            return item, batch.next_result()

        nothing = _Batch[Item, Result]()
        for item in items:
            name = name_of(item)
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
    compute: Callable[[Item], Result],
    items: Sequence[Item],
    before: Future[deque[Result | Exception]] | None,
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
