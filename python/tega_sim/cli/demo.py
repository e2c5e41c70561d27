"""Show a simulated person lifting three objects, with the real loop in between: ``tega-teleop demo``."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tega.errors import MissingExtraError
from tega.runtime.lifecycle import require
from tega.ui.cli.options import echo_json, json_option
from tega.ui.cli.page import browser_observer, view_options
from tega_sim.cli.options import loop_options, loop_sets, objects_option, print_rows

if TYPE_CHECKING:
    from tega.ui.view.state import ViewState
    from tega_sim.demo import DemoReport
    from tega_sim.plan import TrialPlan, TrialResult
    from tega_sim.rig import TrialSteering


TITLE = "TEGA demo: everything but the loop is simulated"


@click.command(epilog="Example: tega-teleop demo --objects bag --condition non-haptic --out my-demo")
@objects_option
@click.option(
    "--condition",
    default="haptic",
    show_default=True,
    help="Condition of the vest: haptic (on), non-haptic (off), or another of docs/sim.md.",
)
@click.option(
    "--operator",
    type=click.Choice(["simulated", "scripted", "keyboard"]),
    default="simulated",
    show_default=True,
    help="Who leads the hand: the simulated person, a fixed script, or you at the keyboard.",
)
@click.option(
    "--seed",
    type=click.IntRange(0, 2**31),
    default=1,
    show_default=True,
    help="Seed of the simulated person and of all noise.",
)
@click.option(
    "--practice",
    type=click.IntRange(0, 20),
    default=0,
    show_default=True,
    help="Lifts of each object before the one that counts.",
)
@loop_options
@click.option("--fast", is_flag=True, help="Compute as fast as the machine can; do not wait for real time.")
@view_options
@click.option(
    "--out",
    "out_dir",
    type=click.Path(path_type=Path, file_okay=False),
    default=Path("tega-demo"),
    show_default=True,
    help="Folder for the tables and the picture.",
)
@click.option(
    "--record",
    type=click.Path(path_type=Path, file_okay=False),
    metavar="DIR",
    help="Record each lift into this session folder, for play, verify, recording inspect and export.",
)
@json_option
def demo(
    *,
    objects: list[str],
    condition: str,
    operator: str,
    preset: str,
    seed: int,
    practice: int,
    config: Path | None,
    sets: tuple[str, ...],
    fast: bool,
    view: bool,
    view_port: int,
    out_dir: Path,
    record: Path | None,
    as_json: bool,
) -> None:
    """Show a simulated person who lifts three objects in turn; needs no hardware.

    Hand, objects, fingertip cameras, muscles and person are simulated. The loop between them is the one that runs
    real devices. The terminal shows fingertips, vest, muscles, hand and object, and then a summary. The folder --out
    gets a table of each signal of each lift, and a picture, demo.png, if the extra pictures is installed. The three
    lifts take 47 s; --fast takes about a fifth of that. With --view the browser shows the lifts again and again, until
    you press the page's stop or Ctrl-C. After Ctrl-C the demo writes no picture and prints no summary.
    The simulated person has not practised with the vest; people of sim trials have.

    \b
    --json prints one object:
      simulated_s, wall_s, real_time_factor (their ratio)
      trials: [{object, condition, seed, success, slips, deformations, drops, duration_s, peak_force_n,
                lift_off_s, lifted_s, slid_m, deformation_m, mean_level, events: [{kind, t_s, size_m}], ...}]
    """  # noqa: D301  # click keeps the lines after \b as they are
    import msgspec

    from tega.recording.run_tables import prepare_folder
    from tega.runtime.threads import short_turns
    from tega.safety.stop import CtrlC
    from tega.ui.cli.options import with_origin
    from tega.ui.cli.report import check_recorded
    from tega_sim.demo import demo_outputs, draw_demo, prepare_demo, run_demo, write_demo
    from tega_sim.trials import plan_trials

    if operator == "keyboard" and fast:
        raise click.UsageError("--fast leaves no time for a person at the keyboard")
    sets = loop_sets(config, sets)
    plans = plan_trials(
        objects, [condition], [seed], operator=operator, preset=preset, practice=practice, settings=sets
    )
    recorder = None
    if record is not None:
        from tega_sim.streams import LiftRecorder

        require("foxglove", driver="recording", extra="record")
        recorder = LiftRecorder(record, real_time=not fast)
    if kept := prepare_folder(out_dir, also=demo_outputs(out_dir)):
        click.echo(f"the earlier results in {out_dir} are kept in {kept}", err=True)
    with CtrlC() as stop, short_turns(), ExitStack() as stack:
        show, more = stack.enter_context(
            _displayed(view=view, port=view_port, terminal=not as_json, objects=objects)
        )
        person = stack.enter_context(_at_keyboard(plans[0])) if operator == "keyboard" else None
        stopped = more.pop("stop", lambda: False)
        paused = more.pop("paused", lambda: False)
        with stop.interrupting():  # nothing runs yet, and this takes some seconds
            prepare_demo(plans)
        rounds = 1_000 if view and not fast else 1
        report, courses = run_demo(
            plans * rounds,
            person=person,
            real_time=not fast,
            observer=show,
            recorder=recorder,
            stop=lambda: stop() or stopped(),
            paused=lambda: paused() and not stop(),
            **more,
        )
    if not report.trials:  # stopped before the first one
        raise KeyboardInterrupt
    write_demo(out_dir, report, courses)
    if stop.requested:  # a user who leaves waits for no picture
        click.echo(f"tables and summary.json are in {out_dir}", err=True)
        raise KeyboardInterrupt
    try:
        draw_demo(out_dir / "demo.png", report, courses)
        left = "tables, summary.json and demo.png"
    except MissingExtraError as error:  # everything but the picture is there
        click.echo(with_origin(f"no picture: {error}"), err=True)
        left = "tables and summary.json"
    if as_json:
        echo_json(msgspec.to_builtins(report))
    else:
        _print(report, real_time=not fast)
        click.echo(f"{left} are in {out_dir}")
    for recording in () if recorder is None else recorder.reported:
        check_recorded(recording)
    if record is not None and not as_json:
        click.echo(f"recorded in {record}; look into it: tega-teleop recording inspect {record}")


@contextmanager
def _displayed(
    *, view: bool, port: int, terminal: bool, objects: list[str]
) -> Iterator[tuple[Callable[[ViewState], None] | None, dict[str, Callable[[], Any]]]]:
    """Open the displays of the run; yield callables that may be slow, and the viewers' wishes."""
    if not view:
        from tega.ui.cli.run import stage

        with stage(TITLE, enabled=terminal) as (progress, watch):
            if watch is None:
                yield None, {}
                return
            progress("running", 0, 0)
            yield lambda state: watch.offer(state.loop, state.rows), {}
        return
    from tega.ui.view.browser import Controls

    controls = Controls(can_pause=True, can_mute=True, objects=objects)
    with browser_observer("TEGA demo, simulated", port=port, controls=controls) as page:
        yield (
            page.offer,
            {
                "stop": lambda: controls.stopped,
                "paused": lambda: controls.paused,
                "muted": lambda: not controls.haptics,
                "next_object": controls.take_object,
            },
        )


