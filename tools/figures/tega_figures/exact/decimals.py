"""The Butterworth low-pass and the vest's intensity (Eq 7 to 9) in 60-digit decimals.

Of the filter: design by pole placement, difference equation, response.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from decimal import Context, Decimal, localcontext
from fractions import Fraction

__all__ = ["dc_gain", "design", "exact_intensity", "filtered", "gain_squared", "transfer_function"]

DIGITS = 60
PI = Decimal("3.14159265358979323846264338327950288419716939937510582097494459230781640628620899")

Section = tuple[Decimal, Decimal, Decimal, Decimal, Decimal]
"""b0, b1, b2, a1, a2."""


def _sine_cosine(angle: Decimal) -> tuple[Decimal, Decimal]:
    """Taylor series; the angles here are at most π."""
    sine, cosine, term, n = Decimal(0), Decimal(0), Decimal(1), 0
    while abs(term) > Decimal(10) ** -(DIGITS + 5) or n < 4:
        part = term if n % 4 in {0, 1} else -term
        if n % 2:
            sine += part
        else:
            cosine += part
        n += 1
        term = term * angle / n
    return sine, cosine


def design(rate_hz: float, cutoff_hz: float, order: int) -> list[Section]:
    """Place the analogue poles, take them through the bilinear transform, pair them.

    The gain is down by 3 dB at ``cutoff_hz``; ``order`` is the number of poles. Sections have gain 1 at
    frequency 0, by rising a2.
    """
    with localcontext() as context:
        context.prec = DIGITS
        sine, cosine = _sine_cosine(PI * Decimal(cutoff_hz) / Decimal(rate_hz))
        radius = sine / cosine
        sections: list[Section] = []
        for k in range(1, order // 2 + 1):
            sine, cosine = _sine_cosine(PI * (2 * k + order - 1) / (2 * order))
            re, im = radius * cosine, radius * sine
            apart = 1 - 2 * re + radius * radius
            z_re, z_im = (1 - radius * radius) / apart, 2 * im / apart
            a1, a2 = -2 * z_re, z_re * z_re + z_im * z_im
            gain = (1 + a1 + a2) / 4
            sections.append((gain, 2 * gain, gain, a1, a2))
        if order % 2:
            a1 = (radius - 1) / (radius + 1)
            gain = (1 + a1) / 2
            sections.append((gain, gain, Decimal(0), a1, Decimal(0)))
        return sorted(sections, key=lambda section: section[4])


def filtered(sections: Iterable[Sequence[Decimal | float]], samples: Sequence[float]) -> list[Decimal]:
    """Run the difference equation on one channel, settled on the first sample; exact to 50 digits or so.

    ``sections`` are as of :func:`design`, or rounded to floats.
    """
    with localcontext() as context:
        context.prec = DIGITS
        signal = [Decimal(x) for x in samples]
        for section in sections:
            b0, b1, b2, a1, a2 = map(Decimal, section)
            x1 = x2 = signal[0]
            y1 = y2 = signal[0] * (b0 + b1 + b2) / (1 + a1 + a2)
            out = []
            for x in signal:
                y = b0 * x + b1 * x1 + b2 * x2 - a1 * y1 - a2 * y2
                out.append(y)
                x1, x2, y1, y2 = x, x1, y, y1
            signal = out
        return signal


def transfer_function(sections: Iterable[Section]) -> tuple[list[float], list[float]]:
    """Multiply the sections of :func:`design` out into one fraction, each coefficient rounded once.

    Numerator and denominator are in ascending powers of 1/z.
    """
    with localcontext() as context:
        context.prec = DIGITS
        b, a = [Decimal(1)], [Decimal(1)]
        for b0, b1, b2, a1, a2 in sections:
            b, a = _product(b, (b0, b1, b2)), _product(a, (Decimal(1), a1, a2))
        return [float(x) for x in b], [float(x) for x in a]


def _product(p: Sequence[Decimal], q: Sequence[Decimal]) -> list[Decimal]:
    out = [Decimal(0)] * (len(p) + len(q) - 1)
    for i, x in enumerate(p):
        for j, y in enumerate(q):
            out[i + j] += x * y
    return out


def dc_gain(sos: Iterable[Sequence[float]]) -> Decimal:
    """Gain at frequency 0 of sections b0, b1, b2, 1, a1, a2 as they are, coefficients rounded or not."""
    with localcontext() as context:
        context.prec = DIGITS
        gain = Decimal(1)
        for row in sos:
            b0, b1, b2, _, a1, a2 = (Decimal(c) for c in row)
            gain *= (b0 + b1 + b2) / (1 + a1 + a2)
        return gain


def gain_squared(sos: Iterable[Sequence[float]], share: float) -> Decimal:
    """Squared gain of sections as they are, rows b0, b1, b2, 1, a1, a2, at a share of the rate."""
    with localcontext() as context:
        context.prec = DIGITS
        sine, cosine = _sine_cosine(2 * PI * Decimal(share))
        sine2, cosine2 = 2 * sine * cosine, cosine * cosine - sine * sine
        gain = Decimal(1)
        for row in sos:
            b0, b1, b2, _, a1, a2 = (Decimal(c) for c in row)
            above = (b0 + b1 * cosine + b2 * cosine2) ** 2 + (b1 * sine + b2 * sine2) ** 2
            below = (1 + a1 * cosine + a2 * cosine2) ** 2 + (a1 * sine + a2 * sine2) ** 2
            gain *= above / below
        return gain


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
