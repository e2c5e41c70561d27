"""Act in the place of a simulated person: a script, for tests of other parts and a demo that must go well, or keys."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

from tega.errors import InvalidValueError
from tega_sim.filling import HOLD_S
from tega_sim.operator.motor import AWAY_M, FARTHEST_M, SimulatedForearm, level_effort
from tega_sim.operator.person import typical_person
from tega_sim.seams import Act, Percept


class Step(NamedTuple):
    """One step of a script.

    ``level`` is 1 to 5; fractions lie between. ``forearm_m`` is where the hand goes, height over the grasp
    pose and distance back from it, within ``move_s``.
    """

    t_s: float
    phase: str
    level: float
    forearm_m: tuple[float, float]
    move_s: float


DEFAULT_COURSE = (
    Step(0.0, "reach", 1, (0.0, 0.0), 1.2),
    Step(1.5, "grasp", 2, (0.0, 0.0), 0.0),
    Step(2.3, "grasp", 3, (0.0, 0.0), 0.0),
    Step(3.8, "lift", 3, (0.22, 0.0), 2.0),
    Step(5.8, "hold", 3, (0.22, 0.0), 0.0),
    Step(9.0, "place", 3, (0.0, 0.0), 2.0),
    Step(11.3, "release", 1, (0.0, 0.0), 0.0),
    Step(12.3, "release", 1, (0.0, 0.10), 1.2),
    Step(13.8, "done", 1, (0.0, 0.10), 0.0),
)
"""Reach, close to level 3, lift to 0.22 m, hold, put down, let go."""

PLACE_COURSE = (
    *DEFAULT_COURSE[:5],
    Step(7.0, "carry", 3, (0.22, AWAY_M), 1.5),
    Step(9.0, "place", 3, (0.0, AWAY_M), 2.0),
    Step(11.3, "release", 1, (0.0, AWAY_M), 0.0),
    Step(12.3, "release", 1, (0.0, FARTHEST_M), 1.2),
    Step(13.8, "done", 1, (0.0, FARTHEST_M), 0.0),
)
"""The same, but carried to the second marked place before it is put down."""

COURSES: Final[dict[str, Sequence[Step]]] = {
    "lift": DEFAULT_COURSE,
    "place": PLACE_COURSE,
    "fill": (
        *DEFAULT_COURSE[:5],
        # Held for 3.2 s by default.
        *(step._replace(t_s=step.t_s + HOLD_S - 3.2) for step in DEFAULT_COURSE[5:]),
    ),
}
"""Course of each task; the hold of ``fill`` lasts as long as a simulated person's."""


class ScriptedOperator:
    """Follows a fixed course of level and forearm movement, without error, noise or perception.

    Args:
        course: The steps, in order of time; the first begins at 0.
        full_effort: Excitation at which a channel's mean is Emax.

    Raises:
        InvalidValueError: There is no step, the first does not begin at 0, times do not rise, or a level is not
            within 1 to 5.

    Example:
        >>> from tega_sim.operator import ScriptedOperator
        >>> ScriptedOperator(full_effort=0.7).at(2.0).phase
        'grasp'
    """

    def __init__(
        self,
        course: Sequence[Step] = DEFAULT_COURSE,
        *,
        full_effort: float = 0.7,
    ) -> None:
        if not course or course[0].t_s != 0 or any(a.t_s >= b.t_s for a, b in itertools.pairwise(course)):
            raise InvalidValueError("a script needs steps whose times rise from 0 s")
        for step in course:
            if not 1 <= step.level <= 5:
                raise InvalidValueError(f"level = {step.level} at {step.t_s} s is not within 1 to 5")
        self._course, self._full = tuple(course), full_effort
        self._motor = typical_person().motor
        self.begin()

    def begin(self, name: str = "", *, width_m: float = 0.0, trial: int = 0, rest_s: float = 0.0) -> None:
        """Start over; the arguments are those of :meth:`tega_sim.operator.Operator.begin` and change nothing."""
        del name, width_m, trial, rest_s
        self._forearm, self._next = SimulatedForearm((0.0, _FARTHEST_M)), 0

    def act(self, percept: Percept) -> Act:
        """Return the script's act for the percept's time; time must not go back."""
        return self.at(percept.t_s)

    def at(self, t_s: float) -> Act:
        """Return the script's act for a time; times must be asked for in order."""
        while self._next < len(self._course) and self._course[self._next].t_s <= t_s:
            step = self._course[self._next]
            self._forearm.step(step.t_s)
            self._forearm.move(step.forearm_m, step.t_s, step.move_s)
            self._next += 1
        step = self._course[max(self._next - 1, 0)]
        low = int(step.level)
        effort = level_effort(self._motor, low)
        if step.level > low:
            effort += (level_effort(self._motor, low + 1) - effort) * (step.level - low)
        return Act(min(self._full * effort, 1.15), self._forearm.step(t_s), step.phase)


