"""Estimate how closed a person believes the hand to be, and what closure an object needs and bears.

All in levels, all Gaussian. The pure functions are the moment updates; :class:`ObjectBelief` outlasts a trial.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from tega_sim.operator.sections import GripSection
from tega_sim.operator.vision import normal_cdf

Panel: TypeAlias = Literal["front", "back"]
# Where a panel's line stands in the state: x, front b0 and b1, back b0 and b1.
_LINE: dict[Panel, int] = {"front": 1, "back": 3}
_LEAST_CLOSED, _MOST_CLOSED = 0.5, 5.5


def above(mean: float, sd: float, x: float, var: float, floor: float) -> tuple[float, float]:
    """Update a Gaussian on learning that it lies above ``x``, itself known with variance ``var``.

    Returns mean and standard deviation of the truncated Gaussian, the latter not below ``floor``.
    """
    u = math.sqrt(sd * sd + var)
    z = (x - mean) / u
    rest = 1 - normal_cdf(z)
    k = math.exp(-z * z / 2) / math.sqrt(2 * math.pi) / rest if rest > 1e-12 else z
    return mean + sd * sd / u * k, _narrowed(sd, u, k * (k - z), floor)


def below(mean: float, sd: float, x: float, var: float, floor: float) -> tuple[float, float]:
    """Update a Gaussian on learning that it lies below ``x``: the mirror of :func:`above`."""
    mirrored, narrowed = above(-mean, sd, -x, var, floor)
    return -mirrored, narrowed


def _narrowed(sd: float, u: float, factor: float, floor: float) -> float:
    return max(math.sqrt(max(sd * sd * (1 - sd * sd / (u * u) * factor), 0.0)), floor)


class Closure:
    """Belief about the closure ``x`` together with the vest's reading of it (extended Kalman filter).

    For each panel a line ``ln I = b0 + b1 x`` is learned along with ``x``. They are estimated jointly because one
    closure is felt many times: with separate estimates, each reading would count the same error of ``x`` again.
    Slopes start at 0, and a panel does not move ``x`` before its slope is known, so that the vest's frames have no
    meaning before they are learned.
    """

    def __init__(self, grip: GripSection) -> None:
        log_half = math.log(0.5)
        self._mean = np.array([1.0, log_half, 0.0, log_half, 0.0])
        line = [grip.line_intercept_sd**2, grip.line_slope_sd**2]
        self._cov = np.diag([0.0, *line, *line])
        self._least = grip.line_slope_min

    @property
    def x(self) -> float:
        """The closure, levels."""
        return float(self._mean[0])

    @property
    def var(self) -> float:
        """Variance of the closure."""
        return float(self._cov[0, 0])

    def slope(self, panel: Panel) -> float:
        """Change of a panel's log intensity with one level."""
        return float(self._mean[_LINE[panel] + 1])

    def known(self, panel: Panel) -> bool:
        """Whether the slope stands two standard deviations clear of 0, and is not flat."""
        n = _LINE[panel] + 1
        return abs(self.slope(panel)) > max(2 * math.sqrt(self._cov[n, n]), self._least)

    def set(self, x: float, var: float) -> None:
        """Start from a new command: its error has nothing to do with the last one's."""
        self._mean[0] = min(max(x, _LEAST_CLOSED), _MOST_CLOSED)
        self._cov[0, :] = self._cov[:, 0] = 0.0
        self._cov[0, 0] = var

    def fade(self, var: float) -> None:
        """Become less sure of how strong the vest is felt altogether."""
        for n in _LINE.values():
            self._cov[n, n] += var

    def drift(self, var: float) -> None:
        """Become less sure."""
        self._cov[0, 0] += var

    def observe(self, level: float, var: float) -> None:
        """Take in one independent reading of the closure."""
        self._update(level - self.x, np.array([1.0, 0.0, 0.0, 0.0, 0.0]), var, moves_x=True)

    def feel(self, panel: Panel, y: float, var: float) -> None:
        """Take in one mean log intensity of a panel."""
        n = _LINE[panel]
        b0, b1 = self._mean[n], self._mean[n + 1]
        h = np.zeros(5)
        h[0], h[n], h[n + 1] = b1, 1.0, self.x
        self._update(y - float(b0 + b1 * self.x), h, var, moves_x=self.known(panel))

    def _update(self, surprise: float, h: NDArray[np.float64], var: float, *, moves_x: bool) -> None:
        spread = self._cov @ h
        gain = spread / (float(h @ spread) + var)
        if not moves_x:
            gain[0] = 0.0
        self._mean = self._mean + gain * surprise
        self._mean[0] = min(max(self._mean[0], _LEAST_CLOSED), _MOST_CLOSED)
        # The form that holds for any gain.
        keep = np.eye(5) - np.outer(gain, h)
        self._cov = keep @ self._cov @ keep.T + var * np.outer(gain, gain)


@dataclass
class ObjectBelief:
    """Belief about one object.

    ``closure`` is about the hand's closure on it and the vest at that closure; ``need`` and ``harm`` are the
    closures that it needs and that harm it, each with its standard deviation.
    """

    grip: GripSection
    closure: Closure
    need: tuple[float, float] = (0.0, 0.0)
    harm: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        """Start from the person's first guesses."""
        self.need = (self.grip.need, self.grip.need_sd)
        self.harm = (self.grip.harm, self.grip.harm_sd)

    def fade(self, felt_var: float) -> None:
        """Forget a little, as between two trials.

        ``felt_var`` is how much the vest's felt strength may have changed, variance of the logarithm.
        """
        self.closure.fade(felt_var)
        forgotten = self.grip.between_sd**2
        self.need = (self.need[0], math.sqrt(self.need[1] ** 2 + forgotten))
        self.harm = (self.harm[0], math.sqrt(self.harm[1] ** 2 + forgotten))

    def slipped(self, x: float, var: float) -> None:
        """Learn that closure ``x`` did not do."""
        self.need = above(*self.need, x, var, self.grip.belief_floor_sd)

    def sufficed(self, x: float, var: float) -> None:
        """Learn that closure ``x`` did."""
        self.need = below(*self.need, x, var + self.grip.quiet_sd**2, self.grip.belief_floor_sd)

    def spared(self, x: float, var: float) -> None:
        """Learn that closure ``x`` was not too much."""
        self.harm = above(*self.harm, x, var + self.grip.quiet_sd**2, self.grip.belief_floor_sd)

    def harmed(self, x: float, var: float) -> None:
        """Learn that closure ``x`` was too much."""
        self.harm = below(*self.harm, x, var, self.grip.belief_floor_sd)


def cost(belief: ObjectBelief, x: float, var: float) -> float:
    """Return the expected cost of closure ``x``: slipping, harming, effort."""
    grip = belief.grip
    slips = 1 - normal_cdf((x - belief.need[0]) / math.sqrt(belief.need[1] ** 2 + var))
    harms = normal_cdf((x - belief.harm[0]) / math.sqrt(belief.harm[1] ** 2 + var))
    return slips + grip.harm_cost * harms + grip.effort_cost * x / 5


def best_level(belief: ObjectBelief, aim_sd: float) -> int:
    """Return the level of least expected cost for a hand that closes again."""
    closure_var = belief.grip.closure_sd**2
    return min(range(1, 6), key=lambda level: cost(belief, level, (aim_sd * level) ** 2 + closure_var))
