"""Run a session over two machines: ``tega-teleop operator`` and ``tega-teleop robot``."""

from __future__ import annotations

from functools import partial
from typing import Any

import click

from tega.config import SessionConfig
from tega.errors import ConfigError
from tega.ui.cli.run import run_options, run_settings
from tega_link.settings import net_of


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
    """Refuse settings that are not this station's."""
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
