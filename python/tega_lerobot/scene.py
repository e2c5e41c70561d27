"""Lay a scene camera's video on an episode's frames: each shows the newest picture by its time."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from tega.errors import RecordingError
from tega.recording.mcap_index import open_indexed
from tega.recording.mcap_reader import McapReader
from tega.runtime.files.plain_name import plain_name
from tega_lerobot.episode import Episode
from tega_scene.pictures import read_pictures, times_path
from tega_scene.record import export_camera, filmed_cameras

_BEFORE_S: Final = 1.0
"""A picture older than this at the first frame is none of the episode; likewise at the last."""


def check_scene(video: Path) -> tuple[int, int]:
    """Return height and width of a video's pictures.

    One without a time code raises :class:`RecordingError`, since its times are unknown.
    """
    if not times_path(video).is_file():
        raise RecordingError(
            f"{video.name}: has no time code {times_path(video).name}",
            "write both with tega-teleop scene export",
        )
    first = next(read_pictures(video), None)
    if first is None:
        raise RecordingError(f"{video.name}: has no pictures", "export it again")
    height, width = first[1].shape[:2]
    return height, width


def own_scenes(recording: Path, beside: Path) -> dict[str, Path]:
    """Write the films of a recording's own cameras as videos with time codes, and return them by name."""
    if "foxglove.CompressedVideo" not in open_indexed(recording).topics.values():
        return {}  # by the index at its end; the file is passed over only where it has films
    names = filmed_cameras(McapReader(recording))
    for name in names:
        plain_name(name, subject="camera", source=recording.name)
        export_camera(recording, name, beside / f"{name}.mp4")
    return {name: beside / f"{name}.mp4" for name in names}


def scene_frames(video: Path, episode: Episode) -> Iterator[tuple[NDArray[np.uint8], int]]:
    """Return pictures, uint8 (H, W, 3) BGR, and how many frames of an episode in a row show each.

    The video has its time code and must be of the same machine, and cover the episode.
    """
    begin_s = (int(episode.tables["tega"].get("start_ns", "0")) + episode.start_ns) / 1e9
    at_s = begin_s + np.arange(episode.n_frames) / episode.fps
    held, held_s, k = None, -np.inf, 0
    for t_s, image in read_pictures(video, begin_s=begin_s - _BEFORE_S, end_s=float(at_s[-1])):
        if held is None and t_s > begin_s:
            break
        n = int(np.searchsorted(at_s, t_s)) - k
        if held is not None and n > 0:
            yield held, n
            k += n
        held, held_s = image, t_s
    if held is None or at_s[-1] - held_s > _BEFORE_S:
        raise RecordingError(
            f"{video.name}: does not cover {episode.path.name}, which goes from {begin_s:.3f} to {at_s[-1]:.3f} s of "
            "the machine's clock",
            "name the video that was recorded beside it, on the same machine",
        )
    yield held, episode.n_frames - k
