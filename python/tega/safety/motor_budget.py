"""Limit how much a vest's motors vibrate: a ceiling on each, the heat of each, the dose at its place on the skin.

For a motor at share d of full drive (0 to 1):

- heat: θ' = (d² - θ)/τ, θ being the case's temperature rise as a share of the final rise at full drive. At most
  ``heat_share`` is allowed: d² ≤ H + 5 (H - θ), so full drive from cold, then down to the drive that keeps H forever;
- dose: D = ∫ d² dt, in seconds of full drive. Above 80 % of the budget B the motor's ceiling sinks in proportion to
  the remaining budget, and is 0 at B: d ≤ (B - D)/(0.2 B).

Neither can be passed, whatever is asked for. The numbers' origin is in docs/evidence/safety.md; none was measured on a
vest.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

HEAT_TAU_S: Final = 60.0
"""Time constant of a coin motor's case in cloth, seconds."""

HEAT_SHARE: Final = 0.5
"""Allowed share of the temperature rise that full drive gives in the end: 10 of 20 K."""

DOSE_S: Final = 1800.0
"""Allowed seconds of full drive of one motor in a day."""

_EASE: Final = 5.0
_TAPER: Final = 0.2
_LONGEST_S: Final = 1.0


class MotorBudget:
    """Keeps 40 motors within their limits; ``limit`` is the highest intensity, percent.

    Attributes:
        heat: θ of each motor, float64 (40,).
        dose_s: D of each motor, float64 (40,), seconds of full drive.
        carried_s: Part of ``dose_s`` that earlier runs used, float64 (40,).
        n_lowered: Frames in which heat or dose took something off a motor.
    """

    def __init__(self, *, limit: int = 100, heat_share: float = HEAT_SHARE, dose_s: float = DOSE_S) -> None:
        self._limit = min(limit, 100)
        self._heat_share = heat_share
        self._budget_s = dose_s
        self._displayed = np.zeros(40)
        self._t_ns: int | None = None
        self.heat = np.zeros(40)
        self.dose_s = np.zeros(40)
        self.carried_s = np.zeros(40)
        self.n_lowered = 0

    def carry(self, *, dose_s: NDArray[np.float64], heat: NDArray[np.float64]) -> None:
        """Set dose and heat (0 to 1) of earlier runs, float64 (40,) each."""
        self.carried_s = dose_s.copy()
        self.dose_s += dose_s
        self.heat = np.maximum(self.heat, heat)

    def allow(self, t_ns: int, wanted: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Return the intensities that may be shown from now on, nowhere above ``wanted``.

        Both are uint8 (40,), percent, in the wearer's order; ``t_ns`` is on a clock that never goes back.
        """
        self._pass(t_ns)
        squared = self._heat_share + _EASE * (self._heat_share - self.heat)
        # np.clip takes several times as long for so few numbers.
        warm = np.sqrt(np.minimum(np.maximum(squared, 0.0), 1.0))
        left = (self._budget_s - self.dose_s) / (_TAPER * self._budget_s)
        share = np.maximum(np.minimum(warm, left), 0.0)
        # Rounded down, as the cast does: a ceiling that is rounded up is none.
        ceiling = (100.0 * share).astype(np.uint8)
        limited = np.minimum(wanted, np.uint8(self._limit))
        allowed = np.minimum(limited, ceiling)
        self.n_lowered += allowed.tobytes() != limited.tobytes()
        self._displayed = allowed / 100.0
        return allowed

    def words(self) -> tuple[str, ...]:
        """Return the notes on the budget that a reader of the results must know."""
        earlier_s = float(self.carried_s.max())
        notes: tuple[str, ...] = ()
        if earlier_s >= 1:
            notes = (
                f"earlier runs of the day used up to {earlier_s:.0f} of {self._budget_s:.0f} s of full drive",
            )
        if not self.n_lowered:
            return notes
        tired = int((self.dose_s > (1 - _TAPER) * self._budget_s).sum())
        why = f"the vibration dose of {tired} motors is nearly used up" if tired else "motors were warm"
        return (*notes, f"intensity was lowered in {self.n_lowered} frames: {why}")

    def _pass(self, t_ns: int) -> None:
        """Apply the effect of the shown frame until now, in steps short enough for the taper to hold."""
        left_s = 0.0 if self._t_ns is None else max(0.0, (t_ns - self._t_ns) * 1e-9)
        self._t_ns = t_ns if self._t_ns is None else max(t_ns, self._t_ns)
        power = self._displayed**2
        # A vest that receives nothing for longer stops by itself.
        driven_s = min(left_s, _LONGEST_S)
        self.heat = power + (self.heat - power) * np.exp(-driven_s / HEAT_TAU_S)
        if left_s > driven_s:
            self.heat *= np.exp(-(left_s - driven_s) / HEAT_TAU_S)
        self.dose_s += power * driven_s
