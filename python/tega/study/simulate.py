"""A study in silico: simulated people go through a plan on the simulated bench, each a whole session in its order.

A person remembers and tires from trial to trial, so a session is the unit of work: it is a function of the
study's seed and the person's number, whoever runs it. A session that was cut short is run again from its start.
"""

from __future__ import annotations

import hashlib
import os
import shutil
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tega.errors import InvalidValueError, MissingExtraError, RecordingError
from tega.study.coupling import TouchCourse, write_course
from tega.study.journal import Journal, read_events
from tega.study.plan import PlannedTrial, StudyPlan, make_plan, read_plan, write_plan
from tega.study.privacy import COURSES
from tega.study.state import derive, events_path
from tega.study.trials import course_path

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tega.sim.plan import TrialResult
    from tega.sim.streams import Streams

__all__ = ["ensure_plan", "person_seed", "run_session", "simulate", "unfinished"]

COURSE_HZ = 30.0
PEOPLE_APART = 1000
"""Between the seeds of two people: worlds are seeded by person and trial, and must not meet."""


def ensure_plan(plan: StudyPlan, folder: Path) -> None:
    """Write a simulated study's plan, or find the same one there.

    Several machines may do this at once on one file system; one of them writes.

    Raises:
        InvalidValueError: There is something else.
    """
    try:
        if read_plan(folder) == plan:
            return
    except RecordingError:
        try:
            write_plan(plan, folder)
        except (InvalidValueError, OSError):  # somebody else was faster, or something else is there
            if (folder / "study.toml").exists() and read_plan(folder) == plan:
                return
            raise
        return
    raise InvalidValueError(
        f"{folder}: has another plan", "name a new folder, or the same settings as before"
    )


def simulate(
    folder: Path,
    *,
    operators: int,
    seed: int = 1,
    objects: Sequence[str] = ("bottle", "container", "bag"),
    conditions: Sequence[str] = ("haptic", "non-haptic"),
    trials: int = 10,
    jobs: int = 0,
    shard: tuple[int, int] = (1, 1),
    progress: Callable[[str, int, int], None] = lambda _what, _done, _total: None,
) -> StudyPlan:
    """Run a whole study with simulated people, or what is left of it.

    Args:
        folder: The study's folder, new or of the same study.
        operators: How many people.
        seed: Of everything.
        objects: Names in :data:`tega.sim.world.OBJECTS`.
        conditions: Arms of :data:`tega.sim.arms.CONDITIONS` that are felt; the first is compared with the second.
        trials: Per person, object and condition.
        jobs: Worker processes; 0 for as many as there are cores.
        shard: ``(i, n)``: only the i-th of n parts of the people, from 1.
        progress: Told how many sessions are done.

    Raises:
        InvalidValueError: A name is unknown, or the folder has another study.
        MissingExtraError: A package of the extra ``sim`` is not installed.
    """
    from tega.sim.arms import CONDITIONS, feels
    from tega.sim.world import OBJECTS

    part, parts = shard
    if not 1 <= part <= parts:
        raise InvalidValueError(
            f"shard = {part}/{parts}: cannot be", "write i/n with i from 1 to n, such as 2/4"
        )
    for what, names, known in (
        ("objects", objects, list(OBJECTS)),
        ("conditions", conditions, [one for one in CONDITIONS if feels(one)]),
    ):
        for name in names:
            if name not in known:
                raise InvalidValueError(
                    f"{what}: {name!r} cannot be simulated", f"choose from {', '.join(map(str, known))}"
                )
    plan = make_plan(
        participants=operators,
        seed=seed,
        objects=objects,
        conditions=conditions,
        trials=trials,
        simulated=True,
    )
    ensure_plan(plan, folder)
    mine = plan.participants[part - 1 :: parts]
    still = set(unfinished(folder, plan))
    left = [person for person in mine if person in still]
    n_done = len(mine) - len(left)
    progress("sessions", n_done, len(mine))
    for _person in _sessions(folder, plan, left, jobs or os.cpu_count() or 1):
        n_done += 1
        progress("sessions", n_done, len(mine))
    return plan


def unfinished(folder: Path, plan: StudyPlan) -> list[str]:
    """Return whose sessions are not over."""
    return [
        person
        for person in plan.participants
        if derive(plan.of(person), read_events(events_path(folder, person))).next is not None
    ]


