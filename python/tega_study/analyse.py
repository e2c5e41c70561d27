"""Analyse a study into one record that holds every number its report shows, and nothing else."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from tega.errors import RecordingError
from tega_sim.operator.person import Parameter
from tega_study.answers import ArmCoupling, Contrast, PoseUse, TrialCoupling, answers
from tega_study.compare import Test, compare
from tega_study.coupling import TouchCourse, read_course
from tega_study.difference import Cell, Direction, OutcomeDifference, cells_of, directions, outcomes
from tega_study.journal import events_path, read_events
from tega_study.plan import default_family
from tega_study.power import Planner, next_study
from tega_study.ratings import ProbeUse, RatingUse, probe_uses, ratings
from tega_study.score.accounts import agreements
from tega_study.score.agree import Agreement
from tega_study.silico.assumptions import Assumptions, read_assumptions, read_parameters
from tega_study.silico.sensitivity import SensitivityRow, read_sensitivity
from tega_study.state import derive, rehearsed
from tega_study.study_notes import ObjectFacts, note_unblinding, read_objects, staying, unblindings
from tega_study.touch_picture import FingerPicture, FingerRow, finger_rows, pictures_of
from tega_study.trials import Trial, bench_trials, course_path, study_trials

FORMAT = "tega-study-analysis"


class Flow(msgspec.Struct, frozen=True, kw_only=True):
    """Counts of the people and trials that took part; ``None`` without a plan.

    Attributes:
        people: With at least one trial.
        planned_trials: Of people who have not withdrawn.
        status: Trials by how they ended; ``not run`` for the rest.
        redone: The experimenter's reason, by id of a trial of which an attempt that took place does not count.
    """

    planned_people: int | None
    withdrawn: int
    people: int
    complete: int
    planned_trials: int | None
    status: dict[str, int]
    redone: dict[str, str] = {}


class Analysis(msgspec.Struct, frozen=True, kw_only=True):
    """All numbers of a report; equal input gives equal bytes.

    Attributes:
        source: ``study``, or the names of the files that it was made from.
        interim: Whether the plan is not complete yet.
        blind: Whether results are withheld for that reason: no trial, mean, test, effect or course is in it.
        unblinded: When results were looked at before the plan was complete, and how far it was then.
        conditions: The first is compared with the second.
        family: Tests that were corrected together.
        probes: The second task, where the plan has one.
        sensitivity: Which directions hold when an assumption is changed.
        fingers: The contacts that Fig 3 shows.
        outcomes: Each outcome's difference between the first two conditions, over people; ``further`` of each
            further condition, less the second.
        rehearsed: In a plan for real participants, those with a session outside the lab.
        counted_by: Number of trials that count, by who counted their slips, deformations and drops.
    """

    source: str
    simulated: bool
    interim: bool
    blind: bool
    objects: tuple[str, ...]
    conditions: tuple[str, ...]
    family: tuple[str, ...]
    alpha: float
    plan_sha256: str
    flow: Flow
    trials: tuple[Trial, ...] = ()
    cells: tuple[Cell, ...] = ()
    tests: tuple[Test, ...] = ()
    couplings: tuple[TrialCoupling, ...] = ()
    arms: tuple[ArmCoupling, ...] = ()
    contrasts: tuple[Contrast, ...] = ()
    pose_use: tuple[PoseUse, ...] = ()
    planner: tuple[Planner, ...] = ()
    agreements: tuple[Agreement, ...] = ()
    ratings: tuple[RatingUse, ...] = ()
    probes: tuple[ProbeUse, ...] = ()
    directions: tuple[Direction, ...] = ()
    assumptions: Assumptions | None = None
    parameters: dict[str, dict[str, Parameter]] = {}
    sensitivity: tuple[SensitivityRow, ...] = ()
    fingers: tuple[FingerRow, ...] = ()
    outcomes: tuple[OutcomeDifference, ...] = ()
    further: tuple[OutcomeDifference, ...] = ()
    object_facts: dict[str, ObjectFacts] = {}
    rehearsed: tuple[str, ...] = ()
    counted_by: dict[str, int] = {}
    unblinded: tuple[str, ...] = ()
    format: str = FORMAT
    version: int = 2


class FigureMaterial(NamedTuple):
    """Courses of touch and pose, and pictures of fingertips, by trial id; for the figures."""

    courses: Mapping[str, TouchCourse] = {}
    pictures: Mapping[str, FingerPicture] = {}


def analyse_study(folder: Path, *, unblind: bool = False) -> tuple[Analysis, FigureMaterial]:
    """Analyse a study's folder; nothing else is read.

    ``unblind`` compares conditions before the plan is complete, and is written into the study's journal: a
    test loses its error rate if the study is stopped or changed after a look. Without a trial that counts there
    is a ``RecordingError``.
    """
    plan, trials = study_trials(folder)
    settings, stay = plan.settings, staying(folder, plan)
    sessions = {person: read_events(events_path(folder, person)) for person in stay}
    complete = sum(derive(plan.of(person), events).next is None for person, events in sessions.items())
    people_rehearsed = tuple(person for person, events in sessions.items() if rehearsed(events))
    planned = sum(len(plan.of(person)) for person in stay)
    status = _status(trials)
    if planned > len(trials):
        status["not run"] = planned - len(trials)
    flow = Flow(
        planned_people=settings.participants,
        withdrawn=settings.participants - len(stay),
        people=len({trial.participant for trial in trials}),
        complete=complete,
        planned_trials=planned,
        status=status,
        redone={trial.id: trial.redone for trial in trials if trial.redone},
    )
    unfinished = complete < len(stay)
    blind = Analysis(
        source="study",
        simulated=settings.simulated,
        interim=unfinished,
        blind=True,
        objects=settings.objects,
        conditions=settings.conditions,
        family=settings.family,
        alpha=settings.alpha,
        plan_sha256=settings.plan_sha256,
        flow=flow,
        assumptions=read_assumptions(folder),
        parameters=read_parameters(folder),
        object_facts=read_objects(folder),
        rehearsed=() if settings.simulated else people_rehearsed,
        counted_by=_counted_by(trials),
        unblinded=unblindings(folder),
    )
    _need_trials(trials)
    if unfinished and not unblind:
        return blind, FigureMaterial()
    if unfinished:
        note_unblinding(folder, f"{complete} of {len(stay)} people complete")
    paths = {trial.id: course_path(folder, trial) for trial in trials if trial.counts}
    courses = {number: read_course(path) for number, path in paths.items() if path.exists()}
    crossed = settings.layout == "period"
    result = analyse(blind, trials, courses, per_cell=settings.trials, crossed=crossed)
    pictures = pictures_of(folder, trials, settings.objects, settings.conditions[0])
    result = msgspec.structs.replace(
        result,
        agreements=tuple(agreements(folder)),
        ratings=ratings(folder),
        probes=probe_uses(trials, settings.conditions),
        sensitivity=read_sensitivity(folder),
        fingers=finger_rows(pictures, trials),
        unblinded=unblindings(folder),
    )
    return result, FigureMaterial(courses, pictures)


def analyse_bench(paths: Sequence[Path]) -> Analysis:
    """Analyse results of ``tega-teleop sim trials``: at least two conditions, and no courses."""
    trials = bench_trials(paths)
    objects = tuple(dict.fromkeys(trial.object for trial in trials))
    conditions = tuple(dict.fromkeys(trial.condition for trial in trials))
    if len(conditions) < 2:
        raise RecordingError(
            f"{', '.join(path.name for path in paths)}: has {len(conditions)} conditions, a comparison needs two",
            "run sim trials with --conditions haptic,non-haptic",
        )
    if "non-haptic" in conditions:  # the reference
        first, *others = sorted((one for one in conditions if one != "non-haptic"), key="haptic".__ne__)
        conditions = (first, "non-haptic", *others)
    n = len({trial.participant for trial in trials})
    none: dict[str, Any] = {"planned_people": None, "planned_trials": None, "withdrawn": 0}
    flow = Flow(people=n, complete=n, status=_status(trials), **none)
    blind = Analysis(
        source=", ".join(path.name for path in paths),
        simulated=True,
        interim=False,
        blind=True,
        objects=objects,
        conditions=conditions,
        family=default_family(objects),
        alpha=0.05,
        plan_sha256="",
        flow=flow,
    )
    return analyse(blind, trials, {}, per_cell=max(trial.repeat for trial in trials))


def analyse(
    blind: Analysis,
    trials: Sequence[Trial],
    courses: Mapping[str, TouchCourse],
    *,
    per_cell: int,
    crossed: bool = False,
) -> Analysis:
    """Work out all numbers of a report from its ``blind`` state, in which results are withheld.

    ``courses`` holds, by trial id, those that there are. ``per_cell`` is the trials per person, object and
    condition, for the planner; ``crossed``: each person had one condition before the other. Raises
    ``RecordingError`` if no trial counts.
    """
    _need_trials(trials)
    objects, conditions, family = blind.objects, blind.conditions, blind.family
    pair = (conditions[0], conditions[1])
    cells = cells_of(trials, objects, conditions)
    couplings, arms, contrasts, uses = answers(trials, courses, objects, conditions)
    of_paper = directions(trials, pair) if blind.simulated and pair == ("haptic", "non-haptic") else ()
    others = ((other, conditions[1]) for other in conditions[2:])
    return msgspec.structs.replace(
        blind,
        blind=False,
        counted_by=_counted_by(trials),
        trials=tuple(trials),
        cells=tuple(cells),
        tests=tuple(compare(trials, objects, pair, family=family, crossed=crossed)),
        couplings=tuple(couplings),
        arms=tuple(arms),
        contrasts=tuple(contrasts),
        pose_use=tuple(uses),
        planner=next_study(cells, family, pair, trials=per_cell, alpha=blind.alpha),
        outcomes=outcomes(trials, objects, pair),
        further=tuple(one for other in others for one in outcomes(trials, objects, other)),
        directions=tuple(one for one in of_paper if one.object in objects),
    )


def _need_trials(trials: Sequence[Trial]) -> None:
    if not any(trial.counts for trial in trials):
        raise RecordingError("there is no finished trial yet", "run some trials first")


def _counted_by(trials: Sequence[Trial]) -> dict[str, int]:
    return dict(sorted(Counter(trial.counted_by for trial in trials if trial.counts).items()))


def _status(trials: Sequence[Trial]) -> dict[str, int]:
    return dict(sorted(Counter(trial.status for trial in trials).items()))
