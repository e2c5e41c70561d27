"""Compute in a thread of its own, with a fixed delay: the caller never waits for a computation that is late."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from concurrent.futures import TimeoutError as LateError
from typing import Final

import numpy as np
from numpy.typing import NDArray

from tega.runtime.threads import run_realtime

_MOST_WAITING: Final = 8


class Ahead:
    """Gives at each time the result for the newest input that is at least a fixed delay old.

    The result of an input may be used as soon as it is ``delay_ms`` old, and has to be ready by then on the
    clock as well. In real time the loop does not wait; a recording that is computed faster waits for the
    computation alone. Both give the same numbers, unless a computation takes longer than the delay; its
    result then counts as missing.

    ``compute`` returns the result of an input, float64 (outputs,), and is called in the thread; ``first`` is
    the result until the first input is old enough. Inputs less than ``every_ms`` after the last are not
    computed. ``problem`` is the last error of a computation; ``""`` for none.
    """

    def __init__(
        self,
        compute: Callable[[NDArray[np.float32]], NDArray[np.float64]],
        first: NDArray[np.float64],
        *,
        delay_ms: float,
        every_ms: float,
    ) -> None:
        self._compute, self._newest = run_realtime("beside")(compute), first
        self._delay_ns, self._every_ns = round(delay_ms * 1e6), round(every_ms * 1e6)
        self._missing = np.full(len(first), math.nan)
        self._waiting: deque[tuple[int, float, Future[NDArray[np.float64]]]] = deque()
        self._last_ns: int | None = None
        self._pool = ThreadPoolExecutor(1, thread_name_prefix="tega-onnx")
        self.n_late = 0
        self.problem = ""

    def wants(self, t_ns: int) -> bool:
        """Return whether an input of this time is to be given."""
        due = self._last_ns is None or t_ns - self._last_ns >= self._every_ns
        return due and len(self._waiting) < _MOST_WAITING

    def give(self, t_ns: int, prepare: Callable[[], NDArray[np.float32]]) -> None:
        """Compute an input, which ``prepare`` makes in the thread."""
        self._last_ns = t_ns
        self._waiting.append((t_ns, time.monotonic(), self._pool.submit(lambda: self._compute(prepare()))))

    def at(self, t_ns: int) -> NDArray[np.float64]:
        """Return the result at a time; NaN where it is missing."""
        due: tuple[float, Future[NDArray[np.float64]]] | None = None
        while self._waiting and self._waiting[0][0] <= t_ns - self._delay_ns:
            _, given_s, future = self._waiting.popleft()
            due = given_s, future
        if due is not None:
            self._newest = self._result(*due)
        return self._newest

    def _result(self, given_s: float, future: Future[NDArray[np.float64]]) -> NDArray[np.float64]:
        left_s = given_s + self._delay_ns / 1e9 - time.monotonic()
        try:
            return future.result(max(0.0, left_s))
        except LateError:
            self.n_late += 1
            return self._missing
        except Exception as error:  # the model's; what reads the value sees that it is missing
            self.problem = str(error)[:300]
            return self._missing
