"""Decode scene video packet by packet, and find the pictures from which a decoder can begin."""

from __future__ import annotations

from array import array
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from tega.errors import RecordingError
from tega.runtime.lifecycle import require
from tega_scene.settings import MOST_CAMERAS

_DECODERS: Final = {"h264": "h264", "av1": "libdav1d"}
# Four times as many as Full HD has: a packet of some bytes may claim a picture of gigabytes.
_MOST_PIXELS: Final = 4 * 1920 * 1088

_START: Final = b"\x00\x00\x01"
_H264_SLICE, _H264_ALONE, _H264_SPS = 1, 5, 7
_AV1_SEQUENCE: Final = 1
# Temporal delimiter, metadata and padding may stand before a sequence header.
_AV1_BEFORE: Final = frozenset({2, 5, 15})


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
