"""The readings of equations 1 to 6 side by side on recorded touch.

The paper's threshold mixes pixels with grey values, its difference image has no stated sign, and its area has three
meanings; each way of reading it is a line of the table here, applied to the same frames.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.errors import RecordingError
from tega.foreign_file import read_words
from tega.tactile import contact_mask, contact_metrics, pressure_map, read_contact

__all__ = [
    "READINGS",
    "Mark",
    "ReadingScore",
    "audit_frames",
    "far_field",
    "mean_difference",
    "read_forces",
    "read_marks",
]

Image = NDArray[np.uint8]
Mask = NDArray[np.bool_]

# Beyond this many marked radii a press is not seen any more.
FAR_RADII = 2.4
LUMA_BGR = np.array([0.114, 0.587, 0.299])


class Outcome(msgspec.Struct, frozen=True):
    """What one reading says of one frame."""

    eda: int
    cci: float
    mask: Mask


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


class ReadingScore(msgspec.Struct, frozen=True):
    """How one reading behaves on a set of frames.

    Attributes:
        reading: Its name in :data:`READINGS`.
        n_frames: Frames looked at.
        n_found: Frames with a contact area.
        eda: EDA of every frame, pixels.
        cci: CCI of every frame.
        eda_at_rest: EDA of the no-contact frame, pixels; ``None`` without one.
        area_ratio: Median of EDA over marked area; ``None`` without marks and masks.
        iou: Median overlap of its pixels with the marked circle or mask (intersection over union); likewise.
        iou_low: The tenth of the presses that overlap least lie below this.
        area_correlation: Of EDA with marked area over the presses; likewise.
        n_false: Frames with a contact area among those whose force is 0 or whose mask is empty; ``None`` without
        such frames.
        n_touched: Frames whose force is over 0 or whose mask or mark is not empty; likewise.
        n_felt: Those of them with a contact area.
        force_rank: Rank correlation of EDA with force over the frames with a force over 0; ``None`` without.
    """

    reading: str
    n_frames: int
    n_found: int
    eda: list[int]
    cci: list[float]
    eda_at_rest: int | None = None
    area_ratio: float | None = None
    iou: float | None = None
    iou_low: float | None = None
    area_correlation: float | None = None
    n_false: int | None = None
    n_touched: int | None = None
    n_felt: int | None = None
    force_rank: float | None = None


def _printed(**options: str) -> Callable[[Image, Image], Outcome]:
    """Equations 1 to 6 as printed, with one named option."""

    def read(frame: Image, baseline: Image) -> Outcome:
        m = contact_metrics(frame, baseline, **options)  # type: ignore[arg-type]
        difference = frame.astype(np.int16) - baseline
        if options.get("difference") == "rectified":
            difference = np.maximum(difference, 0)
        elif options.get("difference") == "absolute":
            difference = np.abs(difference)
        mask = difference @ LUMA_BGR > m.threshold if m.in_contact else np.zeros(frame.shape[:2], np.bool_)
        return Outcome(m.eda, m.cci, mask)

    return read


def _preset(reading: str) -> Callable[[Image, Image], Outcome]:
    def read(frame: Image, baseline: Image) -> Outcome:
        m = read_contact(frame, baseline, reading=reading)  # type: ignore[arg-type]
        return Outcome(m.eda, m.cci, contact_mask(frame, baseline, reading=reading))  # type: ignore[arg-type]

    return read


def _masked(threshold: Callable[[NDArray[np.float32], float], float]) -> Callable[[Image, Image], Outcome]:
    """The `paper` preset's masked map under another threshold, given the map and its value at the centroid."""

    def read(frame: Image, baseline: Image) -> Outcome:
        m = read_contact(frame, baseline, reading="paper")
        if not m.in_contact:
            return Outcome(0, 0.0, np.zeros(frame.shape[:2], np.bool_))
        grey = pressure_map(frame, baseline, reading="paper")
        x, y = (int(v + 0.5) for v in m.centroid_xy)
        mask = (grey > threshold(grey, float(grey[y, x]))) & (grey > 0)
        area = int(mask.sum())
        return Outcome(area, m.peak / area if area else 0.0, mask)

    return read


