"""Track a grasp by a particle filter that knows the plant: closure, need and harm, and what each act would cost.

A particle is one way things may be: the muscles' true aim, the closure that follows, the closure that this object needs
and the one that harms it. All laws are those of the plant and of the person's motor stage, with the person's numbers.
"""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import erfc

from tega_figures.information.plant import (
    DEFORMED_LEVELS,
    HAND_S,
    SLIP_LEVELS,
    SLIP_M_S_PER_LEVEL,
    plant_objects,
)
from tega_sim.operator import PersonNumbers
from tega_sim.operator.motor import level_effort

Floats = NDArray[np.float64]
N_PARTICLES = 500
STEP_S = 0.05
HORIZON_S = 2.5
"""How far ahead an act is weighed; after that the agent will have acted again."""


class Past(NamedTuple):
    """State of all particles at an earlier moment."""

    t_s: float
    closure: Floats
    held: bool


def _normal_cdf(z: Floats) -> Floats:
    half: Floats = 0.5 * erfc(-z / math.sqrt(2))
    return half


class GraspCloud:
    """Particles of one object, kept over its trials.

    Args:
        person: Whose muscles and eyes.
        rng: Of the filter.
        full_effort: Excitation that closes the hand fully.
    """

    def __init__(self, person: PersonNumbers, rng: np.random.Generator, full_effort: float) -> None:
        self._p, self._rng, self._full = person, rng, full_effort
        objects = plant_objects(rng, N_PARTICLES)
        self.need = np.array([item.need for item in objects])
        self.harm = np.array([item.harm for item in objects])
        self._errors = np.random.default_rng(1).standard_normal((2, N_PARTICLES))
        self.begin()

    def begin(self) -> None:
        """Start a trial with the hand open."""
        n = N_PARTICLES
        self.weight = np.full(n, 1 / n)
        self.target = self.first = self.shaped = np.zeros(n)
        self.share = np.ones(n)
        self.closure = np.ones(n)
        self.harmed = np.zeros(n, dtype=bool)
        self.past: deque[Past] = deque(maxlen=round(3 / STEP_S))

    def command(self, level: int) -> None:
        """Let the muscles aim at a level anew, each particle with an error of its own."""
        self.target = self._aim(level, self._rng.standard_normal((2, N_PARTICLES)))
        self.share = np.ones(N_PARTICLES)

    def step(self, t_s: float, *, held: bool) -> None:
        """Let muscles and hand go on by :data:`STEP_S`."""
        motor = self._p.motor
        keep = math.exp(-STEP_S * 1e3 / motor.lag_ms)
        self.first = self.target + (self.first - self.target) * keep
        self.shaped = self.first + (self.shaped - self.first) * keep
        slack = np.where(self.shaped > motor.slack_above, math.exp(-motor.slack_per_s * STEP_S), 1.0)
        self.share = np.maximum(self.share * slack, motor.slack_floor)
        self.closure = self.closure + (self._asked(self.shaped * self.share) - self.closure) * -math.expm1(
            -STEP_S / HAND_S
        )
        self.harmed = self.harmed | (self.closure > self.harm + DEFORMED_LEVELS)
        self.past.append(Past(t_s, self.closure, held))

    def told(self, closure: float, before: float, *, settled: bool) -> None:
        """Learn the true closure, now and a step ago: from both follows what the muscles ask for."""
        asked = before + (closure - before) / -math.expm1(-STEP_S / HAND_S)
        self.closure = np.full(N_PARTICLES, closure)
        if settled:
            excitation = (min(max(asked, 1.0), 5.0) - 0.5) * self._full / 4
            self.shaped = excitation / self.share
            self.first = self.target = self.shaped
        self.past[-1] = self.past[-1]._replace(closure=self.closure)

    def weigh(self, likelihood: Floats) -> None:
        """Take in evidence; poor particles give way to good ones."""
        weight = self.weight * np.maximum(likelihood, 1e-9)
        self.weight = weight / weight.sum()
        if 1 / np.sum(self.weight**2) < N_PARTICLES / 2:
            self._resample()

    def at(self, t_s: float) -> Past | None:
        """Return the state at an earlier moment; ``None`` where that is too long ago."""
        return next((past for past in self.past if past.t_s >= t_s - 1e-9), None)

    def slip_rate(self, closure: Floats) -> Floats:
        """Return how often a second a slip would be noticed at a closure, eyes on the hand."""
        eyes = self._p.vision
        w = 57.3 * SLIP_M_S_PER_LEVEL * np.maximum(self.need - closure, 0) / eyes.distance_m
        rate: Floats = np.where(w > eyes.motion_floor_deg_s, w ** (2 / 3) / eyes.motion_c, 0.0)
        return rate

    def deformation_seen(self, closure: Floats) -> Floats:
        """Return the probability that one look at the hand finds deformation."""
        eyes = self._p.vision
        share = np.maximum(0.1 * (closure - self.harm), 1e-9)
        return _normal_cdf(np.log(share / eyes.deform_theta) / eyes.deform_log_sd)

    def expected(self, level: int | None, *, held_s: float) -> float:
        """Return the expected cost of aiming at a level now, or of doing nothing, over the horizon.

        Args:
            level: The level; ``None`` for nothing.
            held_s: How long an object is held in all, seconds: effort counts by the time.
        """
        motor, grip = self._p.motor, self._p.grip
        if level is None:
            start = self._asked(self.target * self.share)
            last = np.maximum(self.share * math.exp(-motor.slack_per_s * HORIZON_S), motor.slack_floor)
            end = self._asked(self.target * last)
        else:
            target = self._aim(level, self._errors)
            start = self._asked(target)
            end = self._asked(target * max(math.exp(-motor.slack_per_s * HORIZON_S), motor.slack_floor))
        slips = self.need - end > SLIP_LEVELS
        harms = (start > self.harm + DEFORMED_LEVELS) & ~self.harmed
        effort = grip.effort_cost * (start + end) / 10 * HORIZON_S / held_s
        return float(self.weight @ (slips + grip.harm_cost * harms + effort))

    def _aim(self, level: int, errors: Floats) -> Floats:
        motor = self._p.motor
        share = level_effort(motor, level) * (1 + motor.aim_sd * errors[0]) + motor.aim_floor * errors[1]
        aimed: Floats = np.clip(self._full * share, 0.0, 1.15)
        return aimed

    def _asked(self, excitation: Floats) -> Floats:
        asked: Floats = np.clip(4 * excitation / self._full + 0.5, 1.0, 5.0)
        return asked

    def _resample(self) -> None:
        n = N_PARTICLES
        at = (np.arange(n) + self._rng.random()) / n
        chosen = np.minimum(np.searchsorted(np.cumsum(self.weight), at), n - 1)
        for name in ("need", "harm", "target", "first", "shaped", "share", "closure", "harmed"):
            setattr(self, name, getattr(self, name)[chosen])
        self.past = deque(
            (past._replace(closure=past.closure[chosen]) for past in self.past), maxlen=self.past.maxlen
        )
        self.weight = np.full(n, 1 / n)
        jitter = self._rng.standard_normal((2, n))
        self.need = self.need + 0.04 * jitter[0]
        self.harm = self.harm + 0.04 * jitter[1]
