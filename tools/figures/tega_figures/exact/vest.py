"""Vest intensity (Eq 7 to 9) in 60-digit decimals."""

from __future__ import annotations

from decimal import Context, Decimal, localcontext
from fractions import Fraction

__all__ = ["exact_intensity"]

DIGITS = 60


def exact_intensity(value: float, maximum: float, end_value: float | Fraction = Fraction(1, 100)) -> Decimal:
    """Return 100 / (1 + exp(-k (value - maximum / 2))) with k = 2 ln((1 - e) / e) / maximum, in percent.

    ``maximum`` counts as full touch, in the metric's unit; ``end_value`` is e, the share at a value of 0, a
    float taken as the binary fraction that it is. Exact to 60 digits; 0 where the exponential has more digits
    than a decimal's exponent.
    """
    with localcontext(Context(prec=DIGITS, traps=[])):
        share = Fraction(end_value)
        odds = Decimal((1 - share).numerator) / Decimal((1 - share).denominator)
        odds /= Decimal(share.numerator) / Decimal(share.denominator)
        k = 2 * odds.ln() / Decimal(maximum)
        return 100 / (1 + (-k * (Decimal(value) - Decimal(maximum) / 2)).exp())
