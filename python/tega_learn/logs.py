"""Read logs of EMG beside a force or a closure, from files and from records of practice."""

from __future__ import annotations

from pathlib import Path
from typing import Any, ClassVar, Literal

import click
import msgspec
import numpy as np

from tega.config.calibration.records import CalibrationRecord, read_record
from tega.errors import CalibrationError, RecordingError
from tega.runtime.files.foreign_file import load_npy, read_foreign
from tega.runtime.files.signals import Signals, read_signals
from tega.runtime.files.tables.table import Reading
from tega_learn.compare import Log

_MOST_MIB = 1024
_ARRAYS = {".mat", ".npz", ".h5", ".hdf5", ".hdf"}


target_option = click.option(
    "--target", help="Closure or force: a variable of a file of arrays, else a column from 1."
)


class PracticeRecord(CalibrationRecord, frozen=True, kw_only=True, tag_field="format", tag="tega-practice"):
    """Score of a person following a curve of levels.

    Attributes:
        preset: Rules of the levels.
        rms_error_levels: Root of the mean square of the difference, levels.
        delay_s: Shift at which the levels fit the curve best; left out where the level never changed.
        kind: Kind of the samples beside the record (``.npy``: the channels, then the closure asked for).
        decoder: Decoder that computed the levels; with the rules, the preset's too. Empty in records before
            0.2.
        options: Its options, as JSON.
    """

    comments: ClassVar[dict[str, str]] = {
        "in_target_percent": "of the time on the level asked for",
        "delay_s": "shift at which the levels fit the curve best",
    }

    person: str
    preset: Literal["paper", "live"]
    seed: int
    duration_s: float
    in_target_percent: float
    rms_error_levels: float
    delay_s: float | None = None
    kind: Literal["raw", "rectified", "envelope"] | None = None
    rate_hz: float | None = None
    channels: tuple[str, ...] = ()
    decoder: str = ""
    options: str = ""


def read_emg(file: Path, reading: Reading) -> Signals:
    """Read a file of EMG, and print the choices made and the problems found."""
    signals = read_signals(file, reading)
    for note in signals.notes:
        click.echo(f"{file.name}: {note}", err=True)
    return signals


def force_log(file: Path, target: str, kind: Any, reading: Reading) -> Log:
    """Read EMG beside a force or a closure: a variable of a file of arrays, or a column of a table."""
    if file.suffix.lower() in _ARRAYS:
        signals = read_emg(file, reading)
        alone = msgspec.structs.replace(reading, rate_hz=None, channels=(1,), variable=target, time="none")
        samples, measured = signals.samples, read_emg(file, alone).samples[:, 0]
    elif target.isdecimal() and int(target) > 0:
        if not reading.channels:
            raise click.UsageError(
                f"{file.name} is a table, where --target {target} is a column beside the EMG: name that with --channels"
            )
        both = msgspec.structs.replace(reading, channels=(*reading.channels, int(target)), variable="emg")
        signals = read_emg(file, both)
        samples, measured = signals.samples[:, :-1], signals.samples[:, -1]
    else:
        raise click.UsageError(
            f"--target {target!r}: {file.name} is no file of arrays, so name a column from 1"
        )
    if len(samples) != len(measured):
        raise RecordingError(
            f"{file.name}: {len(samples)} samples and {len(measured)} targets: they are not on one clock",
            "give one target a sample",
        )
    return Log(file.name, samples, measured, _rate(signals, file.name), kind)


def _rate(signals: Signals, name: str) -> float:
    if signals.rate_hz is None:
        raise click.UsageError(f"{name} does not state its rate: name its --rate-hz")
    return signals.rate_hz


def read_log(log: str, target: str | None, kind: Any, reading: Reading) -> Log:
    """Read a log as ``emg compare`` is given it: a practice, files of one class each, or EMG beside a force."""
    channels = reading.channels
    if log.endswith(".toml"):
        practised, known = read_tracked(Path(log))
        if channels and max(channels) > len(known.channels):
            raise click.UsageError(f"--channels {max(channels)}: {log} has {len(known.channels)} channels")
        return practised.columns([c - 1 for c in channels]) if channels else practised
    if "=" not in log:
        if target is None:
            raise click.UsageError(f"{log}: name its --target, or give FILE=CLOSURE for files of one class")
        return force_log(Path(log), target, kind, reading)
    samples, goal, rates = [], [], set()
    for part in log.split(","):
        file, _, closure = part.rpartition("=")
        try:
            meant = float(closure)
        except ValueError:
            raise click.UsageError(f"{part!r} is not FILE=CLOSURE, such as rest.csv=0") from None
        found = read_emg(Path(file), reading)
        rates.add(_rate(found, file))
        samples.append(found.samples)
        goal.append(np.full(len(found.samples), meant))
    if len(rates) > 1:
        raise click.UsageError(
            f"the files have different rates: {', '.join(f'{rate:g}' for rate in sorted(rates))} Hz"
        )
    name = f"{Path(log.split(',', maxsplit=1)[0].rpartition('=')[0]).name} and {len(samples) - 1} more"
    return Log(name, np.concatenate(samples), np.concatenate(goal), rates.pop(), kind)


def read_tracked(record: Path) -> tuple[Log, PracticeRecord]:
    """Read a practice record and the EMG beside it, in the source's unit, which earlier versions did not keep."""
    if not record.is_file():
        raise CalibrationError(f"{record.name}: no such practice record", f"looked for {record}")
    reported = read_record(record, PracticeRecord)
    path = record.with_suffix(".npy")
    if reported.kind is None or reported.rate_hz is None or not path.exists():
        raise CalibrationError(
            f"{record.name}: keeps no EMG", "track again: tega-teleop practice SETTINGS.toml --person ID"
        )
    try:
        data = load_npy(read_foreign(path, most_mib=_MOST_MIB, error=CalibrationError), path.name)
    except ValueError as error:
        raise CalibrationError(f"{path.name}: damaged: {error}", "track again") from error
    if data.dtype != np.float64 or data.ndim != 2 or data.shape[1] != len(reported.channels) + 1:
        raise CalibrationError(
            f"{path.name}: {data.dtype} {data.shape}, expected float64 (n, {len(reported.channels) + 1})",
            "track again",
        )
    samples, target = np.ascontiguousarray(data[:, :-1]), np.ascontiguousarray(data[:, -1])
    return Log(record.name, samples, target, reported.rate_hz, reported.kind), reported
