"""Resample a recording at a fixed rate: each frame has the newest earlier values, and nothing from later."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from tega.errors import RecordingError
from tega.hand import JOINT_NAMES
from tega.recording.decode_ahead import decode_ahead
from tega.recording.mcap_reader import McapReader, Message, read_picture
from tega.recording.origin import span
from tega.records import Contact
from tega.records.arm import PoseNumbers
from tega.records.schema import read
from tega.runtime.files.foreign_file import tells_damage

if TYPE_CHECKING:
    from numpy.typing import NDArray


_S = 1_000_000_000
# One wrong time would ask for memory for all the frames up to it.
_MOST_S = 24 * 3600
_MARKERS = {"/run/marker", "/markers"}
_ARM_MEASURED, _ARM_TARGET = "/arm/measured", "/arm/target"
# What a contact has in units of length and force, where its metric gives them.
_MEASURED = ("area_mm2", "depth_mm", "force_n")


class Column(NamedTuple):
    """One feature of all frames.

    Attributes:
        values: float32, shape (frames, ...).
        names: Names of the values of one frame; names of its axes if it has two.
    """

    values: NDArray[np.float32]
    names: list[str]


class EpisodeMarker(NamedTuple):
    """A marked moment.

    Attributes:
        t_ns: When, nanoseconds since the start of the session.
        text: Text of the mark.
        source: Source of the mark.
    """

    t_ns: int
    text: str
    source: str


class Episode(NamedTuple):
    """A recording at a fixed rate.

    Attributes:
        path: Its file.
        fps: Frames per second.
        start_ns: Time of the first frame, nanoseconds since the start of the session.
        n_frames: How many.
        columns: By name of the feature, pictures left out.
        shapes: Height and width of the pictures, by finger.
        shown: By finger, how many frames show each of its pictures, in the order of the file.
        markers: Marked moments, in the order of their times.
        tables: The recording's metadata.
    """

    path: Path
    fps: int
    start_ns: int
    n_frames: int
    columns: dict[str, Column]
    shapes: dict[str, tuple[int, int]]
    shown: dict[str, NDArray[np.int64]]
    markers: list[EpisodeMarker]
    tables: dict[str, dict[str, str]]

    def pictures(self) -> Iterator[tuple[str, NDArray[np.uint8], int]]:
        """Read the pictures: finger, picture as uint8 (H, W, 3) in BGR, and how many frames in a row show it."""
        places = dict.fromkeys(self.shown, 0)
        messages = McapReader(self.path).messages(lambda topic: topic.endswith("/image"))
        for message, decoding in decode_ahead(messages):
            finger = _finger(message, "/image")
            if finger:
                shown, place = self.shown.get(finger, ()), places.get(finger, 0)
                if place >= len(shown):  # two topics share a finger's name
                    raise RecordingError(
                        f"{self.path.name}: damaged, or not written by TEGA: pictures of {finger} in two topics",
                        "inspect says how far it can be read",
                    )
                n_frames = int(shown[place])
                places[finger] = place + 1
                if n_frames and decoding is not None:
                    yield finger, decoding.result(), n_frames


class _Stream:
    """Times and values of one topic."""

    def __init__(self) -> None:
        self.times: list[int] = []
        self.values: list[Any] = []

    def add(self, t_ns: int, value: Any) -> None:
        self.times.append(t_ns)
        self.values.append(value)

    def newest(self, grid_ns: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return for each time which item was the newest."""
        newest: NDArray[np.int64] = np.searchsorted(np.array(self.times, np.int64), grid_ns, side="right") - 1
        return newest

    def at(self, grid_ns: NDArray[np.int64]) -> NDArray[np.float32]:
        """Return the newest value at each time; NaN and values outside float32 become 0."""
        rows = np.array(self.values, np.float64)[self.newest(grid_ns)]
        with np.errstate(over="ignore"):
            stored = rows.astype(np.float32)
        return np.nan_to_num(stored, posinf=0.0, neginf=0.0)


