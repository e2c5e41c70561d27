"""The logistic law at the ends of the number range, against 60-digit decimals."""

from __future__ import annotations

from decimal import Decimal, localcontext

import numpy as np

from tega.errors import InvalidValueError
from tega.haptics import intensity
from tega_campaigns.stress.case import StressCase

__all__ = ["SIGMOID_CASES"]

DIGITS = 60
SHARES = (-60.0, -10.0, -1.0, 0.0, 0.1, 0.25, 1 / 3, 0.5, 0.75, 0.999, 1.0, 2.0, 10.0)
SMALLEST, LARGEST = 5e-324, float(np.finfo(np.float64).max)


def _exact(value: float, maximum: float) -> Decimal:
    """100 / (1 + exp(-k (value - maximum / 2))), k = 2 ln 99 / maximum."""
    with localcontext() as context:
        context.prec = DIGITS
        k = 2 * Decimal(99).ln() / Decimal(maximum)
        return 100 / (1 + (-k * (Decimal(value) - Decimal(maximum) / 2)).exp())


def _maxima(*, quick: bool) -> list[StressCase]:  # noqa: ARG001  # every case is called alike
    cases = []
    for maximum in (1e-300, 1.0, 1e300):
        errors = []
        for share in SHARES:
            value = share * maximum
            exact = _exact(value, maximum)
            with localcontext() as context:
                context.prec = DIGITS
                errors.append(float(abs(Decimal(intensity(value, maximum)) - exact) / exact))
        ends = [intensity(share * maximum, maximum) for share in (0.0, 0.5, 1.0)]
        cases.append(
            StressCase(
                group="sigmoid",
                name=f"maximum {maximum:g}",
                done=f"{len(SHARES)} values from {SHARES[0]:g} to {SHARES[-1]:g} times the maximum",
                happened=f"at 0, half and the whole maximum: {ends[0]!r}, {ends[1]!r}, {ends[2]!r}",
                error=max(errors),
                bound=3e-15,
                error_of="relative, worst of all values",
                holds=ends == [1.0, 50.0, 99.0],
            )
        )
    return cases


def _order(*, quick: bool) -> list[StressCase]:
    steps = 2_000 if quick else 20_000
    falls = 0
    for maximum in (1e-300, 1e300):
        values = [maximum * (i / steps * 3 - 1) for i in range(steps + 1)]
        results = np.array([intensity(value, maximum) for value in values])
        falls += int((np.diff(results) < 0).sum())
    return [
        StressCase(
            group="sigmoid",
            name="order",
            done="rising values from -1 to 2 times the maximum, at maxima 1e-300 and 1e300",
            happened="the intensity never falls" if falls == 0 else f"the intensity FALLS {falls} times",
            error=falls,
            bound=0,
            error_of="steps at which it falls",
        )
    ]


def _far_out(*, quick: bool) -> list[StressCase]:  # noqa: ARG001
    wanted = {
        (LARGEST, SMALLEST): 100.0,
        (-LARGEST, SMALLEST): 0.0,
        (SMALLEST, LARGEST): 1.0,
        (-SMALLEST, LARGEST): 1.0,
        (LARGEST, LARGEST): 99.0,
        (SMALLEST, SMALLEST): 99.0,
    }
    wrong = sum(intensity(value, maximum) != result for (value, maximum), result in wanted.items())
    return [
        StressCase(
            group="sigmoid",
            name="ends of the number range",
            done="values and maxima of ±1.8e308 and ±5e-324 together",
            happened="0, 1, 99 and 100 exactly, no overflow" if wrong == 0 else f"{wrong} results are WRONG",
            error=wrong,
            bound=0,
            error_of="wrong results",
        )
    ]


def _impossible(*, quick: bool) -> list[StressCase]:  # noqa: ARG001
    nan, inf = float("nan"), float("inf")
    pairs = [(1.0, 0.0), (1.0, -1.0), (1.0, nan), (1.0, inf), (nan, 1.0), (inf, 1.0), (-inf, 1.0)]
    taken = 0
    for value, maximum in pairs:
        try:
            intensity(value, maximum)
            taken += 1
        except InvalidValueError:
            pass
    return [
        StressCase(
            group="sigmoid",
            name="impossible arguments",
            done="maxima of 0, -1, NaN and ∞, values of NaN and ±∞",
            happened="each is refused with `InvalidValueError`" if taken == 0 else f"{taken} are TAKEN",
            error=taken,
            bound=0,
            error_of="arguments taken",
        )
    ]


SIGMOID_CASES = [_maxima, _order, _far_out, _impossible]
"""The cases of this group, each a function of ``quick``."""
