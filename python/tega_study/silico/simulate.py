"""Run a whole study with simulated people, over the cores of one machine or of several; the results are the same."""

from __future__ import annotations

import os
import shutil
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from tega.errors import DeviceUnavailableError, InvalidValueError
from tega.runtime.files.whole_file import lock_file, open_to_append
from tega_sim.conditions import SESSION_CONDITIONS
from tega_sim.operator import load_parameters
from tega_sim.trials import over_cores
from tega_sim.world import OBJECTS, ObjectSpec
from tega_study.journal import events_path, read_events
from tega_study.plan import StudyPlan, make_plan, read_plan, write_plan
from tega_study.silico.assumptions import PARAMETERS, Assumptions, assume
from tega_study.silico.session import RUNNING, SessionJob, run_session
from tega_study.state import derive

Progress = Callable[[str, int, int], None]
"""Called with the unit that is counted, the number of finished ones, and the total."""

_POLL_S = 0.5


def run_sessions(
    jobs: Sequence[SessionJob],
    *,
    workers: int = 0,
    progress: Progress = lambda _subject, _done, _total: None,
) -> None:
    """Run sessions and put each into its study's folder as soon as it is over.

    ``workers`` are processes on this machine, 0 for as many as there are cores; with 1 all run in this
    process. ``progress`` gets the number of finished trials.
    """
    if not jobs:
        return
    done = 0
    with _watched(jobs, progress) as count:
        for job in over_cores(_session, jobs, workers or os.cpu_count() or 1):
            done += len(job.trials)
            count(done)


def _session(job: SessionJob) -> SessionJob:
    """Run and keep a session, unless another program is at it or has done so meanwhile."""
    lock = job.folder / RUNNING / f"{job.person}.lock"
    lock.parent.mkdir(parents=True, exist_ok=True)
    with open_to_append(lock) as file:
        if not lock_file(file, lock):
            raise DeviceUnavailableError(
                f"{job.folder}: another program simulates {job.person} now",
                "wait for it, or give each program its own people, such as --shard 1/2 and --shard 2/2",
            )
        if derive(job.trials, read_events(events_path(job.folder, job.person))).next is not None:
            run_session(job)
    return job


@contextmanager
def _watched(jobs: Sequence[SessionJob], progress: Progress) -> Iterator[Callable[[int], None]]:
    """Report progress in trials: finished sessions, and the written courses of running ones."""
    total, n_over, ended = sum(len(job.trials) for job in jobs), 0, threading.Event()

    def notify(done: int) -> None:
        nonlocal n_over
        n_over = done
        progress("trials", done, total)

    def check() -> None:
        while not ended.wait(_POLL_S):
            progress("trials", min(n_over + sum(map(_written, jobs)), total), total)

    notify(0)
    watcher = threading.Thread(target=check, daemon=True, name="tega-progress")
    watcher.start()
    try:
        yield notify
    finally:
        ended.set()
        watcher.join()


def _written(job: SessionJob) -> int:
    return sum(1 for _ in (job.folder / RUNNING / job.person / "courses" / job.person).glob("*.csv"))


def ensure_plan(plan: StudyPlan, folder: Path, files: Mapping[str, bytes] = {}) -> None:
    """Write a simulated study's plan, or find the same one there; ``InvalidValueError`` if there is another.

    Several machines may do this at once on one file system; one of them writes. ``files`` is what else
    belongs to it, by name; has to be the same as well.
    """
    if not (folder / "study.toml").exists():
        try:
            write_plan(plan, folder, files)
        except (InvalidValueError, OSError):  # somebody else was faster, or something else is there
            if not (folder / "study.toml").exists():
                raise
    there = read_plan(folder)
    if there != plan:
        raise InvalidValueError(
            f"{folder}: has another plan", "name a new folder, or the same settings as before"
        )
    for name, content in files.items():
        path = folder / name
        if not path.is_file() or path.read_bytes() != content:
            raise InvalidValueError(
                f"{folder}: was begun with another {name}",
                "other assumptions, or another version of the program, are another study: name a new folder",
            )


def simulate(
    folder: Path,
    *,
    operators: int,
    jobs: int = 0,
    shard: tuple[int, int] = (1, 1),
    progress: Progress = lambda _subject, _done, _total: None,
    **requested: Any,
) -> StudyPlan:
    """Run a whole study with simulated people, or the sessions that are not finished.

    ``folder`` is new, or of the same study. ``shard`` is ``(i, n)``: only the i-th of n parts of the people,
    from 1. ``jobs`` are the ``workers`` of :func:`run_sessions`; ``requested`` are other arguments of
    :func:`made_study`.
    """
    part, parts = shard
    plan, stated = made_study(folder, operators=operators, **requested)
    mine = plan.participants[part - 1 :: parts]
    run_sessions(jobs_of(folder, plan, stated, mine), workers=jobs, progress=progress)
    if not unfinished(folder, plan):  # else another shard may be at work in there
        shutil.rmtree(folder / RUNNING, ignore_errors=True)
    return plan


def made_study(
    folder: Path,
    *,
    operators: int,
    seed: int = 1,
    objects: Sequence[str] | Mapping[str, ObjectSpec] = ("bottle", "container", "bag"),
    conditions: Sequence[str] = ("haptic", "non-haptic"),
    trials: int = 10,
    **assumed: Any,
) -> tuple[StudyPlan, Assumptions]:
    """Plan a study in silico and write plan and assumptions, or find the same ones in ``folder``.

    ``objects`` are names in :data:`tega_sim.world.OBJECTS`, or other objects by name; ``conditions`` names in
    :data:`tega_sim.conditions.SESSION_CONDITIONS`. ``assumed`` are other arguments of
    :func:`tega_study.silico.assumptions.assume`.
    """
    for subject, names, known in (
        ("objects", objects, [*OBJECTS, *(objects if isinstance(objects, Mapping) else ())]),
        ("conditions", conditions, SESSION_CONDITIONS),
    ):
        for name in names:
            if name not in known:
                raise InvalidValueError(
                    f"{subject}: {name!r} cannot be simulated", f"choose from {', '.join(map(str, known))}"
                )
    settings: dict[str, Any] = {"objects": list(objects), "conditions": conditions, "trials": trials}
    plan = make_plan(participants=operators, seed=seed, simulated=True, **settings)
    specs = objects if isinstance(objects, Mapping) else {name: OBJECTS[name] for name in objects}
    stated, files = assume(specs, **assumed)
    ensure_plan(plan, folder, files)
    return plan, stated


def jobs_of(
    folder: Path, plan: StudyPlan, stated: Assumptions, people: Sequence[str], *, pictures: bool = True
) -> list[SessionJob]:
    """Return the sessions of these people that are not over."""
    loaded = load_parameters(folder / PARAMETERS).of_everyone(stated.everyone)
    still = set(unfinished(folder, plan))
    first = plan.participants[0]
    return [
        SessionJob(folder, one, plan.settings, plan.of(one), stated, loaded, pictures and one == first)
        for one in people
        if one in still
    ]


def unfinished(folder: Path, plan: StudyPlan) -> list[str]:
    """Return the IDs of people with unfinished sessions."""
    return [
        person
        for person in plan.participants
        if derive(plan.of(person), read_events(events_path(folder, person))).next is not None
    ]
