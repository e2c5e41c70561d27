"""Spread sessions over this machine's cores or the workers of a dask cluster; the results are the same."""

from __future__ import annotations

import importlib
import os
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from tega.errors import DeviceUnavailableError, MissingExtraError, WrongDeviceError
from tega_sim.trials import over_cores
from tega_study.silico.assumptions import code_sha256
from tega_study.silico.session import RUNNING, SessionJob, keep_session, run_session

Progress = Callable[[str, int, int], None]
"""Called with the unit that is counted, the number of finished ones, and the total."""

_POLL_S = 0.5
_CONNECT_S = 10.0


def run_sessions(
    jobs: Sequence[SessionJob],
    *,
    workers: int = 0,
    dask: str = "",
    progress: Progress = lambda _subject, _done, _total: None,
) -> None:
    """Run sessions and put each into its study's folder as soon as it is over.

    ``workers`` are processes on this machine, 0 for as many as there are cores; with 1 all run in this
    process. With ``dask``, the address of a scheduler, its workers run them, and need not share a disk with
    this machine; ``WrongDeviceError`` if one has another version of the program, ``DeviceUnavailableError``
    if no scheduler answers or it has no worker. ``progress`` gets the number of finished trials, with
    ``dask`` after each session.
    """
    total = sum(len(job.trials) for job in jobs)
    if not jobs:
        return
    done = 0
    finished: Iterator[tuple[SessionJob, dict[str, bytes]]]
    with _watched(jobs, total, progress, on=not dask) as count:
        finished = (
            _over_dask(jobs, dask) if dask else over_cores(_session, jobs, workers or os.cpu_count() or 1)
        )
        for job, files in finished:
            keep_session(job, files)
            done += len(job.trials)
            count(done)


def _session(job: SessionJob) -> tuple[SessionJob, dict[str, bytes]]:
    return job, run_session(job, job.folder / RUNNING / job.person)


def _over_dask(jobs: Sequence[SessionJob], address: str) -> Iterator[tuple[SessionJob, dict[str, bytes]]]:
    try:
        distributed: Any = importlib.import_module("distributed")  # untyped
    except ImportError as error:
        raise MissingExtraError("dask.distributed is not installed", "pip install 'tega[dask]'") from error
    start = "start one: dask scheduler, and on each machine: dask worker ADDRESS"
    try:
        client = distributed.Client(address, timeout=_CONNECT_S)
    except (OSError, ValueError) as error:
        raise DeviceUnavailableError(f"--dask {address}: no scheduler answers", start) from error
    with client:
        abouts: dict[str, str] = client.run(_about)
        if not abouts:
            raise DeviceUnavailableError(f"--dask {address}: the scheduler has no worker", start)
        here = _about()
        for worker, there in abouts.items():
            if there != here:
                raise WrongDeviceError(
                    f"--dask {address}: worker {worker} has tega {there}, here it is {here}",
                    "install the same version everywhere; other versions may give other results",
                )
        jobs_of = {client.submit(run_session, job, pure=False, retries=2): job for job in jobs}
        for future in distributed.as_completed(list(jobs_of)):
            files: dict[str, bytes] = future.result()
            yield jobs_of[future], files
            future.release()


def _about() -> str:
    """Return the program's version and a digest of its files, which determine a session's result."""
    import tega

    return f"{tega.__version__} ({code_sha256()[:12]})"


@contextmanager
def _watched(
    jobs: Sequence[SessionJob], total: int, progress: Progress, *, on: bool
) -> Iterator[Callable[[int], None]]:
    """Report progress in trials: finished sessions, and the written courses of running ones."""
    n_over, ended = 0, threading.Event()

    def notify(done: int) -> None:
        nonlocal n_over
        n_over = done
        progress("trials", done, total)

    def check() -> None:
        while not ended.wait(_POLL_S):
            progress("trials", min(n_over + sum(map(_written, jobs)), total), total)

    notify(0)
    watcher = threading.Thread(target=check, daemon=True, name="tega-progress")
    if on:
        watcher.start()
    try:
        yield notify
    finally:
        ended.set()
        if on:
            watcher.join()


def _written(job: SessionJob) -> int:
    folder = job.folder / RUNNING / job.person / "courses" / job.person
    return sum(1 for _ in folder.glob("*.csv")) if folder.is_dir() else 0
