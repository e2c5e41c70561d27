"""Group the verbs on the vest: ``tega-teleop vest``."""

from __future__ import annotations

import click

from tega.ui.cli.guest_group import GuestGroup
from tega.ui.cli.identify import identify


@click.group(cls=GuestGroup, epilog="Example: tega-teleop vest identify lab.toml")
def vest() -> None:
    """Switch on the vest's motors one at a time, measure them, and practise reading them."""


vest.add_command(identify)
