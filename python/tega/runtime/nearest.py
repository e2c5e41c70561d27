"""Suggest the known name nearest to one that is unknown."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


def nearest_hint(
    name: str, known: Iterable[str], otherwise: str = "choose from", *, cutoff: float = 0.6
) -> str:
    """Return a hint for an unknown name.

    Args:
        name: The unknown name.
        known: The names to choose from.
        otherwise: Words before the list of all names, if none is near.
        cutoff: Least similarity of a near name, 0 to 1.

    Example:
        >>> nearest_hint("botle", ["bottle", "bag"]), nearest_hint("cup", ["bottle", "bag"])
        ("did you mean 'bottle'?", 'choose from bottle, bag')
    """
    names = list(known)
    near = difflib.get_close_matches(name, names, n=1, cutoff=cutoff)
    return f"did you mean {near[0]!r}?" if near else f"{otherwise} {', '.join(names) or 'none'}"
