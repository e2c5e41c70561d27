"""Lead a participant through the planned trials: ``tega-teleop study run``, ``tell`` and ``observe``."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Literal

import click

from tega.config import check_tree, load_config, override_tree
from tega.runtime.lifecycle import require
from tega.ui.cli.options import FILE, PATH, FiniteRange, answer, echo_json, json_option
from tega_sim.cli.options import loop_sets
from tega_study.cli.options import folder_argument, participant_argument, shown_option

if TYPE_CHECKING:
    from tega_study.lead.benches import TrialBench
    from tega_study.lead.tell import Command
    from tega_study.masking_sound import MaskingSound
    from tega_study.plan import StudyPlan
    from tega_study.state import Where


@click.command(epilog="Example: tega-teleop study run my-study p01 --lab lab.toml")
@folder_argument
@participant_argument
@click.option("--lab", type=PATH, metavar="LAB.toml", help="Settings file of the lab's devices, as for run.")
@click.option(
    "--emulated", is_flag=True, help="Run on emulated devices; only in a plan made with --simulated."
)
@click.option(
    "--simulated",
    is_flag=True,
    help="Run on the simulated bench, with a simulated participant; only in such a plan.",
)
@click.option(
    "--set",
    "sets",
    multiple=True,
    metavar="KEY=VALUE",
    help="Override a setting; with --simulated: of the loop, as stages.*, vest.layout. Repeatable.",
)
@click.option(
    "--config",
    type=FILE,
    metavar="LAB.toml",
    help="With --simulated: take the stages, vest.layout, vest.mirror and session.pose_base of these settings.",
)
@shown_option(
    "--preset",
    type=click.Choice(["paper", "live"]),
    default="live",
    help="Preset of the loop, with --simulated.",
)
@shown_option(
    "--task",
    type=click.Choice(["lift", "place"]),
    default="lift",
    help="lift: a trial ends when the object is held up. place: it ends when the object is put down again (Enter).",
)
@click.option(
    "--pedals",
    "--pedal",
    default="",
    metavar="KEYS",
    help="Keys that foot pedals type, such as 12345: go on, end, slip, deformation, again.",
)
@shown_option(
    "--answer",
    "answer_key",
    default="p",
    metavar="KEY",
    help="The key that the participant's pedal types at a beep, in a plan made with --probe.",
)
@click.option("--trials", type=click.IntRange(1), help="Number of trials after which to stop.")
@click.option("--yes", is_flag=True, help="Go on by the clock and pass over the questions; to rehearse.")
@click.option(
    "--time-scale",
    type=FiniteRange(0.01, 1.0),
    default=1.0,
    metavar="FACTOR",
    help="Shorten rests and countdowns; to rehearse.",
)
@json_option
def run(
    *,
    folder: Path,
    participant: str,
    lab: Path | None,
    emulated: bool,
    simulated: bool,
    sets: tuple[str, ...],
    config: Path | None,
    preset: Literal["paper", "live"],
    answer_key: str,
    yes: bool,
    as_json: bool,
    **options: Any,
) -> None:
    """Lead a participant through the planned trials, or go on where it was stopped.

    Keyboard or pedal only. Rests are enforced. Each trial is recorded into recordings/ID; the person's calibration is
    used (tega-teleop calibrate LAB.toml --person ID). Ctrl-C breaks a running trial off; the same command goes on. With
    --json: {"participant", "over", "trials", "next"}.
    """
    from tega.safety.stop import CtrlC
    from tega_study.lead.benches import SimulatedBench
    from tega_study.lead.experimenter import desk_for
    from tega_study.lead.session import lead_session
    from tega_study.plan import read_plan

    if (lab is not None) + emulated + simulated != 1:
        raise click.UsageError("give one of --lab LAB.toml, --emulated and --simulated")
    if config is not None and not simulated:
        raise click.UsageError("--config is for --simulated; --lab has settings of its own")
    plan = read_plan(folder)
    plan.of(participant)
    if lab is not None:
        benches = _lab_bench(folder, participant, lab, sets)
    elif emulated:
        benches = _emulated_bench(sets)
    else:
        benches = nullcontext(
            SimulatedBench(plan, participant, preset=preset, settings=loop_sets(config, sets))
        )
    with (
        benches as bench,
        CtrlC() as stop,
        desk_for(stop, alone=yes) as desk,
        _masking(bench, plan) as masking,
    ):
        state = lead_session(
            folder,
            participant,
            bench,
            desk,
            answer_key=answer_key,
            auto=yes,
            masking=masking,
            stop=stop,
            **options,
        )
    if state.next is None and bench.measurable:
        click.echo(f"tega-teleop scene measure {folder} {participant} scores the trials by rule", err=True)
    if as_json:
        following = None if state.next is None else state.next[0]
        n_trials = len(plan.of(participant))
        echo_json({"participant": participant, "over": state.n_over, "trials": n_trials, "next": following})


def _masking(bench: TrialBench, plan: StudyPlan) -> AbstractContextManager[MaskingSound | None]:
    """Return what masks the motors of the lab's vest, where its settings set a level, and plays the plan's beeps."""
    from tega_study.lead.benches import LabBench
    from tega_study.masking_sound import MaskingSection, MaskingSound

    settings = bench.masking if isinstance(bench, LabBench) else MaskingSection()
    if settings.level_dbfs is None and not plan.settings.probe:
        return nullcontext()
    return MaskingSound(settings, beeps=plan.settings.probe)


def _lab_bench(
    folder: Path, participant: str, lab: Path, sets: tuple[str, ...]
) -> AbstractContextManager[TrialBench]:
    import json

    from tega.config.person import whose
    from tega_study.lead.benches import LabBench
    from tega_study.privacy import note_elsewhere

    loaded = load_config(lab, sets=sets)
    file = loaded.config.calibration.file
    if loaded.config.calibration.person is None:
        person = (f"calibration.person={json.dumps(participant)}",)
        mine = load_config(lab, sets=(*sets, *person))
        _, folder_of = whose(mine.config.calibration)
        if file is not None and not folder_of.person(participant).is_dir():
            # The maxima are the file's; the vibration is this person's.
            mine = load_config(lab, sets=(*sets, *person, f"calibration.file={json.dumps(str(file))}"))
        loaded = mine
    if loaded.config.calibration.person is not None:
        code, calibrations = whose(loaded.config.calibration)
        note_elsewhere(folder, participant, calibrations.person(code))
    where: Where = "emulated" if loaded.config.session.emulated else "lab"
    return nullcontext(LabBench(loaded.config, settings=str(lab), where=where))


@contextmanager
def _emulated_bench(sets: tuple[str, ...]) -> Iterator[TrialBench]:
    import tempfile

    from tega.runtime.lifecycle import needs_tools
    from tega_study.lead.benches import LabBench

    with needs_tools("tega-teleop study run --emulated"):
        from tega_emulators.lab import emulated_lab

    with tempfile.TemporaryDirectory() as beside:
        made_in = Path(beside)
        with emulated_lab(made_in, emg_hz=250.0, hand=True, vest=True, fingers=("thumb", "index")) as made:
            config = check_tree(made.tree, override_tree(made.tree, sets), base=made_in).config
            yield LabBench(config, settings="emulated lab", where="emulated")


# As in tega_study.lead.tell, which takes long to import.
COMMANDS: Final = ("start", "mark", "slip", "deformation", "drop", "undo", "end", "break", "safety", "quit")


@click.command(epilog="Example: tega-teleop study tell my-study p01 start")
@folder_argument
@participant_argument
@click.argument("command", type=click.Choice(COMMANDS))
@json_option
def tell(*, folder: Path, participant: str, command: Command, as_json: bool) -> None:
    """Give the session that study run leads on this machine a command, as if its key had been pressed.

    A command has the effect of the key at that moment: start does not begin a trial during a rest. The answer
    contains the session's state. A program that does not want to start a process appends a line such as {"do":
    "start"} to FOLDER/sessions/ID/told.jsonl.
    """
    from tega.runtime.clock import SystemClock
    from tega_study.lead.tell import notify as give
    from tega_study.plan import read_plan

    read_plan(folder).of(participant)
    board = give(folder, participant, command, clock=SystemClock())
    answer(
        {"participant": participant, "phase": board.phase, "trial": board.trial},
        [f"{participant}: {board.phase}, trial {board.trial} of {board.n_trials}"],
        as_json=as_json,
    )


@click.command(epilog="Example: tega-teleop study observe my-study p01 --rater r1")
@folder_argument
@participant_argument
@shown_option("--rater", default="r1", metavar="ID", help="Who observes: a code, no name.")
def observe(*, folder: Path, participant: str, rater: str) -> None:
    """Score a session as it goes on: one key an event, in a terminal of its own.

    Start it before or after study run, on the same machine, also over SSH. The same command goes on after a stop.
    Recordings are coded in BORIS: see study clips.

    Each rater has a file of their own. Neither the condition nor another rater is shown. Needs the extra observe.
    """
    require("textual", driver="study observe", extra="observe")
    from tega_study.observe.console import Console

    Console(folder, participant, rater).run()
