"""Group the verbs on recordings: ``tega-teleop recording``."""

from __future__ import annotations

import click

from tega.cli.export import export
from tega.cli.inspect import inspect
from tega.cli.trim import merge, trim


@click.group(epilog="Example: tega-teleop recording inspect sessions/monday")
def recording() -> None:
    """Inspect, export, trim and merge recordings."""


for _verb in (inspect, export, trim, merge):
    recording.add_command(_verb)
