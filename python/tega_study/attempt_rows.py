"""Write and read the tables of an attempt beside its recording, each whole or not at all.

``touch.csv`` has the fingertips frame by frame, ``hand.csv`` what hand and arm did.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from tega.errors import RecordingError
from tega.haptics import FINGERS
from tega.runtime.files.foreign_file import read_words
from tega.runtime.files.whole_file import write_whole
from tega_study.plan import PlannedTrial

_Row = TypeVar("_Row")

_TIPS = tuple(f"{finger}_mm" for finger in FINGERS)


class TouchRow(NamedTuple):
    """A measured frame of a fingertip, ``t_s`` since the trial's start; area (Eq 4) and centroid in pixels.

    ``mass`` is the sum of the pressure map, ``peak`` its largest value.
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
    """State of hand and arm at one moment, ``t_s`` since the trial's start; ``None`` for what is not measured.

    Attributes:
        level: Closure level asked for, 1 to 5; ``None`` before the first.
        closure: Measured at the joints, levels with fractions.
        height_m: Of the arm's end.
        tips_mm: Height of each fingertip over the palm by the joints, thumb first.
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
    _write(path, TouchRow._fields, rows, (".4f", "", "d", "g", ".5g", ".5g", ".2f", ".2f"))


def write_hand(path: Path, rows: Sequence[HandRow]) -> None:
    """Write rows of hand and arm."""
    cells = ((*row[:-1], *(row.tips_mm or (None,) * len(_TIPS))) for row in rows)
    forms = ".4f", "d", ".4f", ".5f", *(".3f",) * len(_TIPS)
    _write(path, (*HandRow._fields[:-1], *_TIPS), cells, forms)


def _write(path: Path, head: Sequence[str], rows: Iterable[Sequence[Any]], forms: Sequence[str]) -> None:
    lines = [",".join(head)]
    for row in rows:
        cells = ("" if v is None else format(v, form) for v, form in zip(row, forms, strict=True))
        lines.append(",".join(cells))
    write_whole(path, "".join(f"{line}\n" for line in lines))


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
