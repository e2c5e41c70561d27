"""Run a session over two machines: ``tega-teleop operator`` and ``tega-teleop robot``."""

from __future__ import annotations

from typing import Any

import click

from tega.ui.cli.run import run_options, run_settings


@click.command(epilog="Example: tega-teleop operator operator.toml --view")
@run_options
def operator(**options: Any) -> None:
    """Run the operator's station: muscles, forearm, switches, vest and page, until Ctrl-C.

    The robot's station has to be there: fingertips, hand and arm are at the other end of the link that [net] names.
    See docs/two-machines.md.
    """
    run_settings(**options, station="operator")


@click.command(epilog="Example: tega-teleop robot robot.toml --record sessions/today")
@run_options
def robot(**options: Any) -> None:
    """Run the robot's station: hand, arm, fingertips and recorder, until Ctrl-C.

    It waits for an operator, obeys one at a time, and holds hand and arm by itself when that one is lost. See
    docs/two-machines.md.
    """
    run_settings(**options, station="robot")
