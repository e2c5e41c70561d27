"""Read the pictures of a scene video, each with its time, and keep how late a camera's are: ``session.offsets.json``.

A video is an MP4 with a time code beside it, or any other; offsets stand beside the recording.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Annotated

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.errors import RecordingError
from tega.runtime.files.foreign_file import read_foreign, read_words
from tega.runtime.files.video import VideoFrames
from tega.runtime.files.whole_file import write_whole

_MOST_TIMES_MIB = 256


def times_path(video: Path) -> Path:
    """Return where a video's time code is: ``cam.mp4`` has ``cam.times.csv``."""
    return video.with_suffix(".times.csv")


def read_times(path: Path) -> list[int]:
    """Read a time code: the columns ``picture`` and ``t_ns``, a line a picture.

    Returns nanoseconds on the clock of the machine that recorded; times that do not rise raise
    :class:`RecordingError`.
    """
    try:
        head, *rows = csv.reader(io.StringIO(read_words(path, most_mib=_MOST_TIMES_MIB)))
        times = [int(t_ns) for _, t_ns in rows]
        numbers = [int(number) for number, _ in rows]
    except (OSError, ValueError, csv.Error) as error:
        raise RecordingError(
            f"{path.name}: no time code of a video: {error}",
            "export the video again with tega-teleop scene export",
        ) from error
    if (
        head != ["picture", "t_ns"]
        or numbers != list(range(len(times)))
        or any(b <= a for a, b in pairwise(times))
    ):
        raise RecordingError(
            f"{path.name}: no time code of a video: picture,t_ns with pictures from 0 on and rising times",
            "export the video again with tega-teleop scene export",
        )
    return times


def read_pictures(
    video: Path, *, begin_s: float = -np.inf, end_s: float = np.inf
) -> Iterator[tuple[float, NDArray[np.uint8]]]:
    """Return times, seconds, and pictures, uint8 (H, W, 3) BGR, of a video file.

    With a time code beside it (:func:`times_path`) times are those of the machine that recorded; without one
    they are seconds from the beginning of the file, as the file says. Fewer pictures than the header or the
    time code says raise :class:`RecordingError`.
    """
    frames = VideoFrames(video)
    number, code = 0, times_path(video)
    try:
        times = read_times(code) if code.exists() else None
        while (times is None or number < len(times)) and (found := frames.read()) is not None:
            t_s = found[0] if times is None else times[number] / 1e9
            number += 1
            if t_s > end_s:
                return
            if t_s >= begin_s:
                yield t_s, found[1]
    finally:
        frames.close()
    if times is None and (fault := frames.fault()):
        raise RecordingError(fault, "export it again")
    if times is not None and number < len(times):
        raise RecordingError(
            f"{video.name}: {number} pictures decode, its time code has {len(times)}",
            "the video was cut short; export it again",
        )


MOST_LATE_S, LEAST_LATE_S = 2.0, -0.1
"""Delays that a camera may have, seconds."""


class CameraOffset(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Delay of a camera.

    ``late_s`` is how much later than the middle of its exposure a picture has its time, ``error_s`` its
    standard error, ``n_edges`` the switchings of the light that it comes from.
    """

    late_s: Annotated[float, msgspec.Meta(ge=LEAST_LATE_S, le=MOST_LATE_S)]
    error_s: Annotated[float, msgspec.Meta(ge=0, le=MOST_LATE_S)]
    n_edges: Annotated[int, msgspec.Meta(ge=1, le=1_000_000)]

    @property
    def late_ns(self) -> int:
        """The delay in nanoseconds."""
        return round(self.late_s * 1e9)


def offsets_path(recording: Path) -> Path:
    """Return where the offsets of a scene recording are: ``session.mcap`` has ``session.offsets.json``."""
    return recording.with_suffix(".offsets.json")


def read_offsets(recording: Path) -> dict[str, CameraOffset]:
    """Return the offsets of a scene recording by camera; none where none were estimated."""
    path = offsets_path(recording)
    if not path.exists():
        return {}
    try:
        return msgspec.json.decode(read_foreign(path, most_mib=1), type=dict[str, CameraOffset])
    except (OSError, msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise RecordingError(
            f"{path.name}: no offsets of scene cameras: {error}",
            "estimate them again with tega-teleop scene offset, or remove the file",
        ) from error


def keep_offset(recording: Path, name: str, offset: CameraOffset) -> None:
    """Write a camera's offset beside its recording; those of its other cameras stay."""
    offsets = read_offsets(recording) | {name: offset}
    text = msgspec.json.format(msgspec.json.encode(offsets), indent=2).decode() + "\n"
    write_whole(offsets_path(recording), text)
