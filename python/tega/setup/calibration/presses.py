"""Judge guided presses on a fingertip: which of them count, and which frames give its maxima."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal, NamedTuple

import numpy as np

from tega.records import Contact

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
        self.eda_px = 0

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
        self.eda_px = live.eda
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