READINGS: Mapping[str, Callable[[Image, Image], Outcome]] = {
    "print, signed": _printed(),
    "print, rectified": _printed(difference="rectified"),
    "print, absolute": _printed(difference="absolute"),
    "print, σ of intensity": _printed(difference="absolute", spread="intensity"),
    "masked, σ of intensity": _masked(lambda grey, centre: centre - 1.28 * float(grey[grey > 0].std())),
    "masked, 0.44 of centre": _masked(lambda _grey, centre: 0.44 * centre),
    "masked, 10 % of peak": _masked(lambda grey, _centre: 0.1 * float(grey.max())),
    "masked, half of peak": _masked(lambda grey, _centre: 0.5 * float(grey.max())),
    "paper (masked, as printed)": _preset("paper"),
    "live": _preset("live"),
}
"""Every reading by name."""


def audit_frames(
    frames: Sequence[Image],
    baseline: Image,
    *,
    marks: Sequence[Mark | None] = (),
    masks: Sequence[Mask | None] = (),
    forces_n: Sequence[float | None] = (),
    at_rest: Image | None = None,
    readings: Sequence[str] = tuple(READINGS),
) -> list[ReadingScore]:
    """Apply the readings to the same frames.

    Args:
        frames: uint8 (H, W, 3), BGR.
        baseline: The untouched gel, same shape.
        marks: The marked circle of each frame, ``None`` where there is none; empty without marks.
        masks: The touched pixels of each frame, bool (H, W), likewise; they count before a mark.
        forces_n: Normal force of each frame, newtons, likewise; 0 where nothing touches.
        at_rest: A frame without contact.
        readings: Which readings; all by default.

    Returns:
        One score a reading.
    """
    n = len(frames)
    drawn = [
        mask if mask is not None else None if mark is None else mark.distance(baseline.shape) <= 1
        for mark, mask in zip(marks or [None] * n, masks or [None] * n, strict=True)
    ]
    return [
        _score(name, frames, baseline, drawn, forces_n=forces_n or [None] * n, at_rest=at_rest)
        for name in readings
    ]


def mean_difference(frames: Sequence[Image], baseline: Image) -> NDArray[np.float64]:
    """Return how far each frame is from the baseline: mean absolute difference in counts, float64 (n,)."""
    still = baseline.astype(np.int16)
    return np.array([np.abs(frame - still).mean() for frame in frames], np.float64)


def _score(
    name: str,
    frames: Sequence[Image],
    baseline: Image,
    drawn: Sequence[Mask | None],
    *,
    forces_n: Sequence[float | None],
    at_rest: Image | None,
) -> ReadingScore:
    read = READINGS[name]
    outcomes = [read(frame, baseline) for frame in frames]
    score = ReadingScore(
        reading=name,
        n_frames=len(frames),
        n_found=sum(o.eda > 0 for o in outcomes),
        eda=[o.eda for o in outcomes],
        cci=[o.cci for o in outcomes],
        eda_at_rest=None if at_rest is None else read(at_rest, baseline).eda,
    )
    # None: not known; a force says more than a drawing.
    touched = [
        force > 0 if force is not None else None if mask is None else bool(mask.any())
        for force, mask in zip(forces_n, drawn, strict=True)
    ]
    found_in = {
        truth: [o.eda > 0 for o, t in zip(outcomes, touched, strict=True) if t is truth]
        for truth in (True, False)
    }
    pressed = [(f, o.eda) for f, o in zip(forces_n, outcomes, strict=True) if f]
    score = msgspec.structs.replace(
        score,
        n_false=sum(found_in[False]) if found_in[False] else None,
        n_touched=len(found_in[True]) or None,
        n_felt=sum(found_in[True]) if found_in[True] else None,
        force_rank=_rank_correlation(pressed),
    )
    marked = [(o, mask) for o, mask in zip(outcomes, drawn, strict=True) if mask is not None and mask.any()]
    if not marked:
        return score
    discs = [mask for _, mask in marked]
    areas = np.array([disc.sum() for disc in discs], np.float64)
    found = np.array([o.eda for o, _ in marked], np.float64)
    overlap = [
        (o.mask & disc).sum() / (o.mask | disc).sum() for (o, _), disc in zip(marked, discs, strict=True)
    ]
    varied = len(marked) > 2 and found.std() > 0 and areas.std() > 0
    return msgspec.structs.replace(
        score,
        area_ratio=float(np.median(found / areas)),
        iou=float(np.median(overlap)),
        iou_low=float(np.percentile(overlap, 10)),
        area_correlation=float(np.corrcoef(found, areas)[0, 1]) if varied else None,
    )


