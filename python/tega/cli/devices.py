"""``tega-teleop devices``: which drivers are there."""

from __future__ import annotations

import click

from tega.cli.options import debug_option, json_option

__all__ = ["devices"]


@click.command(epilog="Example: tega-teleop devices --json")
@json_option
@debug_option
def devices(*, as_json: bool) -> None:
    """List the drivers that are installed, by the name a settings file uses; opens none of them.

    With --json: an object per driver, {"name", "kind", "summary", "package", "ready", "problem"}.
    """
    import msgspec

    from tega.cli.options import echo_json
    from tega.devices import list_drivers

    drivers = list_drivers()
    if as_json:
        echo_json([msgspec.structs.asdict(d) for d in drivers])
        return
    width = max((len(d.name) for d in drivers), default=0)
    for d in drivers:
        click.echo(f"{d.kind or '?':<8} {d.name:<{width}}  {d.summary if d.ready else d.problem}")
