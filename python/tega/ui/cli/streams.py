"""Stream a run live to other programs: ``--stream NAME``, each stream from a feature."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING

import click

from tega.runtime.features import features, load_target

if TYPE_CHECKING:
    from tega.records.bus import Bus


def stream_names() -> list[str]:
    """Return the names of all streams."""
    return sorted(name for feature in features().values() for name in feature.streams)


@contextmanager
def streamed(bus: Bus, names: Sequence[str]) -> Iterator[None]:
    """Stream the records on a bus for the duration of the block; the address is printed on stderr.

    Raises:
        MissingExtraError: A package is not installed.
        DeviceUnavailableError: A port is taken, or a program cannot be reached.
    """
    found = {
        name: (target, feature) for feature in features().values() for name, target in feature.streams.items()
    }
    with ExitStack() as stack:
        for name in dict.fromkeys(names):
            stream = stack.enter_context(load_target(*found[name])(bus))
            click.echo(f"{name}: {stream.url}", err=True)
        yield
