"""Run jobs in worker processes that end when the one that started them does, however that ended."""

from __future__ import annotations

import functools
import os
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, TypeVar

from tega.errors import MissingExtraError
from tega.runtime.child_process import isolated_workers

Job = TypeVar("Job")
Result = TypeVar("Result")

_POLL_S = 0.2


def over_cores(work: Callable[[Job], Result], jobs: Sequence[Job], workers: int) -> Iterator[Result]:
    """Do the jobs in processes of their own; results come as they are ready.

    A signal that ends this process, even SIGKILL, ends the workers within a second: they check their parent.
    (Windows does not report it; there the workers of a killed program finish their job.) ``work`` must be a
    function of a module. With one worker, or one job, it is called in this process.
    """
    if workers == 1 or len(jobs) < 2:
        yield from map(work, jobs)
        return
    try:
        from joblib import Parallel, delayed
    except ImportError as error:
        raise MissingExtraError("joblib is not installed", "pip install 'tega[sim]'") from error
    parallel = Parallel(n_jobs=min(workers, len(jobs)), return_as="generator_unordered", batch_size=1)
    with isolated_workers():
        results: Iterable[Any] = parallel(delayed(_in_worker)(work, job, os.getpid()) for job in jobs)
    yield from results


def _in_worker(work: Callable[[Job], Result], job: Job, parent: int) -> Result:
    _watch(parent)
    return work(job)


@functools.cache
def _watch(parent: int) -> None:
    """Begin to watch, once in a process."""
    threading.Thread(target=_end_with, args=(parent,), daemon=True, name="tega-parent").start()


def _end_with(parent: int) -> None:
    """End this process when it has another parent than the one that started it."""
    while os.getppid() == parent:
        time.sleep(_POLL_S)
    os._exit(1)
