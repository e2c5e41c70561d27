"""Draw the hand as commanded, translucent, where the hand as measured is drawn."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

from tega.ui.view.browser.hand_figure import HandFigure
from tega.ui.view.browser.solids import Solids

if TYPE_CHECKING:
    import numpy as np
    import viser
    from numpy.typing import NDArray

    from tega.ui.view.state import Shape

GHOST_COLOUR: Final = "#1f5fbf"
"""Colour of the hand as commanded."""

_OPACITY = 0.35
# Wider than the hand as measured by this much, so that two surfaces in one place do not flicker.
_WIDER_M = 0.0015


class GhostHand:
    """Draws the fingers of an Allegro hand at the joint angles that the hand steers to.

    If an object stops a finger, the commanded finger is drawn inside the object: the depth shows how firmly
    the hand is asked to press. The palm has no command and is left out. ``solids`` has no batches while
    nothing is commanded.
    """

    def __init__(self, server: viser.ViserServer) -> None:
        self._figure = HandFigure()
        red, green, blue = (int(GHOST_COLOUR[k : k + 2], 16) / 255 for k in (1, 3, 5))
        self._places = [k for k, (name, *_) in enumerate(self._figure.shapes) if name != "palm"]
        self._shapes: list[Shape] = []
        for place in self._places:
            name, kind, (radius_m, half_m, more_m), _ = self._figure.shapes[place]
            size_m = (radius_m + _WIDER_M, half_m, more_m)
            self._shapes.append((name, kind, size_m, (red, green, blue, _OPACITY)))
        self._nothing: list[Shape] = []
        self.solids = Solids(server, "commanded", shadow=False)

    def draw(self, commanded: tuple[Sequence[float], NDArray[np.float64]] | None) -> None:
        """Draw 16 joint angles, rad, with the palm at a pose, float64 (7,); ``None`` draws nothing."""
        if commanded is None:
            self.solids.draw(self._nothing, self._figure.poses([0.0] * 16)[:0])
        else:
            self.solids.draw(self._shapes, self._figure.poses(*commanded)[self._places])
