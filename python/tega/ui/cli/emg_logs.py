"""Read logs of EMG beside a force or a closure, from files and from records of practice."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from tega.setup.calibration.tracked import Tracked
    from tega.stages.learned.compare import Log

__all__ = ["force_log", "practised_log", "read_log"]


def read_log(  # noqa: PLR0917  # one argument an option
    log: str, target: str | None, rate_hz: float | None, kind: Any, channels: list[int] | None, variable: str
) -> Log:
    """Read a log as ``emg compare`` is given it: a practice, files of one class each, or EMG beside a force."""
    import numpy as np

    from tega.devices.emg.emg_formats import read_emg_file
    from tega.stages.learned.compare import Log as Given

    if log.endswith(".toml"):
        practised, known = practised_log(Path(log))
        if channels and max(channels) > len(known.channels):
            raise click.UsageError(f"--channels {max(channels)}: {log} has {len(known.channels)} channels")
        return practised.columns([c - 1 for c in channels]) if channels else practised
    if rate_hz is None:
        raise click.UsageError(f"{log} is no practice record: name its --rate-hz")
    if "=" not in log:
        if target is None:
            raise click.UsageError(f"{log}: name its --target, or give FILE=CLOSURE for files of one class")
        return force_log(Path(log), target, rate_hz, kind, channels, variable)
    samples, goal = [], []
    for part in log.split(","):
        file, _, closure = part.rpartition("=")
        try:
            meant = float(closure)
        except ValueError:
            raise click.UsageError(f"{part!r} is not FILE=CLOSURE, such as rest.csv=0") from None
        found, _ = read_emg_file(Path(file), channels or (), variable=variable)
        samples.append(found)
        goal.append(np.full(len(found), meant))
    name = f"{Path(log.split(',', maxsplit=1)[0].rpartition('=')[0]).name} and {len(samples) - 1} more"
    return Given(name, np.concatenate(samples), np.concatenate(goal), rate_hz, kind)


def practised_log(record: Path) -> tuple[Log, Tracked]:
    """Read a record of practice, with the EMG beside it."""
    from tega.setup.calibration.tracked import read_tracked
    from tega.stages.learned.compare import Log as Given

    tracked = read_tracked(record)
    return Given(record.name, tracked.samples, tracked.target, tracked.rate_hz, tracked.kind), tracked


def force_log(  # noqa: PLR0917  # one argument an option
    file: Path, target: str, rate_hz: float, kind: Any, channels: list[int] | None, variable: str
) -> Log:
    """Read a file of EMG beside a force or a closure."""
    import numpy as np

    from tega.devices.emg.emg_formats import read_emg_file
    from tega.errors import RecordingError
    from tega.stages.learned.compare import Log as Given

    if file.suffix.lower() == ".mat":
        samples, _ = read_emg_file(file, channels or (), variable=variable)
        measured, _ = read_emg_file(file, (1,), variable=target)
    elif target.isdecimal() and int(target) > 0:
        if not channels:
            raise click.UsageError(
                f"{file.name} is a table, where --target {target} is a column beside the EMG: name that with --channels"
            )
        both, _ = read_emg_file(file, (*channels, int(target)))
        samples, measured = both[:, :-1], both[:, -1:]
    else:
        raise click.UsageError(f"--target {target!r}: {file.name} is no .mat file, so name a column from 1")
    if len(samples) != len(measured):
        raise RecordingError(
            f"{file.name}: {len(samples)} samples and {len(measured)} targets: they are not on one clock",
            "give one target a sample",
        )
    return Given(file.name, samples, np.asarray(measured[:, 0], np.float64), rate_hz, kind)
