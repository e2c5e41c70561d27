"""Decide for the simulated person: which level, and when to lift, put down and let go.

The person wants the object lifted with the least force. Percepts become named events, events become rules, rules
become a level; at most one command in a refractory time:

- A command is either a new movement to the middle of a level, with the error of a whole movement, or a correction: it
  moves from the believed closure by the difference, with an error in proportion to that (signal-dependent noise;
  Harris and Wolpert 1998, doi 10.1038/29528). The more certain of the two is taken. A person without feedback
  believes in the middle of the level and has almost nothing to correct; force feedback lets people correct drift and
  dispersion (Dosen 2015, doi 10.1186/s12984-015-0047-z).
- A slip seen is answered by restoring the level where it is believed to be lost, and by the next one otherwise;
  deformation likewise, downwards. A weakening felt is answered by restoring the level. Else the level of least
  expected cost is taken, unless that reverses a correction that was just seen to be needed.
- A quiet second at a closure that is believed to be lower than the last one that sufficed is evidence again.
- What a command has not changed yet is not answered; what it causes itself, at once, is.
"""

from __future__ import annotations

from typing import NamedTuple

from tega_sim.operator.belief import ObjectBelief, best_level, cost
from tega_sim.operator.motor import FARTHEST_M, SimulatedForearm
from tega_sim.operator.person import PersonNumbers
from tega_sim.operator.vision import Kind, SeenEvent
from tega_sim.seams import WorldTruth

_CARRYING = frozenset({"lift", "carry", "place"})
_CONTACT = frozenset({"contact", "onset", "slip", "deformation"})
_HELD = frozenset({"lift", "hold", "carry", "place"})
_LIFTED_M = 0.005
# Level 1 is the open hand: who holds something does not go there.
_LOOSEST = 2
# Above every closure: nothing has sufficed under this command.
_NEVER = 9.0
_CAUSED_BY_TIGHTENING = {"deformation": True, "slip": False}


class Decision(NamedTuple):
    """A command of the person.

    ``change`` is by how many levels the present closure is corrected; ``None`` for a new movement to ``level``.
    """

    level: int
    change: float | None = None


