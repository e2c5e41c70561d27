"""Group the verbs on recordings: ``tega-teleop recording``."""

from __future__ import annotations

import click

from tega.cli.annotate import annotate
from tega.cli.export import export
from tega.cli.inspect import inspect
from tega.cli.take import encode, relabel, take
from tega.cli.trim import merge, trim


@click.group(epilog="Example: tega-teleop recording inspect sessions/monday")
def recording() -> None:
    """Take episodes; inspect, export, trim, merge, relabel, re-encode and annotate recordings."""


for _verb in (take, inspect, export, trim, merge, relabel, encode, annotate):
    recording.add_command(_verb)
