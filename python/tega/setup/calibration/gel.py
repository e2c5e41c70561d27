"""Judge a fingertip's gel at rest: whether its baseline is good, and how it changed since earlier ones.

A baseline is the mean of pictures of the untouched gel. It is worth nothing if the pictures differ among each other or
if something touches the gel, so both are looked for. Numbers are counts of 0 to 255 unless the name says otherwise.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega.errors import CalibrationError
from tega.tactile import read_contact, sensor_noise

LEAST_PICTURES = 20
"""Averaging over fewer leaves noise in the baseline."""

# A DIGIT's channels have 1.7 to 3.2 counts of noise; beyond this something is wrong with the sensor or its cable.
_NOISY = 6.0
# Brightness that moves by more than this between the first and the last third has not settled.
_UNSETTLED = 2.0
# This share of pictures in contact with the mean of all means that something moved.
_MOVED_SHARE = 0.1
# On 31 real presses a dent stands 37 counts or more out of a smooth surface fitted to its own picture, and the same
# sensor's untouched gel 29: there is no sharper test without an earlier baseline.
_DENT_PEAK = 33.0
_SURFACE_ORDER = 5

# Far from contact a baseline and later pictures differ by up to 12 to 15 counts (99th percentile to 99.9th).
# In units of the noise of that sensor's noisiest colour, 3.1 counts: 15 and 6 counts.
_SPOT = 4.8
_SPOT_PX = 20
_SHIFTED = 1.9
# A DIGIT's colours are at 80 to 130 counts, 25 to 40 times its noise.
_DARK_NOISES = 8.0
_LEAST_NOISE, _MOST_NOISE = 0.8, 12.0
_NOISIER = 1.5
_WORN_SHARE = 0.02
_BOX = 5


class Rest(NamedTuple):
    """A fingertip at rest; its picture is the mean of ``n_pictures``, uint8 (H, W, 3), blue, green, red.

    ``noise`` is the standard deviation of a pixel in time, ``cell_noise`` that of a cell's mean
    (:func:`tega.tactile.sensor_noise`), counts, blue, green, red. ``problems`` are reasons why this is no
    good baseline, one sentence each; empty for a good one.
    """

    picture: NDArray[np.uint8]
    noise: tuple[float, float, float]
    cell_noise: tuple[float, float, float]
    n_pictures: int
    problems: tuple[str, ...]


def judge_rest(pictures: Sequence[NDArray[np.uint8]]) -> Rest:
    """Average pictures of an untouched gel and judge whether they agree.

    They must be two or more, uint8 (H, W, 3), of one size, in the order they came.
    """
    if len(pictures) < 2 or len({p.shape for p in pictures}) > 1:
        sizes = sorted({f"{p.shape[1]}×{p.shape[0]}" for p in pictures})
        raise CalibrationError(
            f"{len(pictures)} pictures of {' and '.join(sizes) or 'no size'} make no baseline",
            "look at the sensor's cable",
        )
    mean, noise = mean_and_noise(pictures)
    levels = [picture.mean(axis=(0, 1)) for picture in pictures]
    third = max(1, len(levels) // 3)
    moved = np.mean(levels[-third:], axis=0) - np.mean(levels[:third], axis=0)
    problems = []
    if len(pictures) < LEAST_PICTURES:
        problems.append(f"only {len(pictures)} good pictures came, {LEAST_PICTURES} are needed")
    if float(np.abs(moved).max()) > _UNSETTLED:
        problems.append(
            f"the light still changes (by {moved[np.abs(moved).argmax()]:+.1f} counts): give the sensor a moment"
        )
    if float(noise.max()) > _NOISY:
        problems.append(
            f"the picture is very noisy ({noise.max():.1f} counts, a DIGIT has about 3): look at its cable"
        )
    if text := dark(mean, float(noise.max())):
        problems.append(text)
    cell_noise = sensor_noise(pictures)
    n_touched = sum(read_contact(p, mean, noise=cell_noise).in_contact for p in pictures)
    if n_touched > _MOVED_SHARE * len(pictures):
        problems.append("the pictures differ: something moved on the gel")
    return Rest(mean, _bgr(noise), _bgr(np.array(cell_noise)), len(pictures), tuple(problems))


def mean_and_noise(
    pictures: Sequence[NDArray[np.uint8]],
) -> tuple[NDArray[np.uint8], NDArray[np.float64]]:
    """Return the mean of two or more pictures, uint8 (H, W, 3), and the standard deviation of a pixel in time, (3,).

    The pictures are of one size, in the order they came; the deviation is in counts, blue, green, red.
    """
    total, squares = pictures[0].astype(np.float64), np.zeros(3)
    for before, after in pairwise(pictures):
        total += after
        # In whole numbers, and along rows first: numpy adds three colours a pixel seven times as slowly.
        difference = after.astype(np.int32) - before
        squares += (difference * difference).sum(axis=0).sum(axis=0) / (after.shape[0] * after.shape[1])
    # Two neighbours differ by the noise of both.
    noise: NDArray[np.float64] = np.sqrt(squares / (2 * (len(pictures) - 1)))
    return np.rint(total / len(pictures)).astype(np.uint8), noise


def dark(picture: NDArray[np.uint8], noise: float) -> str:
    """Return a sentence if an untouched gel's image is too dark to detect touch, else ``""``.

    ``picture`` is the mean of some, uint8 (H, W, 3); ``noise`` is that of the noisiest colour, counts.
    """
    level = float(np.median(picture, axis=(0, 1)).max())
    if level >= _DARK_NOISES * max(noise, _LEAST_NOISE):
        return ""
    return (
        f"the picture is dark: its brightest colour is at {level:.0f} of 255, {level / max(noise, _LEAST_NOISE):.0f} "
        f"times its noise, {_DARK_NOISES:g} are needed: look at the sensor's lights"
    )


def suspect_contact(
    picture: NDArray[np.uint8],
    before: NDArray[np.uint8] | None,
    *,
    noise: tuple[float, float, float] | None = None,
) -> str:
    """Return a sentence if something seems to touch a gel that should be at rest, else ``""``.

    Against an earlier baseline of the same sensor, ``before``, a dent is seen as in a run. Without one the
    picture is compared with a smooth surface fitted to itself, which only sees firm dents. ``picture`` is the
    mean of now, uint8 (H, W, 3); ``noise`` is that of the sensor's cells, ``None`` takes a DIGIT's.
    """
    if before is not None and before.shape == picture.shape:
        found = read_contact(picture, before, noise=noise)
        if found.in_contact:
            x, y = found.centroid_xy
            return (
                f"a dent of {found.eda} pixels at ({x:.0f}, {y:.0f}) that the last baseline does not have: "
                "something touches the gel, or it has changed for good"
            )
        return ""
    found = read_contact(picture, _surface(picture))
    if found.in_contact and found.peak > _DENT_PEAK:
        return f"this looks like a dent ({found.eda} pixels): does something touch the gel?"
    return ""


def _surface(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Fit a polynomial of the fourth degree to each colour."""
    height, width = picture.shape[:2]
    y, x = np.mgrid[-1 : 1 : complex(0, height), -1 : 1 : complex(0, width)]
    terms = np.stack(
        [x**i * y**j for i in range(_SURFACE_ORDER) for j in range(_SURFACE_ORDER - i)], axis=-1
    ).reshape(height * width, -1)
    some = slice(None, None, 7)
    weights = np.linalg.lstsq(terms[some], picture.reshape(-1, 3)[some].astype(np.float64), rcond=None)[0]
    fitted: NDArray[np.float64] = np.rint(terms @ weights).reshape(picture.shape)
    return np.clip(fitted, 0, 255).astype(np.uint8)


