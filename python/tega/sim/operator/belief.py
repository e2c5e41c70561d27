"""What the person believes: how closed the hand is, how closed this object needs it, and how closed would harm it.

All in levels, all Gaussian. The pure functions are the moment updates; :class:`ObjectBelief` outlasts a trial.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from tega.sim.operator.sections import Grip
from tega.sim.operator.vision import normal_cdf

__all__ = ["Line", "ObjectBelief", "above", "below", "best_level", "cost"]


def above(mean: float, sd: float, x: float, var: float, floor: float) -> tuple[float, float]:
    """Update a Gaussian on learning that it lies above ``x``, itself known with variance ``var``.

    Returns:
        Mean and standard deviation of the truncated Gaussian, the latter not below ``floor``.
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


class Line:
    """A learned line from closure to the log intensity of one panel: ``ln I = b0 + b1 x``.

    It starts with slope 0, so that nothing is read from the vest before it has been learned.

    Args:
        grip: The person's numbers.
    """

    def __init__(self, grip: Grip) -> None:
        self._b = np.array([math.log(0.5), 0.0])
        self._cov = np.diag([grip.line_intercept_sd**2, grip.line_slope_sd**2])
        self._least = grip.line_slope_min

    @property
    def slope(self) -> float:
        """Change of log intensity with one level."""
        return float(self._b[1])

    @property
    def known(self) -> bool:
        """Whether the slope stands two standard deviations clear of 0, and is not flat."""
        return bool(abs(self.slope) > max(2 * math.sqrt(self._cov[1, 1]), self._least))

    def read(self, y: float, var: float, x: float) -> tuple[float, float]:
        """Return the closure that a log intensity speaks for, and its variance; ask :attr:`known` first."""
        h = np.array([1.0, x])
        total = var + float(h @ self._cov @ h)
        return float((y - self._b[0]) / self._b[1]), total / float(self._b[1] ** 2)

    def learn(self, y: float, var: float, x: float, x_var: float) -> None:
        """Take in one mean log intensity felt at closure ``x``."""
        h: NDArray[np.float64] = np.array([1.0, x])
        spread = self._cov @ h
        total = float(h @ spread) + var + float(self._b[1] ** 2) * x_var
        gain = spread / total
        self._b = self._b + gain * (y - float(h @ self._b))
        self._cov = self._cov - np.outer(gain, spread)


@dataclass
class ObjectBelief:
    """What is believed of one object.

    Attributes:
        grip: The person's numbers.
        need: Closure it needs, and the standard deviation of that.
        harm: Closure that harms it, likewise.
        lines: What front and back of the vest tell about the closure on it.
    """

    grip: Grip
    need: tuple[float, float] = (0.0, 0.0)
    harm: tuple[float, float] = (0.0, 0.0)
    lines: dict[str, Line] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Start from the person's first guesses."""
        self.need = (self.grip.need, self.grip.need_sd)
        self.harm = (self.grip.harm, self.grip.harm_sd)
        self.lines = {"front": Line(self.grip), "back": Line(self.grip)}

    def fade(self) -> None:
        """Forget a little, as between two trials."""
        forgotten = self.grip.between_sd**2
        self.need = (self.need[0], math.sqrt(self.need[1] ** 2 + forgotten))
        self.harm = (self.harm[0], math.sqrt(self.harm[1] ** 2 + forgotten))

    def slipped(self, x: float, var: float) -> None:
        """Learn that closure ``x`` did not do."""
        self.need = above(*self.need, x, var, self.grip.belief_floor_sd)

    def sufficed(self, x: float, var: float) -> None:
        """Learn that closure ``x`` did."""
        self.need = below(*self.need, x, var + self.grip.quiet_sd**2, self.grip.belief_floor_sd)

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
    """Return the level of least expected cost for a hand that is to be closed anew."""
    closure_var = belief.grip.closure_sd**2
    return min(range(1, 6), key=lambda level: cost(belief, level, (aim_sd * level) ** 2 + closure_var))
