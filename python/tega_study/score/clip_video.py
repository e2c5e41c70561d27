"""Write a recorded trial as a video of its fingertips and scene, every picture whole, so that one can step through it.

Pictures, or on the simulated bench, which has none, lines of the object's truth; nothing of the vest, no measure of
touch and no muscle signal. Scene cameras show raters the object.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from tega.errors import RecordingError
from tega.recording.replay.followed_file import FollowedFile, PlayedMoment
from tega.records.bus import Bus
from tega.records.display import DisplayPicture
from tega.runtime.lifecycle import require
from tega_scene.played import followed_scene
from tega_study.score.recorded import RecordedTrial, Reel, read_reel

_EVER_NS: Final = 2**62
_BOOT_NS: Final = 600 * 1_000_000_000
"""Files whose clocks began further apart than this are from two boots, nanoseconds."""


_Newest = dict[str, NDArray[np.uint8]]


def _observe(newest: _Newest, one: DisplayPicture) -> None:
    newest.pop(one.name, None)
    if one.image is not None:
        newest[one.name] = one.image


class SceneReel:
    """Pictures of scene recordings at moments of one trial after another; ``cameras`` has their names, sorted.

    ``paths`` are files that ``scene record`` wrote on the machine of the sessions, or recordings that hold
    scene video.
    """

    def __init__(self, paths: Sequence[Path]) -> None:
        self._films: list[tuple[FollowedFile, _Newest]] = []
        for path in paths:
            bus, newest = Bus(), _Newest()
            bus.subscribe(DisplayPicture, partial(_observe, newest), vital=True)
            self._films.append((followed_scene(path, bus, start_ns=0, end_ns=_EVER_NS), newest))
        self.cameras = sorted({one.name for file, _ in self._films for one in file.followers})
        self._n_trials = self._start_ns = self._boot_ns = 0

    def begin(self, start_ns: int, boot_ns: int) -> None:
        """Go to a trial that began at ``start_ns`` of the machine's clock.

        ``boot_ns`` is the time of day at which that clock was 0, by the trial's recording.
        """
        self._n_trials += 1
        self._start_ns, self._boot_ns = start_ns, boot_ns
        for _, newest in self._films:
            newest.clear()

    def pictures(self, at_ns: int) -> _Newest:
        """Return each camera's newest picture, uint8 (H, W, 3), BGR; without those that have none.

        ``at_ns`` is since the trial's start, and rises from call to call.
        """
        found: _Newest = {}
        for file, newest in self._films:
            if abs(file.zero_ns - self._boot_ns) <= _BOOT_NS:
                file.follow(PlayedMoment(self._n_trials, self._start_ns + at_ns, 0), threading.Event())
                found |= newest
        return found

    @property
    def problems(self) -> list[str]:
        """What cannot be shown, a sentence each."""
        return [text for file, _ in self._films for text in file.problems.values()]


RATE_HZ: Final = 30.0
"""Pictures a second of a clip."""

_WIDTH, _HEIGHT = 320, 240
_WIDE, _TALL = 640, 480
_LINE = 28
_LIGHT = (230, 230, 230)


def write_clip(trial: RecordedTrial, path: Path, scene: SceneReel | None = None) -> float:
    """Write a trial as Motion JPEG in an AVI file; return its length in seconds, the trial's to a picture."""
    cv2 = require("cv2", driver="a clip", extra="record")
    reel = read_reel(trial)
    n_pictures = max(1, round(trial.length_ns * 1e-9 * RATE_HZ))
    size = (_WIDTH * max(len(reel.fingers), 2), _HEIGHT + _LINE)
    if scene is not None and reel.boot_ns is not None:
        scene.begin(trial.start_ns, reel.boot_ns)
        size = (max(size[0], _WIDE * len(scene.cameras)), size[1] + _TALL + _LINE)
    else:
        scene = None
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), RATE_HZ, size)
    try:
        if not writer.isOpened():
            raise RecordingError(f"{path}: the video cannot be written", "is the folder writable?")
        for k in range(n_pictures):
            writer.write(_picture(cv2, reel, scene, round(k / RATE_HZ * 1e9), size))
    finally:
        writer.release()
    return n_pictures / RATE_HZ


def _picture(
    cv2: Any, reel: Reel, scene: SceneReel | None, at_ns: int, size: tuple[int, int]
) -> NDArray[np.uint8]:
    canvas = np.zeros((size[1], size[0], 3), np.uint8)

    def say(text: str, place: tuple[int, int], scale: float) -> None:
        cv2.putText(canvas, text, place, cv2.FONT_HERSHEY_SIMPLEX, scale, _LIGHT, 1, cv2.LINE_AA)

    for k, finger in enumerate(reel.fingers):
        frame, left = reel.picture(finger, at_ns), k * _WIDTH
        say(finger if frame is not None else f"{finger}: no picture", (left + 8, 20), 0.55)
        if frame is not None:
            canvas[_LINE : _LINE + _HEIGHT, left : left + _WIDTH] = cv2.resize(frame, (_WIDTH, _HEIGHT))
    for k, line in enumerate(reel.lines(at_ns)):
        say(line, (8, 60 + 34 * k), 0.7)
    if scene is not None:
        filmed, top = scene.pictures(at_ns), _HEIGHT + _LINE
        for k, camera in enumerate(scene.cameras):
            image, left = filmed.get(camera), k * _WIDE
            say(camera if image is not None else f"{camera}: no picture", (left + 8, top + 20), 0.55)
            if image is not None:
                scale = min(_WIDE / image.shape[1], _TALL / image.shape[0])
                wide, tall = (max(1, int(side * scale)) for side in image.shape[1::-1])
                canvas[top + _LINE : top + _LINE + tall, left : left + wide] = cv2.resize(image, (wide, tall))
    return canvas
