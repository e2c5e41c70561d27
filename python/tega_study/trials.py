"""Derive one row a trial from a study's events, with the events that each row comes from."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec

from tega.errors import RecordingError
from tega_study.journal import WITH_DATA, JournalEvent, Status, counting, events_path, read_events
from tega_study.observers import CAMERA, measured_path, read_measured, read_observers, saw_whole
from tega_study.plan import PlannedTrial, StudyPlan, read_plan
from tega_study.side_scores import score_beeps, squeeze_shares
from tega_study.study_notes import staying

_CAN_BE_UNDONE = {"lift_off", "lifted", "slip", "deformation", "drop", "note", "override", "redo", "rating"}


class Trial(msgspec.Struct, frozen=True, kw_only=True):
    """Outcome of one trial.

    Attributes:
        id: Such as ``p01-t07``, or file and line of a bench's results.
        repeat: Number among those of the same person, object and condition.
        status: ``done`` and ``failed_task`` are data; the others are reported in the flow and left out of the
            statistics.
        success: Lifted, held and not dropped; as corrected, if it was.
        slips: After lift-off, as the paper counts them (reading A68); ``slips_before`` are before it.
        deformations: In the whole trial (reading A69).
        duration_s: From the start to the end of the trial; ``None`` where it did not run to its end.
        lift_off_s: From the start.
        rater: Who counted slips, deformations and drops at a separate console; else ``""``.
        counted_by: Source of the counts, in words: that rater, else the sources of the session's own events.
        redone: The experimenter's reason why an attempt that had taken place does not count; ``""`` for none.
        beeps: Of the second task, those that count; ``beeps_answered`` of them were answered in time.
        reaction_s: Median from beep to press; ``None`` where none was answered.
        squeeze_share: Strength of the newest squeeze in the rest after it, as a share of the person's first.
        first: Whether the condition was the person's first with this object.
        events: Every event used, such as ``sessions/p01/events.jsonl:12``.
    """

    id: str
    participant: str
    trial: int
    repeat: int
    object: str
    condition: str
    status: Status = "done"
    success: bool
    slips: int
    slips_before: int = 0
    deformations: int
    drops: int = 0
    duration_s: float | None
    lift_off_s: float | None = None
    rater: str = ""
    counted_by: str = ""
    redone: str = ""
    beeps: int = 0
    beeps_answered: int = 0
    false_answers: int = 0
    reaction_s: float | None = None
    squeeze_share: float | None = None
    first: bool = False
    events: tuple[str, ...] = ()

    @property
    def counts(self) -> bool:
        """Whether the trial takes part in the analysis."""
        return self.status in WITH_DATA


def course_path(folder: Path, trial: Trial | PlannedTrial) -> Path:
    """Return where a trial's course of touch and level is: ``courses/<person>/<trial>.csv``."""
    return folder / "courses" / trial.participant / f"{trial.id}.csv"


def study_trials(folder: Path) -> tuple[StudyPlan, list[Trial]]:
    """Read a study's trials from its sessions' events, in the plan's order; those not run are left out."""
    plan = read_plan(folder)
    trials: list[Trial] = []
    for person in staying(folder, plan):
        path = events_path(folder, person)
        trials += trials_of_events(
            plan.of(person),
            read_events(path),
            where=path.relative_to(folder).as_posix(),
            observers=read_observers(folder, person),
            measured=read_measured(folder, person) if plan.settings.scored_by == "camera" else (),
            simulated=plan.settings.simulated,
        )
    return plan, trials


