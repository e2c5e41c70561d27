"""Measure codecs of recorded pictures: bytes and processor time against what a reading of the decoded ones misses."""

from __future__ import annotations

import io
import os
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Final, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from tega.recording.pictures import cell_sums, read_sums
from tega.tactile import ContactReader, TouchTracker
from tega_figures.pareto.drawing import Choice, PricedVariant
from tega_figures.touch_recordings import GRIPS, grip_video
from tega_sim.gel import Gel, ball

__all__ = ["jpeg_quality"]

Image = NDArray[np.uint8]

DEFAULT: Final = "JPEG 95 + cells"
_GRIPS: Final = ("bag_of_peanuts_2", "plastic_cup_1")
# Pictures of four fingers at 60 Hz.
_PER_S, _PER_MIN = 240, 14_400
_MIDDLE: Final = 128
# What loses nothing is slow, and known by its first pictures.
_EXACT: Final = frozenset({"PNG", "FFV1", "HEVC lossless"})
_FEW: Final = 60


class _Coded(NamedTuple):
    """Pictures that were encoded and decoded; ``sums`` where the reading has these instead."""

    n_bytes: int
    encode_s: float
    pictures: Sequence[Image]
    sums: Sequence[NDArray[np.int16]] | None = None


class _Course(NamedTuple):
    """Pictures one after the other, and the contacts that are read in them."""

    name: str
    still: Image
    pictures: Sequence[Image]
    live: Sequence[Any]
    paper: Sequence[Any]

    def first(self, n: int) -> _Course:
        return _Course(self.name, self.still, self.pictures[:n], self.live[:n], self.paper[:n])


Codec = Callable[[Sequence[Image], Image], _Coded]


def jpeg_quality(*, budget_s: float) -> Choice:  # noqa: ARG001  # every picture is encoded once
    """Measure JPEG of several qualities, of differences, beside cells, and what loses nothing."""
    courses = [
        _Course(
            name,
            still,
            pictures,
            [*map(TouchTracker(still).update, pictures)],
            [*map(ContactReader(still).read, pictures)],
        )
        for name, still, pictures in _courses()
    ]
    return Choice(
        title="Recording: codec of the pictures",
        setting="`recording.jpeg_quality`, `recording.lossless`",
        cost="MB a minute of four fingers at 60 Hz",
        error="area that differs, %",
        how=(
            f"{sum(len(course.pictures) for course in courses)} pictures of {len(courses)} courses: "
            f"{', '.join(course.name for course in courses)}. Each course is encoded, decoded and read by `live` from "
            "its beginning, as the pictures themselves are. Area: mean over the frames in which both have contact, "
            "then over the courses; likewise read by `paper`. Sizes are those before the file's compression."
        ),
        why=(
            "No JPEG keeps the area within 1 % on every course, at any quality: `live` decides by a fraction of the "
            "noise, and a weak contact begins or ends a frame earlier. It reads sums over cells of 8 × 8 pixels, "
            "and these cost as much as the step from quality 95 to 98: beside the JPEG they give the run's contacts "
            "to the last bit. A metric that reads pixels, as `paper` does, has the error of JPEG 95; for that one set "
            "`lossless`."
        ),
        variants=[
            _measured(name, codec, [course.first(_FEW) for course in courses] if name in _EXACT else courses)
            for name, codec in _codecs().items()
        ],
    )


def _courses() -> Iterator[tuple[str, Image, Sequence[Image]]]:
    """Yield name, baseline and pictures of each course: simulated ones, and grips where the recordings are there."""
    for seed in (1, 2):
        gel = Gel(seed)
        forces_n = np.maximum(np.sin(np.arange(200) * np.pi / 25), 0.0) * np.repeat([0.3, 1.0, 3.0, 6.0], 50)
        touching = [[ball(force_n=f, centre_xy=(119.5, 159.5))] if f > 0 else [] for f in forces_n.tolist()]
        pictures = [gel.frame(shapes, k) for k, shapes in enumerate(touching)]
        yield f"simulated gel {seed}", gel.still(), pictures
    folder = Path(os.environ.get("TEGA_DATA", "")) / "digit"
    for name in _GRIPS if (folder / "gsmini_grips").is_dir() else ():
        grip = GRIPS[name]
        for camera in (0, 2):
            frames = grip_video(folder, name, camera)
            still = np.median(frames[grip.rest[0] : grip.rest[1] + 1], axis=0).astype(np.uint8)
            yield f"{name} camera {camera}", still, list(frames[grip.from_frame :])


def _codecs() -> dict[str, Codec]:
    found: dict[str, Codec] = {f"JPEG {quality}": partial(_jpeg, quality) for quality in (90, 95, 98, 100)}
    found |= {f"JPEG {quality} 4:4:4": partial(_jpeg, quality, full=True) for quality in (95, 98)}
    found |= {f"differences, JPEG {quality}": partial(_differences, quality) for quality in (95, 98)}
    found[DEFAULT] = _with_cells
    found["PNG"] = partial(_images, ".png", [cv2.IMWRITE_PNG_COMPRESSION, 1])
    found["FFV1"] = partial(_video, "ffv1", "bgr0", {"slices": "4"})
    found["HEVC lossless"] = partial(
        _video, "libx265", "gbrp", {"preset": "ultrafast", "x265-params": "lossless=1:log-level=none"}
    )
    return found


