"""Encode scene video picture by picture, as Foxglove's CompressedVideo wants it, and decode it packet by packet.

H.264 is an Annex B stream, AV1 a stream of temporal units: every packet is one picture, none waits for a later one, and
a picture that stands alone comes at least once a second with all that a decoder needs to begin there.
"""

from __future__ import annotations

import os
from array import array
from fractions import Fraction
from typing import Any, ClassVar, Final

import numpy as np
from numpy.typing import NDArray

from tega.errors import InvalidValueError, RecordingError
from tega.records.base import VideoPacket
from tega.runtime.lifecycle import require
from tega.runtime.opencv import load_cv2
from tega.runtime.threads import restored
from tega_scene.settings import CRF, MOST_CAMERAS, VideoFormat

_DECODERS: Final = {"h264": "h264", "av1": "libdav1d"}
# Four times as many as Full HD has: a packet of some bytes may claim a picture of gigabytes.
_MOST_PIXELS: Final = 4 * 1920 * 1088

_START: Final = b"\x00\x00\x01"
_H264_SLICE, _H264_ALONE, _H264_SPS = 1, 5, 7
_AV1_SEQUENCE: Final = 1
# Temporal delimiter, metadata and padding may stand before a sequence header.
_AV1_BEFORE: Final = frozenset({2, 5, 15})


class SceneVideo(VideoPacket, frozen=True, kw_only=True):
    """One encoded picture of a scene camera."""

    topic: ClassVar[str] = "/scene/{camera}/video"


RECORDS = (SceneVideo,)
"""Record types of scene cameras."""


class SceneDecoder:
    """Decodes packets as they come, and converts the picture that is asked for, no other.

    ``video`` is ``h264`` or ``av1``.
    """

    def __init__(self, video: str = "h264") -> None:
        if video not in _DECODERS:
            raise RecordingError(
                f"a scene camera's video has the format {video[:20]!r}", "h264 and av1 can be decoded"
            )
        self._av: Any = require("av", driver="scene", extra="lab")
        self._context = self._av.CodecContext.create(_DECODERS[video], "r")
        self._context.thread_count = 1
        at_once = {"max_frame_delay": "1"} if video == "av1" else {"flags": "low_delay"}
        self._context.options = {"max_pixels": str(_MOST_PIXELS), **at_once}
        self._newest: tuple[int, Any] | None = None

    def take(self, t_ns: int, packet: bytes) -> None:
        """Decode the next packet: one picture, which no later one is needed for.

        A damaged one, or a picture larger than 3840 x 2176 pixels, raises :class:`RecordingError`.
        """
        if not packet:
            raise RecordingError("a picture of the video is empty", "the recording is damaged")
        try:
            sent = self._av.Packet(packet)
            sent.pts = t_ns
            frames = self._context.decode(sent)
        except (self._av.FFmpegError, ValueError, OverflowError) as error:
            raise _damage(error) from error
        for frame in frames:  # which has its own packet's time, should a decoder hold it back
            self._newest = t_ns if frame.pts is None else frame.pts, frame

    def image(self) -> tuple[int, NDArray[np.uint8]] | None:
        """Return the newest picture once: its time, and uint8 (H, W, 3) BGR; ``None`` without one."""
        newest, self._newest = self._newest, None
        if newest is None:
            return None
        t_ns, frame = newest
        try:
            return t_ns, np.asarray(frame.to_ndarray(format="bgr24"), np.uint8)
        except (self._av.FFmpegError, ValueError) as error:
            raise _damage(error) from error


def _damage(error: Exception) -> RecordingError:
    return RecordingError(f"a picture of the video cannot be decoded: {error}", "the recording is damaged")


def stands_alone(video: str, packet: bytes) -> bool:
    """Return whether decoding can begin with a packet: it has parameters and a frame that refers to no other.

    Always false for formats other than ``h264`` and ``av1``.
    """
    if video == "av1":
        return _av1_alone(packet)
    return video == "h264" and _h264_alone(packet)


def _h264_alone(packet: bytes) -> bool:
    """Look at the stream's units up to the first that belongs to a picture."""
    has_parameters = False
    at = packet.find(_START)
    while 0 <= at < len(packet) - len(_START):
        kind = packet[at + len(_START)] & 31
        if _H264_SLICE <= kind <= _H264_ALONE:
            return has_parameters and kind == _H264_ALONE
        has_parameters = has_parameters or kind == _H264_SPS
        at = packet.find(_START, at + len(_START))
    return False


