"""Measure fingertip frames by any reading of Eq 1 to 6: every unclear place of the equations is an option.

D1 and D2 are the equations as printed, on the signed and on the rectified difference. D3 to D8 first blur the
difference (5 × 5 box) and set values under the noise floor to 0. They differ in the threshold T above which the area
is counted:

====  =========================================================================
D3    I(µ) - factor · σ as printed, σ in pixels, not below the noise floor
D4    I(µ) - factor · σ, σ the standard deviation of the grey values in contact
D5    0.44 · I(µ), what the printed law gives for a Gaussian press at 1.28 σ
D6    the noise floor
D7    10 % of the largest value
D8    half of the largest value
====  =========================================================================

``docs/readings.md`` compares them on real presses.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from fractions import Fraction
from typing import Annotated, ClassVar, Literal, TypeAlias

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.errors import InvalidValueError, ShapeError
from tega.records import Contact
from tega.stages.base import FingerSetup, Metric, StageOptions, TouchMap
from tega.stages.metrics import contact_record
from tega.tactile import ContactGate, ContactMetrics, contact_metrics

Threshold: TypeAlias = Literal["D1", "D2", "D3", "D4", "D5", "D6", "D7", "D8"]

Difference: TypeAlias = Literal["signed", "rectified", "absolute", "l2", "luminance"]

_Weight = Annotated[float, msgspec.Meta(ge=-10, le=10)]

# What the kernels of the equations as printed do not know.
_MASKED_ONLY = ("l2", "luminance", "disc", "peak", True, "median", "percentile")

# Of a Gaussian press the value at 1.28 standard deviations is this share of its peak: exp(-1.28² / 2).
GAUSSIAN_SHARE = 0.44


class ReadingOptions(StageOptions, frozen=True):
    """Options of the metric ``reading``.

    Attributes:
        threshold: Reading of Eq 4 and 5, D1 to D8: see :mod:`tega_readings.metric`.
        weights: ω of Eq 1 for red, green, blue; their sum is 1.
        difference: Difference of frame and baseline; none means signed for D1, rectified for D2, else absolute. D3 to
            D8 also accept ``l2`` (root mean square over the channels) and ``luminance`` (weighted, then absolute).
        spread: σ of D1 and D2: ``spatial`` in pixels as printed, or ``intensity`` of the whole map.
        factor: The 1.28 of Eq 4.
        centroid_value: I(µ): the ``nearest`` pixel, or ``bilinear`` between four; of D3 to D8 also the largest value
            within 5 pixels (``disc``), or of the picture (``peak``).
        ties: Whether a pixel at the threshold counts (D3 to D8); as printed it does not.
        peak: Largest value of Eq 6 (D3 to D8): that of one pixel (``raw``), of the ``median`` over 3 × 3 pixels, or the
            ``percentile`` 99.9 of the contact.
        noise_floor: Values under this are noise, grey values; D1 and D2 know no noise where ``gate`` is false.
        min_pixels: Fewer pixels than this above the noise floor are no contact.
        gate: Whether D1 and D2 report no contact below ``min_pixels``; as printed they always report one.
        cci: ``area``: peak / EDA as printed; ``root``: peak / √EDA, which rises with the press; ``peak``: the largest
            value alone; ``mass``: the sum of all values.
    """

    threshold: Threshold = "D3"
    weights: tuple[_Weight, _Weight, _Weight] = (0.299, 0.587, 0.114)
    difference: Difference | None = None
    spread: Literal["spatial", "intensity"] = "spatial"
    factor: Annotated[float, msgspec.Meta(ge=0, le=10)] = 1.28
    centroid_value: Literal["nearest", "bilinear", "disc", "peak"] = "nearest"
    ties: bool = False
    peak: Literal["raw", "median", "percentile"] = "raw"
    noise_floor: Annotated[float, msgspec.Meta(ge=0, le=255)] = 6.0
    min_pixels: Annotated[int, msgspec.Meta(ge=1, le=100_000)] = 30
    gate: bool = False
    cci: Literal["area", "root", "peak", "mass"] = "area"


class ReadingMetric(Metric):
    """Eq 1 to 6 with every reading an option.

    Raises ``InvalidValueError`` unless the weights add up to 1 and the options go with the threshold.
    """

    summary: ClassVar[str] = "Eq 1 to 6 with every unclear place an option (D1 to D8)"
    options_type: ClassVar[type[StageOptions]] = ReadingOptions

    def __init__(self, setup: FingerSetup, options: ReadingOptions) -> None:
        self._finger, self._baseline, self._options = setup.finger, setup.baseline, options
        usual: dict[str, Difference] = {"D1": "signed", "D2": "rectified"}
        self._difference = options.difference or usual.get(options.threshold, "absolute")
        self._read: Callable[[NDArray[np.uint8]], ContactMetrics] = self._masked
        if options.threshold in {"D1", "D2"}:
            self._read = self._printed
            for name in ("difference", "centroid_value", "ties", "peak"):
                if (value := getattr(options, name)) in _MASKED_ONLY:
                    reported = str(value).lower() if value is True else repr(value)
                    raise InvalidValueError(
                        f"{name} = {reported} does not go with threshold {options.threshold}, which is as printed",
                        "take one of D3 to D8",
                    )
        elif options.spread != "spatial":
            raise InvalidValueError(
                f"spread = {options.spread!r} does not go with threshold {options.threshold}",
                "take D4 for the spread of the grey values in contact",
            )
        if abs(sum(options.weights) - 1) > 1e-9:
            raise InvalidValueError(f"weights = {options.weights} add up to {sum(options.weights):g}, not 1")
        # As decimals they are whole numbers of millionths, so that the map's sums are exact.
        parts = [Fraction(str(weight)) * 1_000_000 for weight in options.weights]
        self._millionths = np.array([float(part) for part in parts[::-1]])
        self._frame, self._metrics = setup.baseline, ContactMetrics()

    def update(self, frame: NDArray[np.uint8], t_ns: int) -> Contact:
        """Measure a frame."""
        if frame.shape != self._baseline.shape:
            raise ShapeError(f"the frame is {frame.shape}, its baseline {self._baseline.shape}")
        metrics = self._read(frame)
        if self._options.cci != "area" and metrics.eda:
            root = metrics.peak / math.sqrt(metrics.eda)
            cci = {"root": root, "peak": metrics.peak, "mass": metrics.mass}[self._options.cci]
            metrics = metrics._replace(cci=cci)
        self._frame, self._metrics = frame, metrics
        return contact_record(self._finger, t_ns, metrics)

    def touch_map(self) -> TouchMap:
        """Return the grey map of the last frame and its pixels above T."""
        if self._options.threshold in {"D1", "D2"}:
            # Grey values and threshold are rounded here; the kernel compares exact sums.
            grey = _signed(self._frame, self._baseline, self._difference) @ self._millionths / 1e6
        else:
            grey, _ = self._map(self._frame)
        above = self._above(grey, self._metrics.threshold)
        mask = above if self._metrics.in_contact else np.zeros(grey.shape, np.bool_)
        return TouchMap(np.maximum(grey, 0).astype(np.float32), "grey", mask)

    def _printed(self, frame: NDArray[np.uint8]) -> ContactMetrics:
        o = self._options
        return contact_metrics(
            frame,
            self._baseline,
            weights=o.weights,
            difference=self._difference,  # type: ignore[arg-type]  # checked when it was made
            spread=o.spread,
            factor=o.factor,
            centroid_value=o.centroid_value,  # type: ignore[arg-type]  # likewise
            gate=ContactGate(o.noise_floor, o.min_pixels) if o.gate else None,
        )

    def _masked(self, frame: NDArray[np.uint8]) -> ContactMetrics:
        o = self._options
        grey, counted = self._map(frame)
        peak_at = int(grey.argmax())
        peak, peak_xy = float(grey.flat[peak_at]), (peak_at % grey.shape[1], peak_at // grey.shape[1])
        mass = float(grey.sum())
        if counted < o.min_pixels or mass <= 0:
            return ContactMetrics(mass=mass, peak=peak, peak_xy=peak_xy)
        columns, rows = np.arange(grey.shape[1]), np.arange(grey.shape[0])
        by_column, by_row = grey.sum(axis=0), grey.sum(axis=1)
        x, y = float(by_column @ columns) / mass, float(by_row @ rows) / mass
        if o.threshold == "D4":
            spread = float(grey[grey > 0].std())
        else:
            variance = (by_column @ (columns - x) ** 2 + by_row @ (rows - y) ** 2) / mass
            spread = math.sqrt(max(float(variance), 0.0))
        threshold = max(self._threshold(_value_at(grey, x, y, o.centroid_value), spread, peak), o.noise_floor)
        eda = int(np.count_nonzero(self._above(grey, threshold)))
        peak = self._peak(grey, peak)
        return ContactMetrics(
            mass=mass,
            centroid_xy=(x, y),
            spread=spread,
            threshold=threshold,
            eda=eda,
            cci=peak / eda if eda else 0.0,
            peak=peak,
            peak_xy=peak_xy,
            in_contact=True,
        )

    def _above(self, grey: NDArray[np.float64], threshold: float) -> NDArray[np.bool_]:
        above: NDArray[np.bool_] = grey >= threshold if self._options.ties else grey > threshold
        return above

    def _peak(self, grey: NDArray[np.float64], raw: float) -> float:
        match self._options.peak:
            case "median":
                padded = np.pad(grey, 1, mode="edge")
                around = np.lib.stride_tricks.sliding_window_view(padded, (3, 3)).reshape(*grey.shape, 9)
                return float(np.median(around, axis=2).max())
            case "percentile":
                return float(np.percentile(grey[grey > 0], 99.9))
            case _:
                return raw

    def _threshold(self, value: float, spread: float, peak: float) -> float:
        o = self._options
        shares = {"D5": GAUSSIAN_SHARE * value, "D6": o.noise_floor, "D7": 0.1 * peak, "D8": 0.5 * peak}
        return shares.get(o.threshold, value - o.factor * spread)

    def _map(self, frame: NDArray[np.uint8]) -> tuple[NDArray[np.float64], int]:
        """Return the grey map after blur and noise floor, and how many of its pixels are above the floor."""
        o = self._options
        # Sums of whole numbers below 2⁵³: exact in float64 where the weights are millionths.
        signed, how = _signed(frame, self._baseline, self._difference), self._difference
        grey = np.sqrt(np.square(signed).mean(axis=2)) * 1e6 if how == "l2" else signed @ self._millionths
        grey = _box_sums(np.abs(grey) if how == "luminance" else grey)
        grey /= 25e6
        counted = int(np.count_nonzero(grey > o.noise_floor))
        grey[grey < o.noise_floor] = 0.0
        return grey, counted


def _signed(
    frame: NDArray[np.uint8], baseline: NDArray[np.uint8], difference: Difference
) -> NDArray[np.float64]:
    """Return frame - baseline under a sign rule, float64 (H, W, 3)."""
    left = frame.astype(np.float64)
    left -= baseline
    if difference == "absolute":
        return np.abs(left, out=left)
    return np.maximum(left, 0, out=left) if difference == "rectified" else left


def _box_sums(image: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return sums over 5 × 5 pixels, float64 (H, W), the border mirrored without repeating it."""
    sums = image
    for axis in (0, 1):
        n = image.shape[axis]
        pad = [(2, 2) if a == axis else (0, 0) for a in range(2)]
        padded = np.pad(sums, pad, mode="reflect" if n > 1 else "edge")
        at = padded if axis == 0 else padded.T
        sums = at[:n] + at[1 : n + 1] + at[2 : n + 2] + at[3 : n + 3] + at[4 : n + 4]
        sums = sums if axis == 0 else sums.T
    return sums


def _value_at(grey: NDArray[np.float64], x: float, y: float, how: str) -> float:
    height, width = grey.shape
    if how == "peak":
        return float(grey.max())
    if how == "disc":
        rows, columns = np.ogrid[:height, :width]
        near = grey[(columns - x) ** 2 + (rows - y) ** 2 <= 25.0]
        return float(near.max()) if near.size else 0.0
    x, y = min(max(x, 0.0), width - 1.0), min(max(y, 0.0), height - 1.0)
    if how == "nearest":
        return float(grey[min(int(y + 0.5), height - 1), min(int(x + 0.5), width - 1)])
    left, top = min(int(x), max(width - 2, 0)), min(int(y), max(height - 2, 0))
    dx, dy = x - left, y - top
    right, bottom = min(left + 1, width - 1), min(top + 1, height - 1)
    above = (1 - dx) * grey[top, left] + dx * grey[top, right]
    below = (1 - dx) * grey[bottom, left] + dx * grey[bottom, right]
    return float((1 - dy) * above + dy * below)
