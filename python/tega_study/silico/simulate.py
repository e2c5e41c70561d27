"""Run a whole study with simulated people, or the sessions that are not finished."""

from __future__ import annotations

import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from tega.errors import InvalidValueError
from tega_sim.conditions import SESSION_CONDITIONS
from tega_sim.operator import load_parameters
from tega_sim.world import OBJECTS, ObjectSpec
from tega_study.journal import events_path, read_events
from tega_study.plan import StudyPlan, make_plan, read_plan, write_plan
from tega_study.silico.assumptions import (
    PARAMETERS,
    Assumptions,
    assume,
    assumption_files,
)
from tega_study.silico.session import RUNNING, SessionJob
from tega_study.silico.spread import Progress, run_sessions
from tega_study.state import derive


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
    dask: str = "",
    progress: Progress = lambda _subject, _done, _total: None,
    **requested: Any,
) -> StudyPlan:
    """Run a whole study with simulated people, or the sessions that are not finished.

    ``folder`` is new, or of the same study; ``jobs`` of 0 takes as many processes as there are cores.
    ``shard`` is ``(i, n)``: only the i-th of n parts of the people, from 1. ``dask`` is the address of a
    scheduler, whose workers are used instead of this machine's cores; ``DeviceUnavailableError`` if none
    answers there. ``progress`` gets the number of finished trials. ``requested`` are other arguments of
    :func:`made_study`.
    """
    part, parts = shard
    if not 1 <= part <= parts:
        raise InvalidValueError(
            f"shard = {part}/{parts}: cannot be", "write i/n with i from 1 to n, such as 2/4"
        )
    plan, stated = made_study(folder, operators=operators, **requested)
    mine = plan.participants[part - 1 :: parts]
    run_sessions(jobs_of(folder, plan, stated, mine), workers=jobs, dask=dask, progress=progress)
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

    ``objects`` are names in :data:`tega_sim.world.OBJECTS`, or other objects by name, such as those of
    :func:`tega_sim.world.crossed`. ``conditions`` are names in
    :data:`tega_sim.conditions.SESSION_CONDITIONS`; the first is compared with the second. ``trials`` are per
    person, object and condition. ``assumed`` are other arguments of
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
    plan = make_plan(
        participants=operators,
        seed=seed,
        objects=list(objects),
        conditions=conditions,
        trials=trials,
        simulated=True,
    )
    specs = objects if isinstance(objects, Mapping) else {name: OBJECTS[name] for name in objects}
    stated, content = assume(specs, **assumed)
    ensure_plan(plan, folder, assumption_files(stated, content))
    return plan, stated


def jobs_of(
    folder: Path, plan: StudyPlan, stated: Assumptions, people: Sequence[str], *, pictures: bool = True
) -> list[SessionJob]:
    """Return the sessions of these people that are not over."""
    loaded = load_parameters(folder / PARAMETERS).of_everyone(stated.everyone)
    still = set(unfinished(folder, plan))
    first = plan.participants[0]
    return [
        SessionJob(
            folder, person, plan.settings, plan.of(person), stated, loaded, pictures and person == first
        )
        for person in people
        if person in still
    ]


def unfinished(folder: Path, plan: StudyPlan) -> list[str]:
    """Return the IDs of people with unfinished sessions."""
    return [
        person
        for person in plan.participants
        if derive(plan.of(person), read_events(events_path(folder, person))).next is not None
    ]
