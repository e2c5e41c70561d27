"""Where the time of a simulated trial goes, and what leaving out saves.

The same scripted lifts are run several times, with and without each skip in turns. The parts' methods are timed where
they are called, from the first physics step to the trial's end; what no part accounts for is the loop's own.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, Literal

import msgspec

from tega_figures.bench.machine import Machine, describe_machine

__all__ = ["SimReport", "SimRow", "SkipRow", "bench_simulation"]

METHOD = (
    "Scripted lifts of every object, median over repeats; one process, one thread. Stages and the first factor are by "
    "processor time, which other work on the machine disturbs least; the second factor is by the wall clock. Factors "
    "are of runs whose stages are not timed, as that costs time itself. The building of the scene and the calibration "
    "are left out. Grasping: while the object is touched."
)
REST = "loop and the rest"

Part = Literal["whole", "grasping"]
PARTS: tuple[Part, ...] = ("whole", "grasping")

_Way = Literal["plain", "timed", "all rendered"]
WAYS: tuple[_Way, ...] = ("plain", "timed", "all rendered")


class SimRow(msgspec.Struct, frozen=True, kw_only=True):
    """One object's lift.

    Attributes:
        part: Of the trial: ``whole`` or ``grasping``.
        simulated_s: Length of that part.
        real_time_factor: Simulated over processor time.
        wall_factor: Simulated over wall time.
        stages_ms: Processor time per simulated second, by stage.
    """

    object: str
    part: Part
    simulated_s: float
    real_time_factor: float
    wall_factor: float
    stages_ms: dict[str, float]


class SkipRow(msgspec.Struct, frozen=True, kw_only=True):
    """What a skip saves on an object's whole trial.

    ``saved_ms`` is processor time per simulated second, ``share`` its share of the time without the skip.
    """

    object: str
    skip: str
    saved_ms: float
    share: float


class SimReport(msgspec.Struct, frozen=True, kw_only=True):
    """Where the time goes, in ``repeats`` runs of each lift."""

    method: str
    machine: Machine
    repeats: int
    rows: list[SimRow]
    skips: list[SkipRow]


class _StageSeconds:
    """Adds up seconds by stage, apart for the time in which something is touched."""

    def __init__(self) -> None:
        self.stages: dict[tuple[str, bool], float] = {}
        self.touching = False
        self.busy = {True: 0.0, False: 0.0}
        self.wall = {True: 0.0, False: 0.0}
        self.simulated = {True: 0.0, False: 0.0}
        self._since = (time.thread_time(), time.perf_counter())
        self._scored_s = 0.0

    def timed(self, stage: str, call: Callable[..., Any]) -> Callable[..., Any]:
        stages, clock = self.stages, time.thread_time

        def run(*args: Any, **named: Any) -> Any:
            started = clock()
            try:
                return call(*args, **named)
            finally:
                key = (stage, self.touching)
                stages[key] = stages.get(key, 0.0) + clock() - started

        return run

    def start(self) -> None:
        """Begin with the first physics step."""
        self._since = (time.thread_time(), time.perf_counter())

    def check(self, t_s: float, *, touching: bool) -> None:
        """Book the time since the last look on what was going on until now."""
        now = (time.thread_time(), time.perf_counter())
        self.busy[self.touching] += now[0] - self._since[0]
        self.wall[self.touching] += now[1] - self._since[1]
        self.simulated[self.touching] += t_s - self._scored_s
        self._since, self._scored_s, self.touching = now, t_s, touching


def bench_simulation(
    *,
    objects: Sequence[str] = ("bottle", "container", "bag"),
    repeats: int = 5,
    preset: Literal["paper", "live"] = "live",
    progress: Callable[[str, int, int], None] = lambda _subject, _done, _total: None,
) -> SimReport:
    """Measure where the time of lifts goes; ``progress`` receives how many lifts are done."""
    from tega_sim.lab import lab_of
    from tega_sim.plan import TrialPlan
    from tega_sim.trial import run_trial

    plans = [
        TrialPlan.checked({"object": name, "operator": "scripted", "seed": 1, "preset": preset})
        for name in objects
    ]
    lab_of(1, preset, ())
    for plan in plans:
        run_trial(plan)
    watches: dict[tuple[str, _Way], list[_StageSeconds]] = {}
    done, total = 0, len(WAYS) * repeats * len(plans)
    for number in range(repeats):
        for plan in plans:
            for route in WAYS if number % 2 else reversed(WAYS):
                with _watched(stages=route != "plain") as watch:
                    run_trial(plan, skip_untouched=route != "all rendered")
                watches.setdefault((plan.object, route), []).append(watch)
                done += 1
                progress("lifts", done, total)
    rows, skips = [], []
    for name in objects:
        plain, timed, rendered = (watches[name, route] for route in WAYS)
        rows += [_row(name, part, timed, plain) for part in PARTS]
        skips += _skips(_row(name, "whole", timed, plain), _row(name, "whole", rendered, rendered))
    return SimReport(
        method=METHOD,
        machine=describe_machine(),
        repeats=repeats,
        rows=rows,
        skips=skips,
    )


@contextmanager
def _watched(*, stages: bool) -> Iterator[_StageSeconds]:
    """Time every trial that is run in the block; with ``stages``, its parts, too."""
    from tega.loop.inbox.frames import FrameMeter
    from tega.loop.inbox.sources import BlockMeter
    from tega.loop.loop import DualLoop
    from tega.loop.touch import TouchLoop
    from tega_sim.gel import Gel
    from tega_sim.hand import SimulatedAllegro, SimulatedBus
    from tega_sim.operator import ForearmEmg, ScriptedOperator
    from tega_sim.rig import TrialRig
    from tega_sim.score import TrialScorer
    from tega_sim.world import World

    watch = _StageSeconds()
    parts: Mapping[str, Sequence[tuple[type, str]]] = {
        "physics": [(World, "advance_to")],
        "contact reads and truth": [(World, "pads"), (World, "truth")],
        "render": [(Gel, "frame"), (Gel, "sums")],
        "tactile read": [(FrameMeter, "take"), (FrameMeter, "take_sums")],
        "mapping": [(TouchLoop, "update"), (TouchLoop, "frame"), (TrialRig, "write")],
        "EMG": [(ForearmEmg, "samples")],
        "levels": [(BlockMeter, "take")],
        "operator": [(ScriptedOperator, "act"), (World, "set_forearm")],
        "hand controller": [(SimulatedAllegro, "step")],
        "CAN bus": [(SimulatedBus, "write")],
    }
    changed = []

    def replace(owner: Any, name: str, method: Callable[..., Any]) -> None:
        changed.append((owner, name, getattr(owner, name)))
        setattr(owner, name, method)

    score, run = TrialScorer.take, DualLoop.run

    def check(scorer: TrialScorer, t_s: float, truth: Any, **named: Any) -> None:
        watch.check(t_s, touching=any(truth.pad_force_n))
        score(scorer, t_s, truth, **named)

    def start(loop: DualLoop, **named: Any) -> Any:
        watch.start()
        return run(loop, **named)

    try:
        replace(DualLoop, "run", start)
        replace(TrialScorer, "take", check)
        for stage, methods in parts.items() if stages else ():
            for owner, name in methods:
                replace(owner, name, watch.timed(stage, getattr(owner, name)))
        yield watch
    finally:
        for owner, name, method in reversed(changed):
            setattr(owner, name, method)


def _row(name: str, part: Part, timed: Sequence[_StageSeconds], plain: Sequence[_StageSeconds]) -> SimRow:
    """Sum up one object's runs: stages of those that were timed, factors of those that were not."""
    states = (True, False) if part == "whole" else (True,)
    simulated_s = sum(timed[0].simulated[state] for state in states)
    per_s = 1e3 / simulated_s if simulated_s else 0.0
    stages: dict[str, list[float]] = {}
    for watch in timed:
        totals: dict[str, float] = {}
        for (stage, state), spent in watch.stages.items():
            if state in states:
                totals[stage] = totals.get(stage, 0.0) + spent
        totals[REST] = sum(watch.busy[state] for state in states) - sum(totals.values())
        for stage, spent in totals.items():
            stages.setdefault(stage, []).append(spent * per_s)
    busy_s = statistics.median(sum(watch.busy[state] for state in states) for watch in plain)
    wall_s = statistics.median(sum(watch.wall[state] for state in states) for watch in plain)
    return SimRow(
        object=name,
        part=part,
        simulated_s=simulated_s,
        real_time_factor=simulated_s / busy_s if busy_s else 0.0,
        wall_factor=simulated_s / wall_s if wall_s else 0.0,
        stages_ms={stage: statistics.median(spent) for stage, spent in sorted(stages.items())},
    )


def _skips(own: SimRow, rendered: SimRow) -> list[SkipRow]:
    """Return what is saved by not rendering what nothing touches, and by not measuring it again."""
    whole_ms = sum(rendered.stages_ms.values())
    rows = []
    for skip, stage in (
        ("untouched fingertips are not rendered", "render"),
        ("their known frames are not measured", "tactile read"),
    ):
        saved_ms = rendered.stages_ms[stage] - own.stages_ms.get(stage, 0.0)
        rows.append(SkipRow(object=own.object, skip=skip, saved_ms=saved_ms, share=saved_ms / whole_ms))
    return rows
