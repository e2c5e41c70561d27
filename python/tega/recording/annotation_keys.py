"""Annotate a recording by keys while it is played."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from tega.errors import TegaError
from tega.recording.annotations import KEYS, STATES, AnnotationFile

__all__ = ["AnnotationKeys"]


class _Played(Protocol):
    """Knows the moment of the recording that is played."""

    @property
    def at_s(self) -> float:
        """Seconds from the beginning of the recording."""
        ...


class AnnotationKeys:
    """Codes an event for each key, at the moment of the recording that ``played`` has then; from any thread.

    Raises what :class:`~tega.recording.annotations.AnnotationFile` does.
    """

    def __init__(self, recording: Path, rater: str, played: _Played) -> None:
        self._file = AnnotationFile(recording, rater)
        self._played = played
        self._lock = threading.Lock()

    def __enter__(self) -> Callable[[str], str]:
        """Return the function that takes a key and returns its effect in words."""
        return self.press

    def __exit__(self, *_error: object) -> None:
        """Close the file."""
        with self._lock:
            self._file.close()

    def press(self, key: str) -> str:
        """Code the behaviour of a key, or undo the last step (``u``); return the effect in words, ``""`` for none."""
        t_s = self._played.at_s
        with self._lock:
            try:
                if key == "u":
                    return self._file.undo()
                code = KEYS.get(key)
                return "" if code is None else self._file.press(code, t_s, is_state=code in STATES)
            except (TegaError, OSError, ValueError) as error:  # a full disk; or the file is closed already
                return f"not kept: {error}"
