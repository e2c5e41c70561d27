"""Turn a fingertip camera's frame and its baseline into contact metrics (equations 1 to 6).

Images are uint8 arrays of shape (height, width, 3), 1 to 4096 pixels on each side, with any strides, writeable or
not; they are borrowed, never copied. Any other dtype and masked pixels are refused: turning floats into counts, or
filling a mask, is a decision of the caller. Coordinates are (column, row), pixel centres counted from 0. Grey values
are counts of 0 to 255.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import lru_cache, partial
from typing import Any, Literal, NamedTuple, TypeAlias, TypedDict, Unpack, cast

import numpy as np
from numpy.typing import NDArray

from tega import _native
from tega.errors import ShapeError
from tega.runtime.leading_axes import each_item
from tega.tactile.tracker import Order, Outline

Reading = Literal["paper", "live"]
Images: TypeAlias = "NDArray[np.uint8] | Sequence[NDArray[np.uint8]]"


class ContactMetrics(NamedTuple):
    """Contact metrics of one frame.

    Where the equations have no value (the mass is not positive, or the variance of the chosen reading is negative),
    and where a gate says there is no contact, ``in_contact`` is False, ``centroid_xy``, ``spread`` and ``threshold``
    are NaN, and ``eda`` and ``cci`` are 0.
    """

    mass: float = 0.0
    """Sum of the grey map, grey values."""
    centroid_xy: tuple[float, float] = (math.nan, math.nan)
    """Eq 2, pixels."""
    spread: float = math.nan
    """σ: pixels (Eq 3, spatial) or grey values (intensity)."""
    threshold: float = math.nan
    """Eq 4: T, grey values."""
    eda: int = 0
    """Eq 5: effective deformation area, pixels above T."""
    cci: float = 0.0
    """Eq 6: contact concentration index, grey values per pixel; 0 where ``eda`` is 0."""
    peak: float = 0.0
    """Largest grey value."""
    peak_xy: tuple[int, int] = (0, 0)
    """Where it is; the first in row order."""
    in_contact: bool = False
    """False where there is nothing to report."""


# As ``_make``, which counts the fields once more.
_metrics: Callable[[Any], ContactMetrics] = partial(tuple.__new__, ContactMetrics)


class ContactGate(NamedTuple):
    """No contact unless ``min_pixels`` pixels exceed ``noise_floor`` grey values (0 to 255)."""

    noise_floor: float
    min_pixels: int = 30


class ReadingOptions(TypedDict, total=False):
    """Options of :func:`read_contact` beside its preset."""

    order: Order
    outline: Outline
    noise: Sequence[float] | None


def contact_metrics(
    frame: NDArray[np.uint8],
    baseline: NDArray[np.uint8],
    *,
    weights: tuple[float, float, float] = (0.299, 0.587, 0.114),
    order: Order = "bgr",
    difference: Literal["signed", "rectified", "absolute"] = "signed",
    spread: Literal["spatial", "intensity"] = "spatial",
    factor: float = 1.28,
    centroid_value: Literal["nearest", "bilinear"] = "nearest",
    gate: ContactGate | None = None,
) -> ContactMetrics:
    """Compute equations 1 to 6 on one frame; the defaults are the equations as printed.

    The sums are exact integers: ``eda``, ``peak`` and ``peak_xy`` are exact, the other numbers are rounded once or
    twice at the end. Weights and factor mean their printed decimals (0.299 is 299/1000).

    Args:
        frame: The image, uint8 (H, W, 3).
        baseline: The no-contact image, same shape.
        weights: (ω_r, ω_g, ω_b) of Eq 1 whatever ``order`` is; their sum is 1 within 1e-9, never renormalised.
        order: Order of the colour bytes in both images.
        difference: ``frame - baseline`` as printed, or negative to 0, or absolute; the last two per channel and
            before weighting.
        spread: σ of Eq 4: Eq 3 in pixels as printed, or the population standard deviation of the grey map over all
            pixels.
        factor: The 1.28 of Eq 4.
        centroid_value: I(μ) of Eq 4: the nearest pixel (ties upward), or bilinear between four; a centroid outside
            the image is clamped into it.
        gate: Report no contact below this; ``None`` as printed.

    Raises:
        DtypeError: An image is not a uint8 array.
        ShapeError: An image is not (H, W, 3), is empty or too large, or the two differ in size.
        InvalidValueError: The weights do not add up to 1, a number is not finite, or an option is not known.

    Example:
        >>> import numpy as np
        >>> baseline = np.full((240, 320, 3), 90, np.uint8)
        >>> frame = baseline.copy()
        >>> frame[100:120, 50:80] += 40
        >>> m = contact_metrics(frame, baseline, spread="intensity")
        >>> m.peak, m.eda, m.centroid_xy
        (40.0, 600, (64.5, 109.5))
    """
    equations = _equations(tuple(weights), order, difference, spread, factor, centroid_value, gate)
    return _metrics(equations.metrics(frame, baseline))


def contact_metrics_many(
    frames: Images,
    baseline: NDArray[np.uint8] | Images,
    *,
    weights: tuple[float, float, float] = (0.299, 0.587, 0.114),
    order: Order = "bgr",
    difference: Literal["signed", "rectified", "absolute"] = "signed",
    spread: Literal["spatial", "intensity"] = "spatial",
    factor: float = 1.28,
    centroid_value: Literal["nearest", "bilinear"] = "nearest",
    gate: ContactGate | None = None,
) -> list[ContactMetrics]:
    """Apply :func:`contact_metrics` to many frames in one call; a batch is spread over the cores.

    ``frames`` are uint8 (N, H, W, 3), or N images of any sizes, ``baseline`` one image for all, or one each, else
    ``ShapeError``; options, other errors and each result are those of :func:`contact_metrics`.
    """
    equations = _equations(tuple(weights), order, difference, spread, factor, centroid_value, gate)
    return _each(equations.metrics_many, frames, baseline)


@lru_cache(maxsize=32)
def _equations(  # noqa: PLR0917  # by position: a key of keywords takes longer to make than the options
    weights: tuple[float, float, float],
    order: str,
    difference: str,
    spread: str,
    factor: float,
    centroid_value: str,
    gate: ContactGate | None,
) -> _native.Equations:
    # Kept, since parsing the decimals takes longer than finding them again.
    return _native.Equations(
        weights=weights,
        order=order,
        difference=difference,
        spread=spread,
        factor=factor,
        centroid_value=centroid_value,
        gate=gate,
    )


def _each(
    read: Callable[[list[NDArray[np.uint8]], list[NDArray[np.uint8]]], list[Any]],
    frames: Images,
    baseline: NDArray[np.uint8] | Images,
) -> list[ContactMetrics]:
    if getattr(baseline, "ndim", 0) in {2, 3}:  # a grey one is refused as such
        baselines = [cast("NDArray[np.uint8]", baseline)] * len(frames)
    elif len(baseline) == len(frames):
        baselines = list(baseline)
    else:
        raise ShapeError(
            f"{len(baseline)} baselines for {len(frames)} frames", "give one for all frames, or one for each"
        )
    return list(map(_metrics, read(list(frames), baselines)))


def read_contact(
    frame: NDArray[np.uint8],
    baseline: NDArray[np.uint8],
    *,
    reading: Reading = "live",
    order: Order = "bgr",
    outline: Outline = "dent",
    noise: Sequence[float] | None = None,
) -> ContactMetrics:
    """Read the contact as a preset does: ``paper`` for the printed law, ``live`` for people.

    ``paper``: absolute differences with the default weights, 5×5 box blur (mirrored border), values under the noise
    floor of 6 grey values set to 0, then Eq 2 to 6 with T not below that floor; no contact under 30 pixels above it.

    ``live``: the dent that the picture shows, found by its shading against the sensor's noise, one outline a patch.
    ``eda`` is its area, ``peak`` its height in counts, ``cci`` is peak/√EDA, which rises with the press;
    ``centroid_xy`` and ``spread`` are the mask's, ``threshold`` is the mean response at the outlines.

    Args:
        frame: The image, uint8 (H, W, 3).
        baseline: The no-contact image, same shape.
        reading: The preset.
        order: Order of the colour bytes in both images.
        outline: Area that ``live`` outlines: the dent, as an eye marks it, or the touching area of a curved object,
            which is smaller and fragile on faint contacts. ``paper`` ignores it.
        noise: The sensor's, from :func:`sensor_noise`; ``None`` takes that of a DIGIT. ``paper`` takes no notice of it.

    Errors are those of :func:`contact_metrics`; ``InvalidValueError`` also for a choice that is not known.
    """
    preset = _preset(reading, order=order, outline=outline, noise=noise)
    return _metrics(preset.read(frame, baseline))


def _preset(
    reading: Reading,
    *,
    order: Order = "bgr",
    outline: Outline = "dent",
    noise: Sequence[float] | None = None,
) -> _native.Preset:
    return _native.Preset(reading=reading, order=order, outline=outline, noise=noise)


def read_contacts(
    frames: Images,
    baseline: NDArray[np.uint8] | Images,
    *,
    reading: Reading = "live",
    **options: Unpack[ReadingOptions],
) -> list[ContactMetrics]:
    """Apply :func:`read_contact` to many frames in one call: the fingers of a hand, or a batch over the cores.

    ``frames`` are uint8 (N, H, W, 3), or N images of any sizes, ``baseline`` one image for all, or one each, else
    ``ShapeError``; options, other errors and each result are those of :func:`read_contact`.
    """
    return _each(_preset(reading, **options).read_many, frames, baseline)


class ContactReader:
    """Reads one sensor's frames against one baseline, as :func:`read_contact` does, to the last bit, and quicker.

    The baseline, uint8 (H, W, 3), is copied; options and errors are those of :func:`read_contact`.

    Example:
        >>> import numpy as np
        >>> still = np.full((320, 240, 3), 90, np.uint8)
        >>> ContactReader(still).read(still).in_contact
        False
    """

    def __init__(
        self,
        baseline: NDArray[np.uint8],
        *,
        reading: Reading = "live",
        **options: Unpack[ReadingOptions],
    ) -> None:
        self._preset = _preset(reading, **options)
        self._preset.read(baseline, baseline)
        self._baseline = baseline.copy()
        self._known = self._preset.known(baseline) if reading == "live" else None

    def read(self, frame: NDArray[np.uint8]) -> ContactMetrics:
        """Return the contact metrics of a frame; ``ShapeError`` if it is not of the baseline's size."""
        known = self._known
        return _metrics(known.read(frame) if known else self._preset.read(frame, self._baseline))


