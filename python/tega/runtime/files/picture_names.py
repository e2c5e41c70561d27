"""Put pictures into the order of the numbers and times in their names."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from decimal import Decimal
from itertools import pairwise
from pathlib import Path
from typing import Final

# So few pictures with names of another kind are no part of the recording.
_STRAY_SHARE: Final = 0.1
_NUMBER: Final = r"(?:[0-9]+[.,][0-9]+(?![.,]?[0-9])|[0-9]+)"
# A decimal fraction has one point: 10.05.03 is three whole numbers.
_DECIMAL: Final = re.compile(rf"(?<![0-9.,])({_NUMBER})|([0-9]+)")
_WHOLE: Final = re.compile("[0-9]+")
_UNIX_UNITS: Final = {10: Decimal(1), 13: Decimal("1e-3"), 16: Decimal("1e-6"), 19: Decimal("1e-9")}
"""Unit of a time since 1970 by the digits that it has from 2001 to 2033, when the first of them is 1; seconds."""


def sorted_names(files: Sequence[Path]) -> list[Path]:
    """Return files in the order of the numbers in their names, so that ``frame_2`` comes before ``frame_10``.

    ``1700000000.25`` comes before ``1700000000.5``: a number with one point is a decimal fraction. It is two whole
    numbers, so that ``1.9`` comes before ``1.10``, where one of several lengths ends in zero: no program prints a
    fraction so.
    """
    decimal = _are_decimals([path.stem for path in files])
    return sorted(files, key=lambda path: _key(path, decimal=decimal))


def without_strays(files: Sequence[Path]) -> tuple[list[Path], tuple[str, ...]]:
    """Return pictures without those named unlike nearly all others, and a sentence that names these, if any.

    As frames they would set the maximum.
    """
    shapes = {path: _DECIMAL.sub("#", path.stem.casefold()) for path in files}
    usual, n_usual = Counter(shapes.values()).most_common(1)[0]
    if n_usual == len(files) or len(files) - n_usual > _STRAY_SHARE * len(files):
        return list(files), ()
    strays = sorted(path.name for path, shape in shapes.items() if shape != usual)
    return [path for path, shape in shapes.items() if shape == usual], (
        f"{', '.join(strays[:3])}{' and others' if len(strays) > 3 else ''}: not named as the {n_usual} other pictures "
        f"({usual}), so not used; rename a file that is a frame",
    )


def name_times_s(stems: Sequence[str]) -> list[float] | None:
    """Return the times in the names of sorted pictures, seconds from the first.

    ``None`` where the longest numbers of the names are not all seconds, milliseconds, microseconds or
    nanoseconds since 1970, or do not rise.
    """
    if len(stems) < 2:
        return None
    numbers = [[one[0] or one[1] for one in _DECIMAL.findall(stem)] or [""] for stem in stems]
    found = [max(some, key=_n_whole_digits).replace(",", ".") for some in numbers]
    unit = _UNIX_UNITS.get(_n_whole_digits(found[0]))
    if unit is None or any(
        one[0] != "1" or _n_whole_digits(one) != _n_whole_digits(found[0]) for one in found
    ):
        return None
    times = [Decimal(one) for one in found]
    steps = [b - a for a, b in pairwise(times)]
    counts = all(step == 1 for step in steps)  # 1000000001, 1000000002 are numbers of pictures
    return None if counts or min(steps) <= 0 else [float((t - times[0]) * unit) for t in times]


def _n_whole_digits(number: str) -> int:
    return len(re.split("[.,]", number)[0])


def _are_decimals(stems: Sequence[str]) -> bool:
    """Return whether numbers with a point are decimal fractions."""
    numbers = [one[0] for stem in stems for one in _DECIMAL.findall(stem)]
    fractions = [part[1] for one in numbers if len(part := re.split("[.,]", one)) > 1]
    several = len({len(fraction) for fraction in fractions}) > 1
    return not (several and any(len(one) > 1 and one.endswith("0") for one in fractions))


def _key(path: Path, *, decimal: bool) -> list[tuple[int, Decimal, str]]:
    """Return a sort key in which the numbers of a name count as numbers."""
    key: list[tuple[int, Decimal, str]] = []
    at, stem = 0, path.stem.casefold()
    for found in (_DECIMAL if decimal else _WHOLE).finditer(stem):
        key += [(1, Decimal(0), stem[at : found.start()]), (0, Decimal(found[0].replace(",", ".")), "")]
        at = found.end()
    # Names equal but for case or leading zeros: the name itself decides, so that the order never depends on the disk.
    return [*key, (1, Decimal(0), stem[at:]), (2, Decimal(0), path.name)]
