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
<<<<<<< HEAD
    """Inspect, export, trim and merge recordings; take, relabel and re-encode episodes."""


for _verb in (inspect, export, trim, merge):
=======
    """Take episodes; inspect, export, trim, merge, relabel, re-encode and annotate recordings."""


for _verb in (take, inspect, export, trim, merge, relabel, encode, annotate):
>>>>>>> deddcd91ed4f6d42ddeb6544aef45d72c3565edb
    recording.add_command(_verb)
