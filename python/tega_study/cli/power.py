"""Compute how many people a study needs: ``tega-teleop study power``."""

from __future__ import annotations

from typing import Any

import click

from tega.ui.cli.options import echo_json, json_option
from tega_study.cli.options import shown_option

_SIZES = (6, 9, 12, 18, 24)
_ALPHA = 0.05
"""Two-sided level of the report's tests."""


@click.command(epilog="Example: tega-teleop study power --slips 5.9,2.8 --trials 10")
@shown_option("--slips", default="5.9,2.8", help="Mean per trial without and with touch.")
@shown_option("--trials", type=click.IntRange(1, 1000), default=10, help="Trials of each condition.")
@shown_option(
    "--tests", type=click.IntRange(1, 100), default=7,
    help="Number of tests in the plan's family, for Holm's correction. The others find nothing.",
)  # fmt: skip
@json_option
def power(*, slips: str, trials: int, tests: int, as_json: bool) -> None:
    """Compute how many people a study needs to find a difference in counts.

    Draws studies with people who hardly differ, who differ, and who differ a lot, and analyses each as the report does:
    sign-flips of people's means, corrected by Holm's method.
    """
    from tega_study.power import MOST_PEOPLE, SPREADS, PlannedTest, least_people, people_for, power_of

    try:
        reference, mean = (float(part) for part in slips.split(","))
    except ValueError as error:
        raise click.BadParameter("give two numbers, such as 5.9,2.8", param_hint="--slips") from error
    family = [
        PlannedTest("slips", mean, reference),
        *[PlannedTest("slips", reference, reference)] * (tests - 1),
    ]
    least = least_people("slips", tests=tests)
    rows: list[dict[str, Any]] = []
    for name, spread in SPREADS.items():
        needed = people_for(family, trials=trials, spread=spread)
        some = [power_of(family, people=n, trials=trials, spread=spread) for n in _SIZES]
        rows.append(
            {
                "people_differ": name,
                "people_for_80": None if needed is None else needed.people,
                "power": {one.people: one.found for one in some},
            }
        )
    if as_json:
        echo_json(
            {
                "reference": reference,
                "mean": mean,
                "trials": trials,
                "alpha": _ALPHA,
                "tests": tests,
                "least_people": least,
                "rows": rows,
            }
        )
        return
    click.echo(
        f"{reference:g} against {mean:g} per trial, {trials} trials per condition; sign-flips over people, "
        f"Holm over {tests} tests, p < {_ALPHA:g}"
    )
    message = f"over {MOST_PEOPLE}" if least is None else str(least)
    click.echo(f"least number of people: {message}; with fewer no result can be significant")
    click.echo(f"people differ   for 80 %   power with {', '.join(map(str, _SIZES))} people")
    for row in rows:
        needed_text = f"over {MOST_PEOPLE}" if row["people_for_80"] is None else str(row["people_for_80"])
        text = "  ".join(f"{found:.2f}" for found in row["power"].values())
        click.echo(f"{row['people_differ']:<14}  {needed_text:>8}   {text}")
    click.echo("effects seen in a small pilot are too large on average: plan for less")