KEYS_HELP = (
    "1 to 5: close to that level · space: let go · up, down: lift, lower · right, left: nearer, away · q: end"
)
"""The keys, in one line."""

_STEP_M = 0.02
_SPEED_M_S = 0.15
_HIGHEST_M = 0.30
_FARTHEST_M = 0.10


class KeyboardOperator:
    """Turns keys into acts; the excitation rises and falls as a typical person's does, without error or noise.

    Args:
        keys: Returns the keys pressed since it was last called, such as :meth:`tega.runtime.keys.Keys.read`.
        full_effort: Excitation at which a channel's mean is Emax.

    Example:
        >>> from tega_sim.operator import KeyboardOperator
        >>> KeyboardOperator(lambda: ["3"]).level
        1
    """

    def __init__(self, keys: Callable[[], Sequence[str]], *, full_effort: float = 0.7) -> None:
        self._keys, self._full, self._p = keys, full_effort, typical_person().motor
        self.begin()

    def begin(self, name: str = "", *, width_m: float = 0.0, trial: int = 0, rest_s: float = 0.0) -> None:
        """Start over; the arguments are those of :meth:`tega_sim.operator.Operator.begin` and change nothing."""
        del name, width_m, trial, rest_s
        self.level = 1
        self._ended = self._held = False
        self._wanted_m = self._at_m = (0.0, _FARTHEST_M)
        self._first = self._shaped = self._full * level_effort(self._p, 1)
        self._last_s = 0.0

    def act(self, percept: Percept) -> Act:
        """Return the act that the keys ask for now."""
        for key in self._keys():
            self._press(key)
        dt_s = max(percept.t_s - self._last_s, 0.0)
        self._last_s = percept.t_s
        target = self._full * level_effort(self._p, self.level)
        keep = math.exp(-dt_s * 1e3 / self._p.lag_ms)
        self._first = target + (self._first - target) * keep
        self._shaped = self._first + (self._shaped - self._first) * keep
        most_m = _SPEED_M_S * dt_s
        height, back = (
            at + min(max(wanted - at, -most_m), most_m)
            for wanted, at in zip(self._wanted_m, self._at_m, strict=True)
        )
        self._at_m = (height, back)
        return Act(min(self._shaped, 1.15), self._at_m, self._phase())

    def _press(self, key: str) -> None:
        height, back = self._wanted_m
        if key in {"1", "2", "3", "4", "5"}:
            self.level = int(key)
        elif key == " ":
            self.level = 1
        elif key in {"up", "down"}:
            height += _STEP_M if key == "up" else -_STEP_M
        elif key in {"right", "left"}:
            back += _STEP_M if key == "left" else -_STEP_M
        elif key in {"q", "Q"}:
            self._ended = True
        self._held = self._held or self.level > 1
        self._wanted_m = (min(max(height, 0.0), _HIGHEST_M), min(max(back, 0.0), _FARTHEST_M))

    def _phase(self) -> str:
        (height, back), (wanted, _) = self._at_m, self._wanted_m
        if self._ended:
            return "done"
        if self.level == 1:
            return "release" if self._held else "reach"
        if wanted > height:
            return "lift"
        if wanted < height:
            return "place"
        if height > 0:
            return "hold"
        return "reach" if back > 0 else "grasp"
