"""Make the keys that two stations share: ``tega-teleop net``."""

from __future__ import annotations

from pathlib import Path

import click

from tega.ui.cli.options import echo_json, json_option


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
    from tega_link.keys import make_keys

    if not operators and not robots:
        raise click.UsageError("name at least one station with --operator or --robot")
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