def trials_of_events(
    planned: Sequence[PlannedTrial],
    events: Sequence[JournalEvent],
    *,
    where: str,
    observers: Mapping[str, Sequence[JournalEvent]] = {},
    measured: Sequence[JournalEvent] = (),
    simulated: bool = False,
) -> list[Trial]:
    """Work out a person's trials.

    Slips, deformations and drops are those of the first rater, in the order of the names, who saw the trial
    from start to end; without one, those among the session's own events. If the camera's outcome counts, it
    replaces them and the success wherever it has measured the trial, as confirmed or corrected by a person if
    one has.

    ``where`` is the name of the events' file; ``measured`` are the scene camera's events, if its outcome
    counts. Raises ``RecordingError`` if an event undoes one that is not there, or that cannot be undone.
    """
    undone = set()
    for event in (one for one in events if one.kind == "undo"):
        number = event.undone or 0
        if not 0 < number < event.n or events[number - 1].kind not in _CAN_BE_UNDONE:
            text = f"{where}:{event.n}: undoes event {number}, which cannot be undone"
            raise RecordingError(text, "restore the file from a copy")
        undone.add(number)
    attempts: dict[int, list[list[JournalEvent]]] = {}
    for event in events:
        given_up = event.kind == "trial_end" and event.status == "skipped"
        if event.kind == "trial_start" or given_up:
            attempts.setdefault(event.trial, []).append([])
        if event.trial in attempts:
            attempts[event.trial][-1].append(event)
    first = {trial.object: trial.condition for trial in reversed(planned)}
    trials, shares = [], squeeze_shares(events)
    by_bench = simulated and not any(
        e.kind == "session_start" and e.item in {"lab", "emulated"} for e in events
    )
    for plan in planned:
        runs = [run for run in attempts.get(plan.trial, []) if any(e.kind == "trial_end" for e in run)]
        if runs:
            is_first = first[plan.object] == plan.condition
            done = _trial(plan, runs[-1], undone, where=where, first=is_first, by_bench=by_bench)
            redone = [e for run in runs for e in run if e.kind == "redo" and e.n not in undone]
            squeezed = [None, *(shares[event.n] for event in runs[-1] if event.n in shares)]
            why = (redone[-1].text or "reason left out") if redone else ""
            done = msgspec.structs.replace(done, redone=why, squeeze_share=squeezed[-1])
            if any(event in redone for event in runs[-1]):
                # It was to be done again and was not: nothing of it is data.
                done = msgspec.structs.replace(done, status="aborted_technical")
            trials.append(_counted(done, runs[-1], observers, measured, where=where))
    return trials


def _counted(
    trial: Trial,
    run: Sequence[JournalEvent],
    observers: Mapping[str, Sequence[JournalEvent]],
    measured: Sequence[JournalEvent],
    *,
    where: str,
) -> Trial:
    """Return a trial with the counts of the rater or the camera that counts, if there is one."""
    start = next((event for event in run if event.kind == "trial_start"), None)
    if start is None:
        return trial
    key, beside = (start.trial, start.attempt), where.rpartition("/")[0]
    by_camera = saw_whole(measured, *key)
    for rater, seen in observers.items():
        if saw_whole(seen, *key) and rater.startswith(f"{CAMERA}+") >= by_camera:
            own = f"{beside}/observers/{rater}.jsonl"
            trial = _rated(trial, counting(seen, *key), rater, start.t_ns, where=own)
            break
    if not by_camera:
        return trial
    events = counting(measured, *key)
    if not trial.rater:
        own = f"{beside}/{measured_path(Path(), 'p').name}"
        trial = _rated(trial, events, CAMERA, start.t_ns, where=own)
    # The camera's verdict, without a drop that a person struck: it writes "lifted" only for a lift in time.
    kinds = {event.kind for event in events}
    good = any(event.kind == "trial_end" and event.success for event in events) or {"drop", "lifted"} <= kinds
    return msgspec.structs.replace(trial, success=good and not trial.drops)


def _rated(trial: Trial, seen: Sequence[JournalEvent], rater: str, start_ns: int, *, where: str) -> Trial:
    """Return a trial with a rater's counts; the session's own lift-off comes first."""
    lift_off_s = trial.lift_off_s
    if lift_off_s is None or rater.startswith(CAMERA):
        marked = next((event for event in seen if event.kind == "lift_off"), None)
        lift_off_s = None if marked is None else (marked.t_ns - start_ns) / 1e9
    slips_s = [(event.t_ns - start_ns) / 1e9 for event in seen if event.kind == "slip"]
    drops = sum(event.kind == "drop" for event in seen)
    return msgspec.structs.replace(
        trial,
        rater=rater,
        counted_by=rater,
        lift_off_s=lift_off_s,
        **_slips(slips_s, lift_off_s),
        deformations=sum(event.kind == "deformation" for event in seen),
        drops=drops if rater.startswith(CAMERA) else max(trial.drops, drops),
        events=(*trial.events, *(f"{where}:{event.n}" for event in seen if event.kind != "note")),
    )


def _slips(slips_s: Sequence[float], lift_off_s: float | None) -> dict[str, Any]:
    before = sum(lift_off_s is None or t_s < lift_off_s for t_s in slips_s)
    return {"slips": len(slips_s) - before, "slips_before": before}


