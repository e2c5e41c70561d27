"""Write and read the tables of an attempt beside its recording, each whole or not at all.

``touch.csv`` has the fingertips frame by frame, ``hand.csv`` what hand and arm did.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple, TypeVar

from tega.errors import RecordingError
from tega.haptics import FINGERS
from tega.runtime.files.foreign_file import read_words
from tega.runtime.files.whole_file import write_whole
from tega_study.plan import PlannedTrial

_Row = TypeVar("_Row")

_TIPS = tuple(f"{finger}_mm" for finger in FINGERS)


class TouchRow(NamedTuple):
    """A measured frame of a fingertip.

    Attributes:
        t_s: Since the trial's start.
        in_contact: 1 where something is touched.
        eda: Contact area, pixels (Eq 4).
        mass: Sum of the pressure map; ``peak`` is its largest value.
        x: Centroid, pixels; so is ``y``.
    """

    t_s: float
    finger: str
    in_contact: int
    eda: float
    mass: float
    peak: float
    x: float
    y: float


class HandRow(NamedTuple):
    """State of hand and arm at one moment, ``t_s`` since the trial's start.

    Attributes:
        level: Closure level asked for, 1 to 5; ``None`` before the first.
        closure: Measured at the joints, levels with fractions; ``None`` where no hand is read.
        height_m: Of the arm's end; ``None`` if no arm is measured.
        tips_mm: Height of each fingertip over the palm by the joints, thumb first; ``None`` where no hand is
            read.
    """

    t_s: float
    level: int | None
    closure: float | None
    height_m: float | None
    tips_mm: tuple[float, ...] | None = None


TOUCH, HAND = "touch.csv", "hand.csv"


def recording_folder(folder: Path, trial: PlannedTrial, attempt: int) -> Path:
    """Return where an attempt is recorded: ``recordings/<person>/<trial>-a<attempt>``."""
    return folder / "recordings" / trial.participant / f"{trial.id}-a{attempt}"


def write_touch(path: Path, rows: Sequence[TouchRow]) -> None:
    """Write frames."""
    text = ",".join(TouchRow._fields) + "\n"
    text += "".join(
        f"{r.t_s:.4f},{r.finger},{r.in_contact},{r.eda:g},{r.mass:.5g},{r.peak:.5g},{r.x:.2f},{r.y:.2f}\n"
        for r in rows
    )
    write_whole(path, text)


def write_hand(path: Path, rows: Sequence[HandRow]) -> None:
    """Write rows of hand and arm."""
    text = ",".join((*HandRow._fields[:-1], *_TIPS)) + "\n"
    for row in rows:
        cells = [_cell(row.level, "d"), _cell(row.closure, ".4f"), _cell(row.height_m, ".5f")]
        cells += [_cell(tip_mm, ".3f") for tip_mm in row.tips_mm or (None,) * len(_TIPS)]
        text += f"{row.t_s:.4f},{','.join(cells)}\n"
    write_whole(path, text)


def _cell(value: float | None, form: str) -> str:
    return "" if value is None else format(value, form)


def read_touch(path: Path) -> list[TouchRow]:
    """Read frames; ``RecordingError`` where the file is missing or damaged."""

    def row_of(row: Mapping[str, str]) -> TouchRow:
        numbers = (float(row[name]) for name in TouchRow._fields[3:])
        return TouchRow(float(row["t_s"]), row["finger"], int(row["in_contact"]), *numbers)

    return _read(path, row_of, "no frames of a trial")


def read_hand(path: Path) -> list[HandRow]:
    """Read rows of hand and arm; a file that is not there has none, a damaged one is a ``RecordingError``."""

    def row_of(row: Mapping[str, str]) -> HandRow:
        level, closure, height_m = (row[name] for name in HandRow._fields[1:-1])
        return HandRow(
            float(row["t_s"]),
            int(level) if level else None,
            float(closure) if closure else None,
            float(height_m) if height_m else None,
            tuple(float(row[tip]) for tip in _TIPS) if row.get(_TIPS[0]) else None,
        )

    return _read(path, row_of, "no course of a hand") if path.exists() else []


def _read(path: Path, row_of: Callable[[Mapping[str, str]], _Row], problem: str) -> list[_Row]:
    try:
        rows = csv.DictReader(io.StringIO(read_words(path, most_mib=256), newline=""))
        return [row_of(row) for row in rows]
    except (OSError, ValueError, KeyError, TypeError, csv.Error) as error:
        raise RecordingError(f"{path}: {problem}: {error}", "restore it from a copy") from error
