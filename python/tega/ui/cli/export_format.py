"""Define a format of ``recording export`` that a feature brings."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import click


class ExportFormat(NamedTuple):
    """A format of ``recording export``, which then takes its ``options``.

    It is called as ``export(recordings, out, **options)``, and returns the files and folders that it wrote.
    """

    options: tuple[click.Option, ...]
    export: Callable[..., Sequence[Path]]
