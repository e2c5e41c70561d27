"""Group the verbs on recordings: ``tega-teleop recording``."""

from __future__ import annotations

import click

from tega.ui.cli.export import export
from tega.ui.cli.inspect import inspect
from tega.ui.cli.trim import merge, trim
from tega_study.cli.take import encode, relabel, take


@click.group(epilog="Example: tega-teleop recording inspect sessions/monday")
def recording() -> None:
    """Take episodes; inspect, export, trim, merge, relabel and re-encode recordings."""


for _verb in (take, inspect, export, trim, merge, relabel, encode):
    recording.add_command(_verb)
