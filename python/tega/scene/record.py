"""Record scene cameras into an MCAP file on the machine's clock, and export them as MP4 with a time code.

Each camera has a thread that reads and encodes; every picture is one ``foxglove.CompressedVideo`` message on
``/scene/NAME/video``. Its time is when the machine had it, on the monotonic clock that sessions of the same machine
keep, so that a trial of a study is found in it without more.
"""

from __future__ import annotations

import tempfile
import threading
import time
from collections.abc import Callable, Generator, Mapping
from contextlib import closing
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import msgspec

from tega.errors import DeviceUnavailableError, RecordingError
from tega.foreign_file import tells_damage
from tega.lifecycle import require
from tega.plain_name import plain_name
from tega.recording.mcap_file import McapFile
from tega.recording.mcap_reader import McapReader, table_ns
from tega.scene.offset_file import read_offsets
from tega.scene.pictures import times_path
from tega.scene.sources import is_camera, open_pictures
from tega.scene.video import SceneEncoder, VideoFormat
from tega.whole_file import write_whole

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

TABLE = "tega.scene"
_LATE: Final = 1.5
_LEAVE_S: Final = 5.0
_TICKS: Final = 90_000


class CameraTally(msgspec.Struct):
    """Counts of one camera's recording.

    Attributes:
        pictures: Pictures that were recorded.
        missed: Pictures that the camera's rate says are missing in gaps between them.
        longest_gap_s: Longest time between two pictures.
        trouble: Why it stopped; ``""`` where it was told to.
    """

    pictures: int = 0
    missed: int = 0
    longest_gap_s: float = 0.0
    trouble: str = ""


def record_cameras(
    out: Path,
    cameras: Mapping[str, str],
    *,
    size: tuple[int, int],
    rate_hz: float,
    stop: Callable[[], bool],
    video: VideoFormat = "h264",
    crf: int = 20,
) -> dict[str, CameraTally]:
    """Record until told to stop, or until every camera has stopped.

    Args:
        out: The MCAP file; it must not exist.
        cameras: Number, device, address or video file by name.
        size: Width and height of the pictures, pixels.
        rate_hz: Pictures a second.
        stop: Asked twenty times a second.
        video: Format of the stream.
        crf: Quality, smaller is better.

    Raises:
        DeviceUnavailableError: A camera does not open; nothing is recorded then.
        InvalidValueError: A name is not plain, or a size cannot be encoded.
        RecordingError: The file cannot be made.
        MissingExtraError: A package of the extras ``record`` and ``lerobot`` is not installed.
    """
    threads = []
    for name, source in cameras.items():
        plain_name(name, what="camera", source="--camera")
        encoder = SceneEncoder(*size, rate_hz=rate_hz, video=video, crf=crf)
        pictures = open_pictures(source, size, rate_hz)
        threads.append(_CameraThread(name, source, pictures, encoder, size=size, rate_hz=rate_hz))
    file = McapFile(out, lossless=True)
    file.epoch_ns = time.time_ns() - time.monotonic_ns()
    file.metadata(TABLE, {"clock": "monotonic", "epoch_ns": str(file.epoch_ns)})
    try:
        for thread in threads:
            thread.begin(file)
        while not stop() and any(thread.is_alive() for thread in threads):
            time.sleep(0.05)
    finally:
        for thread in threads:
            thread.leave()
        tallies = {thread.name: thread.tally for thread in threads}
        for name, tally in tallies.items():
            told = {key: str(value) for key, value in msgspec.to_builtins(tally).items()}
            file.metadata(f"{TABLE}.{name}", told)
        file.close()
    return tallies


