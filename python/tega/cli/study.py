"""``tega-teleop study``: plan a user study, see how it stands, let people withdraw, report it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tega.cli.options import NameList, debug_option, echo_json, json_option

if TYPE_CHECKING:
    from tega.study.analyse import Analysis
    from tega.study.order import Layout

__all__ = ["study"]

_FOLDER = click.Path(path_type=Path, file_okay=False)


@click.group(epilog="Example: tega-teleop study plan --participants 12 --out my-study")
def study() -> None:
    """Plan a user study, see how it stands, let people withdraw, and report it."""


@study.command(epilog="Example: tega-teleop study plan --participants 12 --seed 7 --out my-study")
@click.option("--participants", type=click.IntRange(1, 999), required=True, help="How many people.")
@click.option("--out", type=_FOLDER, required=True, help="A new folder; nothing is ever overwritten.")
@click.option(
    "--seed", type=click.IntRange(0, 2**63 - 1), default=1, show_default=True, help="Of all orders."
)
@click.option(
    "--objects", type=NameList(), default="bottle,container,bag", show_default=True, help="What is lifted."
)
@click.option(
    "--conditions",
    type=NameList(),
    default="haptic,non-haptic",
    show_default=True,
    help="The first is compared with the second; a third can be event-gated.",
)
@click.option(
    "--trials", type=click.IntRange(1, 1000), default=10, show_default=True, help="Per object and condition."
)
@click.option(
    "--layout",
    type=click.Choice(["abba", "pairs", "period"]),
    default="abba",
    show_default=True,
    help="Conditions there and back per object; in random pairs; or one after the other.",
)
@click.option(
    "--rest-s", type=click.FloatRange(0, 3600), default=60.0, show_default=True, help="Between two trials."
)
@json_option
@debug_option
def plan(
    *,
    participants: int,
    out: Path,
    seed: int,
    objects: list[str],
    conditions: list[str],
    trials: int,
    layout: Layout,
    rest_s: float,
    as_json: bool,
) -> None:
    """Write a counterbalanced plan: study.toml and plan.csv, never changed afterwards.

    People have ids only. Who they are belongs on paper, elsewhere.
    """
    import msgspec

    from tega.study import make_plan, write_plan

    made = make_plan(
        participants=participants,
        seed=seed,
        objects=objects,
        conditions=conditions,
        trials=trials,
        layout=layout,
        rest_s=rest_s,
    )
    write_plan(made, out)
    first = made.of(made.participants[0])
    rests_s = sum(trial.rest_s for trial in first)
    if as_json:
        echo_json({"out": str(out), **msgspec.to_builtins(made.settings)})
        return
    click.echo(f"{out}: {participants} people, {len(first)} trials each, seed {seed}")
    click.echo(f"{first[0].participant} begins with {first[0].object}, {first[0].condition}")
    click.echo(
        f"rests alone take {rests_s / 60:.0f} min a person; with 15 s a trial {rests_s / 60 + len(first) / 4:.0f} min"
    )
    if participants < 6:
        click.echo(
            f"note: with {participants} people no test over people can reach p = 0.05; six can", err=True
        )


@study.command(epilog="Example: tega-teleop study status my-study")
@click.argument("folder", type=_FOLDER)
@json_option
@debug_option
def status(*, folder: Path, as_json: bool) -> None:
    """Show how far everybody is, and which trial comes next. What comes next is not shown to who recruits."""
    from tega.study import read_plan
    from tega.study.journal import read_events
    from tega.study.privacy import withdrawn
    from tega.study.state import derive, events_path

    made, gone = read_plan(folder), withdrawn(folder)
    rows: list[dict[str, Any]] = []
    for person in made.participants:
        mine = made.of(person)
        if person in gone:
            rows.append({"participant": person, "state": "withdrawn"})
            continue
        events = read_events(events_path(folder, person))
        state = derive(mine, events)
        what = "complete" if state.next is None else "under way" if events else "not begun"
        row: dict[str, Any] = {
            "participant": person,
            "state": what,
            "over": state.n_over,
            "trials": len(mine),
        }
        if state.next is not None and events:
            number, attempt = state.next
            trial = mine[number - 1]
            row |= {"next": number, "attempt": attempt, "object": trial.object, "condition": trial.condition}
        rows.append(row)
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
        click.echo(text)


@study.command(epilog="Example: tega-teleop study withdraw my-study p03")
@click.argument("folder", type=_FOLDER)
@click.argument("participant")
@click.option("--yes", is_flag=True, help="Do not ask.")
@json_option
@debug_option
def withdraw(*, folder: Path, participant: str, yes: bool, as_json: bool) -> None:
    """Delete everything of one person, and reports made with it. It cannot be undone.

    Backups, copies and exports made before are not reached: delete them by hand.
    """
    from tega.study import read_plan
    from tega.study.privacy import withdraw as delete

    read_plan(folder).of(participant)
    if not yes:
        click.confirm(f"Delete everything of {participant} for good?", abort=True, err=True)
    gone = delete(folder, participant)
    if as_json:
        echo_json({"participant": participant, "deleted": [str(path) for path in gone]})
        return
    for path in gone:
        click.echo(f"deleted {path}")
    click.echo(f"{participant} has withdrawn; backups and earlier exports have to be deleted by hand")


@study.command(epilog="Example: tega-teleop study export my-study --out my-study-open")
@click.argument("folder", type=_FOLDER)
@click.option("--out", type=_FOLDER, required=True, help="A new folder.")
@json_option
@debug_option
def export(*, folder: Path, out: Path, as_json: bool) -> None:
    """Write an anonymised copy, fit to be published: new ids, no muscle signals, texts, names or dates.

    Nobody can work out the old ids, you included: the key that made the new ones is thrown away.
    """
    import secrets

    from tega.study.privacy import export as copy

    new = copy(folder, out, key=secrets.token_hex(32))
    if as_json:
        echo_json({"out": str(out), "participants": len(new)})
    else:
        click.echo(f"{out}: {len(new)} people under new ids")


@study.command(epilog="Example: tega-teleop study report my-study")
@click.argument("source", type=click.Path(path_type=Path))
@click.option("--out", type=_FOLDER, help="Folder for report.html and report/; the study's own unless given.")
@click.option("--interim", is_flag=True, help="Show p-values although the plan is not done yet.")
@json_option
@debug_option
def report(*, source: Path, out: Path | None, interim: bool, as_json: bool) -> None:
    """Analyse a study's folder, or a file of sim-trials, and write one HTML page with tables and figures.

    Everything comes from the folder; the same folder gives the same bytes. --json prints {page, tables, table1,
    tests}, tests as in report/tests.csv.
    """
    import msgspec

    from tega.study.report import write_report
    from tega.study.tables import table_1

    done = write_report(source, out, interim=interim)
    if as_json:
        tests = [
            test for test in done.analysis.tests if f"{test.metric}:{test.object}" in done.analysis.family
        ]
        echo_json(
            {
                "page": str(done.page),
                "tables": str(done.tables),
                "table1": table_1(done.analysis),
                "tests": msgspec.to_builtins(tests),
            }
        )
        return
    _print(done.analysis)
    click.echo(f"{done.page}")


def _print(analysis: Analysis) -> None:
    from rich.box import SIMPLE
    from rich.console import Console
    from rich.table import Table

    from tega.study.tables import table_1

    out = Console(highlight=False, width=110)
    head, *rows = table_1(analysis)
    title = "Table I, simulated" if analysis.simulated else "Table I"
    shown = Table(title=f"{title}: means, time in seconds", title_justify="left", box=SIMPLE)
    for place, name in enumerate(head):
        shown.add_column(name, justify="left" if place < 2 else "right")
    for row in rows:
        shown.add_row(*row)
    out.print(shown)
    if analysis.interim:
        text = "p-values are withheld" if not analysis.p_shown else "p-values shown early"
        out.print(f"interim: {analysis.flow.complete} people complete; {text}")


@study.command(epilog="Example: tega-teleop study power --slips 5.9,2.8 --trials 10")
@click.option("--slips", default="5.9,2.8", show_default=True, help="Mean per trial without and with touch.")
@click.option("--trials", type=click.IntRange(1, 1000), default=10, show_default=True, help="Per condition.")
@click.option(
    "--alpha", type=click.FloatRange(0.0001, 0.5), default=0.05, show_default=True, help="Two-sided level."
)
@click.option(
    "--tests", type=click.IntRange(1, 100), default=1, show_default=True, help="How many, for Holm."
)
@click.option(
    "--seed", type=click.IntRange(0, 2**31), default=1, show_default=True, help="Of the simulation."
)
@json_option
@debug_option
def power(*, slips: str, trials: int, alpha: float, tests: int, seed: int, as_json: bool) -> None:
    """Say how many people find a difference in counts, by simulated studies with people who differ.

    Shown for people who hardly differ, who differ, and who differ a lot. With --tests the level is that of
    Holm's first step.
    """
    from tega.study.power import SPREADS, count_power, people_for

    try:
        reference, mean = (float(part) for part in slips.split(","))
    except ValueError as error:
        raise click.BadParameter("give two numbers, such as 5.9,2.8", param_hint="--slips") from error
    level = alpha / tests
    rows: list[dict[str, Any]] = []
    for name, spread in SPREADS.items():
        needed = people_for(mean, reference, trials=trials, spread=spread, alpha=level, seed=seed)
        some = [
            count_power(mean, reference, people=n, trials=trials, spread=spread, alpha=level, seed=seed)
            for n in (6, 8, 10, 12)
        ]
        rows.append(
            {
                "people_differ": name,
                "people_for_80": None if needed is None else needed[0],
                "power": {one.people: {"paired_t": one.paired_t, "sign_flip": one.sign_flip} for one in some},
            }
        )
    if as_json:
        echo_json({"reference": reference, "mean": mean, "trials": trials, "alpha": level, "rows": rows})
        return
    click.echo(
        f"{reference:g} against {mean:g} per trial, {trials} trials per condition, two-sided {level:.3g}"
    )
    click.echo("people differ   for 80 %   power (paired t / sign-flip) with 6, 8, 10, 12 people")
    for row in rows:
        needed_text = "over 30" if row["people_for_80"] is None else str(row["people_for_80"])
        text = "  ".join(f"{one['paired_t']:.2f}/{one['sign_flip']:.2f}" for one in row["power"].values())
        click.echo(f"{row['people_differ']:<14}  {needed_text:>8}   {text}")
    click.echo("effects seen in a small pilot are too large on average: plan for less")


class _Shard(click.ParamType[tuple[int, int]]):
    """Which part of how many."""

    name = "i/n"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[int, int]:
        """Read the part, or fail with a usage error."""
        if isinstance(value, tuple):
            return value
        part, _, parts = str(value).partition("/")
        if not (part.isdecimal() and parts.isdecimal() and 1 <= int(part) <= int(parts)):
            self.fail(f"{value!r} is not i/n with i from 1 to n, such as 2/4", param, ctx)
        return int(part), int(parts)


@study.command(epilog="Example: tega-teleop study simulate --operators 10 --out in-silico")
@click.option("--operators", type=click.IntRange(1, 999), required=True, help="How many simulated people.")
@click.option("--out", type=_FOLDER, required=True, help="A new folder, or the same study's to go on.")
@click.option("--seed", type=click.IntRange(0, 2**31), default=1, show_default=True, help="Of everything.")
@click.option("--objects", type=NameList(), default="bottle,container,bag", show_default=True)
@click.option("--conditions", type=NameList(), default="haptic,non-haptic", show_default=True)
@click.option(
    "--trials", type=click.IntRange(1, 1000), default=10, show_default=True, help="Per object and condition."
)
@click.option("--jobs", type=click.IntRange(0, 1024), default=0, help="Worker processes; 0 for all cores.")
@click.option("--shard", type=_Shard(), default="1/1", help="Only the i-th of n parts, for many machines.")
@json_option
@debug_option
def simulate(
    *,
    operators: int,
    out: Path,
    seed: int,
    objects: list[str],
    conditions: list[str],
    trials: int,
    jobs: int,
    shard: tuple[int, int],
    as_json: bool,
) -> None:
    """Run the whole study with simulated people, and report it once all sessions are there.

    Each person goes through a whole session in the plan's order, with what was learned and tired from trial to trial.
    The results are the same with any number of workers and shards. Run it again to go on where it was stopped;
    a session that was cut short is run anew.
    """
    from tega.cli.options import progress_bar
    from tega.study.report import write_report
    from tega.study.simulate import simulate as run
    from tega.study.simulate import unfinished

    with progress_bar() as progress:
        plan = run(
            out,
            operators=operators,
            seed=seed,
            objects=objects,
            conditions=conditions,
            trials=trials,
            jobs=jobs,
            shard=shard,
            progress=progress,
        )
    left = unfinished(out, plan)
    page = None if left else write_report(out).page
    if as_json:
        echo_json({"out": str(out), "operators": operators, "left": left, "report": page and str(page)})
    elif left:
        click.echo(f"{out}: {len(left)} of {operators} sessions are left to other shards")
    else:
        click.echo(f"{page}: simulated, {operators} people, {len(plan.trials)} trials")
