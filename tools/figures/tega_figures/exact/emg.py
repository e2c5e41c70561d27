"""The Butterworth low-pass in 60-digit decimals: design by pole placement, difference equation, response."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from decimal import Decimal, localcontext

__all__ = ["dc_gain", "design", "filtered", "gain_squared"]

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
