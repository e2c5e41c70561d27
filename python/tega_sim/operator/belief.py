"""Estimate how closed a person believes the hand to be, and what closure an object needs and bears.

All in levels, all Gaussian. The pure functions are the moment updates; :class:`ObjectBelief` outlasts a trial.

A panel's log intensity is learned as a curve over the closure: the vest's real course is curved, flat at both ends, and
may have nothing to do with the grip. A panel moves the belief only by as much as the person trusts it. Trust is the
probability that the panel follows the closure rather than a source of its own (causal inference in cue combination;
Ernst and Banks 2002, doi 10.1038/415429a; Koerding 2007, doi 10.1371/journal.pone.0000943). It starts low and grows
only by readings that were predicted.
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
_LEAST_CLOSED, _MOST_CLOSED = 0.5, 5.5


def above(mean: float, sd: float, x: float, var: float, floor: float) -> tuple[float, float]:
    """Update a Gaussian on learning that it lies above ``x``, itself known with variance ``var``.

    Returns mean and standard deviation of the truncated Gaussian, the latter not below ``floor``.
    """
    u = math.sqrt(sd * sd + var)
    z = (x - mean) / u
    rest = 1 - normal_cdf(z)
    k = math.exp(-z * z / 2) / math.sqrt(2 * math.pi) / rest if rest > 1e-12 else z
    narrowed = math.sqrt(max(sd * sd * (1 - sd * sd / (u * u) * (k * (k - z))), 0.0))
    return mean + sd * sd / u * k, max(narrowed, floor)


def below(mean: float, sd: float, x: float, var: float, floor: float) -> tuple[float, float]:
    """Update a Gaussian on learning that it lies below ``x``: the mirror of :func:`above`."""
    mirrored, narrowed = above(-mean, sd, -x, var, floor)
    return -mirrored, narrowed


# The curve is kept at these closures, levels, straight in between.
_STEP = 0.5
_KNOTS = np.arange(1.0, 5.6, _STEP)
# Departure of the curve from a straight line: standard deviation in ln, and over how many levels it changes. Between
# nothing felt and full drive lie ln(1/0.2) = 1.6, which a curve may run through within a level.
_BEND_SD, _BEND_LEVELS = 0.5, 1.0
# Log odds that a panel follows the closure, before it has shown so, and how far they can go: 1 in 20, and 1 in 400.
_FIRST_ODDS, _MOST_ODDS = -3.0, 6.0


class Closure:
    """Belief about the closure and about the panels' curves (extended Kalman filter), with trust.

    ``threshold`` is the intensity felt in half of the looks, share of full drive; the intensity of a panel
    that does not follow the closure lies anywhere between this and 1, in ln. ``log_odds``, by panel, are that
    it follows it. Curves and closure are estimated jointly because one closure is felt many times: with
    separate estimates, each reading would count the same error of it again.
    """

    def __init__(self, grip: GripSection, threshold: float) -> None:
        self._least = grip.line_slope_min
        n = len(_KNOTS)
        apart = _KNOTS[:, None] - _KNOTS[None, :]
        from_mid = _KNOTS - grip.need
        prior = (
            grip.line_intercept_sd**2
            + grip.line_slope_sd**2 * np.outer(from_mid, from_mid)
            + _BEND_SD**2 * np.exp(-0.5 * (apart / _BEND_LEVELS) ** 2)
            + 1e-6 * np.eye(n)
        )
        # As the person is taught: stronger is tighter, barely felt at the first touch, full at the firmest grip.
        taught = np.clip((_KNOTS - 5.0) / 3.5, -1.0, 0.0) * math.log(1.0 / threshold)
        self._mean = np.concatenate([[1.0], taught, taught])
        self._cov = np.zeros((1 + 2 * n, 1 + 2 * n))
        self._cov[1 : 1 + n, 1 : 1 + n] = self._cov[1 + n :, 1 + n :] = prior
        self._own_direction = 1.0 / max(math.log(1.0 / threshold), 0.5)
        self.log_odds: dict[Panel, float] = {"front": _FIRST_ODDS, "back": _FIRST_ODDS}

    @property
    def x(self) -> float:
        """The closure, levels."""
        return float(self._mean[0])

    @property
    def var(self) -> float:
        """Variance of the closure."""
        return float(self._cov[0, 0])

    def set(self, x: float, var: float) -> None:
        """Start from a new command: its error has nothing to do with the last one's."""
        self._mean[0] = min(max(x, _LEAST_CLOSED), _MOST_CLOSED)
        self._cov[0, :] = self._cov[:, 0] = 0.0
        self._cov[0, 0] = var

    def drift(self, var: float) -> None:
        """Become less sure."""
        self._cov[0, 0] += var

    def trust(self, panel: Panel) -> float:
        """Probability that a panel follows the closure."""
        return 1 / (1 + math.exp(-self.log_odds[panel]))

    def slope(self, panel: Panel) -> float:
        """Change of a panel's log intensity with one level, here."""
        return float(self._curve(panel)[1] @ self._mean)

    def known(self, panel: Panel) -> bool:
        """Whether the slope here stands two standard deviations clear of 0, and is not flat."""
        _, d = self._curve(panel)
        error = math.sqrt(max(float(d @ self._cov @ d), 0.0))
        return abs(float(d @ self._mean)) > max(2 * error, self._least)

    def fade(self, var: float) -> None:
        """Become less sure of how strong the vest is felt altogether."""
        back = 1 + len(_KNOTS)
        self._cov[1:back, 1:back] += var
        self._cov[back:, back:] += var

    def observe(self, level: float, var: float) -> None:
        """Take in one independent reading of the closure."""
        self._take(level - self.x, np.eye(1, len(self._mean))[0], var, share=1.0, learns=True)

    def feel(self, panel: Panel, y: float, var: float, *, fresh: bool = True) -> None:
        """Take in a panel's mean log intensity; moves the closure by as much as the panel is trusted.

        ``fresh`` is whether the command is so recent that the closure aimed at is a fair guess of the real
        one. Only then curve and trust are learned; later, muscles having slackened, a change is one of the
        closure.
        """
        h, d = self._curve(panel)
        surprise = y - float(h @ self._mean)
        h[0] = float(d @ self._mean)
        # The slope is not known either: of second order, but what keeps an unlearned panel from being read.
        var += float(d @ self._cov @ d) * self.var
        if fresh:
            spread = float(h @ self._cov @ h) + var
            foretold = math.exp(-surprise * surprise / (2 * spread)) / math.sqrt(2 * math.pi * spread)
            odds = self.log_odds[panel] + math.log(max(foretold, 1e-12) / self._own_direction)
            self.log_odds[panel] = min(max(odds, -_MOST_ODDS), _MOST_ODDS)
        self._take(surprise, h, var, share=self.trust(panel), learns=fresh)

    def _curve(self, panel: Panel) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the weights of the knots in the state for a panel's curve, and for its slope, at the closure."""
        h, d = np.zeros((2, len(self._mean)))
        left = min(max(int((self.x - _KNOTS[0]) / _STEP), 0), len(_KNOTS) - 2)
        part = min(max((self.x - float(_KNOTS[left])) / _STEP, 0.0), 1.0)
        at = 1 + (len(_KNOTS) if panel == "back" else 0) + left
        h[at : at + 2] = 1 - part, part
        d[at : at + 2] = -1 / _STEP, 1 / _STEP
        return h, d

    def _take(
        self, surprise: float, h: NDArray[np.float64], var: float, *, share: float, learns: bool
    ) -> None:
        spread = self._cov @ h
        gain = spread / (float(h @ spread) + var)
        gain[0] *= share
        if not learns:
            gain[1:] = 0.0
        self._mean = self._mean + gain * surprise
        self._mean[0] = min(max(self._mean[0], _LEAST_CLOSED), _MOST_CLOSED)
        # The form that holds for any gain.
        keep = np.eye(len(h)) - np.outer(gain, h)
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
