"""Define what features show on the page: pictures and rows that are not recorded."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


class DisplayPicture(msgspec.Struct, frozen=True, kw_only=True):
    """A picture for the page, published on the run's bus if the page has subscribed.

    Attributes:
        name: Name shown with the picture, such as that of a scene camera.
        t_ns: Time at which it was taken, nanoseconds since the start of the session.
        image: uint8 (H, W, 3), blue, green, red; borrowed and read only. ``None`` removes the picture.
    """

    name: str
    t_ns: int
    image: NDArray[np.uint8] | None


class DisplayRow(msgspec.Struct, frozen=True, kw_only=True):
    """A row of text for page and terminal, published on the run's bus.

    Attributes:
        name: Label of the row.
        text: Its text; ``""`` removes the row.
    """

    name: str
    text: str


class Notice(msgspec.Struct, frozen=True, kw_only=True):
    """A sentence for the person who runs the session, published once.

    Attributes:
        text: The sentence.
    """

    text: str
