"""Simulate a person at the Fitts test: sees the cursor late, aims with an error, corrects, through the real decoder.

The muscles, the eye's delays and the errors are those of :mod:`tega_sim.operator`; nothing is tuned to a result. The
model of the person:

- A new target is answered after reaction time and choice. The person knows from practice which closure an effort gives
  (:func:`practised`), and aims at the effort that gives the target's centre. The error is a share of the change.
- The cursor is seen ``rt_ms`` late. When it had time to settle (as long as practice has shown, and a refractory time)
  and stands more than a quarter of the target's width from the centre, the effort is corrected by the difference,
  through the practised relation, repeatedly.

Effects of :data:`tega_sim.operator.EFFECTS` come after calibration and practice, so the person learns them from the
cursor alone. Everything is simulated, and says so wherever it is shown.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from typing import TYPE_CHECKING, Any, Final, Literal, NamedTuple

import numpy as np

from tega.errors import CalibrationError
from tega.setup.calibration.practice import Curve
from tega.stages.base import MuscleSetup
from tega.stages.learned.compare import LEARNED
from tega.stages.learned.training import fit
from tega.stages.registry import stage_class
from tega_practice.fitts import FittsScore, fitts_score
from tega_practice.fitts_course import FittsCourse, fitts_plan
from tega_practice.live import cursor_of
from tega_sim.operator import TICK_HZ, ForearmEmg, PersonNumbers, calibrate
from tega_sim.operator.motor import MuscleMotor
from tega_sim.operator.person import stream

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tega_practice.fitts_course import Target
    from tega_sim.operator import Calibrated

__all__ = ["Practised", "SimulatedAim", "practised", "simulated_decoder", "simulated_fitts"]

_RATE_HZ: Final = 1000.0
_TAU: Final = 100
_TICKS: Final = 10
"""Acts in a block of 100 ms: the cursor moves once a block."""
_TRACK_S: Final = 60.0
_STAIR: Final = tuple(np.linspace(0.0, 1.1, 23).tolist())
_STAIR_S: Final = 2.0
_MARGIN: Final = 0.05
_STEPS: Final = 4
_STEP: Final = 0.75
_SETTLED: Final = 0.15
_NEAR: Final = 0.25
_CHANNELS: Final = ("ecr", "fcu", "fds")

Cursor = Callable[["NDArray[np.float64]"], tuple[float, float]]
"""Takes a block's samples; returns the cursor's closure and its step."""


class Practised(NamedTuple):
    """Learned map from effort to closure, and how long the cursor takes to get there.

    Attributes:
        effort: Shares of the effort at Emax, rising.
        closure: What each gives, rising.
        settle_s: How long the cursor takes to get there.
    """

    effort: NDArray[np.float64]
    closure: NDArray[np.float64]
    settle_s: float

    def effort_for(self, closure: float) -> float:
        """Return the effort that gives a closure: where a level is held over a range of efforts, its middle."""
        around = np.interp([closure - _MARGIN, closure + _MARGIN], self.closure, self.effort)
        return float(around.mean())


def simulated_decoder(name: str, person: PersonNumbers, seed: int) -> tuple[Callable[[], Cursor], float]:
    """Calibrate a decoder on a simulated person, by the code that does it for people.

    Args:
        name: ``rules-paper``, ``rules``, one of :data:`tega.stages.learned.compare.LEARNED`, or an installed decoder's.
        person: The simulated person.
        seed: Seed of all random draws.

    Returns:
        What makes the decoder, at its start; and the excitation of full effort.

    Raises:
        CalibrationError: A model cannot be fitted to the person's tracking.
        ConfigError: There is no such decoder.
    """
    preset: Literal["paper", "live"] = "paper" if name == "rules-paper" else "live"
    calibrated = calibrate(person, seed=seed, rate_hz=_RATE_HZ, preset=preset)
    if name in LEARNED:
        emg, closure = _tracked(person, seed, calibrated)
        model = fit(emg, closure, rate_hz=_RATE_HZ, tau=_TAU, model=LEARNED[name], full=1.0)

        def learned() -> Cursor:
            decoder = type(model)(model.model)
            return lambda samples: cursor_of(1, float(decoder.process(samples)[-1]))

        return learned, calibrated.full_effort
    kind: Any = stage_class("decoder", "rules" if name == "rules-paper" else name)
    maxima = tuple(calibrated.maxima.tolist())
    setup = MuscleSetup("raw", _RATE_HZ, _TAU, _CHANNELS, maxima, preset)

    def made() -> Cursor:
        stage = kind(setup, kind.options_type())
        count = 0

        def take(samples: NDArray[np.float64]) -> tuple[float, float]:
            nonlocal count
            numbers = count + np.arange(1, len(samples) + 1)
            count += len(samples)
            intents = stage.decode(samples, np.rint(numbers * (1e9 / _RATE_HZ)).astype(np.int64))
            if not intents:
                raise CalibrationError(f"decoder {name!r} says nothing for a block of {_TAU} samples")
            return cursor_of(intents[-1].level, intents[-1].closure)

        return take

    return made, calibrated.full_effort


def _tracked(
    person: PersonNumbers, seed: int, calibrated: Calibrated
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Follow the curve of a practice as people do, late and with errors; return EMG and the closure asked for."""
    curve = Curve(_TRACK_S, seed=seed)
    muscles = _Muscles(person, seed, "track", calibrated.full_effort)
    late_s = (person.vision.rt_ms + person.vision.choice_ms) / 1e3
    again_s, seen = 0.0, 1.0
    parts = []
    for block in range(round(_TRACK_S * _RATE_HZ / _TAU)):
        t_s = block * _TAU / _RATE_HZ
        if t_s >= again_s and (now := curve.at(max(0.0, t_s - late_s))) != seen:
            seen, again_s = now, t_s + person.grip.refractory_ms / 1e3
            muscles.motor.correct((now - 1) / 4)
        parts.append(muscles.block())
    asked = np.array([(curve.at(n / _RATE_HZ) - 1) / 4 for n in range(round(_TRACK_S * _RATE_HZ))])
    return np.concatenate(parts), asked


