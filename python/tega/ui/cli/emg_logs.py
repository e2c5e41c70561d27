"""Read logs of EMG beside a force or a closure, from files and from records of practice."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from tega.runtime.files.signals import Signals
    from tega.setup.calibration.tracked import Tracked
    from tega.stages.learned.compare import Log

__all__ = ["ReadOption", "emg_beside", "practised_log", "read_emg", "read_log"]

_ARRAYS = {".mat", ".npz", ".h5", ".hdf5", ".hdf"}


class ReadOption(click.ParamType[dict[str, Any]]):
    """KEY=VALUE[,KEY=VALUE]: choices for files that can be read in several ways."""

    name = "key=value"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> dict[str, Any]:
        """Return the choices by name, checked."""
        import msgspec

        from tega.runtime.files.tables.table import Reading

        if isinstance(value, dict):
            return value
        from tega.config.errors import wrong_value

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


READ_OPTION = click.option(
    "--read",
    type=ReadOption(),
    default="rows=auto",
    metavar="KEY=VALUE",
    help="Choice for files that can be read in several ways: decimal=comma or point, time=COLUMN or none, "
    "rows=samples or channels; several with commas between.",
)


def read_emg(
    file: Path,
    *,
    rate_hz: float | None,
    channels: Any = (),
    variable: str = "emg",
    read: dict[str, Any] | None = None,
) -> Signals:
    """Read a file of EMG, and print the choices made and the problems found."""
    import msgspec

    from tega.runtime.files.signals import read_signals
    from tega.runtime.files.tables.table import Reading

    tree = {"channels": channels or (), "variable": variable, "rate_hz": rate_hz, **(read or {})}
    signals = read_signals(file, msgspec.convert(tree, Reading))
    for note in signals.notes:
        click.echo(f"{file.name}: {note}", err=True)
    return signals


def read_log(  # noqa: PLR0917  # one argument an option
    log: str,
    target: str | None,
    rate_hz: float | None,
    kind: Any,
    channels: list[int] | None,
    variable: str,
    read: dict[str, Any] | None = None,
) -> Log:
    """Read a log as ``emg compare`` is given it: a practice, files of one class each, or EMG beside a force."""
    import numpy as np

    from tega.stages.learned.compare import Log as Given

    if log.endswith(".toml"):
        practised, known = practised_log(Path(log))
        if channels and max(channels) > len(known.channels):
            raise click.UsageError(f"--channels {max(channels)}: {log} has {len(known.channels)} channels")
        return practised.columns([c - 1 for c in channels]) if channels else practised
    if "=" not in log:
        if target is None:
            raise click.UsageError(f"{log}: name its --target, or give FILE=CLOSURE for files of one class")
        return force_log(Path(log), target, rate_hz, kind, channels, variable, read)
    samples, goal, rates = [], [], set()
    for part in log.split(","):
        file, _, closure = part.rpartition("=")
        try:
            meant = float(closure)
        except ValueError:
            raise click.UsageError(f"{part!r} is not FILE=CLOSURE, such as rest.csv=0") from None
        found = read_emg(Path(file), rate_hz=rate_hz, channels=channels, variable=variable, read=read)
        rates.add(_rate(found, file))
        samples.append(found.samples)
        goal.append(np.full(len(found.samples), meant))
    if len(rates) > 1:
        raise click.UsageError(
            f"the files have different rates: {', '.join(f'{rate:g}' for rate in sorted(rates))} Hz"
        )
    name = f"{Path(log.split(',', maxsplit=1)[0].rpartition('=')[0]).name} and {len(samples) - 1} more"
    return Given(name, np.concatenate(samples), np.concatenate(goal), rates.pop(), kind)


def practised_log(record: Path) -> tuple[Log, Tracked]:
    """Read a record of practice, with the EMG beside it."""
    from tega.setup.calibration.tracked import read_tracked
    from tega.stages.learned.compare import Log as Given

    tracked = read_tracked(record)
    return Given(record.name, tracked.samples, tracked.target, tracked.rate_hz, tracked.kind), tracked


def force_log(  # noqa: PLR0917  # one argument an option
    file: Path,
    target: str,
    rate_hz: float | None,
    kind: Any,
    channels: list[int] | None,
    variable: str,
    read: dict[str, Any] | None = None,
) -> Log:
    """Read a file of EMG beside a force or a closure."""
    import numpy as np

    from tega.stages.learned.compare import Log as Given

    samples, measured, rate_hz = emg_beside(
        file, target, option="--target", rate_hz=rate_hz, channels=channels, variable=variable, read=read
    )
    return Given(file.name, samples, np.asarray(measured, np.float64), rate_hz, kind)


def emg_beside(
    file: Path,
    beside: str,
    *,
    option: str,
    rate_hz: float | None,
    channels: list[int] | None,
    variable: str,
    read: dict[str, Any] | None = None,
) -> tuple[Any, Any, float]:
    """Read EMG and a signal measured beside it: a variable of a file of arrays, or a column of a table.

    Returns:
        Samples (n, channels), the measured values (n,), samples per second.
    """
    from tega.errors import RecordingError

    if file.suffix.lower() in _ARRAYS:
        signals = read_emg(file, rate_hz=rate_hz, channels=channels, variable=variable, read=read)
        other = read_emg(
            file, rate_hz=None, channels=(1,), variable=beside, read={**(read or {}), "time": "none"}
        )
        samples, measured = signals.samples, other.samples[:, 0]
    elif beside.isdecimal() and int(beside) > 0:
        if not channels:
            raise click.UsageError(
                f"{file.name} is a table, where {option} {beside} is a column beside the EMG: name that with --channels"
            )
        signals = read_emg(file, rate_hz=rate_hz, channels=(*channels, int(beside)), read=read)
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
    return samples, measured, _rate(signals, file.name)


def _rate(signals: Signals, name: str) -> float:
    if signals.rate_hz is None:
        raise click.UsageError(f"{name} does not state its rate: name its --rate-hz")
    return signals.rate_hz
