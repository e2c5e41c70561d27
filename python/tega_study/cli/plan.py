"""Write a plan, its forms and objects, and show how far it is: ``study plan``, ``forms``, ``object``, ``status``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tega.errors import InvalidValueError
from tega.ui.cli.options import NAMES, echo_json, json_option
from tega_study.cli.options import FILE, FOLDER, design_options, folder_argument, shown_option

if TYPE_CHECKING:
    from tega_study.plan import StudyPlan


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

    made = make_plan(simulated=simulated, behaviours=behaviours or (), **settings)
    warning = _too_few(made)
    if warning and not (anyway or simulated):
        raise InvalidValueError(warning, "plan more people, or add --anyway")
    write_plan(made, out)
    first = made.of(made.participants[0])
    rests_s = sum(trial.rest_s for trial in first)
    if as_json:
        echo_json({"out": str(out), **msgspec.to_builtins(made.settings)})
        return
    click.echo(f"{out}: {len(made.participants)} people, {len(first)} trials each, seed {made.settings.seed}")
    click.echo(f"{first[0].participant} begins with {first[0].object}, {first[0].condition}")
    click.echo(
        f"rests alone take {rests_s / 60:.0f} min a person; with 15 s a trial {rests_s / 60 + len(first) / 4:.0f} min"
    )
    if warning:
        click.echo(f"warning: {warning}", err=True)


def _too_few(made: StudyPlan) -> str:
    """Return in words which tests cannot become significant with the people of a plan; ``""`` if all can."""
    from tega_study.power import MOST_PEOPLE, too_few

    settings = made.settings
    few = too_few(settings.family, people=settings.participants, alpha=settings.alpha)
    if not few:
        return ""
    words = {"duration_s": "time"}
    least = ", ".join(f"{words.get(name, name)} {n or f'over {MOST_PEOPLE}'}" for name, n in few.items())
    return (
        f"with {settings.participants} people these tests cannot be significant at p = {settings.alpha:g}, "
        f"however large the effect; least number of people, {len(settings.family)} tests corrected by Holm: {least}"
    )


@click.command(epilog="Example: tega-teleop study status my-study")
@folder_argument
@json_option
def status(*, folder: Path, as_json: bool) -> None:
    """Show how far everybody is, and which trial comes next. What comes next is not shown to who recruits."""
    from tega_study.journal import events_path, read_events
    from tega_study.plan import read_plan
    from tega_study.state import derive
    from tega_study.study_notes import withdrawn_ids

    made, gone = read_plan(folder), withdrawn_ids(folder)
    rows: list[dict[str, Any]] = []
    by_person: dict[str, str] = {}
    for person in made.participants:
        mine = made.of(person)
        if person in gone:
            rows.append({"participant": person, "state": "withdrawn"})
            continue
        events = read_events(events_path(folder, person))
        state = derive(mine, events)
        subject = "complete" if state.next is None else "under way" if events else "not begun"
        lacks = {"without_data": list(state.without_data), "broken_off": state.broken_off}
        row: dict[str, Any] = {
            "participant": person,
            "state": subject,
            "over": state.n_over,
            "trials": len(mine),
            **lacks,
        }
        if state.next is not None and events:
            number, attempt = state.next
            trial = mine[number - 1]
            row |= {"next": number, "attempt": attempt, "object": trial.object, "condition": trial.condition}
        rows.append(row)
        by_person[person] = state.said()
    if as_json:
        echo_json({"participants": rows})
        return
    for row in rows:
        text = f"{row['participant']}  {row['state']:<10}"
        if "over" in row:
            text += f"  {row['over']:>3} of {row['trials']}"
        if "next" in row:
            again = ", again" if row["attempt"] > 1 else ""
            text += f"  next: trial {row['next']}, {row['object']}, {row['condition']}{again}"
        if by_person.get(row["participant"]):
            text += f"  ({by_person[row['participant']]})"
        click.echo(text)


@click.command(epilog="Example: tega-teleop study forms my-study --out forms")
@folder_argument
@click.option("--out", type=FOLDER, required=True, help="Folder for the forms; no form in it is overwritten.")
@json_option
def forms(*, folder: Path, out: Path, as_json: bool) -> None:
    """Write templates of a consent form and a data protection sheet, filled in from the plan.

    The forms are templates, not legal advice. Complete the parts in brackets, and have the forms approved.
    """
    from tega_study.page import write_forms

    paths = write_forms(folder, out)
    if as_json:
        echo_json({"forms": [str(path) for path in paths]})
        return
    for path in paths:
        click.echo(f"{path}: complete what stands in [brackets], and have it approved")


@click.command(
    "object", epilog="Example: tega-teleop study object my-study bag --mass-g 32 --measured 'kitchen scale'"
)
@folder_argument
@click.argument("name")
@click.option("--mass-g", type=float, help="Mass as it is lifted, grams.")
@click.option(
    "--stiffness-n-per-mm", type=float, help="Stiffness where it is grasped: force over indentation, N/mm."
)
@click.option("--friction", type=float, help="Static friction against the gel.")
@click.option("--measured", help="How these were measured.")
@click.option("--photo", type=FILE, help="JPEG or PNG; it is copied.")
@json_option
def object_(
    *,
    folder: Path,
    name: str,
    mass_g: float | None,
    stiffness_n_per_mm: float | None,
    friction: float | None,
    measured: str | None,
    photo: Path | None,
    as_json: bool,
) -> None:
    """Record properties of one of the plan's objects in objects.toml; the report shows them.

    Properties that are not given stay unchanged. Without any, the recorded ones are shown.
    """
    import msgspec

    from tega_study.study_notes import note_object

    given: dict[str, Any] = {
        "mass_g": mass_g,
        "stiffness_n_per_mm": stiffness_n_per_mm,
        "friction": friction,
        "measured": measured,
    }
    changes = {key: value for key, value in given.items() if value is not None}
    facts = msgspec.to_builtins(note_object(folder, name, photo=photo, **changes))
    if as_json:
        echo_json({"object": name, **facts})
        return
    click.echo(
        f"{name}: " + ", ".join(f"{key} {'not known' if v in {None, ''} else v}" for key, v in facts.items())
    )
