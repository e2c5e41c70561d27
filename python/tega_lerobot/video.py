"""Encode one finger's pictures, H.264 in MP4; compute the figures that a training run normalises with."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tega.runtime.lifecycle import require
from tega.runtime.opencv import load_cv2
from tega_lerobot.spool import Spool

QUANTILES = (0.01, 0.10, 0.50, 0.90, 0.99)

Figures = dict[str, Any]

PLACE = "chunk-{chunk_index:03d}/file-{file_index:03d}"
"""Where a file is, below its folder."""

VIDEOS = f"videos/{{video_key}}/{PLACE}.mp4"
FILES_PER_CHUNK, VIDEO_MB = 1000, 200

ENCODER, CODEC, PIXELS = "libx264", "h264", "yuv420p"
# Every other frame can be decoded on its own, since training reads frames at random. Of the same dB as LeRobot's own
# choice, AV1 of quality 30, in a tenth of the processor time for 1.7 times the bytes of a real gel's pictures
# (docs/evidence/recording.md).
_OPTIONS = {"g": "2", "crf": "21", "preset": "ultrafast", "threads": "1"}


class Values:
    """All values of a feature, on disk: quantiles need every one."""

    def __init__(self, like: NDArray[Any]) -> None:
        self._shape = like.shape[1:] or (1,)
        self._spool = Spool(like.dtype)
        self._parts: list[tuple[int, int]] = []

    def add(self, values: NDArray[Any]) -> None:
        """Add a part: the values of some frames."""
        self._parts.append((self._spool.n, len(values)))
        self._spool.add(values.reshape(len(values), -1).T)

    @property
    def n_parts(self) -> int:
        """Number of parts that were added."""
        return len(self._parts)

    def figures(self, since: int = 0) -> Figures:
        """Return minimum, maximum, mean, deviation, count and quantiles of the parts from ``since`` on."""
        parts = self._parts[since:]
        # One column after the other, since all of a long recording would take the most memory of the export.
        known = [
            _known(np.concatenate([self._spool.read(at + k * n, at + (k + 1) * n) for at, n in parts]))
            for k in range(math.prod(self._shape))
        ]
        found = {name: np.reshape([one[name] for one in known], self._shape).tolist() for name in known[0]}
        return found | {"count": [sum(n for _, n in parts)]}


def _known(values: NDArray[Any]) -> dict[str, float]:
    column = values.astype(np.float64)
    quantiles = np.quantile(column, QUANTILES)
    return {"min": column.min(), "max": column.max(), "mean": column.mean(), "std": column.std()} | {
        _key(q): value for q, value in zip(QUANTILES, quantiles, strict=True)
    }


def _key(quantile: float) -> str:
    return f"q{round(quantile * 100):02d}"


def sampled_frames(n_frames: int) -> NDArray[np.int64]:
    """Return the frames of an episode whose pictures are counted: as many, and as far apart, as LeRobot takes."""
    n = max(min(100, n_frames), min(int(n_frames**0.75), 10_000))
    return np.round(np.linspace(0, n_frames - 1, n)).astype(np.int64)


class Colours:
    """Counts of every value of red, green and blue over pictures, from which their figures follow exactly.

    Of a picture whose longer side has 300 pixels or more, rows and columns are left out as LeRobot does: of 240 x 320
    every other one is counted.
    """

    def __init__(self) -> None:
        self._counts = np.zeros((3, 256), np.int64)
        self._n = 0

    def add(self, image: NDArray[np.uint8], n_times: int) -> None:
        """Count a picture, uint8 (H, W, 3) in BGR, so many times."""
        cv2 = load_cv2("export")
        longer = max(image.shape[:2])
        step = longer // 150 if longer >= 300 else 1
        image = np.ascontiguousarray(image[::step, ::step])
        for colour, channel in enumerate((2, 1, 0)):
            counts = cv2.calcHist([image], [channel], None, [256], [0, 256]).ravel()
            self._counts[colour] += n_times * counts.astype(np.int64)
        self._n += n_times

    def __iadd__(self, other: Colours) -> Colours:
        """Count those of another one too."""
        self._counts += other._counts
        self._n += other._n
        return self

    def figures(self) -> Figures:
        """Return the figures per colour of values from 0 to 1, each of shape (3, 1, 1)."""
        levels = np.arange(256) / 255.0
        share = self._counts / self._counts.sum(1, keepdims=True)
        mean = share @ levels
        known: Figures = {
            "min": [levels[np.flatnonzero(row)[0]] for row in self._counts],
            "max": [levels[np.flatnonzero(row)[-1]] for row in self._counts],
            "mean": mean,
            "std": np.sqrt(np.maximum(share @ levels**2 - mean**2, 0.0)),
        }
        below = np.cumsum(share, axis=1)
        known |= {_key(q): [levels[np.searchsorted(row, q - 1e-12)] for row in below] for q in QUANTILES}
        shaped = {name: np.reshape(value, (3, 1, 1)).tolist() for name, value in known.items()}
        return shaped | {"count": [self._n]}


class Video:
    """A video that grows by pictures, whose height and width, pixels, must be even.

    ``n_bytes`` is the size of what has left the encoder, which keeps pictures back; the file is there only
    from then on.
    """

    def __init__(self, path: Path, *, fps: int, height: int, width: int) -> None:
        self._av: Any = require("av", driver="export", extra="lerobot")
        self._cv2 = load_cv2("export")
        path.parent.mkdir(parents=True, exist_ok=True)
        self.path = path
        self._file = self._av.open(str(path), "w")
        self._stream = self._file.add_stream(ENCODER, fps, options=dict(_OPTIONS))
        self._stream.width, self._stream.height, self._stream.pix_fmt = width, height, PIXELS
        frame = self._av.VideoFrame
        # Without a copy; PyAV 18 cuts off rows there where a quarter of the height is no whole number.
        self._framed = frame.from_ndarray if height % 4 else frame.from_numpy_buffer
        self.n_frames = self.n_bytes = 0

    def add(self, image: NDArray[np.uint8], n_times: int) -> None:
        """Add a picture, uint8 (H, W, 3) in BGR, so many times in a row."""
        # OpenCV converts in a quarter of FFmpeg's time; that makes an even grey up to 4 values too dark from BGR.
        planes = self._cv2.cvtColor(image, self._cv2.COLOR_BGR2YUV_I420)
        for _ in range(n_times):
            frame = self._framed(planes, format=PIXELS)
            frame.pts = self.n_frames
            self.n_frames += 1
            self._write(self._stream.encode(frame))

    def close(self) -> None:
        """Write the encoder's remaining packets, and finish the file."""
        self._write(self._stream.encode())
        self._file.close()

    def _write(self, packets: Sequence[Any]) -> None:
        self.n_bytes += sum(packet.size for packet in packets)
        self._file.mux(packets)