class GelChange(NamedTuple):
    """Change of a gel between two baselines of one sensor.

    ``shift`` is that of the whole picture, counts, blue, green, red. ``dark_px`` counts the pixels that are
    darker than the shift explains. ``wear`` is the share of darker and brighter pixels, 0 to 1; ``words`` are
    the consequences, one sentence each, none for a healthy gel.
    """

    shift: tuple[float, float, float]
    dark_px: int
    wear: float
    words: tuple[str, ...]


def compare_gels(
    now: NDArray[np.uint8], then: NDArray[np.uint8], *, noise_now: float, noise_then: float, when: str
) -> GelChange:
    """Compare two baselines of one sensor, uint8 (H, W, 3) of one size.

    The noises are those of the noisiest colour, counts, the unit for judging spots and changes of light;
    ``noise_then`` is above 0. ``when`` names the earlier baseline in the sentences, such as ``2026-11-02``.
    """
    difference = now.astype(np.float64) - then
    shift = np.median(difference, axis=(0, 1))
    grey = _blurred((difference - shift).mean(axis=2))
    noise = min(max(noise_now, noise_then, _LEAST_NOISE), _MOST_NOISE)
    dark_px = int((grey < -_SPOT * noise).sum())
    wear = int((np.abs(grey) > _SPOT * noise).sum()) / grey.size
    ratio = noise_now / max(noise_then, 0.1)
    row, column = divmod(int(grey.argmin()), grey.shape[1])
    words = []
    level = float(shift.mean())
    if float(np.abs(shift).max()) > _SHIFTED * noise:
        words.append(
            f"the picture is {abs(level):.0f} counts {'darker' if level < 0 else 'brighter'} than on {when}: "
            "lights, cable or gel have aged"
        )
    if dark_px >= _SPOT_PX:
        words.append(
            f"a dark spot of {dark_px} pixels at ({column}, {row}) that was not there on {when}: "
            "wipe the gel; if it stays, its coat is damaged"
        )
    if ratio > _NOISIER:
        words.append(
            f"{ratio:.1f} times as noisy as on {when}: look at the cable and at what else is on its USB hub"
        )
    if wear > _WORN_SHARE:
        words.append(f"{wear:.0%} of the gel looks other than on {when}: think of a new one")
    return GelChange(_bgr(shift), dark_px, wear, tuple(words))


def _blurred(grey: NDArray[np.float64]) -> NDArray[np.float64]:
    """Average over 5 by 5 pixels; a pixel's own noise is no spot."""
    padded = np.pad(grey, ((_BOX // 2 + 1, _BOX // 2), (_BOX // 2 + 1, _BOX // 2)), mode="edge")
    sums = padded.cumsum(axis=0).cumsum(axis=1)
    boxes: NDArray[np.float64] = (
        sums[_BOX:, _BOX:] - sums[:-_BOX, _BOX:] - sums[_BOX:, :-_BOX] + sums[:-_BOX, :-_BOX]
    )
    boxes /= _BOX**2
    return boxes


def _bgr(values: NDArray[np.float64]) -> tuple[float, float, float]:
    blue, green, red = (round(float(v), 3) for v in values)
    return blue, green, red