def _images(kind: str, how: list[int], pictures: Sequence[Image], _still: Image) -> _Coded:
    began_s = time.process_time()
    encoded = [cv2.imencode(kind, picture, how)[1] for picture in pictures]
    spent_s = time.process_time() - began_s
    decoded = [np.asarray(cv2.imdecode(data, cv2.IMREAD_COLOR), np.uint8) for data in encoded]
    return _Coded(sum(map(len, encoded)), spent_s, decoded)


def _jpeg(quality: int, pictures: Sequence[Image], still: Image, *, full: bool = False) -> _Coded:
    how = [cv2.IMWRITE_JPEG_QUALITY, quality]
    how += [cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444] if full else []
    return _images(".jpg", how, pictures, still)


def _differences(quality: int, pictures: Sequence[Image], still: Image) -> _Coded:
    """Encode the differences to the baseline around a middle grey, every pixel's colour of its own."""
    base = still.astype(np.int16) - _MIDDLE
    began_s = time.process_time()
    apart = [np.clip(picture - base, 0, 255).astype(np.uint8) for picture in pictures]
    spent_s = time.process_time() - began_s
    coded = _jpeg(quality, apart, still, full=True)
    back = [np.clip(one + base, 0, 255).astype(np.uint8) for one in coded.pictures]
    return coded._replace(encode_s=coded.encode_s + spent_s, pictures=back)


def _with_cells(pictures: Sequence[Image], still: Image) -> _Coded:
    coded = _jpeg(95, pictures, still)
    began_s = time.process_time()
    cells = [cell_sums(picture, cv2) for picture in pictures]
    spent_s = coded.encode_s + time.process_time() - began_s
    return _Coded(coded.n_bytes + sum(map(len, cells)), spent_s, coded.pictures, [*map(read_sums, cells)])


def _video(
    codec: str, pixels: str, options: dict[str, str], pictures: Sequence[Image], _still: Image
) -> _Coded:
    """Encode a video, and decode it."""
    import av

    kept = io.BytesIO()
    spent_s = -time.process_time()
    with av.open(kept, "w", format="matroska") as file:
        stream: Any = file.add_stream(codec, 60, options=options)
        stream.height, stream.width, stream.pix_fmt = *pictures[0].shape[:2], pixels
        for picture in pictures:
            frame = av.VideoFrame.from_ndarray(picture, format="bgr24").reformat(format=pixels)
            file.mux(stream.encode(frame))
        file.mux(stream.encode(None))
    spent_s += time.process_time()
    back: Any = av.open(io.BytesIO(kept.getvalue()))
    with back:
        decoded: list[Image] = [frame.to_ndarray(format="bgr24") for frame in back.decode(video=0)]
    return _Coded(len(kept.getvalue()), spent_s, decoded)


def _measured(name: str, codec: Codec, courses: Sequence[_Course]) -> PricedVariant:
    n = n_bytes = n_otherwise = n_by_paper = 0
    encode_s, areas, by_paper = 0.0, list[float](), list[float]()
    for course in courses:
        still, pictures = course.still, course.pictures
        coded = codec(pictures, still)
        again, paper = TouchTracker(still), ContactReader(still)
        if coded.sums is None:
            theirs = [again.update(picture) for picture in coded.pictures]
        else:
            theirs = [again.update_sums(sums) for sums in coded.sums]
        otherwise, area = _apart(course.live, theirs)
        otherwise_by_paper, area_by_paper = _apart(course.paper, [*map(paper.read, coded.pictures)])
        n, n_bytes, encode_s = n + len(pictures), n_bytes + coded.n_bytes, encode_s + coded.encode_s
        n_otherwise, n_by_paper = n_otherwise + otherwise, n_by_paper + otherwise_by_paper
        areas.append(area)
        by_paper.append(area_by_paper)
    return PricedVariant(
        name=name,
        cost=n_bytes / n * _PER_MIN / 1e6,
        error=float(np.mean(areas)),
        beside={
            "same contact, % of frames": 100 * (1 - n_otherwise / n),
            "cores to encode": encode_s / n * _PER_S,
            "`paper`: area, %": float(np.mean(by_paper)),
            "`paper`: same contact, %": 100 * (1 - n_by_paper / n),
        },
        default=name == DEFAULT,
    )


def _apart(ours: Sequence[Any], theirs: Sequence[Any]) -> tuple[int, float]:
    """Return in how many frames only one has contact, and by how much the area differs where both have, percent."""
    pairs = list(zip(ours, theirs, strict=True))
    areas = [abs(b.eda / a.eda - 1) for a, b in pairs if a.in_contact and b.in_contact and a.eda]
    return sum(a.in_contact != b.in_contact for a, b in pairs), 100 * float(np.mean(areas or [0.0]))
