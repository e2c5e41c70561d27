"""Prepare a run's output folder, and refuse one that holds anything but an earlier run."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Literal

import msgspec

from tega.errors import ConfigError, RecordingError
from tega.foreign_file import parse_json, read_words
from tega.recording.tables import TABLES
from tega.whole_file import write_whole

SUMMARY_FORMAT = "tega-run"
OUTPUT_NAMES = (*TABLES.values(), "vest.csv", "can.csv", "summary.json", "calibration.toml", "picture.png")


class _RunSummary(msgspec.Struct):
    """Marks a folder as an earlier run's, or as a demo's trials."""

    format: Literal["tega-run", "tega-demo"]


def prepare_folder(folder: Path) -> None:
    """Make a folder ready for a run's outputs.

    It may be new, empty, or hold an earlier run (recognised by its ``summary.json``); an earlier run's own files
    are then removed, anything else in the folder is left alone. A ``summary.json`` that says that the run has not ended
    is written at once: of a run that is killed it stays, and the next run knows the folder by it.

    Args:
        folder: The folder.

    Raises:
        ConfigError: It is a file, or holds something that is not an earlier run.
    """
    if folder.exists() and not folder.is_dir():
        raise ConfigError(f"output folder {folder.name!r} is a file", "name a folder")
    if folder.is_dir() and any(folder.iterdir()) and not _holds_a_run(folder):
        raise ConfigError(
            f"output folder {folder.name!r} is not empty and holds no earlier run",
            "name a new or empty folder, or one whose summary.json was written by TEGA",
        )
    folder.mkdir(parents=True, exist_ok=True)
    for name in OUTPUT_NAMES:
        (folder / name).unlink(missing_ok=True)
    begun = {"format": SUMMARY_FORMAT, "version": 1, "ended": "not yet, or it was killed"}
    write_whole(folder / "summary.json", json.dumps(begun, indent=2) + "\n")


def _holds_a_run(folder: Path) -> bool:
    try:
        parse_json(read_words(folder / "summary.json"), _RunSummary)
    except (OSError, UnicodeDecodeError, msgspec.DecodeError, RecordingError):
        return False
    return True
