"""Read logs of EMG beside a force or a closure, from files and from records of practice."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
import numpy as np

from tega.config.calibration.records import PracticeRecord, read_record
from tega.errors import CalibrationError
from tega.runtime.files.foreign_file import load_npy, read_foreign
from tega.runtime.files.tables.table import Reading
from tega.ui.cli.emg_logs import emg_beside, read_emg, stated_rate
from tega_learn.compare import Log

_MOST_MIB = 1024


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
        rates.add(stated_rate(found, file))
        samples.append(found.samples)
        goal.append(np.full(len(found.samples), meant))
    if len(rates) > 1:
        raise click.UsageError(
            f"the files have different rates: {', '.join(f'{rate:g}' for rate in sorted(rates))} Hz"
        )
    name = f"{Path(log.split(',', maxsplit=1)[0].rpartition('=')[0]).name} and {len(samples) - 1} more"
    return Log(name, np.concatenate(samples), np.concatenate(goal), rates.pop(), kind)


def force_log(file: Path, target: str, kind: Any, reading: Reading) -> Log:
    """Read a file of EMG beside a force or a closure."""
    return Log(file.name, *emg_beside(file, target, "--target", reading), kind)


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