def _trial(
    plan: PlannedTrial,
    events: Sequence[JournalEvent],
    undone: set[int],
    *,
    where: str,
    first: bool,
    by_bench: bool,
) -> Trial:
    used = [event for event in events if event.n not in undone or event.kind == "undo"]
    begin = next((event for event in used if event.kind == "trial_start"), None)
    end = next(event for event in used if event.kind == "trial_end")
    lift_offs = [event for event in used if event.kind == "lift_off"]
    # A person corrects what was measured; both stay in the journal.
    lift = next((event for event in lift_offs if event.source not in {"auto", "arm"}), None)
    lift = lift or next(iter(lift_offs), None)
    success = end.success or False
    for event in used:
        if event.kind == "override" and event.success is not None:
            success = event.success
    slips = [event for event in used if event.kind == "slip"]
    before = sum(lift is None or event.t_ns < lift.t_ns for event in slips)
    beeps = score_beeps(used, end.t_ns)
    return Trial(
        id=plan.id,
        participant=plan.participant,
        trial=plan.trial,
        repeat=plan.repeat,
        object=plan.object,
        condition=plan.condition,
        status=end.status or "done",
        success=success,
        slips=len(slips) - before,
        slips_before=before,
        deformations=sum(event.kind == "deformation" for event in used),
        drops=sum(event.kind == "drop" for event in used),
        counted_by=_counted_by(used, by_bench=by_bench),
        duration_s=None if begin is None else (end.t_ns - begin.t_ns) / 1e9,
        lift_off_s=None if begin is None or lift is None else (lift.t_ns - begin.t_ns) / 1e9,
        beeps=beeps.beeps,
        beeps_answered=beeps.answered,
        false_answers=beeps.false_answers,
        reaction_s=beeps.reaction_s,
        first=first,
        events=tuple(f"{where}:{event.n}" for event in events if event.kind != "note"),
    )


def _counted_by(events: Sequence[JournalEvent], *, by_bench: bool) -> str:
    """Return in words who counted slips, deformations and drops among a session's own events."""
    counted = {event.source for event in events if event.kind in {"slip", "deformation", "drop"}}
    keyed = bool(counted - {"", "auto", "arm"})
    parts = ["the simulation"] * by_bench + ["the experimenter"] * (keyed or not by_bench)
    return " and ".join(parts + ["arm and fingertips"] * ("arm" in counted))


def bench_trials(paths: Iterable[Path]) -> list[Trial]:
    """Read the results that ``tega-teleop sim trials`` writes; a seed there is a person here.

    Results of several settings, which ``sim trials`` keeps in one file, are a ``RecordingError``.
    """
    from tega_sim.trials import read_results
    from tega_sim.world.objects import variant_name

    settings: dict[str, set[str]] = {}
    trials: list[Trial] = []
    repeats: dict[tuple[str, str, str], int] = {}
    numbers: dict[str, int] = {}
    for path in paths:
        if not path.exists():
            raise RecordingError(f"{path}: is not there", "name a file of sim trials, or a study's folder")
        for line, result in enumerate(read_results(path).values(), start=1):
            here = f"{path.name}:{line}"
            person, name = f"s{result.seed}", variant_name(result.object, result.plan.changes)
            for setting in ("operator", "practice", "preset", "settings", "view", "task"):
                values = settings.setdefault(setting, set())
                values.add(str(getattr(result, setting)))
                if len(values) > 1:
                    raise RecordingError(
                        f"{here}: trials of {setting} = {' and '.join(sorted(values))} are not compared as one",
                        "run sim trials with another --out for each",
                    )
            key = person, name, result.condition
            repeats[key] = repeats.get(key, 0) + 1
            numbers[person] = numbers.get(person, 0) + 1
            lift_s = result.lift_off_s
            slips_s = [event.t_s for event in result.events if event.kind == "slip"]
            trial = Trial(
                id=here,
                participant=person,
                trial=numbers[person],
                repeat=repeats[key],
                object=name,
                condition=result.condition,
                status="done" if result.success else "failed_task",
                success=result.success,
                **_slips(slips_s, lift_s),
                deformations=result.deformations,
                drops=result.drops,
                counted_by="the simulation",
                duration_s=result.duration_s,
                lift_off_s=lift_s,
                events=(here,),
            )
            trials.append(trial)
    return trials
