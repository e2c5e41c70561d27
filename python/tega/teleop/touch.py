"""The back loop: what the fingertips see becomes what the wearer feels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

from tega.haptics import FeltMap, intensity, vest_frame

if TYPE_CHECKING:
    from tega.calibration import TouchMaxima
    from tega.haptics import Layout, Mirror, VestFrame
    from tega.tactile import ContactMetrics

__all__ = ["STALE_NS", "Felt", "TouchLoop"]

# A frame older than this says nothing about the present: the finger's columns fall silent.
STALE_NS = 100_000_000

_COLUMNS = ("thumb", "index", "middle", "ring")


class Felt(NamedTuple):
    """What one frame means to the wearer.

    Attributes:
        cci_norm: CCI as a share of its maximum, 0 to 1.
        eda_norm: EDA as a share of its maximum, 0 to 1.
        front: Intensity of the finger's front column, 0 to 100 (Eq 7, 8).
        back: Intensity of its back column, 0 to 100 (Eq 9).
    """

    cci_norm: float
    eda_norm: float
    front: float
    back: float


_NOTHING = Felt(0.0, 0.0, 0.0, 0.0)


class TouchLoop:
    """Turns contact metrics into vest frames.

    A finger that is not in contact, whose newest frame is older than 100 ms, or that has no maximum, is silent:
    intensity 0, not the 1 that Eq 7 gives at rest.

    Args:
        maxima: What counts as full, by finger; the fingers in use are its keys.
        layout: Which motors the vest has.
        mirror: Which faces have their columns reversed.
        felt: Evens out what the wearer feels; ``None`` sends the law's own intensities.
    """

    def __init__(
        self,
        maxima: Mapping[str, TouchMaxima],
        *,
        layout: Layout,
        mirror: Mirror = "none",
        felt: FeltMap | None = None,
    ) -> None:
        self._layout: Layout = layout
        self._mirror: Mirror = mirror
        self._map = felt
        self._maxima = {f: (m.cci_max, m.eda_max) for f, m in maxima.items()}
        self._column = {f: _COLUMNS.index(f) for f in maxima}
        self._newest: dict[int, tuple[int, Felt]] = {}

    def update(self, finger: str, t_ns: int, metrics: ContactMetrics) -> Felt:
        """Take one measured frame.

        Args:
            finger: Whose it is.
            t_ns: Its time in nanoseconds.
            metrics: What was measured.

        Returns:
            What it means to the wearer as long as it is fresh.
        """
        felt = _NOTHING
        if metrics.in_contact:
            cci_max, eda_max = self._maxima[finger]
            cci_norm, front = _scaled(metrics.cci, cci_max)
            eda_norm, back = _scaled(float(metrics.eda), eda_max)
            felt = Felt(cci_norm, eda_norm, front, back)
        self._newest[self._column[finger]] = (t_ns, felt)
        return felt

    def fresh(self, t_ns: int) -> Sequence[Felt]:
        """Return what each finger feels at a time, thumb first; nothing where its frame is too old."""
        fresh = [_NOTHING] * len(_COLUMNS)
        for column, (seen_ns, felt) in self._newest.items():
            if t_ns - seen_ns <= STALE_NS:
                fresh[column] = felt
        return fresh

    def frame(self, t_ns: int) -> VestFrame:
        """Return the vest frame for a time."""
        felt = self.fresh(t_ns)
        front, back = [f.front for f in felt], [f.back for f in felt]
        frame = vest_frame(front, back, layout=self._layout, mirror=self._mirror)
        return frame if self._map is None else self._map.apply(frame)

    def silence(self) -> VestFrame:
        """Return the frame in which every motor rests."""
        return vest_frame([0.0] * len(_COLUMNS), [0.0] * len(_COLUMNS), layout=self._layout)


def _scaled(value: float, maximum: float | None) -> tuple[float, float]:
    if maximum is None:
        return 0.0, 0.0
    return min(max(value / maximum, 0.0), 1.0), intensity(value, maximum)
