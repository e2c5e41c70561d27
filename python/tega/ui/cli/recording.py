"""Group the verbs on recordings: ``tega-teleop recording``."""

from __future__ import annotations

import click

from tega.ui.cli.annotate import annotate
from tega.ui.cli.export import export
from tega.ui.cli.guest_group import GuestGroup
from tega.ui.cli.inspect import inspect
from tega.ui.cli.trim import merge, trim


@click.group(cls=GuestGroup, epilog="Example: tega-teleop recording inspect sessions/monday")
def recording() -> None:
    """Inspect, export, trim, merge and annotate recordings; take, relabel and re-encode episodes."""


for _verb in (inspect, export, trim, merge, annotate):
    recording.add_command(_verb)