@contextmanager
def _at_keyboard(plan: TrialPlan) -> Iterator[TrialSteering]:
    from tega_sim.lab import lab_of
    from tega_sim.operator import KEYS_HELP, KeyboardOperator, Keys

    lab = lab_of(plan.seed, plan.preset, plan.settings)
    with Keys() as keys:
        click.echo(KEYS_HELP, err=True)
        yield KeyboardOperator(keys.read, full_effort=lab.calibrated.full_effort)


def _without_events(trial: TrialResult) -> str:
    if trial.drops:
        return "lifted, then dropped"
    if trial.lift_off_s is None:
        return f"not lifted off the table; it slid or fell over by {1000 * trial.slid_m:.1f} mm"
    return (
        "lifted and held, without slip or deformation" if trial.success else "lifted off, below 0.2 m for 1 s"
    )


def _print(report: DemoReport, *, real_time: bool) -> None:
    out = print_rows(
        "simulated lifts",
        report.trials,
        {
            "object": lambda trial: trial.object,
            "condition": lambda trial: trial.condition,
            "lifted": lambda trial: "yes" if trial.success else "dropped" if trial.drops else "no",
            "slips": lambda trial: str(trial.slips),
            "deformed": lambda trial: str(trial.deformations),
            "time s": lambda trial: f"{trial.duration_s:.1f}",
            "lift-off s": lambda trial: "–" if trial.lift_off_s is None else f"{trial.lift_off_s:.1f}",
            "slid mm": lambda trial: f"{1000 * trial.slid_m:.1f}",
            "level": lambda trial: "–" if trial.lift_off_s is None else f"{trial.mean_level:.1f}",
            "peak N": lambda trial: f"{trial.peak_force_n:.1f}",
        },
    )
    out.print(
        "lifted: to 0.2 m within 15 s, and held there for a second. level: mean level from the muscles while "
        "the object was held, 1 (open) to 5 (tight)."
    )
    for trial in report.trials:
        events = ", ".join(
            f"{event.kind.replace('_', '-')}{f' of {1000 * event.size_m:.1f} mm' if event.size_m else ''}"
            f" at {event.t_s:.2f} s"
            for event in trial.events
        )
        out.print(f"{trial.object}: {events or _without_events(trial)}", style="dim", markup=False)
    pace = "in real time" if real_time else f"{report.real_time_factor:.1f} times as fast as real time"
    out.print(f"simulated {report.simulated_s:.1f} s in {report.wall_s:.1f} s, {pace}")
