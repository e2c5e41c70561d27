"""How far a variant's contact metrics lie from the exact ones."""

from __future__ import annotations

from fractions import Fraction
from math import hypot, isnan

import msgspec

from tega.tactile import ContactMetrics
from tega_figures.bench.variants import Metrics
from tega_figures.exact import ExactContact

__all__ = ["ContactError", "measure_error", "worst"]


class ContactError(msgspec.Struct, frozen=True, kw_only=True):
    """How far a variant's numbers lie from the exact ones.

    ``centroid_px`` is the distance between the centroids, ``spread_relative`` is of σ, ``eda_pixels`` the
    difference in the number of pixels.
    """

    centroid_px: float
    spread_relative: float
    eda_pixels: float
    cci_relative: float


def measure_error(metrics: Metrics | ContactMetrics, truth: ExactContact) -> ContactError | None:
    """Compare a variant's answer with the exact one, whose spread and CCI are not zero.

    The differences are taken between fractions and rounded only then. ``None`` where the variant has no
    answer; :class:`ValueError` where the equations have no value on this frame.
    """
    if truth.centroid_xy is None or truth.spread is None:
        raise ValueError("the equations have no value on this frame")
    if any(isnan(n) for n in (*metrics.centroid_xy, metrics.spread, metrics.cci)):
        return None
    dx, dy = (
        float(Fraction(own) - its) for own, its in zip(metrics.centroid_xy, truth.centroid_xy, strict=True)
    )
    return ContactError(
        centroid_px=hypot(dx, dy),
        spread_relative=_relative(metrics.spread, Fraction(truth.spread)),
        eda_pixels=float(abs(metrics.eda - truth.eda)),
        cci_relative=_relative(metrics.cci, truth.cci),
    )


def _relative(own: float, truth: Fraction) -> float:
    return float(abs(Fraction(own) - truth) / truth)


def worst(errors: list[ContactError | None]) -> ContactError | None:
    """Return the largest error of each number; ``None`` where there was no answer once."""
    known = [error for error in errors if error is not None]
    if len(known) < len(errors):
        return None
    return ContactError(
        centroid_px=max(e.centroid_px for e in known),
        spread_relative=max(e.spread_relative for e in known),
        eda_pixels=max(e.eda_pixels for e in known),
        cci_relative=max(e.cci_relative for e in known),
    )
