"""Simulate sight: slip, deformation, contact, pose, each late, only if large, only in the field of view.

Slip follows the law of Dzhafarov, Sekuler and Allik (1993): the reaction time to a speed ``w`` in degrees a second is
``r + c / w^(2/3)``. Integrating ``w^(2/3)`` up to ``c`` gives the same at constant speed and serves changing speed too.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final, Literal, NamedTuple, TypeAlias

import numpy as np

from tega_sim.operator.sections import Vision
from tega_sim.seams import WorldTruth

Kind = Literal["slip", "deformation", "contact", "weaker", "onset"]

_DEGREES = 180 / math.pi
# A pad that carries this much is visibly against the object, newtons.
_TOUCHING_N = 0.02


ViewName: TypeAlias = Literal["direct", "aside", "hidden"]
"""Where the eyes are while the object is held."""

VIEWS: Final[dict[ViewName, float]] = {"direct": 0.0, "aside": 20.0, "hidden": math.inf}
"""Angle between the gaze and the hand then, degrees. ``direct``: on the hand, away for a look at a time. ``aside``:
on the goal of the object, as in people who move an object (Johansson and others 2001, J Neurosci 21:6917); 20 degrees
are 0.55 m at 1.5 m. ``hidden``: the grip is out of sight, behind the hand or a screen."""

# Eccentricity at which a threshold is twice the fovea's, degrees. Motion and size thresholds rise linearly with
# eccentricity (McKee and Nakayama 1984, doi 10.1016/0042-6989(84)90140-8); 2.5 is a guess, 1.5 to 6 in the literature.
_DOUBLED_DEG: Final = 2.5


class SeenEvent(NamedTuple):
    """Slip, deformation or other event that the person notices.

    ``began_s`` is when it was there to be noticed, ``due_s`` when the person can act on it.
    """

    due_s: float
    kind: Kind
    began_s: float


def normal_cdf(z: float) -> float:
    """Return the standard normal distribution function."""
    return 0.5 * math.erfc(-z / math.sqrt(2))


def reaction_s(
    rng: np.random.Generator, mean_ms: float, sigma_ms: float, tau_ms: float, floor_ms: float
) -> float:
    """Draw a reaction time, seconds: Gaussian plus exponential with the given mean, not below the floor."""
    drawn = mean_ms - tau_ms + sigma_ms * float(rng.standard_normal())
    return max(drawn + tau_ms * float(rng.standard_exponential()), floor_ms) / 1e3


class Eyes:
    """One person's sight during a trial.

    ``process`` returns the random stream of a name. The object's width is plain to see; ``view`` is where the
    eyes are while it is held. ``bears_m`` is the narrowing from which the object counts as harmed, which the
    person knows; 0 if unknown.
    """

    def __init__(
        self,
        vision: Vision,
        process: Callable[[str], np.random.Generator],
        *,
        width_m: float,
        view: ViewName = "direct",
        bears_m: float = 0.0,
    ) -> None:
        self._aside_deg, self._elsewhere = VIEWS[view], False
        self._p, self._width_m = vision, width_m
        self._bears, self._judged = bears_m / width_m, 0.0
        self._gaze, self._checks = process("gaze"), process("vision")
        self._poses, self._reaction = process("pose"), process("visual reaction")
        self._motion = self._next_check_s = 0.0
        self._last_distance_m: float | None = None
        self._on_hand = True

    def observe(
        self, t_s: float, dt_s: float, scene: WorldTruth, *, carried: bool, lifting: bool, held: bool = False
    ) -> list[SeenEvent]:
        """Return the events that have been noticed since the last call, ``dt_s`` ago.

        While ``carried``, the hand moving the object about, the eyes are less on it; while ``lifting``, the
        hand going up, an object that stays behind is seen to move against it. ``held`` is whether the person
        takes the object to be in the hand.
        """
        events: list[SeenEvent] = []
        self._elsewhere = held and self._aside_deg > 0
        self._integrate(dt_s, self._relative_speed_m_s(dt_s, scene, lifting=lifting))
        if self._motion > self._p.motion_c:
            self._motion = -self._p.motion_c / 2
            events.append(self._noticed(t_s, "slip"))
        if t_s >= self._next_check_s:
            self._next_check_s = t_s + self._p.look_s
            share = self._p.gaze_transport if carried else self._p.gaze_grasp
            self._on_hand = bool(self._gaze.random() < share)
            events += self._check(t_s, scene)
        return events

    def pose(self, closure: float) -> tuple[float, float] | None:
        """Return the hand's closure as read by eye and the variance of that, levels; none while looking away."""
        error = float(self._poses.standard_normal())
        return (closure + self._p.pose_sd * error, self._p.pose_sd**2) if self._looking else None

    @property
    def _looking(self) -> bool:
        return math.isfinite(self._aside_deg) if self._elsewhere else self._on_hand

    def _check(self, t_s: float, scene: WorldTruth) -> list[SeenEvent]:
        deformed, touched = self._checks.random(2)
        if not self._looking:
            return []
        found: list[SeenEvent] = []
        if self._dented(scene.deformation_m / self._width_m, float(deformed)):
            found.append(self._noticed(t_s, "deformation"))
        if sum(force > _TOUCHING_N for force in scene.pad_force_n) >= 2 and touched < self._p.contact_p:
            found.append(self._noticed(t_s, "contact"))
        return found

    def _dented(self, share: float, drawn: float) -> bool:
        """Whether a look of chance ``drawn``, 0 to 1, finds the object harmed by a narrowing, a share of its width.

        What was judged is judged again only when it has grown: every hold narrows the object somewhat.
        """
        step = math.exp(self._p.deform_log_sd)
        if share * step < self._judged:
            self._judged = share
        if share <= max(self._judged * step, 0.0):
            return False
        self._judged = share
        return drawn < self._seen(share, max(self._p.deform_theta * self._blurred, self._bears))

    def _seen(self, share: float, middle: float) -> float:
        """Probability that a narrowing is taken for more than one that is seen in half of the looks."""
        return normal_cdf(math.log(share / middle) / self._p.deform_log_sd)

    @property
    def _blurred(self) -> float:
        """How many times larger or faster something has to be, to be seen as well as where the eyes are."""
        return 1 + self._aside_deg / _DOUBLED_DEG if self._elsewhere else 1.0

    def _relative_speed_m_s(self, dt_s: float, scene: WorldTruth, *, lifting: bool) -> float:
        """Speed of the object against the fingers, whether it slides in the grasp or stays behind on the table."""
        last, self._last_distance_m = self._last_distance_m, scene.hand_to_object_m
        behind = 0.0
        if lifting and not scene.lift_off and last is not None:
            behind = (scene.hand_to_object_m - last) / dt_s
        return max(scene.slip_m_s, behind, 0.0)

    def _integrate(self, dt_s: float, speed_m_s: float) -> None:
        w = _DEGREES * speed_m_s / self._p.distance_m / self._blurred
        gained = w ** (2 / 3) * dt_s if self._looking and w > self._p.motion_floor_deg_s else 0.0
        self._motion += gained - self._motion * dt_s / self._p.motion_leak_s

    def _noticed(self, t_s: float, kind: Kind) -> SeenEvent:
        p = self._p
        late = reaction_s(self._reaction, p.rt_ms, p.rt_sigma_ms, p.rt_tau_ms, p.rt_floor_ms)
        return SeenEvent(t_s + late + (p.choice_ms + p.delay_ms) / 1e3, kind, t_s)
