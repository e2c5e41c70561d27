"""Options that say how a file of EMG is read."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import click

from tega.ui.cli.options import CHANNELS, all_options


class _ReadOption(click.ParamType[dict[str, Any]]):
    """KEY=VALUE[,KEY=VALUE]: choices for files that can be read in several ways."""

    name = "key=value"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> dict[str, Any]:
        import msgspec

        from tega.config.errors import wrong_value
        from tega.runtime.files.tables.table import Reading

        if isinstance(value, dict):
            return value
        given = dict(part.partition("=")[::2] for part in str(value).split(","))
        tree = {key: int(text) if text.isdecimal() else text for key, text in given.items()}
        unknown = set(tree) - {"decimal", "time", "rows"}
        try:
            msgspec.convert(tree, Reading)
        except msgspec.ValidationError as error:
            self.fail(f"{value!r}: {wrong_value(error, tree)}", param, ctx)
        if unknown:
            self.fail(
                f"{value!r}: decimal, time and rows can be chosen, not {', '.join(unknown)}", param, ctx
            )
        return tree


def column_options(prefix: str = "") -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Return a decorator that adds the options for rate, columns and array of a file of EMG."""
    return all_options(
        click.option(
            f"--{prefix}rate-hz",
            type=click.FloatRange(0, 10_000_000, min_open=True),
            help="Samples per second; else as the file states them.",
        ),
        click.option(
            f"--{prefix}channels",
            type=CHANNELS,
            help="EMG columns, counted from 1; else those that are EMG.",
        ),
        click.option(
            f"--{prefix}variable",
            default="emg",
            show_default=True,
            help="Array or stream of a file of several.",
        ),
    )


def kind_option(name: str, default: str | None = None) -> Callable[[Any], Any]:
    """Return the option for the kind of samples."""
    return click.option(
        name, type=click.Choice(["raw", "rectified", "envelope"]), default=default, show_default=True,
        help="Whether the samples are raw, rectified or an envelope.",
    )  # fmt: skip


def reading_options(function: Callable[..., Any]) -> Callable[..., Any]:
    """Add the options that say how a file of EMG is read; the command receives them as ``reading``."""

    @functools.wraps(function)
    def command(
        *, rate_hz: float | None, channels: Any, variable: str, read: dict[str, Any], **others: Any
    ) -> Any:
        import msgspec

        from tega.runtime.files.tables.table import Reading

        tree = {"channels": channels or (), "variable": variable, "rate_hz": rate_hz, **read}
        return function(reading=msgspec.convert(tree, Reading), **others)

    read_option = click.option(
        "--read", type=_ReadOption(), default="rows=auto", metavar="KEY=VALUE",
        help="Choice for files that can be read in several ways: decimal=comma or point, time=COLUMN or none, "
        "rows=samples or channels; several with commas between.",
    )  # fmt: skip
    return column_options()(read_option(command))
