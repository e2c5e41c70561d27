"""Run a session over two machines, ``tega-teleop operator`` and ``robot``, and make the stations' keys: ``net``."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import click

from tega.config import SessionConfig
from tega.errors import ConfigError
from tega.runtime.lifecycle import require
from tega.ui.cli.options import echo_json, json_option
from tega.ui.cli.run import run_options, run_settings
from tega_link.settings import net_of


@click.group(epilog="Example: tega-teleop net keys keys --operator alice --robot panda")
def net() -> None:
    """Prepare the link between an operator's and a robot's machine."""


@net.command(epilog="Example: tega-teleop net keys keys --operator alice --robot panda")
@click.argument("folder", type=click.Path(file_okay=False, path_type=Path), metavar="DIR")
@click.option(
    "--operator", "operators", metavar="NAME", multiple=True, help="An operator's station; repeatable."
)
@click.option("--robot", "robots", metavar="NAME", multiple=True, help="A robot's station; repeatable.")
@click.option(
    "--days",
    type=click.IntRange(1, 3650),
    default=365,
    show_default=True,
    help="How long a certificate holds.",
)
@json_option
def keys(
    *, folder: Path, operators: tuple[str, ...], robots: tuple[str, ...], days: int, as_json: bool
) -> None:
    """Make a private authority and a folder of keys for each station, or what of it is not there yet.

    Copy each station's folder to its machine by a way you trust, and name it as net.keys. Keep DIR/authority secret:
    anyone with it can make stations. With --json: {"stations": [{"name", "folder", "expires", "made"}]}.
    """
    if not operators and not robots:
        raise click.UsageError("name at least one station with --operator or --robot")
    require("cryptography", driver="tega-teleop net keys", extra="net")
    from tega_link.keys import make_keys

    made = make_keys(folder, operators=operators, robots=robots, days=days)
    if as_json:
        stations = [
            {
                "name": one.name,
                "folder": str(one.folder),
                "expires": one.expires.isoformat(timespec="seconds"),
                "made": one.made,
            }
            for one in made
        ]
        echo_json({"stations": stations})
        return
    for one in made:
        was = "made " if one.made else "there"
        click.echo(f"{was}  {one.folder}   holds until {one.expires:%Y-%m-%d}")
    click.echo("Copy each station's folder to its machine by a way you trust, and set net.keys to it there.")
    click.echo(f"Keep {folder / 'authority'} to yourself: who has it can make stations.")


@click.command(epilog="Example: tega-teleop operator operator.toml --view")
@run_options
def operator(**options: Any) -> None:
    """Run the operator's station: muscles, forearm, switches, vest and page, until Ctrl-C.

    The robot's station has to be there: fingertips, hand and arm are at the other end of the link that [net] names.
    See docs/two-machines.md.
    """
    run_settings(**options, check=partial(_check_station, options["config"].name, "operator"))


@click.command(epilog="Example: tega-teleop robot robot.toml --record sessions/today")
@run_options
def robot(**options: Any) -> None:
    """Run the robot's station: hand, arm, fingertips and recorder, until Ctrl-C.

    The station waits for an operator, obeys one at a time, and holds hand and arm by itself when that operator is
    lost. See docs/two-machines.md.
    """
    run_settings(**options, check=partial(_check_station, options["config"].name, "robot"))


def _check_station(name: str, station: str, settings: SessionConfig) -> None:
    net = net_of(settings)
    if net is None:
        raise ConfigError(
            f"{name} has no [net], so it is no {station}'s station",
            f'set net.station = "{station}", as docs/two-machines.md shows',
        )
    if net.station != station:
        raise ConfigError(
            f"{name} holds the settings of the {net.station}'s station",
            f"start it with: tega-teleop {net.station} {name}",
        )
