"""Act as somebody who knows every law of the plant: a particle filter with one step of look-ahead.

The agent has the person's body: eyes, skin, muscles, reaction times, the course of a lift. It reasons differently. It
knows the family of objects, the slack and all errors of its muscles, and what its vest shows for each closure.
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from tega.haptics import intensity, vest_frame
from tega_figures.information.cloud import STEP_S, GraspCloud
from tega_sim.operator import Operator, PersonNumbers, Rules
from tega_sim.operator.acting import TrialOfPerson
from tega_sim.operator.grip import LOOSEST, Decision, GripDecisions
from tega_sim.operator.person import stream
from tega_sim.operator.vision import Kind, SeenEvent
from tega_sim.seams import Percept, WorldTruth

Told = Literal["nothing", "vest", "closure"]
# A rate of events, per second, that no particle explains.
_OTHERWISE = 0.02
# Less, in slips, is not worth a command.
_LEAST_GAIN = 0.02


class IdealGrip(GripDecisions):
    """Course of a trial whose levels come from a cloud of particles."""

    cloud: GraspCloud

    def decide(self, t_s: float, dt_s: float, events: list[SeenEvent], scene: WorldTruth) -> Decision | None:
        """As in the base class; a command moves the cloud too."""
        self._now_s = t_s
        decision = super().decide(t_s, dt_s, events, scene)
        if decision is not None:
            self.cloud.command(decision.level)
        return decision

    def _learn(self, t_s: float, events: list[SeenEvent]) -> None:
        """Nothing: the cloud has learned already."""

    def _adjust(self, kinds: set[Kind]) -> tuple[int | None, str]:
        if not kinds and not self.settled(self._now_s, 0.0):
            return None, ""
        held_s = self._arm.lift_s + self._arm.hold_s + self._arm.place_s
        here = self.cloud.expected(None, held_s=held_s)
        level = self._cheapest(held_s)
        gained = here - self.cloud.expected(level, held_s=held_s)
        return (level, "cost") if gained > _LEAST_GAIN else (None, "")

    def _first_level(self) -> int:
        return self._cheapest(self._arm.lift_s + self._arm.hold_s + self._arm.place_s)

    def _cheapest(self, held_s: float) -> int:
        lowest = max(self._least, LOOSEST)
        return min(range(lowest, 6), key=lambda level: self.cloud.expected(level, held_s=held_s))


class IdealAgent(Operator):
    """Agent that is told nothing, what a vest shows, or the closure itself.

    Args:
        person: Whose body.
        seed: Of everything random, in the body as in the filter.
        told: What it learns of the closure besides what its eyes tell: ``nothing``; ``vest``: by the vest, through the
            person's skin; ``closure``: the closure itself, without delay or error.
    """

    def __init__(self, person: PersonNumbers, *, seed: int, told: Told) -> None:
        super().__init__(person, seed=seed, rules=Rules(version=2))
        self._told, self._clouds = told, dict[str, GraspCloud]()
        self._rng = stream(seed, "ideal agent")
        closures = np.arange(1.0, 5.51, 0.05)
        frames = [self._shown(float(x)) for x in closures]
        self._closures, self._shown_at = closures, np.array(frames)

    def begin(self, name: str, *, width_m: float, trial: int = 0, rest_s: float = 60.0) -> None:
        """Start a trial, as a person does."""
        super().begin(name, width_m=width_m, trial=trial, rest_s=rest_s)
        if name not in self._clouds:
            self._clouds[name] = GraspCloud(self.person, self._rng, self._full)
        self._cloud = self._clouds[name]
        self._cloud.begin()
        assert self._trial is not None
        grip = IdealGrip(self.person, self.beliefs[name], self._trial.grip.forearm)
        grip.cloud = self._cloud
        self._trial.grip = grip
        self._lifted, self._read_s, self._last = False, 0.0, 1.0
        eyes = self.person.vision
        self._late_s = (eyes.rt_ms + eyes.choice_ms + 100) / 1e3

    def _decide(self, t_s: float, percept: Percept, trial: TrialOfPerson) -> None:
        grip, cloud = trial.grip, self._cloud
        cloud.step(t_s, held=grip.held and percept.scene.lift_off)
        if self._told == "closure" and percept.closure is not None:
            cloud.told(percept.closure, self._last, settled=grip.age_s(t_s) > 0.6)
            self._last = percept.closure
        if self._told == "vest" and percept.vest is not None:
            self._feel(t_s)
        due = [event for event in trial.pending if event.due_s <= t_s]
        trial.pending = [event for event in trial.pending if event.due_s > t_s]
        if grip.held:
            self._watch(t_s, percept.scene, due)
        decision = grip.decide(t_s, STEP_S, due, percept.scene)
        if decision is not None:
            trial.motor.command(decision.level)

    def _watch(self, t_s: float, scene: WorldTruth, due: list[SeenEvent]) -> None:
        """Weigh the particles by what was seen, and by what was not."""
        cloud, eyes = self._cloud, self.person.vision
        if scene.lift_off and not self._lifted:
            cloud.weigh(np.where(cloud.need - cloud.closure < 0.5, 1.0, 0.01))
        self._lifted = scene.lift_off
        past = cloud.at(t_s - self._late_s)
        if past is not None and past.held:
            looks = STEP_S / eyes.look_s
            unseen = cloud.slip_rate(past.closure) * STEP_S + cloud.deformation_seen(past.closure) * looks
            cloud.weigh(np.exp(-eyes.gaze_grasp * unseen))
        for event in due:
            began = cloud.at(event.began_s)
            if began is None:
                continue
            if event.kind == "slip":
                slid = (
                    cloud.slip_rate(began.closure)
                    if began.held
                    else (cloud.need - began.closure > 0.5).astype(np.float64)
                )
                cloud.weigh(slid + _OTHERWISE)
            elif event.kind == "deformation":
                cloud.weigh(cloud.deformation_seen(began.closure) / eyes.look_s + _OTHERWISE)

    def _feel(self, t_s: float) -> None:
        """Weigh the particles by one look at the vest; its noise and its map are known."""
        look, vest = self._skin.look(t_s, STEP_S), self.person.vest
        late = (vest.link_ms + vest.dead_ms + vest.lag_up_ms) / 1e3
        past = self._cloud.at(t_s - late)
        if past is None:
            return
        shown = np.interp(past.closure, self._closures, self._shown_at)
        felt = np.maximum(shown, 1e-6)
        for y in (look.front, look.back):
            chance = 0.5 * (1 + np.tanh(0.8 * np.log(felt / vest.threshold) / vest.threshold_log_sd))
            chance = np.clip((1 - vest.lapse) * chance, 0.001, 0.999)
            if y is None:
                self._cloud.weigh(1 - chance)
            else:
                # A little wider than the noise: motors lag, and go in steps of a fifteenth.
                sd = math.hypot(self._skin.look_sd, 0.15)
                self._cloud.weigh(chance * np.exp(-0.5 * ((y - np.log(felt)) / sd) ** 2) + 1e-3)

    def _shown(self, closure: float) -> float:
        """Amplitude of the motors at a closure, before noise."""
        percent = intensity(max(closure - 1.5, 0.0) / 3, 1.0)
        levels = vest_frame([percent] * 4, [percent] * 4).levels
        amplitude = (float(levels.max()) / 15.0) ** self.person.vest.exponent
        return 0.0 if float(levels.max()) < self.person.vest.start_level else amplitude
