"""Group the verbs on EMG, show how a file of it is read: ``tega-teleop emg``; and the options that say how."""

from __future__ import annotations

import functools
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tega.ui.cli.guest_group import GuestGroup
from tega.ui.cli.options import CHANNELS, PATH, FiniteRange, all_options, echo_json, json_option

if TYPE_CHECKING:
    from tega.runtime.files.tables.decide import Decision
    from tega.runtime.files.tables.table import Reading


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
            type=FiniteRange(0, 10_000_000, min_open=True),
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


@click.group(cls=GuestGroup, epilog="Example: tega-teleop emg inspect squeeze.csv")
def emg() -> None:
    """Inspect files of EMG, fit decoders to a person and to a day, compare them on one log."""


@emg.command("inspect", epilog="Example: tega-teleop emg inspect squeeze.csv")
@click.argument("file", type=PATH, required=False)
@reading_options
@json_option
def emg_inspect(*, file: Path | None, reading: Reading, as_json: bool) -> None:
    """Show how FILE is read: format, channels, time, rate, losses, events. Without FILE, list the formats.

    \b
    --json prints an object: file, format, channels, names, unit, time and counter (columns from 1, 0 for none),
      columns (number, name, unit, holds, why, constant, unix), facts (encoding, delimiter, decimal, first_line, names),
      sideways, rate_hz, rate_from, n_samples, events (t_s, text), faults, notes, words
    Without FILE a list: name, suffixes, library, origin.
    """  # noqa: D301  # click keeps the lines after \b as they are
    import msgspec

    from tega.runtime.files.formats import FORMATS
    from tega.runtime.files.signals import read_signals

    if file is None:
        formats = [
            {"name": f.name, "suffixes": f.suffixes, "library": f.library, "origin": f.origin}
            for f in FORMATS
        ]
        if as_json:
            echo_json(formats)
            return
        for one in FORMATS:
            endings = " ".join(one.suffixes) or "any other"
            click.echo(
                f"{one.name:14} {endings:20} {one.origin}" + (f"  ({one.library})" if one.library else "")
            )
        return
    decision = read_signals(file, reading).decision
    if as_json:
        echo_json(msgspec.to_builtins(decision))
    else:
        _print_decision(decision)


def _print_decision(decision: Decision) -> None:
    rate = (
        f"{decision.rate_hz:g} samples/s (by {decision.rate_from})" if decision.rate_hz else "no rate stated"
    )
    named = [name or f"column {c}" for c, name in zip(decision.channels, decision.names, strict=True)]
    unit = f", in {decision.unit}" if decision.unit else ""
    click.echo(f"{decision.file}: {decision.format}, {decision.n_samples} samples, {rate}")
    click.echo(f"channels: {', '.join(named)}{unit}")
    for line in (decision.words, *decision.faults, *decision.notes):
        if line:
            click.echo(line)
    for event in decision.events[:20]:
        click.echo(f"event at {event.t_s:.3f} s: {event.text}")
    if len(decision.events) > 20:
        click.echo(f"{len(decision.events) - 20} more events")
