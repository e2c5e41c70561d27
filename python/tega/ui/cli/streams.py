"""Stream a run live to other programs that show it: ``--stream foxglove``, ``--stream rerun``."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from tega.records.bus import Bus


@contextmanager
def streamed(bus: Bus, names: Sequence[str]) -> Iterator[None]:
    """Stream the records on a bus for the duration of the block; the address is printed on stderr.

    Args:
        bus: The run's.
        names: ``foxglove`` and ``rerun``, or none.

    Raises:
        MissingExtraError: A package is not installed.
        DeviceUnavailableError: A port is taken.
    """
    with ExitStack() as stack:
        if "foxglove" in names:
            from tega.ui.view.foxglove_stream import FoxgloveStream

            foxglove = stack.enter_context(FoxgloveStream(bus))
            click.echo(f"foxglove: {foxglove.url}", err=True)
        if "rerun" in names:
            from tega.ui.view.rerun_stream import RerunStream

            rerun = stack.enter_context(RerunStream(bus))
            click.echo(f"rerun: {rerun.url}", err=True)
        yield
