"""Record scene cameras into an MCAP file on the machine's clock, and export them as MP4 with a time code.

Every picture is one ``foxglove.CompressedVideo`` message on ``/scene/NAME/video``. Its time is when the machine had it,
on the monotonic clock that sessions of the same machine keep, so that a trial of a study is found in it without more.
Cameras that a session's settings name are in the session's own recording instead (:mod:`tega_scene.part`).
"""

from __future__ import annotations

import tempfile
import threading
import time
from collections.abc import Callable, Mapping
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import Any, Final, NamedTuple

import msgspec

from tega.errors import RecordingError
from tega.recording.mcap_reader import McapReader, table_ns
from tega.recording.record_channels import McapFile
from tega.runtime.files.foreign_file import plain_name, reports_damage
from tega.runtime.files.whole_file import write_whole
from tega.runtime.lifecycle import require
from tega_scene.filming import CameraTally, Filming
from tega_scene.layout import TagLayout, load_layout
from tega_scene.lens import Lens, load_lens
from tega_scene.pictures import read_offsets, times_path
from tega_scene.settings import SceneConfig, VideoFormat
from tega_scene.video import SceneVideo, stands_alone

TABLE = "tega_scene"
_TICKS: Final = 90_000


def record_cameras(
    out: Path,
    cameras: Mapping[str, str],
    *,
    size: tuple[int, int],
    rate_hz: float,
    stop: Callable[[], bool],
    video: VideoFormat = "h264",
) -> dict[str, CameraTally]:
    """Record until a stop is requested, or until every camera has stopped.

    ``out`` is the MCAP file, which must not exist. ``cameras`` are number, device, address or video file by
    plain name; where one does not open, nothing is recorded. ``size`` is width and height, pixels;
    ``rate_hz`` pictures a second. ``stop`` is asked twenty times a second.
    """
    films: dict[str, Filming] = {}
    lock = threading.Lock()

    def write(camera: str, packets: list[tuple[int, bytes]]) -> None:
        """Write packets, which have times on the monotonic clock; each camera has a thread that does so."""
        with lock:
            for t_ns, data in packets:
                file.write(SceneVideo(camera=camera, t_ns=t_ns, data=data, video=video), t_ns)

    for name, source in cameras.items():
        plain_name(name, subject="camera", source="--camera")
        settings = SceneConfig(
            name=name, source=source, width=size[0], height=size[1], rate_hz=rate_hz, video=video
        )
        films[name] = Filming(settings, give=partial(write, name))
        films[name].open()
    # The file is made once every camera is open.
    file = McapFile(out, lossless=True)
    file.epoch_ns = time.time_ns() - time.monotonic_ns()
    file.metadata(TABLE, {"clock": "monotonic", "epoch_ns": str(file.epoch_ns)})
    try:
        for film in films.values():
            film.begin(0)
            film.start()
        while not stop() and any(film.is_alive for film in films.values()):
            time.sleep(0.05)
    finally:
        for film in films.values():
            film.leave()
        tallies = {name: film.tally for name, film in films.items()}
        for name, tally in tallies.items():
            reported = {key: str(value) for key, value in msgspec.to_builtins(tally).items()}
            file.metadata(f"{TABLE}.{name}", reported)
        file.close()
    return tallies


@reports_damage
def export_camera(recording: Path, name: str, out: Path) -> int:
    """Write a camera of a recording as MP4, without re-encoding; return how many pictures.

    The time code beside it is ``out`` with the suffix ``.times.csv``. The times are less the camera's offset,
    where one was estimated (:mod:`tega_scene.offset`).
    """
    av = require("av", driver="export", extra="lerobot")
    plain_name(name, subject="camera", source=recording.name)
    topic = f"/scene/{name}/video"
    reader = McapReader(recording)
    times: list[int] = []
    others: set[str] = set()
    kind = ""
    with tempfile.TemporaryDirectory() as folder:
        stream = Path(folder, "stream")
        with stream.open("wb") as raw:
            for message in reader.messages(lambda one: one == topic):
                if message.topic != topic or message.schema != "foxglove.CompressedVideo":
                    others.add(message.topic)
                    continue
                kind = message.value.format
                if not times and kind in {"h264", "av1"} and not stands_alone(kind, message.value.data):
                    continue  # a part of a film: no player can begin with this one
                raw.write(message.value.data)
                times.append(message.log_ns)
        if kind not in {"h264", "av1"}:
            there = ", ".join(sorted(others)) or "none"
            raise RecordingError(f"{recording.name}: no camera {name!r}", f"its topics: {there}")
        epoch_ns = scene_epoch(reader)
        if not times:
            raise RecordingError(
                f"{recording.name}: {name} is no whole {kind} video: no picture stands alone"
            )
        try:
            number = _mux(av, stream, kind, times, out)
        except Exception as error:  # of a damaged stream the library raises what it likes
            out.unlink(missing_ok=True)
            raise RecordingError(f"{recording.name}: {name} is no whole {kind} video: {error}") from error
    if number != len(times):
        raise RecordingError(f"{recording.name}: {number} of {len(times)} pictures of {name} are whole")
    offset = read_offsets(recording).get(name)
    zero_ns = epoch_ns + (0 if offset is None else offset.late_ns)
    lines = [f"{k},{t_ns - zero_ns}\n" for k, t_ns in enumerate(times)]
    write_whole(times_path(out), "picture,t_ns\n" + "".join(lines))
    return len(times)