def _sessions(folder: Path, plan: StudyPlan, people: Sequence[str], jobs: int) -> Iterable[str]:
    if jobs == 1 or len(people) < 2:
        return (run_session(folder, plan, person) for person in people)
    try:
        from joblib import Parallel, delayed
    except ImportError as error:
        raise MissingExtraError("joblib is not installed", "pip install 'tega[sim]'") from error
    parallel = Parallel(n_jobs=min(jobs, len(people)), return_as="generator_unordered", batch_size=1)
    done: Iterable[str] = parallel(delayed(run_session)(folder, plan, person) for person in people)
    return done


def run_session(folder: Path, plan: StudyPlan, person: str) -> str:
    """Run one person's session from its start; what an earlier run left of it is deleted.

    Args:
        folder: The study's folder.
        plan: Its plan.
        person: Whose session.

    Returns:
        The person, when the session is over.
    """
    from tega.sim.lab import lab_of
    from tega.sim.lift import Lift
    from tega.sim.plan import TrialPlan
    from tega.sim.streams import Streams

    path = events_path(folder, person)
    shutil.rmtree(path.parent, ignore_errors=True)
    shutil.rmtree(folder / COURSES / person, ignore_errors=True)
    seed = person_seed(plan.settings.seed or 0, person)
    lab = lab_of(seed, "live")
    mind = lab.person(TrialPlan(object=plan.settings.objects[0], seed=seed))
    fatigue, t_ns = 0.0, 0
    with Journal(path) as journal:
        journal.add("session_start", t_ns=0, source="auto", text=plan.settings.plan_sha256)
        for trial in plan.of(person):
            t_ns += round(trial.rest_s * 1e9)
            streams = Streams()
            asked = TrialPlan.checked({"object": trial.object, "condition": trial.condition, "seed": seed})
            lift = Lift(lab, asked, mind, trial.trial, fatigue=fatigue, streams=streams)
            lift.go(real_time=False, observer=None, stop=lambda: False, paused=lambda: False)
            fatigue = lift.fatigue
            result = lift.result(lift.end_s)
            write_course(course_path(folder, trial), _course(streams))
            _keep(journal, trial, t_ns, result)
            t_ns += round(result.duration_s * 1e9)
    return person


def person_seed(seed: int, person: str) -> int:
    """Return the seed that decides who a simulated person of a study is."""
    digest = hashlib.sha256(f"tega-simulate|{seed}|{person}".encode()).digest()
    return int.from_bytes(digest[:4]) % (2**31 // PEOPLE_APART) * PEOPLE_APART


def _keep(
    journal: Journal,
    trial: PlannedTrial,
    start_ns: int,
    result: TrialResult,
) -> None:
    journal.add("trial_start", t_ns=start_ns, trial=trial.trial)
    for event in result.events:
        at_ns = start_ns + round(event.t_s * 1e9)
        journal.add(event.kind, t_ns=at_ns, trial=trial.trial, source="auto")
    journal.add(
        "trial_end",
        t_ns=start_ns + round(result.duration_s * 1e9),
        trial=trial.trial,
        status="done" if result.success else "failed_task",
        success=result.success,
        source="auto",
    )


def _course(streams: Streams) -> TouchCourse:
    """Bring the course of a lift to 30 Hz: touch as it was last measured, the level last chosen as pose 0 to 4."""
    course = streams.course()
    if not len(course.touch_t_s) or not len(course.level_t_s):
        return TouchCourse(*(np.zeros(0) for _ in range(4)))
    begin = max(course.touch_t_s[0], course.level_t_s[0])
    end = min(course.touch_t_s[-1], course.level_t_s[-1])
    t_s: NDArray[np.float64] = (
        np.arange(np.ceil(begin * COURSE_HZ), np.floor(end * COURSE_HZ) + 1) / COURSE_HZ
    )
    touch = np.searchsorted(course.touch_t_s, t_s + 1e-9, side="right") - 1
    level = np.searchsorted(course.level_t_s, t_s + 1e-9, side="right") - 1
    return TouchCourse(
        t_s, course.cci_norm[touch], course.eda_norm[touch], course.level[level].astype(np.float64) - 1.0
    )