def _rank_correlation(pairs: Sequence[tuple[float, float]]) -> float | None:
    """Spearman's, equal values sharing their mean rank; ``None`` under three pairs or where one side does not vary."""
    if len(pairs) < 3:
        return None
    ranks = []
    for values in zip(*pairs, strict=True):
        _, place, counts = np.unique(values, return_inverse=True, return_counts=True)
        ranks.append((np.cumsum(counts) - (counts - 1) / 2)[place])
    if not all(np.ptp(side) for side in ranks):
        return None
    return float(np.corrcoef(ranks[0], ranks[1])[0, 1])


def far_field(frames: Sequence[Image], marks: Sequence[Mark | None], baseline: Image) -> Image:
    """Compose a frame without contact from the parts of real presses that lie far from their circles.

    It carries the sensor's real noise and drift. Where every press is near, the baseline is left.
    """
    composed = baseline.copy()
    filled = np.zeros(baseline.shape[:2], np.bool_)
    for frame, mark in zip(frames, marks, strict=True):
        if mark is not None:
            take = (mark.distance(frame.shape) > FAR_RADII) & ~filled
            composed[take] = frame[take]
            filled |= take
    return composed


def read_marks(path: Path) -> dict[str, Mark]:
    """Read marked circles: a table with the columns img_name, center_x, center_y, radius (pixels).

    A picture that is listed twice has no trustworthy mark and is left out.

    Args:
        path: The CSV file.

    Returns:
        Marks by the base name of the picture.

    Raises:
        RecordingError: The file cannot be read, or a line is not what it should be.
    """
    marks: dict[str, Mark] = {}
    twice: set[str] = set()
    try:
        with io.StringIO(read_words(path, most_mib=64), newline="") as file:
            for number, row in enumerate(csv.DictReader(file), start=2):
                try:
                    name = re.split(r"[/\\]", row["img_name"])[-1]
                    mark = Mark((float(row["center_x"]), float(row["center_y"])), float(row["radius"]))
                except (KeyError, TypeError, ValueError) as error:
                    raise RecordingError(
                        f"{path.name}:{number}: not a mark ({error})",
                        "wanted: img_name,center_x,center_y,radius",
                    ) from error
                twice |= {name} & marks.keys()
                marks[name] = mark
    except OSError as error:
        raise RecordingError(f"{path.name}: cannot be read: {error.strerror}", "check the path") from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise RecordingError(
            f"{path.name}: is no table of text: {error}", "export the marks as CSV"
        ) from error
    return {name: mark for name, mark in marks.items() if name not in twice}


def read_forces(path: Path) -> dict[str, float]:
    """Read forces: a table with the columns img_name and force_n (newtons).

    A video's frames are named by their number from 0.

    Args:
        path: The CSV file.

    Returns:
        Forces by the base name of the picture, or the number as text.

    Raises:
        RecordingError: The file cannot be read, or a line is not what it should be.
    """
    forces: dict[str, float] = {}
    try:
        with path.open(newline="", encoding="utf-8") as file:
            for number, row in enumerate(csv.DictReader(file), start=2):
                try:
                    name, force_n = re.split(r"[/\\]", row["img_name"])[-1], float(row["force_n"])
                except (KeyError, TypeError, ValueError) as error:
                    raise RecordingError(
                        f"{path.name}:{number}: not a force ({error})", "wanted: img_name,force_n"
                    ) from error
                if not 0 <= force_n < 1e4:
                    raise RecordingError(
                        f"{path.name}:{number}: force_n = {force_n}, wanted 0 to 10,000 N", "mend the line"
                    )
                forces[name] = force_n
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise RecordingError(f"{path.name}: cannot be read: {error}", "check the path") from error
    return forces
