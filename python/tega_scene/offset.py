"""Estimate how late a scene camera's pictures reach the machine, by a light that the machine switches.

``flash_light`` makes the terminal white and black at moments that are written down; the camera sees the screen. In the
recorded video the part of the picture that follows best is looked for, over all delays that a camera may have. Each
switching then lies between the last picture before it and the first after it: the delay is the mean of the middles of
these gaps, and its standard error is that of the mean. The offset stands beside the recording (``NAME.offsets.json``);
whatever gives the pictures times (export, play, clips) takes it off.
"""

from __future__ import annotations

import csv
import io
import time
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from tega.errors import InvalidValueError, RecordingError
from tega.recording.mcap_reader import McapReader
from tega.runtime.files.foreign_file import read_words, reports_damage
from tega.runtime.files.whole_file import write_whole
from tega_scene.pictures import LEAST_LATE_S, MOST_LATE_S, CameraOffset
from tega_scene.record import scene_epoch
from tega_scene.video import SceneDecoder

_LEAST_EDGES: Final = 6
_ROWS, _COLUMNS = 12, 16
_LEAST_LIKE: Final = 0.7
_LEAST_SHADES: Final = 8.0
_HELD_S: Final = (0.4, 0.8)
"""How long the light stays on or off: under two flashes a second, which is below what can bring on a seizure."""

_WHITE, _BLACK, _PLAIN = (
    "\x1b[?25l\x1b[107m\x1b[2J",
    "\x1b[?25l\x1b[40m\x1b[2J",
    "\x1b[0m\x1b[2J\x1b[H\x1b[?25h",
)


def flash_light(
    out: Path,
    write: Callable[[str], object],
    *,
    n_flashes: int = 12,
    wait: Callable[[float], object] = time.sleep,
    clock_ns: Callable[[], int] = time.monotonic_ns,
) -> None:
    """Make a terminal white and black by turns, ``n_flashes`` times white, and write down when.

    ``out`` is CSV with the columns ``t_ns``, on the machine's monotonic clock, and ``on``. ``write`` is
    called with text for the terminal, which must appear at once; ``wait`` waits for seconds.
    """
    # Times that no camera's rate and no lamp's mains repeat; the same in every run.
    held_s = np.random.default_rng(23).uniform(*_HELD_S, 2 * n_flashes + 1)
    lines = ["t_ns,on\n"]
    try:
        write(_BLACK)
        wait(float(held_s[-1]))
        for k in range(2 * n_flashes):
            write(_BLACK if k % 2 else _WHITE)
            lines.append(f"{clock_ns()},{1 - k % 2}\n")
            wait(float(held_s[k]))
    finally:
        write(_PLAIN)
    write_whole(out, "".join(lines))


def read_flashes(path: Path) -> list[tuple[int, bool]]:
    """Read when a light was switched: the columns ``t_ns``, rising, and ``on``, 1 and 0 by turns.

    Fewer than six switchings raise :class:`RecordingError`.
    """
    try:
        head, *rows = csv.reader(io.StringIO(read_words(path)))
        edges = [(int(t_ns), {"0": False, "1": True}[on]) for t_ns, on in rows]
    except (OSError, ValueError, KeyError, csv.Error) as error:
        raise RecordingError(
            f"{path.name}: not the moments of a light: {error}", "tega-teleop scene flash writes them"
        ) from error
    in_order = all(a[0] < b[0] and a[1] != b[1] for a, b in pairwise(edges))
    if head != ["t_ns", "on"] or not in_order or len(edges) < _LEAST_EDGES:
        raise RecordingError(
            f"{path.name}: not the moments of a light: t_ns,on with rising times, 1 and 0 by turns, at least "
            f"{_LEAST_EDGES} lines",
            "tega-teleop scene flash writes them",
        )
    return edges


@reports_damage
def measure_offset(recording: Path, name: str, flashes: Path) -> CameraOffset:
    """Estimate a camera's offset from its recorded video; see :func:`estimate_offset`."""
    edges = read_flashes(flashes)
    reader = McapReader(recording)
    topic = f"/scene/{name}/video"
    decoder: SceneDecoder | None = None
    times_ns, shades = [], []
    for message in reader.messages(lambda one: one == topic):
        if message.topic != topic or message.schema != "foxglove.CompressedVideo":
            continue
        decoder = decoder or SceneDecoder(message.value.format)
        decoder.take(message.log_ns, message.value.data)
        if (picture := decoder.image()) is not None:
            times_ns.append(picture[0])
            shades.append(_shades(picture[1]))
    if not times_ns:
        raise RecordingError(
            f"{recording.name}: no camera {name!r}", "tega-teleop recording info lists its topics"
        )
    epoch_ns = scene_epoch(reader)
    return estimate_offset(np.array([t_ns - epoch_ns for t_ns in times_ns]) / 1e9, np.array(shades), edges)


