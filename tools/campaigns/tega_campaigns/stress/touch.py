"""Contact metrics at their extremes."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from decimal import Decimal, localcontext
from fractions import Fraction
from itertools import product
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from tega.tactile import ContactMetrics, contact_metrics, read_contact
from tega_campaigns.stress.case import StressCase
from tega_campaigns.stress.exact_touch import DIGITS, ExactContact, exact_contact

__all__ = ["TOUCH_CASES"]

Image = NDArray[np.uint8]
Weights = tuple[float, float, float]
Ways = Iterable[tuple[Literal["signed", "rectified", "absolute"], Literal["spatial", "intensity"]]]

LUMA: Weights = (0.299, 0.587, 0.114)
ALL_WAYS: list[Any] = list(product(("signed", "rectified", "absolute"), ("spatial", "intensity")))
SHAPE = (240, 320, 3)
# Each number is rounded once or twice from exact sums.
BOUND = 1e-15
ERROR_OF = "relative, worst number"


def _relative(got: float, exact: Fraction | Decimal, size: Fraction | Decimal | None = None) -> float:
    """Distance as a share of the exact value, or of `size`; of the least normal number where that is larger."""
    with localcontext() as context:
        context.prec = DIGITS
        true = exact if isinstance(exact, Decimal) else Decimal(exact.numerator) / Decimal(exact.denominator)
        scale = (
            true
            if size is None
            else (size if isinstance(size, Decimal) else Decimal(size.numerator) / Decimal(size.denominator))
        )
        return float(abs(Decimal(got) - true) / max(abs(scale), Decimal(float(np.finfo(np.float64).tiny))))


def _error(got: ContactMetrics, exact: ExactContact) -> float:
    """Largest relative error; infinite where something is wrong that has to be exact."""
    if (got.in_contact, got.eda, got.peak_xy) != (exact.in_contact, exact.eda, exact.peak_xy):
        return float("inf")
    errors = [_relative(got.mass, exact.mass), _relative(got.peak, exact.peak)]
    if exact.in_contact:
        for centre, true in zip(got.centroid_xy, exact.centroid_xy, strict=True):
            errors.append(_relative(centre, true, max(abs(true), Fraction(1))))
        errors += [
            _relative(got.spread, exact.spread),
            _relative(got.threshold, exact.threshold, exact.threshold_parts),
            _relative(got.cci, exact.cci),
        ]
    elif not all(np.isnan([*got.centroid_xy, got.spread, got.threshold])):
        return float("inf")
    return max(errors)


def _judged(
    name: str,
    done: str,
    pairs: Iterable[tuple[Image, Image]],
    *,
    weights: Iterable[Weights] = (LUMA,),
    ways: Ways = ALL_WAYS,
    live_is_silent: bool = False,
    note: Callable[[list[ContactMetrics]], str] = lambda _: "",
) -> StressCase:
    """Compare every pair, weighting and way of reading the equations with the exact result.

    ``note`` is told of the results of the first way.
    """
    ways = list(ways)
    errors, first, silent, readings = [], [], True, []
    for frame, baseline in pairs:
        for weight in weights:
            for difference, spread in ways:
                got = contact_metrics(frame, baseline, weights=weight, difference=difference, spread=spread)
                exact = exact_contact(frame, baseline, weights=weight, difference=difference, spread=spread)
                errors.append(_error(got, exact))
                if (difference, spread) == ways[0]:
                    first.append(got)
        live, paper = (read_contact(frame, baseline, reading=r) for r in ("live", "paper"))
        silent &= not live.in_contact
        readings.append(f"`paper` {_area(paper)}, `live` {_area(live)}")
    wrong = sum(e == float("inf") for e in errors)
    told = [
        f"EDA, peak pixel and contact verdict exact in {len(errors)} of {len(errors)} results"
        if wrong == 0
        else f"EDA, peak pixel or contact verdict WRONG in {wrong} of {len(errors)} results",
        note(first) or f"as printed: {_area(first[0])}",
    ]
    if len(readings) == 1:
        told.append(readings[0])
    return StressCase(
        group="contact",
        name=name,
        done=done,
        happened="; ".join(told),
        error=max(errors),
        bound=BOUND,
        error_of=ERROR_OF,
        holds=silent or not live_is_silent,
    )


def _area(metrics: ContactMetrics) -> str:
    return f"EDA {metrics.eda}" if metrics.in_contact else "no contact"


def _blob(
    shape: tuple[int, int, int], centre: tuple[float, float], radius: float, height: int
) -> NDArray[np.int16]:
    """A round bump of whole grey values, the same in every channel: (H, W, 1)."""
    rows, columns = np.ogrid[: shape[0], : shape[1]]
    square = ((columns - centre[0]) ** 2 + (rows - centre[1]) ** 2) / radius**2
    return np.floor(height * np.clip(1 - square, 0, None)).astype(np.int16)[..., np.newaxis]


def _all_black(*, quick: bool) -> list[StressCase]:  # noqa: ARG001  # every case is called alike
    black, grey = np.zeros(SHAPE, np.uint8), np.full(SHAPE, 90, np.uint8)
    return [
        _judged(
            "all black",
            "a black frame on a black baseline",
            [(black, black)],
            live_is_silent=True,
        ),
        _judged(
            "gone dark",
            "a black frame on a grey baseline (the lights fail)",
            [(black, grey)],
            live_is_silent=True,
        ),
    ]


def _saturated(*, quick: bool) -> list[StressCase]:  # noqa: ARG001
    pairs = [(np.full(SHAPE, 255, np.uint8), np.zeros(SHAPE, np.uint8))]
    return [_judged("saturated", "a frame of 255 on a baseline of 0: the largest sums there are", pairs)]


def _one_pixel(*, quick: bool) -> list[StressCase]:  # noqa: ARG001
    black = np.zeros(SHAPE, np.uint8)
    lone = black.copy()
    lone[239, 319] = 255
    case = _judged(
        "one pixel",
        "255 in the last pixel of a black frame",
        [(lone, black)],
        live_is_silent=True,
        note=lambda got: (
            f"as printed: centroid {got[0].centroid_xy}, spread {got[0].spread:g}, {_area(got[0])}"
        ),
    )
    return [case]


def _uniform_shift(*, quick: bool) -> list[StressCase]:  # noqa: ARG001
    baseline = np.random.default_rng(1).integers(60, 120, SHAPE, np.uint8)
    return [
        _judged(
            "uniform shift",
            "every pixel 7 counts brighter than its baseline",
            [(baseline + np.uint8(7), baseline)],
            live_is_silent=True,
        )
    ]


def _mass_crossing_zero(*, quick: bool) -> list[StressCase]:  # noqa: ARG001
    baseline = np.full(SHAPE, 100, np.uint8)
    bumps = _blob(SHAPE, (90.0, 120.0), 40.0, 50) - _blob(SHAPE, (230.0, 120.0), 40.0, 50)
    pairs = []
    for extra in range(-3, 4):
        frame = (100 + bumps + np.zeros(SHAPE, np.int16)).astype(np.uint8)
        # The bumps cancel to the last count; a few counts at one pixel carry the mass across zero.
        frame[20, 300] = 100 + extra
        pairs.append((frame, baseline))

    def note(got: list[ContactMetrics]) -> str:
        masses = ", ".join(f"{g.mass:g}" for g in got)
        furthest = max(-g.centroid_xy[0] for g in got if g.in_contact)
        contacts = sum(g.in_contact for g in got)
        return f"masses {masses}: contact in {contacts}, the centroid up to {furthest:.0f} px outside"

    return [
        _judged(
            "signed mass crossing zero",
            "a bump and a dent that cancel, and one pixel that carries the sum from -3 to +3",
            pairs,
            ways=[("signed", "intensity"), ("signed", "spatial")],
            note=note,
        )
    ]


def _largest_frame(*, quick: bool) -> list[StressCase]:
    shape = (4096, 4096, 3)
    baseline = np.full(shape, 40, np.uint8)
    frame = (40 + _blob(shape, (2900.5, 1200.25), 900.0, 200) + np.zeros(shape, np.int16)).astype(np.uint8)
    frame[-1, -1] = 0
    ways: Ways = [("signed", "intensity")] if quick else [("signed", "intensity"), ("rectified", "spatial")]
    return [
        _judged(
            "4096×4096",
            "a bump of 900 px radius on the largest frame taken",
            [(frame, baseline)],
            ways=ways,
            note=lambda got: f"with σ of intensity: {_area(got[0])}",
        )
    ]


def _faint(*, quick: bool) -> list[StressCase]:  # noqa: ARG001
    baseline = np.random.default_rng(2).integers(60, 120, SHAPE, np.uint8)
    frame = baseline + (_blob(SHAPE, (200.0, 80.0), 35.0, 40) > 0).astype(np.uint8)
    return [_judged("contrast 1 of 255", "a disc one count brighter than its baseline", [(frame, baseline)])]


def _weights(*, quick: bool) -> list[StressCase]:  # noqa: ARG001
    rng = np.random.default_rng(3)
    baseline = rng.integers(0, 128, (24, 32, 3), np.uint8)
    frame = rng.integers(64, 256, (24, 32, 3), np.uint8)
    green = baseline.copy()
    green[4:20, 6:28, 1] = 255
    cases = [
        (
            "negative weights",
            "a frame of noise",
            frame,
            [(2.0, -1.5, 0.5), (-1.0, 3.0, -1.0), (0.5, 1.5, -1.0)],
        ),
        ("weights of 1e300", "a frame of noise", frame, [(1e300, -1e300, 1.0), (1.0, 1e300, -1e300)]),
        (
            "tiny weights",
            "a frame of noise",
            frame,
            [(1.0, 1e-300, -1e-300), (1.0, 5e-324, 0.0), (1e-300, 1.0, 5e-324)],
        ),
        ("only tiny weights seen", "green alone changes", green, [(1.0, 1e-300, 0.0), (0.5, 5e-324, 0.5)]),
    ]
    return [
        _judged(
            name,
            f"{what}, weights (r, g, b) " + ", ".join(str(w) for w in weights),
            [(image, baseline)],
            weights=weights,
            note=lambda got: "as printed: " + ", ".join(f"mass {g.mass:.3g} {_area(g)}" for g in got),
        )
        for name, what, image, weights in cases
    ]


TOUCH_CASES = [
    _all_black,
    _saturated,
    _one_pixel,
    _uniform_shift,
    _mass_crossing_zero,
    _largest_frame,
    _faint,
    _weights,
]
"""The cases of this group, each a function of ``quick``."""
