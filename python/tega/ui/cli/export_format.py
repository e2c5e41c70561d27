"""Define a format of ``recording export`` that a feature brings."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import click


class ExportFormat(NamedTuple):
    """A format of ``recording export``, which then takes its ``options``.

    It is called as ``export(recordings, out, **options)``, and returns the files and folders that it wrote.
    """

    options: tuple[click.Option, ...]
    export: Callable[..., Sequence[Path]]

    def given(self, ctx: click.Context) -> list[str]:
        """Return the options of this format that the command line gives, as they are typed."""
        default = click.core.ParameterSource.DEFAULT
        return [
            option.opts[0] for option in self.options if ctx.get_parameter_source(option.name) is not default
        ]

    def values(self, ctx: click.Context) -> dict[str, Any]:
        """Return the values of this format's options by name."""
        return {option.name: ctx.params[option.name] for option in self.options}