def estimate_offset(
    t_s: NDArray[np.float64], shades: NDArray[np.float64], edges: list[tuple[int, bool]]
) -> CameraOffset:
    """Estimate the delay of frames in which some parts get light and dark.

    ``t_s`` are the pictures' times, float64 (n,), rising; ``shades``, float64 (n, m), grey of m parts of
    each. ``edges`` are when the light was switched, nanoseconds on the same clock, and whether it was on from
    then. If no part follows the light, or too few switchings were filmed, :class:`RecordingError` is raised.
    """
    at_s = np.array([t_ns for t_ns, _ in edges]) / 1e9
    on = np.array([is_on for _, is_on in edges])
    frame_s = float(np.median(np.diff(t_s))) if len(t_s) > 1 else 0.0
    filmed = (at_s > t_s[0] - LEAST_LATE_S) & (at_s < t_s[-1] - MOST_LATE_S / 4)
    if filmed.sum() < _LEAST_EDGES:
        raise RecordingError(
            f"the video shows {filmed.sum()} switchings of the light, {_LEAST_EDGES} are needed",
            "film the screen from before the first flash until after the last",
        )
    about = (t_s > at_s[0] - _HELD_S[0]) & (t_s < at_s[-1] + _HELD_S[0] + MOST_LATE_S)
    t_s, shades = t_s[about], shades[about]
    best = (-1.0, 0.0, 0)
    for late_s in np.arange(LEAST_LATE_S, MOST_LATE_S, frame_s / 2):
        like = _likeness(_is_on(t_s - late_s, at_s, on), shades)
        part = int(np.argmax(like))
        best = max(best, (float(like[part]), float(late_s), part))
    like_, coarse_s, part = best
    shade = shades[:, part]
    known = _is_on(t_s - coarse_s, at_s, on)
    light, dark = float(np.median(shade[known])), float(np.median(shade[~known]))
    if like_ < _LEAST_LIKE or light - dark < _LEAST_SHADES:
        raise RecordingError(
            f"no part of the pictures follows the light: the best correlates by {max(0.0, like_):.2f}, "
            f"{_LEAST_LIKE} is needed",
            "hold the screen near the camera, so that it fills a tenth of the picture, and darken the room",
        )
    lit = shade > (light + dark) / 2
    gaps = []
    for instant_s, is_on in zip(at_s, on, strict=True):
        change = np.flatnonzero((lit[1:] == is_on) & (lit[:-1] != is_on))
        middles = (t_s[change] + t_s[change + 1]) / 2 - instant_s
        near = np.abs(middles - coarse_s)
        if len(near) and near.min() < _HELD_S[0] / 2:
            gaps.append(float(middles[near.argmin()]))
    if len(gaps) < _LEAST_EDGES:
        raise RecordingError(
            f"{len(gaps)} switchings of the light are clear in the video, {_LEAST_EDGES} are needed"
        )
    # Never less than even gaps of one picture's length give.
    spread_s = max(float(np.std(gaps, ddof=1)), frame_s / np.sqrt(12))
    return CameraOffset(float(np.mean(gaps)), spread_s / float(np.sqrt(len(gaps))), len(gaps))


def _is_on(t_s: NDArray[np.float64], at_s: NDArray[np.float64], on: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return whether the light was on at times; before the first switching it was the other way round."""
    last = np.searchsorted(at_s, t_s, side="right") - 1
    return np.where(last < 0, ~on[0], on[np.maximum(last, 0)])


def _likeness(known: NDArray[np.bool_], shades: NDArray[np.float64]) -> NDArray[np.float64]:
    light = known - known.mean()
    parts = shades - shades.mean(0)
    size = np.sqrt((parts**2).sum(0) * (light @ light))
    return np.asarray(light @ parts / np.maximum(size, 1e-9))


def _shades(image: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Return the mean grey of 12 × 16 parts of a picture, float64 (192,)."""
    height, width = (side // n * n for side, n in zip(image.shape[:2], (_ROWS, _COLUMNS), strict=True))
    if not height or not width:
        raise InvalidValueError(f"a picture of {image.shape[1]}×{image.shape[0]} is too small")
    grey = image[:height, :width].mean(2) if image.ndim == 3 else image[:height, :width].astype(np.float64)
    return np.asarray(
        grey.reshape(_ROWS, height // _ROWS, _COLUMNS, width // _COLUMNS).mean((1, 3)).ravel(), np.float64
    )