class GripDecisions:
    """One trial's course of decisions.

    ``away_m`` is how far back the place is where the object is put down; 0 is where it stood.
    """

    def __init__(
        self, person: PersonNumbers, belief: ObjectBelief, forearm: SimulatedForearm, *, away_m: float = 0.0
    ) -> None:
        self._grip, self._arm, self._aim_sd = person.grip, person.forearm, person.motor.aim_sd
        self.belief, self.closure, self.forearm = belief, belief.closure, forearm
        self.phase, self.level = "reach", 1
        self._away_m = away_m
        self.closure.set(1.0, self._renewed(1))
        self._tightened, self._suffices = False, _NEVER
        self._commanded_s = self._free_s = self._phase_s = 0.0
        self._contact_s: float | None = None
        # What this command has taught so far: each once.
        self._judged = self._posed = self._need_reported = self._harm_reported = False
        self._before = (1.0, 0.0)
        self._barred = 0
        self._attempts, self._least = 1, 1
        self._give_up_s: float | None = None
        forearm.move((0.0, 0.0), 0.0, self._arm.reach_s)

    @property
    def carrying(self) -> bool:
        """Whether the hand is moving the object about."""
        return self.phase in _CARRYING

    @property
    def touching(self) -> bool:
        """Whether the person takes the hand to be on the object."""
        return self.phase in _HELD or self._contact_s is not None

    @property
    def held(self) -> bool:
        """Whether the person takes the object to be in the hand."""
        return self.phase in _HELD

    def steady(self, t_s: float) -> bool:
        """Whether a felt change must come from the object: held, command unchanged for a second."""
        return self.phase in {"lift", "hold"} and t_s - self._commanded_s >= 1.0

    def settled(self, t_s: float, window_s: float) -> bool:
        """Whether the hand had followed the last command before the last ``window_s`` began."""
        return t_s - self._commanded_s >= self._grip.closing_step_s + window_s

    def age_s(self, t_s: float) -> float:
        """Return how long the last command has stood."""
        return t_s - self._commanded_s

    def judge_effort(self, felt_level: float, effort_sd: float) -> None:
        """Compare the person's effort with the intended level, once a command."""
        if not self._judged:
            self._judged = True
            self.closure.observe(felt_level, max((effort_sd * max(felt_level - 0.5, 0.25)) ** 2, 0.01))

    def judge_pose(self, seen: tuple[float, float] | None) -> None:
        """Take in the hand's pose before it touches: once a command, where the eyes were on it."""
        if seen is not None and not self._posed:
            self._posed = True
            self.closure.observe(*seen)

    def decide(self, t_s: float, dt_s: float, events: list[SeenEvent], scene: WorldTruth) -> Decision | None:
        """Go on by one decision interval, ``dt_s`` after the last; return the new command, if there is one.

        ``events`` are those that can be acted on now; ``scene`` is read for the course of the task.
        """
        self.closure.drift(self._grip.closure_drift**2 * dt_s)
        kinds = {event.kind for event in events}
        if self.phase == "grasp" and self._contact_s is None and kinds & _CONTACT:
            self._contact_s = t_s
        if (level := self._task(t_s, scene)) is not None:
            return self._command(t_s, level, anew=True)
        if not self.touching:
            return None
        self._learn(t_s, events)
        if t_s >= self._free_s:
            level = self._adjust({event.kind for event in events if not self._precedes(event)})
        return None if level is None else self._command(t_s, level)

    def _learn(self, t_s: float, events: list[SeenEvent]) -> None:
        if self._need_reported and self.closure.x < self._suffices - self._grip.belief_floor_sd:
            self._need_reported = False
        reported = self._need_reported
        for event in events:
            x, var = self._before if self._precedes(event) else (self.closure.x, self.closure.var)
            if event.kind == "slip" and self.phase in _HELD:
                self.belief.slipped(x, var)
                self._need_reported = True
            elif event.kind == "deformation":
                self.belief.harmed(x, var)
                self._harm_reported = True
        if t_s - max(self._commanded_s, self._phase_s) >= self._grip.quiet_s:
            self._learn_of_quiet()
        if self._need_reported and not reported:
            self._suffices = self.closure.x

    def _learn_of_quiet(self) -> None:
        """Learn once a command: to go on holding is no new evidence."""
        if self.phase == "hold" and not self._need_reported:
            self.belief.sufficed(self.closure.x, self.closure.var)
            self._need_reported, self._barred = True, max(self._barred, 0)
        if not self._harm_reported:
            self.belief.spared(self.closure.x, self.closure.var)
            self._harm_reported = True

    def _precedes(self, event: SeenEvent) -> bool:
        """Whether an event belongs to the closure before the last command: the hand needs a moment to follow one."""
        caused = _CAUSED_BY_TIGHTENING.get(event.kind)
        own = event.began_s >= self._commanded_s and caused is self._tightened
        return event.began_s < self._commanded_s + self._grip.closing_step_s and not own

    def _adjust(self, kinds: set[Kind]) -> int | None:
        # Less than this cannot be distinguished from the middle of the level.
        lost = self.level - self.closure.x
        if self.phase in _HELD and "slip" in kinds:
            self._barred = -1
            return self._best((0, 1) if lost > self._grip.closure_sd else (1,))
        if "deformation" in kinds:
            self._barred = 1
            return self._best((-1, 0) if -lost > self._grip.closure_sd else (-1,))
        here = cost(self.belief, self.closure.x, self.closure.var)
        if self.phase in _HELD and "weaker" in kinds and self._expected(self.level) < here:
            return self.level
        level = self._best(tuple(step for step in (-1, 0, 1) if step == 0 or step != self._barred))
        return level if here - self._expected(level) > self._grip.gain_to_act else None

    def _best(self, steps: tuple[int, ...]) -> int:
        lowest = max(self._least, _LOOSEST)
        levels = [self.level + step for step in steps if lowest <= self.level + step <= 5]
        return min(levels or [self.level], key=self._expected)

    def _expected(self, level: int) -> float:
        return cost(self.belief, level, min(self._renewed(level), self._corrected(level)))

    def _renewed(self, level: int) -> float:
        """Variance of the closure after a new movement to a level."""
        return (self._aim_sd * level) ** 2 + self._grip.closure_sd**2

    def _corrected(self, level: int) -> float:
        """Variance of the closure after a correction to a level."""
        return self.closure.var + (self._aim_sd * (level - self.closure.x)) ** 2

    def _command(self, t_s: float, level: int, *, anew: bool = False) -> Decision:
        self._before = x, _ = (self.closure.x, self.closure.var)
        renewed, corrected = self._renewed(level), self._corrected(level)
        corrects = not anew and corrected < renewed
        self.closure.set(float(level), corrected if corrects else renewed)
        self._tightened = self.closure.x > x
        self.level, self._suffices = level, _NEVER
        self._commanded_s, self._free_s = t_s, t_s + self._grip.refractory_ms / 1e3
        # The sense of effort is off by the same share as before a correction: nothing new is learned from it.
        self._judged = corrects
        self._posed = self._need_reported = self._harm_reported = False
        return Decision(level, level - x if corrects else None)

    def _task(self, t_s: float, scene: WorldTruth) -> int | None:
        """Go through the phases; return a level where the phase itself asks for one."""
        arm, forearm = self._arm, self.forearm
        if self.phase in _HELD and scene.dropped:
            # Seeing it lie there and giving up takes a moment.
            self._give_up_s = t_s + self._arm.settle_s if self._give_up_s is None else self._give_up_s
            if t_s >= self._give_up_s:
                return self._let_go(t_s)
        elif self.phase == "reach" and forearm.still(t_s, arm.settle_s):
            self._enter("grasp", t_s)
        elif self.phase == "grasp":
            return self._close(t_s)
        elif self.phase == "lift":
            if forearm.at_m[0] > arm.missed_m and not scene.lift_off and scene.object_height_m < _LIFTED_M:
                return self._missed(t_s)
            if forearm.still(t_s, 0.0):
                self._enter("hold", t_s)
        else:
            return self._put_back(t_s)
        return None

    def _close(self, t_s: float) -> int | None:
        grip, waited = self._grip, t_s - self._commanded_s
        direct = self.belief.need[1] < grip.direct_sd or self._attempts > 1
        if self.level == 1:
            best = best_level(self.belief, self._aim_sd) if direct else _LOOSEST
            return max(best, self._least, _LOOSEST)
        if self._contact_s is not None:
            ready = t_s - self._contact_s >= grip.contact_wait_s
        else:
            ready = waited >= (grip.closing_wait_s if direct or self.level == 5 else grip.closing_step_s)
            if ready and self.level < 5:
                return self.level + 1
        if ready:
            self._enter("lift", t_s)
            self.forearm.move((self._arm.lift_m, 0.0), t_s, self._arm.lift_s)
        return None

    def _missed(self, t_s: float) -> int:
        """The object stayed behind: learn from it, go back down open, try again more firmly or give up."""
        late = t_s < self._commanded_s + self._grip.closing_step_s
        self.belief.slipped(*(self._before if late else (self.closure.x, self.closure.var)))
        self._least = min(self.level + (not late), 5)
        if self._attempts >= self._arm.attempts:
            return self._let_go(t_s)
        self._attempts += 1
        self._contact_s = None
        self._enter("reach", t_s)
        self.forearm.move((0.0, 0.0), t_s, self._arm.reach_s)
        return 1

    def _put_back(self, t_s: float) -> int | None:
        """Go through the phases from the hold on: carry where there is a second place, put down, let go, draw back."""
        arm, forearm = self._arm, self.forearm
        held = self.phase == "hold" and t_s - self._phase_s >= arm.hold_s
        if held and self._away_m:
            self._enter("carry", t_s)
            forearm.move((arm.lift_m, self._away_m), t_s, arm.reach_s)
        elif held or (self.phase == "carry" and forearm.still(t_s, arm.settle_s)):
            self._enter("place", t_s)
            forearm.move((0.0, self._away_m), t_s, arm.place_s)
        elif self.phase == "place" and forearm.still(t_s, arm.settle_s):
            return self._let_go(t_s)
        elif self.phase == "release" and t_s - self._phase_s >= arm.release_s:
            away_m = min(self._away_m + arm.back_m, max(FARTHEST_M, arm.back_m))
            if forearm.at_m == (0.0, away_m):
                self._enter("done", t_s)
            elif forearm.still(t_s, arm.settle_s):
                forearm.move((0.0, away_m), t_s, arm.reach_s)
        return None

    def _let_go(self, t_s: float) -> int:
        self._enter("release", t_s)
        self._contact_s = None
        return 1

    def _enter(self, phase: str, t_s: float) -> None:
        self.phase, self._phase_s = phase, t_s
