"""Simulate one person's session: a function of plan, assumptions and the study's seed only.

A person remembers and tires from trial to trial, so a session is the unit of work. It is made in a separate folder.
"""

from __future__ import annotations

import hashlib
import os
import shutil
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega_sim.lab import Lab
from tega_sim.operator import Parameters
from tega_sim.plan import TrialPlan
from tega_sim.streams import Streams
from tega_study.coupling import TouchCourse, write_course
from tega_study.journal import Journal, Status, events_path
from tega_study.plan import PlannedTrial, StudySettings
from tega_study.silico.assumptions import Assumptions
from tega_study.touch_picture import FingerPicture, picture_path, write_touch_picture
from tega_study.trials import course_path

COURSE_HZ = 30.0
PEOPLE_APART = 1000
"""Between the seeds of two people: worlds are seeded by person and trial, and must not meet."""

RESULTS = "results.jsonl"
"""File beside a simulated session's events: a :class:`tega_sim.plan.TrialResult` a line, in the session's order."""

RUNNING = ".running"
"""Folder in a study's folder where sessions are before they are over."""


class SessionJob(NamedTuple):
    """Inputs of one simulated session, to be sent to other processes; ``folder`` is the study's.

    With ``pictures`` one of a fingertip of each object's first felt lift is kept.
    """

    folder: Path
    person: str
    settings: StudySettings
    trials: tuple[PlannedTrial, ...]
    assumptions: Assumptions
    parameters: Parameters
    pictures: bool


def run_session(job: SessionJob) -> None:
    """Run a session from its start, and put it into the study's folder; its events last: then it is whole."""
    made = job.folder / RUNNING / job.person
    shutil.rmtree(made, ignore_errors=True)
    made.mkdir(parents=True)
    _go(job, made)
    for path in made.rglob("*"):
        if path.is_file():
            with path.open("r+b") as file:
                os.fsync(file.fileno())
    shutil.rmtree(events_path(job.folder, job.person).parent, ignore_errors=True)
    for part in sorted(made.iterdir(), key=lambda part: (part.name == "sessions", part.name)):
        target = job.folder / part.name / job.person
        shutil.rmtree(target, ignore_errors=True)
        target.parent.mkdir(exist_ok=True)
        (part / job.person).rename(target)
    shutil.rmtree(made, ignore_errors=True)


def _go(job: SessionJob, folder: Path) -> None:
    from tega_sim.lift import Lift
    from tega_sim.trial import practise

    stated = job.assumptions
    same = {"preset": stated.preset, "settings": stated.settings, "view": stated.view}
    seed = person_seed(job.settings.seed or 0, job.person)
    lab = Lab(seed, stated.preset, job.parameters, settings=stated.settings)
    specs = {name: stated.spec(name) for name in stated.objects}
    first = job.settings.objects[0]
    requested = TrialPlan.checked({"object": first, "spec": specs[first], "seed": seed, **same})
    mind, fatigue, t_ns = lab.person(requested), 0.0, 0
    practised: set[tuple[str, str]] = set()
    pictured: set[str] = set()
    events = events_path(folder, job.person)
    with Journal(events) as journal, events.with_name(RESULTS).open("wb") as results:
        journal.add("session_start", t_ns=0, source="auto", text=job.settings.plan_sha256)
        for trial in job.trials:
            t_ns += round(trial.rest_s * 1e9)
            streams = Streams()
            what = {"object": trial.object, "spec": specs[trial.object], "condition": trial.condition}
            requested = TrialPlan.checked({**what, "seed": seed, **same})
            if (trial.object, trial.condition) not in practised:
                practised.add((trial.object, trial.condition))
                practise(lab, requested, mind, trial.trial)
            lift = Lift(lab, requested, mind, trial.trial, fatigue=fatigue, streams=streams)
            lift.go()
            fatigue = lift.fatigue
            result = lift.result(lift.end_s)
            results.write(msgspec.json.encode(result) + b"\n")
            write_course(course_path(folder, trial), _course(streams))
            own: dict[str, Any] = {"trial": trial.trial, "source": "auto"}
            journal.add("trial_start", t_ns=t_ns, trial=trial.trial)
            for event in result.events:
                journal.add(event.kind, t_ns=t_ns + round(event.t_s * 1e9), **own)
            t_ns += round(result.duration_s * 1e9)
            status: Status = "done" if result.success else "failed_task"
            journal.add("trial_end", t_ns=t_ns, status=status, success=result.success, **own)
            felt = job.pictures and trial.condition == job.settings.conditions[0]
            if felt and trial.object not in pictured:
                pictured.add(trial.object)
                if found := streams.firmest():
                    finger, touch = found
                    full = lab.touch[finger]
                    maxima = full.cci_max or 0.0, full.eda_max or 0.0
                    picture = FingerPicture(finger, lab.preset, lab.baselines[finger], touch, *maxima)
                    write_touch_picture(picture_path(folder, trial), picture)


def person_seed(seed: int, person: str) -> int:
    """Return the seed that decides who a simulated person of a study is."""
    digest = hashlib.sha256(f"tega-simulate|{seed}|{person}".encode()).digest()
    return int.from_bytes(digest[:4]) % (2**31 // PEOPLE_APART) * PEOPLE_APART


def _course(streams: Streams) -> TouchCourse:
    """Bring the course of a lift to 30 Hz: touch as it was last measured, the level last chosen as pose 0 to 4."""
    course = streams.course()
    if not len(course.touch_t_s) or not len(course.level_t_s):
        return TouchCourse(*(np.zeros(0) for _ in range(4)))
    begin = max(course.touch_t_s[0], course.level_t_s[0])
    end = min(course.touch_t_s[-1], course.level_t_s[-1])
    ticks = np.arange(np.ceil(begin * COURSE_HZ), np.floor(end * COURSE_HZ) + 1)
    t_s: NDArray[np.float64] = ticks / COURSE_HZ
    touch = np.searchsorted(course.touch_t_s, t_s + 1e-9, side="right") - 1
    level = np.searchsorted(course.level_t_s, t_s + 1e-9, side="right") - 1
    pose = course.level[level].astype(np.float64) - 1.0
    return TouchCourse(t_s, course.cci_norm[touch], course.eda_norm[touch], pose)