class _CameraThread(threading.Thread):
    """Reads and encodes one camera."""

    def __init__(
        self,
        name: str,
        source: str,
        pictures: Generator[NDArray[np.uint8]],
        encoder: SceneEncoder,
        *,
        size: tuple[int, int],
        rate_hz: float,
    ) -> None:
        super().__init__(name=name, daemon=True)
        self._source, self._pictures, self._encoder = source, pictures, encoder
        self._size, self._rate_hz = size, rate_hz
        self._leaving = threading.Event()
        self.tally = CameraTally()

    def begin(self, file: McapFile) -> None:
        """Begin to record into a file."""
        channels = require("foxglove.channels", driver="recording", extra="record")
        messages = require("foxglove.messages", driver="recording", extra="record")
        channel = channels.CompressedVideoChannel(f"/scene/{self.name}/video", context=file.context)

        def write(packets: list[tuple[int, bytes]]) -> None:
            for t_ns, data in packets:
                at_ns = file.epoch_ns + t_ns
                message = messages.CompressedVideo(
                    timestamp=messages.Timestamp(*divmod(at_ns, 1_000_000_000)),
                    frame_id=self.name,
                    data=data,
                    format=self._encoder.video,
                )
                channel.log(message, log_time=at_ns)

        self._write = write
        self.start()

    def leave(self) -> None:
        """End, and wait for that."""
        self._leaving.set()
        if self.ident is None:
            return
        self.join(_LEAVE_S)
        if self.is_alive():
            self.tally.trouble = f"did not answer for {_LEAVE_S:g} s: its last pictures may be missing"

    def run(self) -> None:
        """Read until told to leave, or until the camera stops."""
        last_ns = 0
        try:
            with closing(self._pictures):
                for image in self._pictures:
                    if not is_camera(self._source):
                        self._leaving.wait(1 / self._rate_hz)
                    if self._leaving.is_set():
                        break
                    self._check(image)
                    t_ns = time.monotonic_ns()
                    if last_ns:
                        self._count_gap((t_ns - last_ns) / 1e9)
                    last_ns = t_ns
                    self._write(self._encoder.encode(image, t_ns))
                    self.tally.pictures += 1
            self._write(self._encoder.close())
        except (DeviceUnavailableError, RecordingError) as error:
            self.tally.trouble = str(error)

    def _count_gap(self, gap_s: float) -> None:
        self.tally.longest_gap_s = max(self.tally.longest_gap_s, gap_s)
        if gap_s * self._rate_hz > _LATE:
            self.tally.missed += round(gap_s * self._rate_hz) - 1

    def _check(self, image: NDArray[np.uint8]) -> None:
        if image.shape[1::-1] != self._size:
            raise RecordingError(
                f"scene camera {self._source}: a picture of {image.shape[1]}×{image.shape[0]}, not "
                f"{self._size[0]}×{self._size[1]}",
                "write --size as the camera sends",
            )


@tells_damage
def export_camera(recording: Path, name: str, out: Path) -> int:
    """Write a camera of a recording as MP4, without encoding it anew, and its time code beside it.

    The times are less the camera's offset, where one was estimated (:mod:`tega.scene.offset`).

    Args:
        recording: The MCAP file.
        name: The camera's name.
        out: The MP4 file; its time code is ``out`` with the suffix ``.times.csv``.

    Returns:
        How many pictures.

    Raises:
        RecordingError: The recording is damaged, or has no such camera.
        MissingExtraError: A package of the extras ``record`` and ``lerobot`` is not installed.
    """
    av = require("av", driver="export", extra="lerobot")
    plain_name(name, what="camera", source=recording.name)
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
                raw.write(message.value.data)
                times.append(message.log_ns)
        if not times or kind not in {"h264", "av1"}:
            there = ", ".join(sorted(others)) or "none"
            raise RecordingError(f"{recording.name}: no camera {name!r}", f"its topics: {there}")
        epoch_ns = scene_epoch(reader)
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
    """Return the log time at which the machine's monotonic clock was 0, by a scene recording that has been read.

    Raises:
        RecordingError: It does not say.
    """
    table = reader.metadata.get(TABLE, {})
    if (epoch_ns := table_ns(table, "epoch_ns")) is None:
        told = table.get("epoch_ns", "")[:40]
        raise RecordingError(
            f"{reader.path.name}: {TABLE} has no epoch_ns, so its times have no clock: {told!r}"
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
