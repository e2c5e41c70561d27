"""Define items that features show on the page: frames and rows that are not recorded."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec

from tega.errors import TegaError
from tega.runtime.features import call_member, having, warn

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from tega.records.bus import Bus


class DisplayPicture(msgspec.Struct, frozen=True, kw_only=True):
    """A picture for the page, published on the run's bus if the page has subscribed; ``None`` removes it.

    ``t_ns`` is when it was taken, nanoseconds since the start of the session; ``image`` is uint8 (H, W, 3),
    blue, green, red; borrowed and read only.
    """

    name: str
    t_ns: int
    image: NDArray[np.uint8] | None


class DisplayRow(msgspec.Struct, frozen=True, kw_only=True):
    """A row of text for page and terminal, published on the run's bus; the text ``""`` removes it."""

    name: str
    text: str


class Notice(msgspec.Struct, frozen=True, kw_only=True):
    """A sentence for the operator of the session, published once."""

    text: str


class DisplayRows:
    """Rows that features show, kept for one display."""

    def __init__(self, bus: Bus, name: str) -> None:
        self._rows: dict[str, str] = {}
        for feature in having("panels"):
            try:
                call_member(feature, "panels", bus)
            except TegaError as error:  # a display must not end what it shows
                warn(f"a panel is left out: {error.message}", error.hint)
        bus.subscribe(DisplayRow, self._take, name=name)

    def __call__(self) -> dict[str, str]:
        """Return the rows by label."""
        return dict(self._rows)

    def _take(self, row: DisplayRow) -> None:
        rows = {label: text for label, text in self._rows.items() if label != row.name}
        if row.text:
            rows[row.name] = row.text
        self._rows = rows  # another thread may be reading the one before
