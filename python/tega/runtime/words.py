"""Put into words: numbers, and the name nearest to an unknown one."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable
from typing import Final

_LEAST: Final = 1e-9
_MOST: Final = 1e12


def number_text(value: float, digits: int = 4, *, decimals: int | None = None) -> str:
    """Return a number as text: without an exponent from 1e-9 to 1e12 in size, ``0`` where it rounds to zero.

    ``digits`` are significant ones of the fractional part, as whole numbers keep all of theirs; if given,
    ``decimals`` is the fixed number of decimal places instead.

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


def printable(text: str) -> str:
    r"""Return a text from outside with its control characters escaped: a terminal obeys them.

    Example:
        >>> printable("µV\x1b[2J")
        'µV\\x1b[2J'
    """
    return "".join(c if c.isprintable() or c in "\n\xa0\u202f" else repr(c)[1:-1] for c in text)


def nearest_hint(
    name: str, known: Iterable[str], otherwise: str = "choose from", *, cutoff: float = 0.6
) -> str:
    """Return a hint for an unknown name: the nearest of those known, else ``otherwise`` and the list of them.

    ``cutoff`` is the least similarity of a near name, 0 to 1.

    Example:
        >>> nearest_hint("botle", ["bottle", "bag"]), nearest_hint("cup", ["bottle", "bag"])
        ("did you mean 'bottle'?", 'choose from bottle, bag')
    """
    names = list(known)
    near = difflib.get_close_matches(name, names, n=1, cutoff=cutoff)
    return f"did you mean {near[0]!r}?" if near else f"{otherwise} {', '.join(names) or 'none'}"
