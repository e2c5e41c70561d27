"""What the properties at the ends of the number range have found: the rows of ``docs/stress.md``."""

from __future__ import annotations

from dataclasses import dataclass, field
from decimal import Decimal, localcontext
from fractions import Fraction
from typing import Final, Literal, TypeAlias

import numpy as np

from tega_campaigns.report import table

Group: TypeAlias = Literal["contact", "touch", "sigmoid", "emg", "decoders"]
GROUPS: Final[dict[Group, tuple[str, str]]] = {
    "contact": (
        "Contact metrics (Eq 1 to 6)",
        "Each is read with every difference and spread that it names, all of them where it names none; where one of "
        "EDA, peak pixel and contact verdict is not exactly right, the error counts as infinite.",
    ),
    "touch": (
        "Touch, live",
        "The tracker follows no equation, so it is held to its guarantees under any camera input.",
    ),
    "sigmoid": ("Vest intensity (Eq 7 to 9)", ""),
    "emg": (
        "EMG filter (Eq 10)",
        "Drift would show as a mean that moves away from the input's, or as an output that depends on how long the "
        "filter has run. What there is at high rates is rounding, which grows as the square of the rate: a constant "
        "comes to rest next to where it should, and stays there.",
    ),
    "decoders": (
        "Learned EMG decoders",
        "Taught once on made squeezes of three channels; held to a decoder's guarantees, not to an equation.",
    ),
}
"""Titles of the groups of extremes, in the order of the page, and what is said of each."""

HEAD: Final = """\
# Stress: the kernels where numbers go wrong

Every line is a property of the kernels (`tests/tega/property/test_extremes_*.py`): the test, how
far the worst result was from an exact reference, and the bound that it has to keep. The references are whole numbers
and fractions for the contact metrics, 60-digit decimals for the vest intensity and the EMG filter
(`tega_figures.exact`); none of them shares code with its subject. A kernel without an equation is held to its
promises. Hypothesis searches the ranges, with the same examples each time.

This page is written by `make stress`, after every line has passed. Errors have one digit; the last digits of a
logarithm or a sine differ from one C library to the next, and so may they.
"""

EXTREMES: Final[list[Extreme]] = []
DIGITS: Final = 60
_TINY: Final = Decimal(float(np.finfo(np.float64).tiny))


@dataclass
class Extreme:
    """One line of the page.

    Attributes:
        group: Which kernel it is about.
        name: Short, and unique within the group.
        done: What is done, and what else has to be true.
        bound: Largest error that passes.
        error_of: What the error is a share or a number of.
        found: The errors that were found.
        notes: What else is told of it.
    """

    group: Group
    name: str
    done: str
    bound: float
    error_of: str
    found: list[float] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Become a line of the page."""
        EXTREMES.append(self)

    def hold(self, error: float, note: str = "") -> None:
        """Fail where an error is beyond the bound; keep it for the page, and what is told of it."""
        assert error <= self.bound, f"{self.name}: the error {error:.3g} is beyond {self.bound:.2g}"
        self.found.append(error)
        if note and note not in self.notes:
            self.notes.append(note)


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
    """Write an error with one digit, which is all that is worth comparing."""
    return f"{value:.0f}" if value == 0 or (1 <= value < 1000 and value == int(value)) else f"{value:.0e}"


def page() -> str:
    """Return the page.

    Raises:
        ValueError: A line was not tried.
    """
    parts = [HEAD]
    for group, (title, said) in GROUPS.items():
        rows = [one for one in EXTREMES if one.group == group]
        if untried := [one.name for one in rows if not one.found]:
            raise ValueError(f"not tried: {untried}")
        cells = [
            ("; ".join([one.done, *one.notes]), short(max(one.found)), f"{one.bound:.2g}", one.error_of)
            for one in rows
        ]
        parts += [f"## {title}\n", *([f"{said}\n"] if said else [])]
        lines = [(one.name, *rest) for one, rest in zip(rows, cells, strict=True)]
        parts.append(table(("case", "done", "error", "bound", "error is"), lines))
    return "\n".join(parts)
