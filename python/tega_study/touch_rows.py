"""Write and read each fingertip's contacts in a trial, frame by frame: ``touch.csv`` beside its recording."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from tega.errors import RecordingError
from tega.runtime.files.foreign_file import read_words
from tega.runtime.files.whole_file import write_whole


class TouchRow(NamedTuple):
    """A measured frame of a fingertip.

    Attributes:
        t_s: Since the trial's start, seconds.
        finger: Which.
        in_contact: 1 where something is touched.
        eda: Contact area, pixels (Eq 4).
        mass: Sum of the pressure map.
        peak: Its largest value.
        x: Centroid, pixels.
        y: Vertical position of the centroid, pixels.
    """

    t_s: float
    finger: str
    in_contact: int
    eda: float
    mass: float
    peak: float
    x: float
    y: float


def touch_path(folder: Path, participant: str, trial_id: str, attempt: int) -> Path:
    """Return where an attempt's frames are."""
    return folder / "recordings" / participant / f"{trial_id}-a{attempt}" / "touch.csv"


def write_touch(path: Path, rows: Sequence[TouchRow]) -> None:
    """Write frames, whole or not at all."""
    text = ",".join(TouchRow._fields) + "\n"
    text += "".join(
        f"{r.t_s:.4f},{r.finger},{r.in_contact},{r.eda:g},{r.mass:.5g},{r.peak:.5g},{r.x:.2f},{r.y:.2f}\n"
        for r in rows
    )
    write_whole(path, text)


def read_touch(path: Path) -> list[TouchRow]:
    """Read frames.

    Raises:
        RecordingError: The file is missing or damaged.
    """
    try:
        rows = list(csv.DictReader(io.StringIO(read_words(path, most_mib=256), newline="")))
        return [
            TouchRow(
                float(row["t_s"]),
                row["finger"],
                int(row["in_contact"]),
                *(float(row[n]) for n in TouchRow._fields[3:]),
            )
            for row in rows
        ]
    except (OSError, ValueError, KeyError, TypeError, csv.Error) as error:
        raise RecordingError(f"{path}: no frames of a trial: {error}", "restore it from a copy") from error
