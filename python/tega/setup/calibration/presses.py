"""Judge guided presses on a fingertip, which give its maxima, and fit its gel to those with a known ball and force."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Literal, NamedTuple, cast

import numpy as np

from tega.errors import CalibrationError
from tega.records import Contact
from tega.tactile.tracker import DEPTH_LAW, KnownPress, TrackedContact, calibrate_light, nominal_light

PRESSES = 3
"""Repetitions of each object: one spike, or one odd press, must not decide."""

LEAST_SHARE = 0.015
"""A press that dents less of the picture is too weak to set a maximum; firm ones of a ball dent 9 to 18 %."""

# A press is over when nothing touches for so long, and one shorter than this was an accident.
_GAP_NS = 200_000_000
_LEAST_NS = 300_000_000
# Presses differ; one under half of the middle one was not meant.
_ODD_SHARE = 0.5
_SIZE_PERCENTILE = 90.0

_Preset = Literal["paper", "live"]


class Press(NamedTuple):
    """One press, from the first touch to the last.

    ``eda_px`` is its dent: as large as one frame in ten showed it, so that one frame does not decide.
    """

    start_ns: int
    end_ns: int
    eda_px: int


class PressMeter:
    """Follows presses as frames are measured."""

    def __init__(self, n_pixels: int) -> None:
        self._n_pixels = n_pixels
        self._seen: dict[_Preset, list[Contact]] = {"paper": [], "live": []}
        self._now: list[Contact] = []
        self.presses: list[Press] = []

    @property
    def touched(self) -> bool:
        """Whether a press is going on."""
        return bool(self._now)

    @property
    def firm(self) -> list[Press]:
        """The presses that count: firm enough, and not far under the others."""
        strong = [p for p in self.presses if p.eda_px >= LEAST_SHARE * self._n_pixels]
        if not strong:
            return []
        middle = float(np.median([p.eda_px for p in strong]))
        return [p for p in strong if p.eda_px >= _ODD_SHARE * middle]

    def take(self, readings: Mapping[_Preset, Contact]) -> Press | None:
        """Take the contacts in a frame under both presets; return a press that has just ended."""
        for preset, contact in readings.items():
            self._seen[preset].append(contact)
        live = readings["live"]
        if live.in_contact:
            self._now.append(live)
            return None
        if not self._now or live.t_ns - self._now[-1].t_ns < _GAP_NS:
            return None
        start_ns, end_ns = self._now[0].t_ns, self._now[-1].t_ns
        size_px = float(np.percentile([contact.eda for contact in self._now], _SIZE_PERCENTILE))
        press = Press(start_ns, end_ns, round(size_px))
        self._now = []
        if end_ns - start_ns < _LEAST_NS:
            return None
        self.presses.append(press)
        return press

    def judge(self, press: Press) -> str:
        """Return the problem with a press; an empty string if it counts."""
        share = press.eda_px / self._n_pixels
        if share < LEAST_SHARE:
            return (
                f"too weak: it dented {share:.1%} of the picture, {LEAST_SHARE:.1%} are needed; press harder"
            )
        if press not in self.firm:
            return "much weaker than the others; it does not count"
        return ""

    def problems(self) -> tuple[str, ...]:
        """Say why the maxima cannot be taken yet; empty where they can."""
        firm, n = self.firm, len(self.presses)
        if len(firm) >= PRESSES:
            return ()
        if self.touched:
            return ("the gel is still touched: let go, or take the baseline again",)
        weak = n - len(firm)
        text = f"{len(firm)} of {PRESSES} firm presses"
        return (f"{text}; {weak} were too weak" if weak else f"only {text} were seen",)

    def frames(self, preset: _Preset) -> list[Contact]:
        """Return the contacts of the firm presses."""
        firm = self.firm
        return [c for c in self._seen[preset] if any(p.start_ns <= c.t_ns <= p.end_ns for p in firm)]


GEL_RADII_MM = (21.0, 100.0)
"""Radii of a DIGIT's gel across and along the finger, millimetres: the published drawing, near the top."""


class Ball(NamedTuple):
    """A ball pressed with a force known, for example, from a kitchen scale; a kilogram is 9.81 N."""

    diameter_mm: float
    force_n: float


class GelFit(NamedTuple):
    """Depth gain, stiffness and scale of a sensor, from presses with a known ball.

    ``depth_gain`` is depth by depth as a gel's nominal light has it; ``mm_per_px`` is for a picture of 320 x
    240 pixels. Gain and stiffness belong to the version ``depth_law`` of the law.
    """

    depth_gain: float
    stiffness_n_mm3: float
    mm_per_px: float
    depth_law: int = DEPTH_LAW


# An outlined dent's radius over that of the touching disc below, 1.03 to 1.09 for balls of 4 and 12 mm at 1 to 5 N on
# simulated units: in-sample.
_OUTLINED = 1.05
# Pixels of the picture that the scale is given for.
_NOMINAL_PX = 320 * 240


def held(contacts: Sequence[Contact]) -> Contact | None:
    """Return the contact of a press while it was held: the middle one of the deeper half; ``None`` without any."""
    felt = [c for c in contacts if c.in_contact and c.depth_mm and c.force_n]
    if not felt:
        return None
    deeper = sorted(felt, key=lambda c: c.force_n or 0.0)[len(felt) // 2 :]
    return deeper[len(deeper) // 2]


def fit_gel(presses: Sequence[Sequence[Contact]], ball: Ball) -> GelFit:
    """Return depth gain, stiffness and scale of a sensor from presses with a known ball and force.

    The scale is that with which the outlined dent is as wide as the ball's touching disc, a twentieth wider,
    with the published stiffness; gain and stiffness are those with which depth and force come out right at
    that scale. ``presses`` are the contacts of each press with the nominal light, frame by frame. Raises
    ``CalibrationError`` if none was felt.
    """
    nominal = nominal_light()
    # A gel gives way like springs side by side: force is stiffness times pressed volume, and a cap of depth d of two
    # bodies has the volume π d² √(Ra Rb), with 1/R = 1/R_ball + 1/R_gel in either direction.
    across_mm, along_mm = (1 / (2 / ball.diameter_mm + 1 / gel) for gel in GEL_RADII_MM)
    round_mm = math.sqrt(across_mm * along_mm)
    depth_mm = math.sqrt(ball.force_n / (math.pi * nominal.stiffness_n_mm3 * round_mm))
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
    radius_px = [math.sqrt((press.contact.broad or 0.0) * _NOMINAL_PX / math.pi) for press in known]
    # The radius of the disc over which a ball touches is √(2 d √(Ra Rb)), d the depth.
    radius_mm = math.sqrt(2 * depth_mm * round_mm)
    mm_per_px = _OUTLINED * radius_mm / (sum(radius_px) / len(radius_px))
    # Depth goes with gain times scale, force with gain times the cube of the scale.
    larger = mm_per_px / nominal.mm_per_px
    return GelFit(gain / larger, light.stiffness_n_mm3 / larger**2, mm_per_px)
