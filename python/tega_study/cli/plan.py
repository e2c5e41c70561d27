"""Write a plan, its forms and objects, and show how far it is: ``study plan``, ``forms``, ``object``, ``status``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from tega.errors import InvalidValueError
from tega.ui.cli.options import FILE, NAMES, FiniteRange, answer, json_option
from tega_study.cli.options import FOLDER, design_options, folder_argument, shown_option


@click.command(epilog="Example: tega-teleop study plan --participants 12 --seed 7 --out my-study")
@click.option("--participants", type=click.IntRange(1, 999), required=True, help="How many people.")
@click.option(
    "--out", type=FOLDER, required=True, help="New folder for the plan; nothing is ever overwritten."
)
@design_options(seed="Seed from which all orders are drawn.", conditions="; a third can be event-gated")
@shown_option(
    "--layout",
    type=click.Choice(["abba", "pairs", "period"]),
    default="abba",
    help="Order of conditions: there and back per object (abba), in random pairs, or one after the other (period).",
)
@click.option(
    "--probe", is_flag=True, help="A second task in every trial: beeps to be answered with a pedal."
)
@shown_option(
    "--scored-by",
    type=click.Choice(["session", "camera"]),
    default="session",
    help="Outcome of a trial that counts: the session's and its raters', or the scene camera's if it measured it.",
)
@click.option("--anyway", is_flag=True, help="Write a plan with too few people for a significant result.")
@click.option(
    "--behaviours",
    type=NAMES,
    help="Behaviours that raters code besides lift-off, slip, deformation and drop, such as regrasp,contact.",
)
@click.option(
    "--simulated", is_flag=True, help="For rehearsals on simulated and emulated devices, not for people."
)
@json_option
def plan(
    *, out: Path, anyway: bool, behaviours: list[str] | None, simulated: bool, as_json: bool, **settings: Any
) -> None:
    """Write a counterbalanced plan: study.toml and plan.csv, never changed afterwards.

    The plan contains participant IDs only. Keep the list of names elsewhere, on paper.
    """
    import msgspec

    from tega_study.plan import make_plan, write_plan
    from tega_study.power import MOST_PEOPLE, too_few

    made = make_plan(simulated=simulated, behaviours=behaviours or (), **settings)
    warning, family = "", made.settings.family
    if few := too_few(family, people=made.settings.participants, alpha=made.settings.alpha):
        words = {"duration_s": "time"}
        least = ", ".join(f"{words.get(name, name)} {n or f'over {MOST_PEOPLE}'}" for name, n in few.items())
        warning = (
            f"with {made.settings.participants} people these tests cannot be significant at p = "
            f"{made.settings.alpha:g}, however large the effect; least number of people, {len(family)} tests "
            f"corrected by Holm: {least}"
        )
    if warning and not (anyway or simulated):
        raise InvalidValueError(warning, "plan more people, or add --anyway")
    write_plan(made, out)
    first = made.of(made.participants[0])
    rests_min = sum(trial.rest_s for trial in first) / 60
    answer(
        {"out": str(out), **msgspec.to_builtins(made.settings)},
        [
            f"{out}: {len(made.participants)} people, {len(first)} trials each, seed {made.settings.seed}",
            f"{first[0].participant} begins with {first[0].object}, {first[0].condition}",
            f"rests alone take {rests_min:.0f} min a person; with 15 s a trial {rests_min + len(first) / 4:.0f} min",
        ],
        as_json=as_json,
    )
    if warning and not as_json:
        click.echo(f"warning: {warning}", err=True)


@click.command(epilog="Example: tega-teleop study status my-study")
@folder_argument
@json_option
def status(*, folder: Path, as_json: bool) -> None:
    """Show each participant's progress. The next trial is shown once a session has begun, not to the recruiter."""
    from tega_study.journal import events_path, read_events
    from tega_study.plan import read_plan
    from tega_study.state import derive
    from tega_study.study_notes import withdrawn_ids

    made, gone = read_plan(folder), withdrawn_ids(folder)
    rows: list[dict[str, Any]] = []
    lines: list[str] = []
    for person in made.participants:
        mine = made.of(person)
        if person in gone:
            rows.append({"participant": person, "state": "withdrawn"})
            lines.append(f"{person}  withdrawn ")
            continue
        events = read_events(events_path(folder, person))
        state = derive(mine, events)
        subject = "complete" if state.next is None else "under way" if events else "not begun"
        row: dict[str, Any] = {"participant": person, "state": subject, "over": state.n_over}
        row |= {"trials": len(mine), "without_data": list(state.without_data), "broken_off": state.broken_off}
        line = f"{person}  {subject:<10}  {state.n_over:>3} of {len(mine)}"
        if state.next is not None and events:
            number, attempt = state.next
            trial = mine[number - 1]
            row |= {"next": number, "attempt": attempt, "object": trial.object, "condition": trial.condition}
            again = ", again" if attempt > 1 else ""
            line += f"  next: trial {number}, {trial.object}, {trial.condition}{again}"
        rows.append(row)
        lines.append(line + (f"  ({state.said()})" if state.said() else ""))
    answer({"participants": rows}, lines, as_json=as_json)


@click.command(epilog="Example: tega-teleop study forms my-study --out forms")
@folder_argument
@click.option("--out", type=FOLDER, required=True, help="Folder for the forms; no form in it is overwritten.")
@json_option
def forms(*, folder: Path, out: Path, as_json: bool) -> None:
    """Write templates of a consent form and a data protection sheet, filled in from the plan.

    The forms are templates, not legal advice. Complete the parts in brackets, and have the forms approved.
    """
    from tega_study.page import write_forms

    paths = [str(path) for path in write_forms(folder, out)]
    lines = [f"{path}: complete what stands in [brackets], and have it approved" for path in paths]
    answer({"forms": paths}, lines, as_json=as_json)


@click.command(
    "object", epilog="Example: tega-teleop study object my-study bag --mass-g 32 --measured 'kitchen scale'"
)
@folder_argument
@click.argument("name")
@click.option("--mass-g", type=FiniteRange(), help="Mass as it is lifted, grams.")
@click.option(
    "--stiffness-n-per-mm",
    type=FiniteRange(),
    help="Stiffness where it is grasped: force over indentation, N/mm.",
)
@click.option("--friction", type=FiniteRange(), help="Static friction against the gel.")
@click.option("--measured", help="How these were measured.")
@click.option("--photo", type=FILE, help="JPEG or PNG; it is copied.")
@json_option
def object_(
    *, folder: Path, name: str, photo: Path | None, as_json: bool, **given: float | str | None
) -> None:
    """Record properties of one of the plan's objects in objects.toml; the report shows them.

    Properties that are not given stay unchanged. Without any, the recorded ones are shown.
    """
    import msgspec

    from tega_study.study_notes import note_object

    changes: dict[str, Any] = {key: value for key, value in given.items() if value is not None}
    facts = msgspec.to_builtins(note_object(folder, name, photo=photo, **changes))
    known = ", ".join(f"{key} {'not known' if v in {None, ''} else v}" for key, v in facts.items())
    answer({"object": name, **facts}, [f"{name}: {known}"], as_json=as_json)
