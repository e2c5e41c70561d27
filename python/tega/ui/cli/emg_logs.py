"""Declare how a file of EMG is read, and read it, alone or beside a force or a closure."""

from __future__ import annotations

import functools
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tega.ui.cli.options import CHANNELS, all_options

if TYPE_CHECKING:
    from tega.runtime.files.signals import Signals
    from tega.runtime.files.tables.table import Reading

_ARRAYS = {".mat", ".npz", ".h5", ".hdf5", ".hdf"}


class _ReadOption(click.ParamType[dict[str, Any]]):
    """KEY=VALUE[,KEY=VALUE]: choices for files that can be read in several ways."""

    name = "key=value"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> dict[str, Any]:
        """Return the choices by name, checked."""
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


target_option = click.option(
    "--target", help="Closure or force: a variable of a file of arrays, else a column from 1."
)


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


def read_emg(file: Path, reading: Reading) -> Signals:
    """Read a file of EMG, and print the choices made and the problems found."""
    from tega.runtime.files.signals import read_signals

    signals = read_signals(file, reading)
    for note in signals.notes:
        click.echo(f"{file.name}: {note}", err=True)
    return signals


def emg_beside(file: Path, beside: str, option: str, reading: Reading) -> tuple[Any, Any, float]:
    """Read EMG and a signal measured beside it: a variable of a file of arrays, or a column of a table.

    Return them, float64 (n, channels) and (n,), and the samples per second.
    """
    import msgspec

    from tega.errors import RecordingError

    if file.suffix.lower() in _ARRAYS:
        signals = read_emg(file, reading)
        alone = msgspec.structs.replace(reading, rate_hz=None, channels=(1,), variable=beside, time="none")
        samples, measured = signals.samples, read_emg(file, alone).samples[:, 0]
    elif beside.isdecimal() and int(beside) > 0:
        if not reading.channels:
            raise click.UsageError(
                f"{file.name} is a table, where {option} {beside} is a column beside the EMG: name that with --channels"
            )
        both = msgspec.structs.replace(reading, channels=(*reading.channels, int(beside)), variable="emg")
        signals = read_emg(file, both)
        samples, measured = signals.samples[:, :-1], signals.samples[:, -1]
    else:
        raise click.UsageError(
            f"{option} {beside!r}: {file.name} is no file of arrays, so name a column from 1"
        )
    if len(samples) != len(measured):
        raise RecordingError(
            f"{file.name}: {len(samples)} samples and {len(measured)} targets: they are not on one clock",
            "give one target a sample",
        )
    return samples, measured, stated_rate(signals, file.name)


def stated_rate(signals: Signals, name: str) -> float:
    """Return the samples per second that a file states, or that were given."""
    if signals.rate_hz is None:
        raise click.UsageError(f"{name} does not state its rate: name its --rate-hz")
    return signals.rate_hz