@tells_damage
def read_episode(path: Path, *, fps: int) -> Episode:
    """Read a recording, pictures left out, and lay its streams on frames of a fixed rate.

    The first frame is when every stream has begun, the last one when the loop ended. A frame has the newest item of
    each stream that had been received, or that the loop had taken in, by its time.

    Args:
        path: The recording.
        fps: Frames per second.

    Raises:
        RecordingError: It cannot be read, or is shorter than a frame or longer than 24 h.
    """
    reader, streams = McapReader(path), dict[str, _Stream]()
    shapes: dict[str, tuple[int, int]] = {}
    markers: list[EpisodeMarker] = []
    epoch_ns = layout = None
    for message in reader.messages(lambda topic: not topic.endswith("/image") or topic not in streams):
        if epoch_ns is None:
            epoch_ns = int(reader.metadata.get("tega", {}).get("epoch_ns", "0"))
            layout = reader.metadata.get("sources", {})
        stream = streams.setdefault(message.topic, _Stream())
        t_ns = message.log_ns - epoch_ns
        if finger := _finger(message, "/image"):
            if finger not in shapes:
                shapes[finger] = read_picture(message).shape[:2]
            stream.add(t_ns, None)
        elif message.topic in _MARKERS:
            markers.append(EpisodeMarker(message.value.t_ns, message.value.text, message.value.source))
        else:
            _keep(stream, message, t_ns)
    if not layout:
        raise RecordingError(f"{path.name}: no recording of a session", "name a file made with --record")
    used = {topic: stream for topic, stream in streams.items() if stream.values}
    if not used:
        raise RecordingError(f"{path.name}: holds no stream", "the run had not begun")
    for topic, stream in used.items():
        if not any(value is None or np.size(value) for value in stream.values):  # None: a picture
            raise RecordingError(
                f"{path.name}: the records of {topic} hold no numbers", "inspect says how far it can be read"
            )
    # Before somebody has taken hold of the arm it has no target.
    begun = [stream.times[0] for topic, stream in used.items() if topic != _ARM_TARGET]
    begin_ns = max(*begun, span(reader.metadata).from_ns)
    samples = _Samples(used.get("/emg/samples"), fps)
    begin_ns = max(begin_ns, samples.begin_ns)
    led = ("/vest/", "/hand/", "/tactile/", "/arm/")
    end_ns = max((s.times[-1] for topic, s in used.items() if topic.startswith(led)), default=begin_ns)
    n_frames = _count_frames(path.name, end_ns - begin_ns, fps)
    grid_ns = begin_ns + np.arange(n_frames, dtype=np.int64) * _S // fps
    columns, shown = _columns(used, grid_ns, samples), {}
    for finger in shapes:
        newest = used[f"/tactile/{finger}/image"].newest(grid_ns)
        shown[finger] = np.bincount(newest, minlength=len(used[f"/tactile/{finger}/image"].times))
    markers.sort()
    return Episode(path, fps, begin_ns, int(n_frames), columns, shapes, shown, markers, reader.metadata)


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


def _keep(stream: _Stream, message: Message, t_ns: int) -> None:
    value, topic = message.value, message.topic
    match message.schema:
        case "tega.Contact":
            contact = read(Contact, value, finger="")
            known = (getattr(contact, name) for name in _MEASURED)
            numbers = (np.nan if one is None else one for one in known)
            stream.add(t_ns, (contact.eda, contact.cci, contact.in_contact, *numbers))
        case "tega.EmgSamples":
            stream.add(t_ns, np.array(value.samples, np.float32).reshape(-1, value.n_channels))
        case "tega.Levels":
            stream.add(t_ns, (*value.channels, value.fused))
        case "tega.VestFrame" if topic == "/vest/frame":
            stream.add(t_ns, tuple(value.intensities))
        case "foxglove.CompressedVideo":
            stream.add(t_ns, None)  # decoded when it is laid on the frames
        case "tega.CanFrames":
            stream.add(t_ns, (value.level,))
        case "foxglove.JointStates":
            stream.add(t_ns, tuple(joint.position for joint in value.joints))
        case "foxglove.PoseInFrame" if topic in {_ARM_MEASURED, _ARM_TARGET}:
            place, turn = value.pose.position, value.pose.orientation
            stream.add(t_ns, (place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w))
        case _:
            pass


