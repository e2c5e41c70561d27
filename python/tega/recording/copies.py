"""Note copies of a participant's recording beside it, so that a study can name them if the person withdraws."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Final

from tega.runtime.files.whole_file import open_to_append

_LOG = logging.getLogger(__name__)

NOTES: Final = "elsewhere.txt"
"""File beside a recording: one absolute path of a copy a line. Copies have one, too, so that their copies are found."""


def note_copy(source: Path, copy: Path) -> None:
    """Note the existing folder of a copy, if the source is part of a study or itself such a copy."""
    folder = source.absolute().parent
    notes = folder / NOTES
    of_study = any((parent / "study.toml").is_file() for parent in folder.parents)
    if not (of_study or notes.is_file()):
        return
    try:
        with open_to_append(notes) as file:
            file.write(f"{copy.absolute()}\n".encode())
        with open_to_append(copy / NOTES):
            pass
    except OSError as error:
        _LOG.warning("%s: the copy %s cannot be noted: %s", source, copy, error)
