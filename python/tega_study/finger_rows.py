"""Measure the contacts in the fingertip pictures of Fig 3."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import msgspec

from tega_study.touch_picture import FingerPicture
from tega_study.trials import Trial


class FingerRow(msgspec.Struct, frozen=True, kw_only=True):
    """One fingertip's contact.

    Attributes:
        preset: Readings.
        cci: Contact concentration (Eq 6).
        eda: Contact area, pixels (Eq 4).
        cci_norm: Share of the calibrated press, at most 1; ``None`` where there is none; ``eda_norm`` too.
        peak_x: Peak, pixels; so is ``peak_y``.
    """

    trial: str
    object: str
    condition: str
    finger: str
    preset: str
    cci: float
    eda: int
    cci_norm: float | None
    eda_norm: float | None
    peak_x: int
    peak_y: int


def finger_rows(pictures: Mapping[str, FingerPicture], trials: Sequence[Trial]) -> tuple[FingerRow, ...]:
    """Return the contacts that the loop measured in the pictures, by trial id."""
    of = {trial.id: trial for trial in trials}
    rows = []
    for trial, picture in pictures.items():
        contact = picture.touch.contact
        rows.append(
            FingerRow(
                trial=trial,
                object=of[trial].object,
                condition=of[trial].condition,
                finger=picture.finger,
                preset=picture.preset,
                cci=float(contact.cci),
                eda=int(contact.eda),
                cci_norm=_share(contact.cci, picture.cci_max),
                eda_norm=_share(contact.eda, picture.eda_max),
                peak_x=int(contact.peak_xy[0]),
                peak_y=int(contact.peak_xy[1]),
            )
        )
    return tuple(rows)


def _share(value: float, full: float) -> float | None:
    return min(float(value) / full, 1.0) if full > 0 else None