def scene_epoch(reader: McapReader) -> int:
    """Return the log time at which the machine's monotonic clock was 0, by a recording that has been read.

    For a session that filmed itself, the session's own start determines it. A recording without either raises
    :class:`RecordingError`.
    """
    table = reader.metadata.get(TABLE, {})
    if not table and "start_ns" in (session := reader.metadata.get("tega", {})):
        epoch_ns, start_ns = table_ns(session, "epoch_ns"), table_ns(session, "start_ns")
        if epoch_ns is not None and start_ns is not None:
            return epoch_ns - start_ns
    if (epoch_ns := table_ns(table, "epoch_ns")) is None:
        reported = table.get("epoch_ns", "")[:40]
        raise RecordingError(
            f"{reader.path.name}: {TABLE} has no epoch_ns, so its times have no clock: {reported!r}"
        )
    return epoch_ns


def _mux(av: Any, stream: Path, kind: str, times: list[int], out: Path) -> int:
    """Put a stream of packets into an MP4 file at their times; return how many there were."""
    number = 0
    with (
        av.open(str(stream), format="h264" if kind == "h264" else "obu") as source,
        av.open(str(out), "w", format="mp4") as target,
    ):
        track = target.add_stream_from_template(source.streams.video[0], opaque=True)
        for packet in source.demux(video=0):
            if packet.size == 0 or number == len(times):
                continue
            packet.stream = track
            packet.pts = packet.dts = (times[number] - times[0]) * _TICKS // 1_000_000_000
            packet.time_base = Fraction(1, _TICKS)
            target.mux(packet)
            number += 1
    return number


_LENS, _LAYOUT = "lens-{}.json", "layout-{}.toml"


class OwnFilm(NamedTuple):
    """What one camera filmed of one run.

    ``video`` has its time code beside it. ``lens`` and ``layout`` are the recording's; ``None`` without.
    """

    camera: str
    video: Path
    lens: Lens | None
    layout: TagLayout | None


def own_recording(folder: Path) -> Path:
    """Return a trial's one recording; none, or more, raises :class:`RecordingError`."""
    files = sorted(folder.glob("*.mcap"))
    if len(files) != 1:
        raise RecordingError(f"{folder.name}: {len(files) or 'no'} recordings", "each trial has one")
    return files[0]


def filmed_cameras(reader: McapReader) -> list[str]:
    """Pass over a recording, and return the names of the scene cameras that it holds video of, sorted."""
    topics = {
        one.topic for one in reader.messages(lambda _topic: False) if one.schema == "foxglove.CompressedVideo"
    }
    return sorted(topic.removeprefix("/scene/").removesuffix("/video") for topic in topics)


def own_film(recording: Path, camera: str | None, beside: Path) -> OwnFilm:
    """Write a recorded camera's film of a run as a video with a time code, into the folder ``beside``.

    ``camera`` of ``None`` is the only one, or the only one that has a lens; :class:`RecordingError` where
    there are more to choose from.
    """
    reader = McapReader(recording)
    names = filmed_cameras(reader)
    if camera is None:
        able = [name for name in names if _LENS.format(name) in reader.files] or names
        if len(able) != 1:
            reported = f"cameras {', '.join(able)}: say which" if able else "no scene camera filmed it"
            raise RecordingError(f"{recording.name}: {reported}", "name one of [[scene]], or a video")
        camera = able[0]
    plain_name(camera, subject="camera", source=recording.name)
    video = beside / f"{camera}.mp4"
    export_camera(recording, camera, video)
    lens = layout = None
    if (data := reader.files.get(_LENS.format(camera))) is not None:
        (kept := beside / "lens.json").write_bytes(data)
        lens = load_lens(kept)
    if (data := reader.files.get(_LAYOUT.format(camera))) is not None:
        (kept := beside / "layout.toml").write_bytes(data)
        layout = load_layout(kept)
    return OwnFilm(camera, video, lens, layout)