class VideoPlace:
    """Numbers of the video file and of the chunk that it is in."""

    def __init__(self) -> None:
        self.chunk_index = self.file_index = 0

    def next(self) -> None:
        """Go on to the next file."""
        self.file_index += 1
        if self.file_index == FILES_PER_CHUNK:
            self.chunk_index, self.file_index = self.chunk_index + 1, 0

    def numbers(self) -> dict[str, int]:
        """Return both numbers."""
        return {"chunk_index": self.chunk_index, "file_index": self.file_index}


class EpisodeCamera:
    """One finger's videos; ``total`` are colours of the pictures that are counted, ``episode`` of the episode's."""

    def __init__(self, folder: Path, key: str, fps: int, shape: tuple[int, int]) -> None:
        self._folder, self._key, self._fps, self._shape = folder, key, fps, shape
        self._place = VideoPlace()
        self._video: Video | None = None
        self._from_frame = 0
        self._sampled = sampled_frames(0)
        self.total, self.episode = Colours(), Colours()

    def begin(self, n_frames: int) -> None:
        """Begin an episode of so many frames, in a new file where the last one is large."""
        self.episode = Colours()
        if self._video is not None and self._video.n_bytes > VIDEO_MB * 2**20:
            self.close()
            self._place.next()
        if self._video is None:
            path = self._folder / VIDEOS.format(video_key=self._key, **self._place.numbers())
            height, width = self._shape
            self._video = Video(path, fps=self._fps, height=height, width=width)
        self._from_frame = self._video.n_frames
        self._sampled = self._from_frame + sampled_frames(n_frames)

    def add(self, image: NDArray[np.uint8], n_frames: int) -> None:
        """Show a picture, uint8 (H, W, 3) in BGR, for so many frames."""
        if self._video is not None:
            before = self._video.n_frames
            self._video.add(image, n_frames)
            begin, end = np.searchsorted(self._sampled, (before, self._video.n_frames))
            if end > begin:
                self.episode.add(image, int(end - begin))

    def end(self) -> dict[str, Any]:
        """End the episode, and return where it is."""
        self.total += self.episode
        n_frames = 0 if self._video is None else self._video.n_frames
        times = {"from_timestamp": self._from_frame / self._fps, "to_timestamp": n_frames / self._fps}
        return {f"videos/{self._key}/{name}": v for name, v in (self._place.numbers() | times).items()}

    def close(self) -> None:
        """Finish the file."""
        if self._video is not None:
            self._video.close()
            self._video = None
