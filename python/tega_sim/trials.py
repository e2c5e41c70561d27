"""Run many simulated trials over all cores: resumable, with the same results for any number of workers.

A trial is a function of its plan, so workers share nothing. Results are written one JSON object a line as they come
and read again by the next run; when all are there the file is put into the order of the plans.
"""

from __future__ import annotations

import functools
import itertools
import os
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import IO, Any, TypeVar

import msgspec

from tega.errors import ConfigError, RecordingError
from tega.runtime.child_process import isolated_workers
from tega.runtime.files.foreign_file import parse_json, read_foreign
from tega.runtime.files.whole_file import write_whole
from tega.runtime.lifecycle import require
from tega_sim.operator import load_parameters, people_digest
from tega_sim.trial import TrialPlan, TrialResult, run_trial
from tega_sim.world.objects import ObjectSpec, trial_fields, variant_name

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
    joblib: Any = require("joblib", driver="sim trials", extra="sim")
    parallel = joblib.Parallel(n_jobs=min(workers, len(jobs)), return_as="generator_unordered", batch_size=1)
    with isolated_workers():
        results: Iterable[Any] = parallel(joblib.delayed(_in_worker)(work, job, os.getpid()) for job in jobs)
    yield from results


def _in_worker(work: Callable[[Job], Result], job: Job, parent: int) -> Result:
    _watch(parent)
    return work(job)


@functools.cache
def _watch(parent: int) -> None:
    threading.Thread(target=_end_with, args=(parent,), daemon=True, name="tega-parent").start()


def _end_with(parent: int) -> None:
    """End this process when it has another parent than the one that started it."""
    while os.getppid() == parent:
        time.sleep(_POLL_S)
    os._exit(1)


def plan_trials(
    objects: Sequence[str] | Mapping[str, ObjectSpec],
    conditions: Sequence[str],
    seeds: Iterable[int],
    *,
    mass_kg: Sequence[float | None] = (None,),
    stiffness_n_m: Sequence[float | None] = (None,),
    friction: Sequence[float | None] = (None,),
    **settings: object,
) -> list[TrialPlan]:
    """Plan every object, with every mass, stiffness and friction, under every condition with every seed.

    A seed is a person with all their chance: trials that differ only in object or condition are of the same
    person, and those that differ only in mass, stiffness, friction or condition have the same chance, too.
    ``None`` as a mass, stiffness or friction is the object's own. ``settings`` are further attributes of
    :class:`TrialPlan`, the same for all.
    """
    plans = []
    specs: Mapping[str, ObjectSpec] = objects if isinstance(objects, Mapping) else {}
    factors = itertools.product(mass_kg, stiffness_n_m, friction)
    for seed, name, changes, condition in itertools.product(seeds, objects, factors, conditions):
        changed = dict(zip(("mass_kg", "stiffness_n_m", "friction"), changes, strict=True))
        plan = {"object": name, "condition": condition, "seed": seed, **changed, **settings}
        plans.append(TrialPlan.checked({**plan, "spec": specs.get(name)}))
    return plans


def run_trials(
    plans: Sequence[TrialPlan],
    *,
    jobs: int = 1,
    out: Path | None = None,
    progress: Callable[[str, int, int], None] = lambda _subject, _done, _total: None,
) -> list[TrialResult]:
    """Run trials, or those of them that ``out`` does not hold yet.

    ``jobs`` are worker processes, 0 for as many as there are cores; one runs in this process. ``out`` has one
    JSON object a line; new results are added as they end, and results of other plans in it are kept. One that
    holds something else, or results of persons with other parameters or rules, raises
    :class:`RecordingError`. ``progress`` is called with the number of finished trials.
    """
    known = read_results(out) if out is not None else {}
    if out is not None:
        _check_persons(out, known.values())
    left = [plan for plan in dict.fromkeys(plans) if plan not in known]
    n_all = len(set(plans))
    with ExitStack() as stack:
        file: IO[bytes] | None = None
        if out is not None and left:
            _write(out, plans, known)  # a line that was cut off must not stay before what is added
            file = stack.enter_context(out.open("ab"))
        progress("trials", n_all - len(left), n_all)
        results = over_cores(run_trial, left, jobs or os.cpu_count() or 1)
        for n_done, result in enumerate(results, n_all - len(left) + 1):
            known[result.plan] = result
            if file is not None:
                file.write(msgspec.json.encode(result) + b"\n")
                file.flush()
            progress("trials", n_done, n_all)
    if out is not None and left:
        _write(out, plans, known)
    return [known[plan] for plan in plans]


def read_results(path: Path) -> dict[TrialPlan, TrialResult]:
    """Read a file of results; a last line that was cut off is passed over, a missing file holds none.

    Another line that is no result of this version raises :class:`RecordingError`.
    """
    if not path.exists():
        return {}
    results = {}
    content = read_foreign(path, most_mib=1024)
    lines = content.split(b"\n")
    for number, line in enumerate(lines, start=1):
        if not line:
            continue
        try:
            result = msgspec.convert(trial_fields(parse_json(line, dict[str, Any])), TrialResult)
        except (msgspec.DecodeError, ConfigError) as error:
            if number == len(lines):  # no newline behind it: the run that wrote it was ended there
                break
            raise RecordingError(
                f"{path.name}: line {number} is no result of a trial: {error}",
                "name a new file, or one that this version wrote",
            ) from error
        results[result.plan] = result
    return results


def _check_persons(path: Path, results: Iterable[TrialResult]) -> None:
    """Refuse results of simulated persons with other parameters, or rules, than today's."""
    today = people_digest(load_parameters().digest)
    for result in results:
        if not today.startswith(result.person):
            raise RecordingError(
                f"{path.name}: made with people {result.person}, who are {today[:16]} now", "name a new file"
            )


def _write(path: Path, plans: Sequence[TrialPlan], known: dict[TrialPlan, TrialResult]) -> None:
    """Write results in the order of the plans, other plans' results last; equal runs give equal bytes."""
    ordered = dict.fromkeys([*plans, *known])
    lines = [msgspec.json.encode(known[plan]) + b"\n" for plan in ordered if plan in known]
    write_whole(path, b"".join(lines))


class Row(msgspec.Struct, frozen=True, kw_only=True):
    """One object, with the changes of the plan, under one condition.

    ``success`` is the share of the ``n`` trials that were lifted and held; the others are means per trial.
    """

    object: str
    condition: str
    n: int
    success: float
    slips: float
    deformations: float
    drops: float
    duration_s: float
    peak_force_n: float


def summarise_trials(results: Sequence[TrialResult]) -> list[Row]:
    """Average trials by object and condition, in the order in which these first come."""
    groups: dict[tuple[str, str], list[TrialResult]] = {}
    for result in results:
        groups.setdefault((variant_name(result.object, result.changes), result.condition), []).append(result)
    rows = []
    for (name, condition), group in groups.items():
        n, subjects = len(group), Row.__struct_fields__[3:]
        means = {subject: sum(getattr(one, subject) for one in group) / n for subject in subjects}
        rows.append(Row(object=name, condition=condition, n=n, **means))
    return rows
