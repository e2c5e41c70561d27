"""Read the frames of a video file with PyAV: every codec of FFmpeg, with the file's own frame times and orientation.

The file is demuxed once without decoding, which gives number and times of its frames. The decodable frames are then
compared with the length that the header states.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega.errors import RecordingError
from tega.runtime.files.foreign_file import check_file
from tega.runtime.lifecycle import require

# A day of one camera's video, little compressed.
_MOST_MIB: Final = 256 * 1024
# Containers only: a playlist would make FFmpeg open other files or addresses, and it draws the letters of a text file.
_CONTAINER: Final = {
    "format_whitelist": "mov,mp4,m4a,3gp,3g2,mj2,matroska,webm,avi,mpegts,mpeg,ogg,flv,asf,nut,mxf,gif,ivf,"
    "yuv4mpegpipe,h264,hevc,av1,obu,mjpeg,m4v",  # those of _RAW to be named
    "protocol_whitelist": "file",
}
# Streams without a container: FFmpeg makes up 25 frames a second.
_RAW: Final = frozenset({"h264", "hevc", "av1", "obu", "mjpeg", "m4v"})
# Memory is allocated by the header, before the first pixel is decoded.
_DECODER: Final = {"max_pixels": str(1 << 26)}
_MOST_HZ: Final = 100_000
# A distance between frames that differs from the mean by more than this share makes the rate variable.
_UNEVEN: Final = 0.25
# Of a header without a number of frames, the stated length may differ from that of the frames by so many periods.
_SLACK_PERIODS: Final = 2.5


class VideoFacts(NamedTuple):
    """Facts of a video, from its header and its packets.

    Attributes:
        n_stated: Number of frames by the header; ``None`` if it states none.
        rate_hz: Frames per second; the mean where the rate is variable.
        longest_s: Longest distance between two frames, seconds.
        cut: Whether the last packet ends with the file, before its end.
        end_s: Length by the header, seconds; ``None`` if it states none.
        times_s: Times of all frames in order, where those of the frames themselves are not used: AVI states
            times of decoding, which are another order with B-frames; ``None`` otherwise.
    """

    codec: str
    n_frames: int
    n_stated: int | None
    rate_hz: float
    longest_s: float
    variable: bool
    cut: bool
    end_s: float | None
    times_s: list[float] | None


class VideoFrames:
    """The frames of a video file, in order; ``notes`` are sentences on how it is read.

    ``n_decoded`` is one ahead of :meth:`read`. A file that states no rate, or none of which decodes, is
    refused.
    """

    def __init__(self, path: Path) -> None:
        self._av: Any = require("av", driver="video", extra="lab")
        self._path = path
        self.facts = self._read_facts()
        self.n_decoded = 0
        self.notes: list[str] = []
        if self.facts.variable:
            self.notes.append(
                f"{path.name}: variable frame rate; each frame has the time that the file states"
            )
        self._damage = ""
        self._last_s, self._end_s = -1.0, 0.0
        self._convert: Callable[[], NDArray[np.uint8]]
        self._container, stream = self._open()
        self._begin_s = _begin_s(self._container)
        self._frames: Iterator[Any] = iter(self._container.decode(stream))
        self._pending_s = self._decode()
        if self._pending_s is None:
            self.close()
            raise RecordingError(
                f"{path.name}: none of its {self.facts.n_frames} frames can be decoded ({self.facts.codec}"
                f"{f'; {self._damage}' if self._damage else ''})",
                "copy it again from its source, or export it again",
            )

    @property
    def ended(self) -> bool:
        """Whether all frames were read."""
        return self._pending_s is None

    def close(self) -> None:
        """Close the file."""
        self._frames = iter(())
        self._container.close()

    def skip(self, n_frames: int) -> None:
        """Pass over frames without converting their pixels."""
        for _ in range(n_frames):
            if self._pending_s is None:
                return
            self._pending_s = self._decode()

    def read(self) -> tuple[float, NDArray[np.uint8]] | None:
        """Return the next frame and its time; ``None`` after the last.

        Time is in seconds from the file's beginning; frames are uint8 (H, W, 3), blue, green, red, turned by
        the rotation tag.
        """
        t_s = self._pending_s
        if t_s is None:
            return None
        try:
            image = self._convert()
        except Exception as error:  # of a damaged file decoders raise what they like
            raise RecordingError(
                f"{self._path.name} frame {self.n_decoded - 1}: cannot be converted: {_text(error)}",
                "export the video again",
            ) from error
        self._pending_s = self._decode()
        return t_s, image

    def fault(self) -> str:
        """Return the difference between the decodable frames and the header; ``""`` if there is none."""
        facts, text = self.facts, f"{self._path.name}: {self.n_decoded} frames decode"
        if self._damage:
            n = facts.n_stated or facts.n_frames
            return f"{text}, its header says {n}: damaged there ({self._damage})"
        slack_s = _SLACK_PERIODS * max(facts.longest_s, 1 / facts.rate_hz)
        short = facts.end_s is not None and self._end_s + slack_s < facts.end_s
        if facts.n_stated is not None and self.n_decoded > facts.n_stated:
            return f"{text}, its header says {facts.n_stated}: the header is wrong"
        # A container of constant rate counts a frame that was left out, too; then the times reach the stated end.
        reached = facts.end_s is not None and self._end_s + 0.5 / facts.rate_hz >= facts.end_s
        whole = reached and self.n_decoded == facts.n_frames
        if facts.n_stated is not None and self.n_decoded < facts.n_stated and not whole:
            return f"{text}, its header says {facts.n_stated}: the video was cut short"
        if facts.cut:
            return f"{text}, the last of them in part: the video was cut short"
        if facts.n_stated is None and short:
            lengths = f"{self._end_s:.2f} s, its header says {facts.end_s:.2f} s"
            return f"{text}, {lengths}: the video was cut short"
        return ""

    def _decode(self) -> float | None:
        """Decode the next frame and return its time; ``None`` at the end and at damage."""
        try:
            frame = next(self._frames, None)
        except Exception as error:  # as above
            self._damage = _text(error)
            return None
        if frame is None:
            return None
        if frame.is_corrupt:
            self._damage = f"frame {self.n_decoded} is incomplete"
            return None
        times_s, k = self.facts.times_s, self.n_decoded
        if times_s is not None and k < len(times_s):
            t_s = times_s[k]
        elif frame.pts is not None:
            t_s = float(frame.pts * frame.time_base) - self._begin_s
        else:
            self._damage = f"frame {k} has no time"
            return None
        if t_s <= self._last_s:
            self._damage = f"frame {self.n_decoded} is at {t_s:.3f} s, the one before at {self._last_s:.3f} s"
            return None
        length_s = float(frame.duration * frame.time_base) if frame.duration and frame.time_base else 0.0
        self._last_s, self._end_s = t_s, t_s + max(length_s, 1 / self.facts.rate_hz)
        self.n_decoded += 1
        self._convert = lambda: self._image(frame)
        return t_s

    def _image(self, frame: Any) -> NDArray[np.uint8]:
        image = np.asarray(frame.to_ndarray(format="bgr24"), np.uint8)
        matrix = _display_matrix(frame)
        if matrix is None or matrix == (1, 0, 0, 1):
            return image
        note = f"{self._path.name}: turned or mirrored as its rotation tag says"
        if note not in self.notes:
            self.notes.append(note)
        return _oriented(image, matrix)

    def _open(self) -> tuple[Any, Any]:
        path, container = self._path, None
        try:
            # PyAV 19 reads titles in any encoding, and refuses the option for them.
            titles = {} if int(self._av.__version__.split(".")[0]) >= 19 else {"metadata_errors": "replace"}
            container = self._av.open(str(path), container_options=_CONTAINER, **titles)
            stream = container.streams.video[0]
            stream.codec_context.thread_count = 1
            stream.codec_context.options = _DECODER
        except Exception as error:  # as above
            if container is not None:
                container.close()
            raise RecordingError(
                f"{path.name}: cannot be opened as a video ({path.stat().st_size} bytes)",
                "it may be cut short (an MP4 keeps its table at the end) or not a video; export it again",
            ) from error
        return container, stream

    def _read_facts(self) -> VideoFacts:
        """Demux the file without decoding it."""
        path = self._path
        check_video(path)
        container, stream = self._open()
        with container:
            if container.format.name in _RAW:
                raise RecordingError(
                    f"{path.name}: a raw stream, which states no frame times",
                    f"put it into a file with its rate: ffmpeg -framerate RATE -i {path.name} -c copy {path.stem}.mp4",
                )
            times_s, n_frames, n_hidden, cut = _packets(container, stream)
            steps = np.diff(times_s)
            rate_hz, variable = float(stream.average_rate or stream.base_rate or 0), False
            if len(steps) and times_s[-1] > times_s[0]:
                mean_hz = len(steps) / (times_s[-1] - times_s[0])
                variable = bool(np.abs(steps * mean_hz - 1).max() > _UNEVEN)
                # Stamps are rounded to ticks; where they agree with the stated rate, that is exact.
                rate_hz = rate_hz if not variable and abs(mean_hz - rate_hz) < 0.01 * rate_hz else mean_hz
            if not 0 < rate_hz <= _MOST_HZ:
                raise RecordingError(
                    f"{path.name}: its header states {rate_hz:g} frames per second and {stream.frames} frames",
                    "export it with a proper header, or as a folder of pictures with a stated rate",
                )
            return VideoFacts(
                codec=stream.codec_context.name,
                n_frames=n_frames,
                n_stated=max(stream.frames - n_hidden, 0) or None,
                rate_hz=rate_hz,
                longest_s=float(steps.max()) if len(steps) else 0.0,
                variable=variable,
                cut=cut,
                end_s=_stated_end_s(container, stream),
                times_s=times_s if container.format.name == "avi" else None,
            )


def check_video(path: Path) -> None:
    """Refuse anything but a regular file, and files that are too large for a video."""
    try:
        check_file(path, most_mib=_MOST_MIB)
    except OSError as error:
        raise RecordingError(f"{path.name}: no such video file", f"looked for {path}") from error
    if path.is_dir():
        raise RecordingError(f"{path.name}: no such video file", f"{path} is a folder")


def _packets(container: Any, stream: Any) -> tuple[list[float], int, int, bool]:
    """Return the times of packets that show a frame, in order, their number, that of hidden ones, and if one is cut."""
    begin_s, n_displayed, n_hidden, cut = _begin_s(container), 0, 0, False
    times_s: list[float] = []
    with contextlib.suppress(Exception):  # damage is reported where decoding reaches it
        for packet in container.demux(stream):
            if not packet.size:
                continue
            if packet.is_discard:
                n_hidden += 1
                continue
            cut |= packet.is_corrupt
            n_displayed += 1
            stamp = packet.dts if packet.pts is None or container.format.name == "avi" else packet.pts
            if stamp is not None:
                times_s.append(float(stamp * packet.time_base) - begin_s)
    return sorted(times_s), n_displayed, n_hidden, cut


def _begin_s(container: Any) -> float:
    """Return the time at which the file begins, as players count it, seconds."""
    return 0.0 if container.start_time is None else container.start_time / 1_000_000


def _stated_end_s(container: Any, stream: Any) -> float | None:
    """Return the length of the video by the header, seconds; ``None`` if only the file's whole length is known."""
    begin_s = _begin_s(container)
    if stream.duration is not None and stream.time_base is not None:
        start = stream.start_time or 0
        return float((start + stream.duration) * stream.time_base) - begin_s
    tag = str(stream.metadata.get("DURATION", "")).split(":")  # Matroska, such as 00:00:02.000000000
    with contextlib.suppress(ValueError):
        if len(tag) == 3:
            return (int(tag[0]) * 60 + int(tag[1])) * 60 + float(tag[2])
    if container.duration is None or len(container.streams) > 1:
        return None
    return float(container.duration) / 1_000_000


