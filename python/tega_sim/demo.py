"""Run the demo: lift one object after the other, looked at meanwhile, with tables and a picture afterwards."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from tega.config import FINGERS
from tega.ui.view.figures import draw_course, draw_touch, new_figure
from tega_sim.conditions import ARMS
from tega_sim.lab import lab_of
from tega_sim.plan import TrialPlan, TrialResult
from tega_sim.streams import Streams
from tega_sim.trial import run_trial
from tega_sim.world.scene import import_mujoco

if TYPE_CHECKING:
    from matplotlib.figure import SubFigure

    from tega.ui.view.state import ViewState
    from tega_sim.rig import TrialSteering
    from tega_sim.streams import LiftRecorder


_EVENT_COLOURS = {"slip": "#c8202f", "deformation": "#8a4fbf", "drop": "#000000"}
DEMO_FORMAT = "tega-demo"


class DemoReport(msgspec.Struct, frozen=True, kw_only=True):
    """Result of a demo. Everything in it is simulated.

    Attributes:
        wall_s: Time that took, from the first physics step to the last trial's end: rendering, mapping,
            scoring and the building of the scenes in between included.
        real_time_factor: ``simulated_s`` over ``wall_s``.
    """

    simulated_s: float
    wall_s: float
    real_time_factor: float
    trials: list[TrialResult]
    format: str = DEMO_FORMAT
    version: int = 1


def run_demo(
    plans: Sequence[TrialPlan],
    *,
    person: TrialSteering | None = None,
    real_time: bool = True,
    observer: Callable[[ViewState], None] | None = None,
    recorder: LiftRecorder | None = None,
    next_object: Callable[[], str | None] = lambda: None,
    stop: Callable[[], bool] = lambda: False,
    paused: Callable[[], bool] = lambda: False,
    muted: Callable[[], bool] = lambda: False,
) -> tuple[DemoReport, list[Streams]]:
    """Run trials one after the other; simulated people have not practised with the vest, which takes 16 s a lift.

    ``person`` operates all trials instead of their plans' operators. ``observer`` is called thirty times a
    second of simulated time. The callables are asked all the time: ``next_object`` for another object that is
    wanted at once (the running trial is then left), ``stop`` for the end (the running trial then counts as it
    stands), ``paused`` whether to stand still, ``muted`` whether the user has switched the vest off.
    """
    left = list(plans)
    results: list[TrialResult] = []
    courses: list[Streams] = []
    wish: list[str] = []

    def leave() -> bool:
        if (name := next_object()) is not None:
            wish.append(name)
        return stop() or bool(wish)

    prepare_demo(plans)
    started = time.perf_counter()
    while left and not stop():
        plan, streams = left.pop(0), Streams()
        result = run_trial(
            plan,
            person=person,
            real_time=real_time,
            observer=observer,
            streams=streams,
            recorder=recorder,
            stop=leave,
            paused=paused,
            muted=muted,
            practised=False,
        )
        results.append(result)
        courses.append(streams)
        if wish:
            left.insert(0, msgspec.structs.replace(plan, object=wish.pop()))
            wish.clear()
    wall_s = time.perf_counter() - started
    simulated_s = sum(result.simulated_s for result in results)
    report = DemoReport(
        simulated_s=simulated_s, wall_s=wall_s, real_time_factor=simulated_s / wall_s, trials=results
    )
    return report, courses


def prepare_demo(plans: Sequence[TrialPlan]) -> None:
    """Do what belongs to no trial's time: calibrate the simulated people, and load the physics."""
    for plan in plans:
        lab_of(plan.seed, plan.preset, plan.settings)
    import_mujoco()


def demo_outputs(folder: Path) -> list[Path]:
    """Return what an earlier demo left beside its ``summary.json``: its picture, and each trial's folder of tables."""
    trials = sorted({table.parent for table in folder.glob("[0-9]*-*/vest.csv")})
    return [*trials, *folder.glob("demo.png")]


def write_demo(folder: Path, report: DemoReport, courses: Sequence[Streams]) -> None:
    """Write the summary, and each trial's tables into a folder of its own."""
    for number, (result, streams) in enumerate(zip(report.trials, courses, strict=True), start=1):
        below = folder / f"{number}-{result.object}"
        below.mkdir(exist_ok=True)
        streams.write_tables(below)
    text = msgspec.json.format(msgspec.json.encode(report), indent=2)
    (folder / "summary.json").write_bytes(text + b"\n")


def draw_demo(path: Path, report: DemoReport, courses: Sequence[Streams]) -> None:
    """Draw every trial: each finger's firmest contact, and the course of touch, pose and height."""
    figure = new_figure(figsize=(16, 0.5 + 2.4 * len(courses)))
    who = "; ".join(dict.fromkeys(map(_who, report.trials)))
    figure.suptitle(f"TEGA demo, simulated: {who}", fontsize=12)
    rows: list[SubFigure] = list(figure.subfigures(len(courses), 1, squeeze=False)[:, 0])
    for row, result, streams in zip(rows, report.trials, courses, strict=True):
        lab = lab_of(result.seed, result.preset, result.settings)
        row.suptitle(_title(result), fontsize=10, x=0.01, ha="left")
        left, right = row.subfigures(1, 2, width_ratios=[1.6, 1], squeeze=False)[0]
        axes = left.subplots(1, 2 * len(FINGERS), squeeze=False)[0]
        for index, finger in enumerate(FINGERS):
            draw_touch(axes[2 * index : 2 * index + 2], finger, streams.picture(finger, lab))
            marked = axes[2 * index + 1]
            marked.set_title(marked.get_title(), fontsize=7.5)
        ax = right.subplots()
        t_s, height_m = streams.array("truth", "t_s"), streams.array("truth", "object_height_m")
        ax.fill_between(t_s, height_m / 0.25, color="0.88", zorder=0, label="height / 0.25 m")
        draw_course(ax, streams.course(pose_base=lab.config.session.pose_base))
        for event in result.events:
            if (colour := _EVENT_COLOURS.get(event.kind)) is not None:
                ax.axvline(event.t_s, color=colour, lw=0.9, ls=":")
                ax.text(event.t_s, 1.0, f" {event.kind}", color=colour, fontsize=8, va="top")
    figure.savefig(path, dpi=85, metadata={"Software": None})


def _who(plan: TrialPlan) -> str:
    if plan.operator == "scripted":
        return "three muscles follow a fixed course, whatever the vest does"
    if plan.operator == "keyboard":
        return "a user at the keyboard steers three simulated muscles, without a vest"
    kind = "vest" if ARMS[plan.condition].sham == "informative" else "sham vest"
    vest = {
        "haptic": "feels the vest, has not practised with it,",
        "non-haptic": "wears no vest",
        "unfelt": "wears the vest and does not feel it",
    }.get(plan.condition, f"wears a {kind} ({plan.condition})")
    return f"the person {vest} and steers with three muscles"


def _title(result: TrialResult) -> str:
    outcome = "lifted and held" if result.success else "dropped" if result.drops else "not lifted"
    return f"{result.object}, {result.condition}: {outcome}, peak {result.peak_force_n:.1f} N on a fingertip"
