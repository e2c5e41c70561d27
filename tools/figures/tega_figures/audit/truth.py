"""Read the truth about a recording besides its readings: marked circles, drawn masks, measured forces."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega.errors import RecordingError
from tega.runtime.files.tables.numbers import named_rows
from tega.runtime.opencv import read_image

Image = NDArray[np.uint8]
Mask = NDArray[np.bool_]

# Beyond this many marked radii a press is not seen any more.
FAR_RADII = 2.4


@dataclass(frozen=True)
class Mark:
    """A contact circle that somebody drew: centre (column, row) and radius, pixels."""

    centre_xy: tuple[float, float]
    radius_px: float

    def distance(self, shape: tuple[int, ...]) -> NDArray[np.float64]:
        """Return the distance of every pixel from the centre, in radii."""
        rows, columns = np.mgrid[: shape[0], : shape[1]]
        x, y = self.centre_xy
        distance: NDArray[np.float64] = np.hypot(columns - x, rows - y) / self.radius_px
        return distance


class PictureTruth(NamedTuple):
    """Touched pixels, bool (H, W), and force of one picture; ``None`` where these are not known.

    ``force_n`` is the normal force, 0 where nothing touches; ``mark`` is the marked circle, from which
    ``drawn`` is.
    """

    drawn: Mask | None = None
    force_n: float | None = None
    mark: Mark | None = None

    @property
    def touched(self) -> bool | None:
        """Whether something touches, ``None`` where that is not known; a force counts before a drawing."""
        if self.force_n is not None:
            return self.force_n > 0
        return None if self.drawn is None else bool(self.drawn.any())


class Forces:
    """Forces by the name of a picture, or over time.

    ``by_name`` is by the base name of the picture, or a frame's number as text. ``t_s`` counts from the start
    of the recording, rising; empty where there is no course.
    """

    def __init__(
        self,
        by_name: dict[str, float],
        t_s: NDArray[np.float64] | None = None,
        force_n: NDArray[np.float64] | None = None,
    ) -> None:
        self._by_name = by_name
        self._t_s = np.zeros(0) if t_s is None else t_s
        self._force_n = np.zeros(0) if force_n is None else force_n

    @property
    def over_time(self) -> bool:
        """Whether it is a course over time."""
        return len(self._t_s) > 0

    def of_picture(self, name: str, seq: int, t_ns: int) -> float | None:
        """Return the force of a picture; ``None`` where it has none."""
        if self.over_time:
            return self.at(t_ns)
        return self._by_name.get(name, self._by_name.get(str(seq)))

    def at(self, t_ns: int) -> float | None:
        """Return the force at a time, between two measured ones; ``None`` before the first and after the last."""
        t_s = t_ns / 1e9
        if not self.over_time or not self._t_s[0] <= t_s <= self._t_s[-1]:
            return None
        return float(np.interp(t_s, self._t_s, self._force_n))


class FarField:
    """A picture without contact, composed from the parts of real presses far from their marked circles.

    It carries the sensor's real noise and drift. Where every press is near, the baseline, uint8 (H, W, 3), is
    left. ``picture`` is what is composed so far.
    """

    def __init__(self, baseline: Image) -> None:
        self.picture = baseline.copy()
        self._filled = np.zeros(baseline.shape[:2], np.bool_)

    def take(self, frame: Image, mark: Mark | None) -> None:
        """Take what is far from a press."""
        if mark is not None:
            take = (mark.distance(frame.shape) > FAR_RADII) & ~self._filled
            self.picture[take] = frame[take]
            self._filled |= take


def mask_of(picture: Path, masks: Path) -> Path | None:
    """Return the file of a picture's mask; ``None`` where it has none.

    A mask has its picture's name, or that with ``mask`` in the place of ``frame``, with any ending of a
    picture. A picture is not its own mask, though both may lie in one folder.
    """
    endings = dict.fromkeys((picture.suffix, ".png", ".bmp", ".jpg", ".jpeg", ".tif", ".tiff"))
    for stem in (picture.stem, picture.stem.replace("frame", "mask", 1)):
        for ending in endings:
            path = masks / f"{stem}{ending}"
            if path.is_file() and path.resolve() != picture.resolve():
                return path
    return None


def read_mask(path: Path, shape: tuple[int, ...]) -> Mask:
    """Read touched pixels: a picture that is white where touched, of the rows and columns of ``shape``."""
    white: Mask = read_image(path, driver="audit").max(axis=2) > 127
    if white.shape != shape:
        raise RecordingError(
            f"{path.name}: a mask of {white.shape[0]} x {white.shape[1]} pixels, the pictures have "
            f"{shape[0]} x {shape[1]}",
            "give masks of the pictures' size",
        )
    return white


def read_marks(path: Path) -> dict[str, Mark]:
    """Read marked circles, by the base name of the picture.

    The table has the columns img_name, center_x, center_y, radius (pixels). A picture that is listed twice
    has no trustworthy mark and is left out.
    """
    marks: dict[str, Mark] = {}
    twice: set[str] = set()

    def take(row: dict[str, str]) -> None:
        name = _base_name(row["img_name"])
        mark = Mark((float(row["center_x"]), float(row["center_y"])), float(row["radius"]))
        twice.update({name} & marks.keys())
        marks[name] = mark

    _read_rows(path, take, subject="mark", wanted="img_name,center_x,center_y,radius")
    return {name: mark for name, mark in marks.items() if name not in twice}


def read_forces(path: Path, *, least_n: float = 0.0) -> Forces:
    """Read forces: a table with the columns img_name and force_n (newtons), or t_s (seconds) and force_n.

    A video's frames are named by their number from 0; that column may be called frame. What is nearer to 0
    than ``least_n``, which a sensor reports of nothing, is taken for 0.
    """
    by_name: dict[str, float] = {}
    course: list[tuple[float, float]] = []

    def take(row: dict[str, str]) -> None:
        force_n = float(row["force_n"])
        force_n = 0.0 if abs(force_n) < least_n else force_n
        if not 0 <= force_n < 1e4:
            raise ValueError(
                f"force_n = {force_n}, wanted 0 to 10,000 N; --least-force-n takes noise about 0 for 0"
            )
        if row.get("t_s") is not None:
            course.append((float(row["t_s"]), force_n))
        else:
            by_name[_base_name(row["frame"] if "frame" in row else row["img_name"])] = force_n

    _read_rows(path, take, subject="force", wanted="img_name,force_n; frame,force_n or t_s,force_n")
    t_s, force_n = np.array(course, np.float64).reshape(-1, 2).T
    if not np.isfinite(t_s).all() or (np.diff(t_s) <= 0).any():
        raise RecordingError(f"{path.name}: t_s does not rise from line to line", "sort the lines by time")
    return Forces(by_name, t_s, force_n)


def _base_name(path: str) -> str:
    return re.split(r"[/\\]", path)[-1]


def _read_rows(path: Path, take: Callable[[dict[str, str]], None], *, subject: str, wanted: str) -> None:
    """Give every line of a table to a function that raises ValueError, KeyError or TypeError where it cannot be."""
    try:
        _, rows = named_rows(path, most_mib=64)
        for line, cells in rows:
            try:
                take(cells)
            except (KeyError, TypeError, ValueError) as error:
                raise RecordingError(
                    f"{path.name}:{line}: not a {subject} ({error})", f"wanted: {wanted}"
                ) from error
    except OSError as error:
        raise RecordingError(f"{path.name}: cannot be read: {error.strerror}", "check the path") from error