def _av1_alone(packet: bytes) -> bool:
    """Look for a sequence header, which stands before every picture that a decoder can begin with."""
    at = 0
    while at < len(packet):
        head = packet[at]
        kind, has_more, has_size = head >> 3 & 15, head >> 2 & 1, head >> 1 & 1
        if kind not in _AV1_BEFORE or not has_size:
            return kind == _AV1_SEQUENCE
        at += 1 + has_more
        size = shift = 0
        while at < len(packet) and shift < 56:
            size |= (packet[at] & 127) << shift
            shift, at = shift + 7, at + 1
            if packet[at - 1] < 128:
                break
        at += size
    return False


def note_key(keys: dict[str, array[int]], topic: str, t_ns: int, video: str, data: bytes) -> None:
    """Note the time of a video's picture that stands alone; of sixteen cameras, which no scene has more of."""
    if topic not in keys and len(keys) == MOST_CAMERAS:
        return
    found = keys.setdefault(topic, array("q"))
    if stands_alone(video, data):
        found.append(t_ns)


_ENCODERS: Final[dict[VideoFormat, str]] = {"h264": "libx264", "av1": "libsvtav1"}
_TICKS: Final = Fraction(1, 1_000_000)


def _options(video: VideoFormat, crf: int, rate_hz: float) -> dict[str, str]:
    every = str(max(1, round(rate_hz)))
    both = {"crf": str(crf), "g": every}
    if video == "av1":  # pred-struct 1 is low delay: no picture refers to a later one
        return {"preset": "10", **both, "svtav1-params": f"pred-struct=1:keyint={every}:lp=1"}
    # This preset alone compares whole pixels: what moves is coded again in each picture, coarsely. Quarters of a
    # pixel take more time, and halve the error of distance that coding adds (docs/evidence/scene.md).
    finely = {"preset": "ultrafast", "x264-params": "subme=2"}
    return {**finely, "tune": "zerolatency", **both, "bf": "0", "threads": "1"}


class SceneEncoder:
    """Encodes the pictures of one camera, whose sides, pixels, must be even.

    About ``rate_hz`` come a second: one of so many stands alone. A smaller ``crf`` is better quality. A PyAV
    wheel without the encoder raises :class:`MissingExtraError`.
    """

    def __init__(
        self, width: int, height: int, *, rate_hz: float, video: VideoFormat = "h264", crf: int = CRF
    ) -> None:
        if width % 2 or height % 2 or width < 64 or height < 64:
            raise InvalidValueError(
                f"pictures of {width}×{height} cannot be encoded",
                "take a resolution with even sides from 64 pixels",
            )
        self._av: Any = require("av", driver="scene", extra="lab")
        os.environ.setdefault("SVT_LOG", "1")
        self.video: VideoFormat = video
        self._context = self._av.CodecContext.create(_ENCODERS[video], "w")
        self._context.width, self._context.height = width, height
        self._context.pix_fmt, self._context.time_base = "yuv420p", _TICKS
        self._context.framerate = Fraction(round(1000 * rate_hz), 1000)
        self._context.options = _options(video, crf, rate_hz)
        with restored():
            self._context.open()
        self._times: list[int] = []
        self._last = -1

    def encode(self, image: NDArray[np.uint8], t_ns: int) -> list[tuple[int, bytes]]:
        """Add a frame, uint8 (H, W, 3) BGR, or (H, W) grey; return the finished packets with their times."""
        order = "gray" if image.ndim == 2 else "bgr24"
        frame = self._av.VideoFrame.from_ndarray(np.ascontiguousarray(image), format=order)
        # Rising by at least one tick, whatever the camera's clock says.
        self._last = max(self._last + 1, t_ns // 1000)
        frame.pts, frame.time_base = self._last, _TICKS
        self._times.append(t_ns)
        return self._ready(frame)

    def close(self) -> list[tuple[int, bytes]]:
        """Return the packets that the encoder still has."""
        return self._ready(None)

    def _ready(self, frame: Any) -> list[tuple[int, bytes]]:
        try:
            packets = self._context.encode(frame)
        except self._av.FFmpegError as error:
            raise RecordingError(f"a picture cannot be encoded as {self.video}: {error}") from error
        # In the order in which the pictures came: nothing is reordered.
        return [(self._times.pop(0), bytes(packet)) for packet in packets]


def shrunk(image: NDArray[np.uint8], width: int) -> NDArray[np.uint8]:
    """Return a picture, uint8 (H, W, 3), at most ``width`` wide: each pixel the mean of what it covers."""
    if image.shape[1] <= width:
        return image
    cv2 = load_cv2("scene")
    height = max(1, round(image.shape[0] * width / image.shape[1]))
    return np.asarray(cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA), np.uint8)
