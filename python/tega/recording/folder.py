"""Prepare a run's output folder, keep an earlier run's results, and refuse a folder that holds anything else."""

from __future__ import annotations

import contextlib
import itertools
import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import msgspec

from tega.errors import ConfigError, RecordingError
from tega.loop.summary import SUMMARY_FORMAT
from tega.recording.tables import TABLES
from tega.runtime.files.foreign_file import parse_json, read_words
from tega.runtime.files.whole_file import write_whole

OUTPUT_NAMES = (*TABLES.values(), "vest.csv", "can.csv", "summary.json", "calibration.toml", "picture.png")
NOT_ENDED = "not yet, or it was killed"


class _RunSummary(msgspec.Struct):
    """Marks a folder as an earlier run's, or as a demo's trials."""

    format: Literal["tega-run", "tega-demo"]


def prepare_folder(folder: Path, *, also: Sequence[Path] = ()) -> Path | None:
    """Make a folder ready for a run's outputs, and keep those of an earlier run in a folder below it.

    The folder may be new, empty, or hold an earlier run (recognised by its ``summary.json``). An earlier
    run's own files, and those of ``also``, are then moved to ``earlier-1``, ``earlier-2``, …, which is
    returned (``None`` without results); other files in the folder are unchanged. A ``summary.json`` that
    marks the run as unfinished is written at once: it stays if the run is killed, and the next run recognises
    the folder by it. ``ConfigError`` as of :func:`check_folder`.
    """
    check_folder(folder)
    folder.mkdir(parents=True, exist_ok=True)
    kept = _keep_earlier(folder, also)
    begun = {"format": SUMMARY_FORMAT, "version": 1, "ended": NOT_ENDED}
    write_whole(folder / "summary.json", json.dumps(begun, indent=2) + "\n")
    return kept


def check_folder(folder: Path) -> None:
    """Check that a folder can take a run's outputs, and change nothing.

    ``ConfigError`` where it is a file, or holds something that is not an earlier run.
    """
    if folder.exists() and not folder.is_dir():
        raise ConfigError(f"output folder {folder.name!r} is a file", "name a folder")
    if folder.is_dir() and any(folder.iterdir()) and not _holds_a_run(folder):
        raise ConfigError(
            f"output folder {folder.name!r} is not empty and holds no earlier run",
            "name a new or empty folder, or one whose summary.json was written by TEGA",
        )


def _keep_earlier(folder: Path, also: Sequence[Path]) -> Path | None:
    """Move the results of an earlier run into a folder of its own; a note of a begun run is no result."""
    ours = [folder / name for name in OUTPUT_NAMES if os.path.lexists(folder / name)]
    ours += also
    if not ours or (ours == [folder / "summary.json"] and NOT_ENDED in read_words(ours[0])):
        return None
    for number in itertools.count(1):
        kept = folder / f"earlier-{number}"
        with contextlib.suppress(FileExistsError):
            kept.mkdir()
            break
    for path in ours:
        path.rename(kept / path.name)  # a link is moved, not what it leads to
    return kept


def _holds_a_run(folder: Path) -> bool:
    try:
        parse_json(read_words(folder / "summary.json"), _RunSummary)
    except (OSError, UnicodeDecodeError, msgspec.DecodeError, RecordingError):
        return False
    return True
