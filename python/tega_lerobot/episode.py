"""Resample a recording at a fixed rate: each frame has the newest earlier values, and nothing from later.

A scene camera's video is laid on the frames by its time code: each shows the newest picture by its time.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from functools import cache
from operator import attrgetter, itemgetter
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega.errors import RecordingError
from tega.recording.mcap_index import open_indexed
from tega.recording.mcap_reader import McapReader, Message, Progress, read_picture
from tega.recording.origin import span
from tega.recording.pictures import PICTURES, compute_ahead
from tega.recording.record_columns import find_kind, record_of
from tega.records import Marker
from tega.records.schema import read
from tega.runtime.files.foreign_file import plain_name, reports_damage
from tega_lerobot.streams import ARM_TARGET, OBSERVED, Chunks, Column, Stream, columns_of
from tega_scene.pictures import read_pictures, times_path
from tega_scene.record import export_camera, filmed_cameras

_S = 1_000_000_000
# One wrong time would ask for memory for all the frames up to it.
_MOST_S = 24 * 3600
_MARKERS = {"/run/marker", "/markers"}
# Cells of the pictures, seven kilobytes each: nobody reads them here.
_FRAMES = re.compile("/tactile/[^/]+/frame")

_BEFORE_S: Final = 1.0
"""A picture older than this at the first frame is none of the episode; likewise at the last."""


class Episode(NamedTuple):
    """A recording at a fixed rate.

    Attributes:
        start_ns: Time of the first frame, from the start of the session.
        streams: Times and numbers by topic.
        shapes: Height and width of the pictures, by finger.
        markers: Marked moments, in the order of their times.
        first: Number of the first frame; not 0 in later parts of an episode.
    """

    path: Path
    fps: int
    start_ns: int
    n_frames: int
    streams: dict[str, Stream]
    shapes: dict[str, tuple[int, int]]
    markers: list[Marker]
    tables: dict[str, dict[str, str]]
    progress: Progress | None = None
    first: int = 0

    @property
    def grid_ns(self) -> NDArray[np.int64]:
        """Times of the frames."""
        numbers = self.first + np.arange(self.n_frames, dtype=np.int64)
        return self.start_ns + numbers * _S // self.fps

    @property
    def columns(self) -> dict[str, Column]:
        """Features of the frames by name, without pictures."""
        return columns_of(self.streams, self.grid_ns)

    def parts(self, most: int) -> Iterator[Episode]:
        """Divide the episode into parts of so many frames: the columns of a whole hour take 80 MB."""
        for first in range(0, self.n_frames, most):
            yield self._replace(first=first, n_frames=min(most, self.n_frames - first))

    def _displayed(self, finger: str) -> NDArray[np.int32]:
        """Return how many frames show each of a finger's pictures, in the order of the file."""
        stream = self.streams[f"/tactile/{finger}/image"]
        first, _, newest = stream.around(self.grid_ns)
        return np.bincount(first + newest, minlength=stream.n).astype(np.int32)

    def pictures(self) -> Iterator[tuple[str, NDArray[np.uint8], int]]:
        """Read the pictures: finger, picture as uint8 (H, W, 3) in BGR, and how many frames in a row show it."""
        reader = McapReader(self.path)
        reader.progress = self.progress or reader.progress
        messages = reader.messages(lambda topic: topic.endswith("/image"), every=False)
        for (finger, _, n_frames), image in compute_ahead(
            self._shown(messages), itemgetter(0), lambda one: read_picture(one[1])
        ):
            assert image is not None
            yield finger, image, n_frames

    def _shown(self, messages: Iterable[Message]) -> Iterator[tuple[str, Message, int]]:
        """Yield each picture that frames show, not decoded, after its finger, and how many in a row do."""
        shown = {finger: self._displayed(finger) for finger in self.shapes}
        places = dict.fromkeys(shown, 0)
        for message in messages:
            finger = _finger(message, "/image")
            if finger:
                displayed, place = shown.get(finger, ()), places.get(finger, 0)
                if place >= len(displayed):  # two topics share a finger's name
                    raise RecordingError(
                        f"{self.path.name}: damaged, or not written by TEGA: pictures of {finger} in two topics",
                        "inspect says how far it can be read",
                    )
                places[finger] = place + 1
                if displayed[place] and message.schema in PICTURES and message.value is not None:
                    yield finger, message, int(displayed[place])


