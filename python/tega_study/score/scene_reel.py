"""Find the scene cameras' pictures of recorded trials, which show raters the object."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from tega.recording.replay.followed_file import FollowedFile, PlayedMoment
from tega.records.bus import Bus
from tega.records.display import DisplayPicture
from tega_scene.played import followed_scene

_EVER_NS: Final = 2**62
_BOOT_NS: Final = 600 * 1_000_000_000
"""Files whose clocks began further apart than this are from two boots, nanoseconds."""


class _FilmFile:
    """A scene recording, looked at from trial to trial."""

    def __init__(self, path: Path) -> None:
        self._bus = Bus()
        self._bus.subscribe(DisplayPicture, self._observe, vital=True)
        self.file: FollowedFile = followed_scene(path, self._bus, start_ns=0, end_ns=_EVER_NS)
        self.names = [one.name for one in self.file.followers]
        self.newest: dict[str, NDArray[np.uint8]] = {}

    def _observe(self, one: DisplayPicture) -> None:
        self.newest.pop(one.name, None)
        if one.image is not None:
            self.newest[one.name] = one.image


class SceneReel:
    """Pictures of scene recordings at moments of one trial after another.

    ``paths`` are files that ``scene record`` wrote on the machine of the sessions, or recordings that hold
    scene video. ``cameras`` has their names, sorted.
    """

    def __init__(self, paths: Sequence[Path]) -> None:
        self._films = [_FilmFile(path) for path in paths]
        self.cameras = sorted({name for film in self._films for name in film.names})
        self._mine: list[_FilmFile] = []
        self._n_trials = self._start_ns = 0

    def begin(self, start_ns: int, boot_ns: int) -> None:
        """Go to a trial that began at ``start_ns`` of the machine's clock.

        ``boot_ns`` is the time of day at which that clock was 0, by the trial's recording.
        """
        self._n_trials += 1
        self._start_ns = start_ns
        self._mine = [film for film in self._films if abs(film.file.zero_ns - boot_ns) <= _BOOT_NS]
        for film in self._films:
            film.newest.clear()

    def pictures(self, at_ns: int) -> dict[str, NDArray[np.uint8]]:
        """Return each camera's newest picture, uint8 (H, W, 3), BGR; without those that have none.

        ``at_ns`` is since the trial's start, and rises from call to call.
        """
        found: dict[str, NDArray[np.uint8]] = {}
        for film in self._mine:
            film.file.follow(PlayedMoment(self._n_trials, self._start_ns + at_ns, 0), threading.Event())
            found |= film.newest
        return found

    @property
    def problems(self) -> list[str]:
        """What cannot be shown, a sentence each."""
        return [text for film in self._films for text in film.file.problems.values()]
