"""Write and read what hand and arm did in a trial: ``hand.csv`` in the folder of an attempt's recording."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from tega.errors import RecordingError
from tega.haptics import FINGERS
from tega.runtime.files.foreign_file import read_words
from tega.runtime.files.whole_file import write_whole
from tega_study.touch_rows import touch_path

_TIPS = tuple(f"{finger}_mm" for finger in FINGERS)


class HandRow(NamedTuple):
    """State of hand and arm at one moment.

    Attributes:
        t_s: Since the trial's start, seconds.
        level: Closure level asked for, 1 to 5; ``None`` before the first.
        closure: Closure measured at the joints, levels with fractions; ``None`` where no hand is read.
        height_m: Height of the arm's end, metres; ``None`` if no arm is measured.
        tips_mm: Height of each fingertip over the palm by the joints, thumb first, millimetres; ``None`` where no hand
            is read.
    """

    t_s: float
    level: int | None
    closure: float | None
    height_m: float | None
    tips_mm: tuple[float, ...] | None = None


def hand_path(folder: Path, participant: str, trial_id: str, attempt: int) -> Path:
    """Return where an attempt's rows are."""
    return touch_path(folder, participant, trial_id, attempt).with_name("hand.csv")


def write_hand(path: Path, rows: Sequence[HandRow]) -> None:
    """Write rows, whole or not at all."""
    text = ",".join((*HandRow._fields[:-1], *_TIPS)) + "\n"
    for row in rows:
        cells = [_cell(row.level, "d"), _cell(row.closure, ".4f"), _cell(row.height_m, ".5f")]
        cells += [_cell(tip_mm, ".3f") for tip_mm in row.tips_mm or (None,) * len(_TIPS)]
        text += f"{row.t_s:.4f},{','.join(cells)}\n"
    write_whole(path, text)


def read_hand(path: Path) -> list[HandRow]:
    """Read rows; a file that is not there has none.

    Raises:
        RecordingError: The file is damaged.
    """
    if not path.exists():
        return []
    try:
        rows = csv.DictReader(io.StringIO(read_words(path, most_mib=256), newline=""))
        return [
            HandRow(
                float(row["t_s"]),
                int(row["level"]) if row["level"] else None,
                float(row["closure"]) if row["closure"] else None,
                float(row["height_m"]) if row["height_m"] else None,
                tuple(float(row[tip]) for tip in _TIPS) if row.get(_TIPS[0]) else None,
            )
            for row in rows
        ]
    except (OSError, ValueError, KeyError, TypeError, csv.Error) as error:
        raise RecordingError(f"{path}: no course of a hand: {error}", "restore it from a copy") from error


def _cell(value: float | None, form: str) -> str:
    return "" if value is None else format(value, form)
