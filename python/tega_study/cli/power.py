"""Estimate how many people a study needs: ``tega-teleop study power``."""

from __future__ import annotations

from typing import Any

import click

from tega.ui.cli.options import echo_json, json_option


@click.command(epilog="Example: tega-teleop study power --slips 5.9,2.8 --trials 10")
@click.option("--slips", default="5.9,2.8", show_default=True, help="Mean per trial without and with touch.")
@click.option(
    "--trials", type=click.IntRange(1, 1000), default=10, show_default=True, help="Trials of each condition."
)
@click.option(
    "--alpha",
    type=click.FloatRange(0.0001, 0.5),
    default=0.05,
    show_default=True,
    help="Two-sided level of the test.",
)
@click.option(
    "--tests",
    type=click.IntRange(1, 100),
    default=1,
    show_default=True,
    help="Number of tests, for Holm's correction.",
)
@click.option(
    "--seed", type=click.IntRange(0, 2**31), default=1, show_default=True, help="Seed of the simulation."
)
@json_option
def power(*, slips: str, trials: int, alpha: float, tests: int, seed: int, as_json: bool) -> None:
    """Estimate how many people a study needs to find a difference in counts.

    Simulates studies with people who hardly differ, who differ, and who differ a lot. With --tests the level is that of
    Holm's first step.
    """
    from tega_study.power import SPREADS, count_power, people_for

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
