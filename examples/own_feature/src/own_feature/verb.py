"""Count the firm grips of a recording: ``tega-teleop grip``."""

from __future__ import annotations

from pathlib import Path

import click

from own_feature.recorded import grips


@click.command(epilog="Example: tega-teleop grip sessions/monday/trial-001.mcap")
@click.argument("recording", type=click.Path(path_type=Path, exists=True))
def grip(recording: Path) -> None:
    """Print how often at least the set number of fingers held."""
    firm = [firm for _, _, firm in grips(recording)]
    click.echo(
        f"{sum(now and not before for before, now in zip([False, *firm], firm, strict=False))} firm grips"
    )
