"""Fit depth and stiffness of one sensor's gel to presses with a ball of known size and force."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple, cast

import numpy as np

from tega.errors import CalibrationError
from tega.touch import KnownPress, calibrate_light, nominal_light

if TYPE_CHECKING:
    from tega.records import Contact
    from tega.touch import TrackedContact

__all__ = ["GEL_RADII_MM", "Ball", "ball_depth_mm", "fit_gel", "held"]

GEL_RADII_MM = (21.0, 100.0)
"""Of a DIGIT's gel across and along the finger, millimetres: the published drawing, near the top."""


class Ball(NamedTuple):
    """A ball that is pressed with a force that somebody knows, such as by a kitchen scale under the hand.

    Attributes:
        diameter_mm: The ball's, millimetres.
        force_n: Newtons; a kilogram is 9.81.
    """

    diameter_mm: float
    force_n: float


def ball_depth_mm(ball: Ball, stiffness_n_mm3: float) -> float:
    """Return how deep a ball goes into a gel that gives way like springs side by side.

    Force is stiffness times pressed volume, and a cap of depth d of two bodies has the volume π d² √(Ra Rb), with
    1/R = 1/R_ball + 1/R_gel in either direction.
    """
    radius_mm = ball.diameter_mm / 2
    across, along = (1 / (1 / radius_mm + 1 / gel) for gel in GEL_RADII_MM)
    return math.sqrt(ball.force_n / (math.pi * stiffness_n_mm3 * math.sqrt(across * along)))


def held(contacts: Sequence[Contact]) -> Contact | None:
    """Return the contact of a press while it was held: the middle one of the deeper half; ``None`` without any."""
    felt = [c for c in contacts if c.in_contact and c.depth_mm and c.force_n]
    if not felt:
        return None
    deeper = sorted(felt, key=lambda c: c.force_n or 0.0)[len(felt) // 2 :]
    return deeper[len(deeper) // 2]


def fit_gel(presses: Sequence[Sequence[Contact]], ball: Ball) -> tuple[float, float]:
    """Return depth gain and stiffness (N/mm³) of a sensor from presses with a known ball and force.

    Args:
        presses: What the nominal light gave of each press, frame by frame.
        ball: What was pressed, and how hard.

    Raises:
        CalibrationError: None of the presses was felt.
    """
    nominal = nominal_light()
    depth_mm = ball_depth_mm(ball, nominal.stiffness_n_mm3)
    # Of a contact only what was read is looked at, which a record of it has as well.
    known = [
        KnownPress(cast("TrackedContact", contact), ball.force_n, depth_mm)
        for press in presses
        if (contact := held(press)) is not None
    ]
    if not known:
        raise CalibrationError("no press with the known ball was felt", "press harder, and hold for a second")
    light = calibrate_light(known)
    gain = float(np.abs(nominal.terms).max() / np.abs(light.terms).max())
    return gain, light.stiffness_n_mm3
