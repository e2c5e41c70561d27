"""Name the fingers of a session: any number of sensors, each with a name of its own."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, TypeAlias, TypeVar

import msgspec

from tega.haptics import FINGERS

FingerName: TypeAlias = Annotated[
    str,
    msgspec.Meta(
        pattern="^[a-z][a-z0-9]*(_[a-z0-9]+)*$",
        max_length=32,
        description="a finger's name has up to 32 lowercase letters, digits and single underscores, such as left_thumb",
    ),
]
"""A finger's name, such as ``left_thumb``: it becomes part of topics, folders and names of columns."""

_Item = TypeVar("_Item")


def in_order(by_finger: Mapping[str, _Item]) -> dict[str, _Item]:
    """Return a mapping with the fingers of the vest's default columns first, in their order, then the others.

    Example:
        >>> list(in_order({"palm": 0, "ring": 1, "left_thumb": 2, "thumb": 3}))
        ['thumb', 'ring', 'palm', 'left_thumb']
    """
    first = {finger: by_finger[finger] for finger in FINGERS if finger in by_finger}
    return first | dict(by_finger)
