"""What the properties at the ends of the number range have found: a table of ``docs/evidence/installing.md``."""

from __future__ import annotations

from dataclasses import dataclass, field
from decimal import Decimal, localcontext
from fractions import Fraction
from typing import Final, Literal, TypeAlias

import numpy as np

from tega_campaigns.runner import table

Group: TypeAlias = Literal["contact", "touch", "sigmoid", "emg", "decoders"]
GROUPS: Final[dict[Group, str]] = {
    "contact": "contact",
    "touch": "touch",
    "sigmoid": "vest",
    "emg": "EMG filter",
    "decoders": "decoders",
}
"""Kernels by group, in the order of the table."""

EXTREMES: Final[list[Extreme]] = []
DIGITS: Final = 60
_TINY: Final = Decimal(float(np.finfo(np.float64).tiny))


@dataclass
class Extreme:
    """One line of the table; ``error_of`` is what the error is a share of, ``bound`` the largest that passes."""

    group: Group
    name: str
    bound: float
    error_of: str
    found: list[float] = field(default_factory=list)

    def __post_init__(self) -> None:
        EXTREMES.append(self)

    def hold(self, error: float) -> None:
        assert error <= self.bound, f"{self.name}: the error {error:.3g} is beyond {self.bound:.2g}"
        self.found.append(error)


def relative(got: float, exact: Fraction | Decimal, size: Fraction | Decimal | None = None) -> float:
    """Return the distance as a share of ``exact``, or of ``size``; of the least normal number where that is larger."""
    with localcontext() as context:
        context.prec = DIGITS
        true, scale = (
            part if isinstance(part, Decimal) else Decimal(part.numerator) / Decimal(part.denominator)
            for part in (exact, exact if size is None else size)
        )
        return float(abs(Decimal(got) - true) / max(abs(scale), _TINY))


def short(value: float) -> str:
    return f"{value:.0f}" if value == 0 or (1 <= value < 1000 and value == int(value)) else f"{value:.0e}"


def extremes_table() -> str:
    if untried := [one.name for one in EXTREMES if not one.found]:
        raise ValueError(f"not tried: {untried}")
    rows = [
        (kernel, one.name, short(max(one.found)), f"{one.bound:.2g}", one.error_of)
        for group, kernel in GROUPS.items()
        for one in EXTREMES
        if one.group == group
    ]
    return table(("kernel", "case", "error", "bound", "error is"), rows)