def _text(error: Exception) -> str:
    return (str(getattr(error, "strerror", "") or error) or type(error).__name__)[:100]


def _oriented(image: NDArray[np.uint8], matrix: tuple[int, int, int, int]) -> NDArray[np.uint8]:
    """Return a picture, uint8 (H, W, 3), as players show it.

    ``matrix`` has the display matrix's signs (a, b, c, d): a pixel at (x, y) is shown at (ax + cy, bx + dy).
    """
    a, b, c, d = matrix
    if a and d:
        return np.ascontiguousarray(image[:: 1 if d > 0 else -1, :: 1 if a > 0 else -1])
    turned = image.transpose(1, 0, 2)
    return np.ascontiguousarray(turned[:: 1 if b > 0 else -1, :: 1 if c > 0 else -1])


def _display_matrix(frame: Any) -> tuple[int, int, int, int] | None:
    """Return the signs of a frame's display matrix; ``None`` for none, and for an angle that is no multiple of 90°."""
    data = bytes(frame.side_data.get("DISPLAYMATRIX", b""))
    if len(data) != 36:
        return None
    a, b, _, c, d = np.frombuffer(data, np.int32, 5).astype(np.int64)
    signs = tuple(int(np.sign(v)) for v in (a, b, c, d))
    square = (signs[0] and signs[3] and not b and not c) or (signs[1] and signs[2] and not a and not d)
    return (signs[0], signs[1], signs[2], signs[3]) if square else None