def contact_mask(
    frame: NDArray[np.uint8],
    baseline: NDArray[np.uint8],
    reading: Reading = "live",
    **options: Unpack[ReadingOptions],
) -> NDArray[np.bool_]:
    """Return the pixels that :func:`read_contact` counts as contact: their number is its ``eda``.

    Args and errors are those of :func:`read_contact`; frames and baselines may have leading axes, which are broadcast.

    Returns:
        bool (..., H, W).
    """
    return _each_picture(_preset(reading, **options).mask, frame, baseline, np.bool_)


def pressure_map(
    frame: NDArray[np.uint8],
    baseline: NDArray[np.uint8],
    reading: Reading = "live",
    **options: Unpack[ReadingOptions],
) -> NDArray[np.float32]:
    """Return the map that :func:`read_contact` measures on, for display.

    ``paper``: grey values after blur and noise floor. ``live``: the response to the dent's slopes in counts, one
    value a cell of a few pixels, and 0 all over without contact. Args and errors are those of :func:`contact_mask`.

    Returns:
        float32 (..., H, W).
    """
    return _each_picture(_preset(reading, **options).pressure_map, frame, baseline, np.float32)


def _each_picture(
    read: Callable[[NDArray[np.uint8], NDArray[np.uint8]], NDArray[Any]],
    frames: NDArray[np.uint8],
    baselines: NDArray[np.uint8],
    dtype: Any,
) -> NDArray[Any]:
    if max(getattr(frames, "ndim", 0), getattr(baselines, "ndim", 0)) <= 3:
        return read(frames, baselines)
    return each_item(read, frames, baselines, item_axes=3, kept=slice(-3, -1), dtype=dtype)


def estimate_baseline(frames: Sequence[NDArray[np.uint8]]) -> NDArray[np.uint8]:
    """Estimate the untouched gel from a recording that comes without a baseline.

    Contact adds shading: the baseline is the median of the frames with the least structure, wherever they lie in the
    recording; frames of another brightness, as a camera gives just after its start, are left out.

    Raises:
        DtypeError: A frame is not a uint8 array.
        ShapeError: A frame is not (H, W, 3), or not of the size of the first.
        InvalidValueError: There are no frames.
    """
    return _native.estimate_baseline(frames)[0]
