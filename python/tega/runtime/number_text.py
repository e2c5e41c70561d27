"""Format a number for people: no exponent, no rounding noise, no negative zero."""

from __future__ import annotations

import math
from typing import Final

_LEAST: Final = 1e-9
_MOST: Final = 1e12


def number_text(value: float, digits: int = 4, *, decimals: int | None = None) -> str:
    """Return a number as text.

    Args:
        value: The number, in any unit.
        digits: Significant digits of the fractional part; whole numbers keep all of theirs.
        decimals: If given, the fixed number of decimal places instead.

    Returns:
        The number without an exponent from 1e-9 to 1e12 in size, and ``0`` for a value that rounds to zero.

    Example:
        >>> number_text(1e4), number_text(-0.04, decimals=1), number_text(0.000059999999999999995)
        ('10000', '0.0', '0.00006')
    """
    if not math.isfinite(value):
        return str(float(value))
    if decimals is not None:
        text = f"{value:.{decimals}f}"
        return text if float(text) else text.removeprefix("-")
    if value == 0:
        return "0"
    size = abs(value)
    if not _LEAST <= size < _MOST:
        return f"{value:.{digits}g}"
    places = max(digits - 1 - math.floor(math.log10(size)), 0)
    text = f"{value:.{places}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text
