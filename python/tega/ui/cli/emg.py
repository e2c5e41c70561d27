"""Group the verbs on EMG, and show how a file of it is read: ``tega-teleop emg``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from tega.ui.cli.calibrate import emg_recalibrate
from tega.ui.cli.emg_logs import reading_options
from tega.ui.cli.guest_group import GuestGroup
from tega.ui.cli.options import PATH, echo_json, json_option

if TYPE_CHECKING:
    from tega.runtime.files.tables.decide import Decision
    from tega.runtime.files.tables.table import Reading


@click.group(cls=GuestGroup, epilog="Example: tega-teleop emg inspect squeeze.csv")
def emg() -> None:
    """Inspect files of EMG, fit decoders to a person and to a day, compare them on one log."""


emg.add_command(emg_recalibrate, "recalibrate")


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