@reports_damage
def read_episode(path: Path, *, fps: int, progress: Progress | None = None) -> Episode:
    """Read a recording, pictures left out, and lay its streams on frames of a fixed rate.

    The first frame is when every stream has begun, the last one when the loop ended. A frame has the newest
    item of each stream that had been received, or that the loop had taken in, by its time. One shorter than a
    frame or longer than 24 h raises :class:`RecordingError`.
    """
    reader, streams = McapReader(path), dict[str, Stream]()
    reader.progress = progress or reader.progress
    shapes: dict[str, tuple[int, int]] = {}
    markers: list[Marker] = []
    epoch_ns = layout = None
    for message in reader.messages(lambda topic: not _FRAMES.fullmatch(topic), every=False):
        if epoch_ns is None:
            epoch_ns = int(reader.metadata.get("tega", {}).get("epoch_ns", "0"))
            layout = reader.metadata.get("sources", {})
        stream = streams.get(message.topic)
        if stream is None:
            stream = streams[message.topic] = Chunks() if message.schema == "tega.EmgSamples" else Stream()
        t_ns = message.log_ns - epoch_ns
        if finger := _finger(message, "/image"):
            if finger not in shapes:
                shapes[finger] = read_picture(message).shape[:2]
            stream.add(t_ns, None)
        elif message.topic in _MARKERS:
            markers.append(read(Marker, message.value))
        else:
            _keep(stream, message, t_ns)
    reader.warn_cut()
    if not layout:
        raise RecordingError(f"{path.name}: no recording of a session", "name a file made with --record")
    used = {topic: stream for topic, stream in streams.items() if stream.n or isinstance(stream, Chunks)}
    if not used:
        raise RecordingError(f"{path.name}: holds no stream", "the run had not begun")
    for topic, stream in used.items():
        if not ((stream.n and stream.width) or topic.endswith(("/image", "/video"))):
            raise RecordingError(
                f"{path.name}: the records of {topic} hold no numbers", "inspect says how far it can be read"
            )
    # Before somebody has taken hold of the arm it has no target.
    needed = (stream for topic, stream in used.items() if topic != ARM_TARGET)
    begun = [one.fit(fps) if isinstance(one, Chunks) else one.first_ns for one in needed]
    begin_ns = max(*begun, span(reader.metadata).from_ns)
    led = ("/vest/", "/hand/", "/tactile/", "/arm/")
    end_ns = max((s.last_ns for topic, s in used.items() if topic.startswith(led)), default=begin_ns)
    n_frames = _count_frames(path.name, end_ns - begin_ns, fps)
    markers.sort(key=attrgetter("t_ns", "text", "source"))
    return Episode(path, fps, begin_ns, n_frames, used, shapes, markers, reader.metadata, progress)


def _count_frames(name: str, length_ns: int, fps: int) -> int:
    n_frames = length_ns * fps // _S + 1
    if n_frames < 1:
        raise RecordingError(f"{name}: has no time at which all of its streams were there")
    if n_frames > _MOST_S * fps:
        raise RecordingError(
            f"{name}: its streams reach over {n_frames / fps / 3600:.0f} h, at most {_MOST_S // 3600} h are read",
            "is a time in it wrong? inspect lists them; else trim it into parts",
        )
    return n_frames


def _finger(message: Message, ending: str) -> str:
    topic = message.topic
    return topic.split("/")[2] if topic.startswith("/tactile/") and topic.endswith(ending) else ""


_kind_of = cache(find_kind)


def _keep(stream: Stream, message: Message, t_ns: int) -> None:
    value = message.value
    if isinstance(stream, Chunks):
        stream.add_samples(t_ns, value.samples, value.n_channels)
    elif message.schema == "foxglove.CompressedVideo":
        stream.add(t_ns, None)  # decoded when it is laid on the frames
    elif (found := _kind_of(message.topic, message.schema)) is not None and found[0] in OBSERVED:
        kind, named = found
        stream.add(t_ns, OBSERVED[kind](record_of(kind, message, named, 0)))


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