class _Samples:
    """The newest EMG samples at each frame: as many as come in one, rounded up."""

    def __init__(self, stream: _Stream | None, fps: int) -> None:
        self.begin_ns = 0
        self._stream = stream
        if stream is None:
            return
        self._rows = np.concatenate(stream.values)
        self._ends = np.cumsum([len(chunk) for chunk in stream.values])
        spent_s = (stream.times[-1] - stream.times[0]) / _S
        rate_hz = (self._ends[-1] - self._ends[0]) / spent_s if spent_s > 0 else float(fps)
        self._n = max(1, int(np.ceil(round(rate_hz / fps, 3))))
        enough = int(np.searchsorted(self._ends, self._n))
        self.begin_ns = stream.times[min(enough, len(stream.times) - 1)]

    def column(self, grid_ns: NDArray[np.int64]) -> Column | None:
        if self._stream is None:
            return None
        ends = self._ends[self._stream.newest(grid_ns)]
        windows = self._rows[np.maximum(ends[:, None] - self._n + np.arange(self._n), 0)]
        return Column(np.nan_to_num(windows), ["sample", "channel"])


def _columns(streams: dict[str, _Stream], grid_ns: NDArray[np.int64], samples: _Samples) -> dict[str, Column]:
    columns: dict[str, Column] = {}
    if joints := streams.get("/hand/joints"):
        columns["observation.state"] = Column(joints.at(grid_ns), list(JOINT_NAMES))
    contacts = [topic for topic in sorted(streams) if topic.endswith("/contact")]
    if contacts:
        by_finger = [streams[topic].at(grid_ns) for topic in contacts]
        for feature, part, what in (
            ("observation.touch", slice(0, 3), ("eda", "cci", "in_contact")),
            ("observation.touch_si", slice(3, None), _MEASURED),
        ):
            values = np.concatenate([rows[:, part] for rows in by_finger], axis=1)
            names = [f"{topic.split('/')[2]}.{name}" for topic in contacts for name in what]
            if part.start == 0 or any(np.isfinite(_all(streams[topic])[:, part]).any() for topic in contacts):
                columns[feature] = Column(values, names)
    images = [
        topic for topic in sorted(streams) if topic.startswith("/tactile/") and topic.endswith("/image")
    ]
    if images:
        ages_s = [_age_s(streams[topic], grid_ns) for topic in images]
        columns["observation.image_age"] = Column(
            np.stack(ages_s, axis=1), [f"{topic.split('/')[2]}.s" for topic in images]
        )
    if (window := samples.column(grid_ns)) is not None:
        columns["observation.emg"] = window
    if levels := streams.get("/emg/levels"):
        values = levels.at(grid_ns)
        names = [*_numbered("ch", values.shape[1] - 1), "fused"]
        columns["observation.emg_levels"] = Column(values, names)
    if vest := streams.get("/vest/frame"):
        values = vest.at(grid_ns)
        columns["observation.vest"] = Column(values, _numbered("motor", values.shape[1]))
    arm = streams.get(_ARM_MEASURED)
    if arm is not None:
        columns["observation.arm"] = Column(arm.at(grid_ns), [f"arm.{name}" for name in PoseNumbers.table])
    asked: list[Column] = []
    if hand := streams.get("/hand/frames"):
        asked.append(Column(hand.at(grid_ns), ["grasp_level"]))
    if arm is not None:
        names = [f"arm_target.{name}" for name in PoseNumbers.table]
        asked.append(Column(_targets(streams.get(_ARM_TARGET), arm, grid_ns), names))
    if asked:
        values = np.concatenate([column.values for column in asked], axis=1)
        columns["action"] = Column(values, [name for column in asked for name in column.names])
    return columns


def _targets(target: _Stream | None, arm: _Stream, grid_ns: NDArray[np.int64]) -> NDArray[np.float32]:
    """Return the arm's target at each frame; before the first target, the arm's pose."""
    where = arm.at(grid_ns)
    if target is None or not target.times:
        return where
    known = target.newest(grid_ns) >= 0
    where[known] = target.at(grid_ns[known])
    return where


def _all(stream: _Stream) -> NDArray[np.float64]:
    return np.array(stream.values, np.float64)


def _age_s(stream: _Stream, grid_ns: NDArray[np.int64]) -> NDArray[np.float32]:
    times = np.array(stream.times, np.int64)
    return ((grid_ns - times[stream.newest(grid_ns)]) / _S).astype(np.float32)


def _numbered(name: str, n: int) -> list[str]:
    return [f"{name}{k}" for k in range(1, n + 1)]