class _Muscles:
    """Motor and EMG of a person, tick by tick."""

    def __init__(
        self,
        person: PersonNumbers,
        seed: int,
        label: str,
        full_effort: float,
        effects: Collection[str] | None = None,
    ) -> None:
        self.motor = MuscleMotor(
            person.motor,
            full_effort=full_effort,
            aim=stream(seed, "skill", label, "aim"),
            sense=stream(seed, "skill", label, "effort sense"),
        )
        self._emg = ForearmEmg(
            person,
            seed=seed,
            label=label,
            rate_hz=_RATE_HZ,
            settled=effects
            is None,  # practice follows the calibration at once; a test comes later in the session
            effects=effects or (),
        )
        self._ticks = 0

    def block(self) -> NDArray[np.float64]:
        """Return the samples of the next 100 ms."""
        excitations = []
        for _ in range(_TICKS):
            self._ticks += 1
            excitations.append(self.motor.step(self._ticks / TICK_HZ, 1 / TICK_HZ))
        return self._emg.course(excitations)


def practised(person: PersonNumbers, seed: int, make: Callable[[], Cursor], full_effort: float) -> Practised:
    """Let a person learn what efforts do: a staircase of held efforts, and a step to see how long the cursor takes."""
    muscles = _Muscles(person, seed, "practice", full_effort)
    cursor = make()
    n = round(_STAIR_S * _RATE_HZ / _TAU)

    def hold(effort: float) -> NDArray[np.float64]:
        muscles.motor.correct(effort)
        return np.array([cursor(muscles.block())[0] for _ in range(n)])

    means = [hold(effort)[n // 2 :].mean() for effort in _STAIR]
    # Strictly rising, so that each closure has one effort.
    closure = np.maximum.accumulate(means) + 1e-6 * np.arange(len(means))
    settle = []
    for _ in range(_STEPS):
        rest, up = hold(0.0), hold(_STEP)
        near = _SETTLED * abs(up[n // 2 :].mean() - rest[n // 2 :].mean())
        settle.append(int(np.argmax(np.abs(up - up[n // 2 :].mean()) <= near)) + 1)
    return Practised(np.array(_STAIR), closure, float(np.mean(settle)) * _TAU / _RATE_HZ)


class SimulatedAim:
    """Eye and hand of a person at the test.

    Args:
        person: The simulated person.
        seed: Seed of the reaction times.
        label: Which stretch of the session.
        known: What practice has taught.
    """

    def __init__(self, person: PersonNumbers, seed: int, label: str, known: Practised) -> None:
        self._p, self._known = person, known
        self._reaction = stream(seed, "skill", label, "reaction")
        self._target: Target | None = None
        self._act_s = 0.0
        self._fresh = False
        self._effort = 0.0
        self._seen: list[tuple[float, float]] = []

    def look(self, t_s: float, target: Target, closure: float) -> float | None:
        """See target and cursor; return the effort to aim at now, or ``None`` to go on as before."""
        vision = self._p.vision
        self._seen.append((t_s, closure))
        if target != self._target:
            self._target, self._fresh = target, True
            late_ms = vision.rt_ms + vision.rt_sigma_ms * float(self._reaction.standard_normal())
            late_ms += vision.rt_tau_ms * float(self._reaction.exponential()) - vision.rt_tau_ms
            self._act_s = t_s + (max(late_ms, vision.rt_floor_ms) + vision.choice_ms) / 1e3
        if t_s < self._act_s:
            return None
        if self._fresh:
            self._fresh = False
            # From where the cursor stands, the change that practice says: what has shifted since is so carried along.
            wanted = self._known.effort_for(target.centre) - self._known.effort_for(self._late(t_s))
        else:
            off = target.centre - self._late(t_s)
            if abs(off) <= _NEAR * target.width:
                return None
            wanted = self._known.effort_for(target.centre) - self._known.effort_for(target.centre - off)
        self._act_s = t_s + max(self._known.settle_s, self._p.grip.refractory_ms / 1e3) + vision.rt_ms / 1e3
        self._effort = min(max(self._effort + wanted, 0.0), 1.3)
        return self._effort

    def _late(self, t_s: float) -> float:
        """Mean of the cursor over the last look that has come through."""
        vision = self._p.vision
        last_s = t_s - vision.rt_ms / 1e3
        first_s = last_s - vision.look_s
        self._seen = [one for one in self._seen if one[0] >= first_s - 1.0]
        some = [c for t, c in self._seen if first_s <= t <= last_s]
        return float(np.mean(some)) if some else self._seen[0][1]


def simulated_fitts(  # noqa: PLR0917  # one argument a part of the test
    person: PersonNumbers,
    seed: int,
    make: Callable[[], Cursor],
    full_effort: float,
    known: Practised,
    effects: Collection[str] = (),
    *,
    movements: int = 6,
    dwell_s: float = 1.0,
    timeout_s: float = 10.0,
) -> FittsScore:
    """Let a simulated person do the test.

    Args:
        person: The simulated person.
        seed: Seed of all random draws; the targets' order is the same for every decoder and effect.
        make: Makes the decoder.
        full_effort: Excitation of full effort.
        known: What practice has taught of it.
        effects: What has changed since, names of :data:`tega_sim.operator.EFFECTS`.
        movements: That count, of each distance and width.
        dwell_s: So long the cursor has to stay in a target.
        timeout_s: After so long the next target comes anyway.

    Raises:
        InvalidValueError: There is no such effect, or no movement counts.
    """
    course = FittsCourse(fitts_plan(seed, movements=movements), dwell_s=dwell_s, timeout_s=timeout_s)
    muscles = _Muscles(person, seed, "test", full_effort, effects)
    aim, cursor = SimulatedAim(person, seed, "test", known), make()
    block, step = 0, 0.01
    while (target := course.target) is not None:
        closure, step = cursor(muscles.block())
        block += 1
        t_s = block * _TAU / _RATE_HZ
        course.take(t_s, closure)
        effort = aim.look(t_s, target, closure)
        if effort is not None:
            muscles.motor.correct(effort)
    return fitts_score(course.movements, cursor_step=step)
