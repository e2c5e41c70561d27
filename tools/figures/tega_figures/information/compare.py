"""Let simulated people and the reasoning agent grasp under each arm, and compare each with being told nothing."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from tega.haptics import MotorLevels
from tega_figures.information.agent import IdealAgent, Told
from tega_figures.information.plant import graded_frame, grasp, plant_objects, told_frame
from tega_sim.operator import Operator, PersonNumbers, Rules, RulesVersion, clear_skin, draw_person, sham_vest
from tega_sim.operator.person import stream

Arm = Literal["off", "vest", "truth", "constant", "unrelated", "inverted", "replayed", "permuted"]
ARMS: tuple[Arm, ...] = get_args(Arm)
OUTCOMES = ("slips", "harm", "effort", "cost")
"""Slips a trial; share of trials with deformation; mean closure held, share of full; their sum as the person weighs."""

N_OBJECTS, N_TRIALS = 2, 4
MARGIN: dict[str, float] = {"slips": 0.1, "harm": 0.05, "effort": 0.02, "cost": 0.1}
"""A sham is null where the 95 % interval of its difference lies within this; the truth must not cost more than this."""

_Vest = Callable[[float, MotorLevels], MotorLevels | None]


class Paired(NamedTuple):
    """Difference of an arm from being told nothing, over people, with its interval."""

    mean: float
    low: float
    high: float


def person_outcomes(
    arm: Arm,
    seeds: Sequence[int],
    *,
    version: RulesVersion,
    n_trials: int = N_TRIALS,
    giving: bool = False,
) -> NDArray[np.float64]:
    """Return the mean outcomes of each person under an arm.

    Args:
        arm: ``off``: no vest. ``vest``: tells the grip by the real vest's law, felt through the person's skin.
            ``truth``: tells the closure in equal steps, through a skin that misses nothing. The others are shams of
            :func:`tega_sim.operator.sham_vest`; ``replayed`` is the vest of the same person's trial with the other
            object.
        seeds: Who.
        version: Of the rules.
        n_trials: With each object.
        giving: Whether walls give before they are harmed.

    Returns:
        float64 (n people, 4), in the order of :data:`OUTCOMES`.
    """
    rows = []
    for seed in seeds:
        drawn = draw_person(seed)
        person = clear_skin(drawn) if arm == "truth" else drawn
        recorded = _recorded(seed, version, n_trials, giving=giving) if arm == "replayed" else []
        operator = Operator(person, seed=seed, rules=Rules(version=version))
        told = graded_frame if arm == "truth" else told_frame
        trials = []
        items = plant_objects(stream(seed, "plant objects"), N_OBJECTS, giving=giving)
        for number in range(N_OBJECTS * n_trials):
            which = number % N_OBJECTS
            worn = _worn(arm, seed, number, recorded)
            if number < N_OBJECTS and worn is not None:
                operator.practise(str(which), _shown(worn, told))
                worn = _worn(arm, seed, number, recorded)
            trials.append(
                grasp(
                    operator, worn, item=items[which], trial=number // N_OBJECTS, name=str(which), told=told
                )
            )
        rows.append(_row(drawn, [(o.slips, o.deformed, o.effort) for o in trials]))
    return np.array(rows)


def agent_outcomes(told: Told, seeds: Sequence[int], *, n_trials: int = N_TRIALS) -> NDArray[np.float64]:
    """Return the mean outcomes of the reasoning agent in each person's body; as :func:`person_outcomes`."""
    rows = []
    for seed in seeds:
        person = draw_person(seed)
        agent = IdealAgent(person, seed=seed, told=told)
        items = plant_objects(stream(seed, "plant objects"), N_OBJECTS)
        vest = sham_vest("informative") if told == "vest" else None
        trials = [
            grasp(agent, vest, item=items[n % N_OBJECTS], trial=n // N_OBJECTS, name=str(n % N_OBJECTS))
            for n in range(N_OBJECTS * n_trials)
        ]
        rows.append(_row(person, [(o.slips, o.deformed, o.effort) for o in trials]))
    return np.array(rows)


def paired(
    arm: NDArray[np.float64],
    off: NDArray[np.float64],
    *,
    names: Sequence[str] = OUTCOMES,
    confidence: float = 0.95,
) -> dict[str, Paired]:
    """Return the mean difference of each outcome over people, with the interval of Student's t.

    Args:
        arm: Outcomes under it, a row a person.
        off: The same people's without it.
        names: Of the outcomes, in their order.
        confidence: Of the intervals, which are infinite with one person.
    """
    from scipy.stats import t as student

    difference = arm - off
    n = len(difference)
    half = np.full(len(names), np.inf)
    if n > 1:
        half = float(student.ppf(0.5 + confidence / 2, n - 1)) * difference.std(axis=0, ddof=1) / math.sqrt(n)
    mean = difference.mean(axis=0)
    return {
        name: Paired(float(mean[k]), float(mean[k] - half[k]), float(mean[k] + half[k]))
        for k, name in enumerate(names)
    }


def power_text(
    rows: Mapping[str, tuple[NDArray[np.float64], NDArray[np.float64]]],
    names: Sequence[str],
    *,
    confidence: float = 0.95,
    share: float = 0.8,
) -> str:
    """Return what paired comparisons could have seen, as Markdown: a normal approximation.

    Args:
        rows: By arm: its outcomes and the same people's without it, a row a person.
        names: Of the outcomes.
        confidence: Of one test.
        share: Of studies that are to find an effect; the least effect that these people show so often is
            (z(confidence) + z(share)) s / √n with s the deviation of differences between people, and the number of
            people that a difference asks for the n at which that is the difference.
    """
    from scipy.stats import norm

    z = float(norm.ppf(0.5 + confidence / 2) + norm.ppf(share))
    lines = [
        "| arm | outcome | people | found | least effect that would have been seen | people for what was found |"
    ]
    lines.append("|---" * 6 + "|")
    for arm, (told, off) in rows.items():
        difference = told - off
        n = len(difference)
        for name, mean, s in zip(names, difference.mean(axis=0), difference.std(axis=0, ddof=1), strict=True):
            needed = "–" if abs(mean) < 5e-4 else f"{max(math.ceil((z * s / mean) ** 2), 2):,}"
            lines.append(f"| {arm} | {name} | {n} | {mean:+.3f} | {z * s / math.sqrt(n):.3f} | {needed} |")
    return "\n".join(lines)


def null(found: dict[str, Paired], margin: dict[str, float] = MARGIN) -> bool:
    """Whether every outcome's interval lies within its margin."""
    return all(-margin[name] <= one.low and one.high <= margin[name] for name, one in found.items())


def _shown(worn: _Vest, told: Callable[[float], MotorLevels]) -> Callable[[float, float], MotorLevels | None]:
    """Return what the vest shows in practice, by time and closure."""
    return lambda t_s, closure: worn(t_s, told(closure))


def _row(person: PersonNumbers, trials: list[tuple[int, bool, float]]) -> list[float]:
    slips, harm, effort = np.mean(trials, axis=0).tolist()
    return [
        slips,
        harm,
        effort,
        slips + person.grip.harm_cost * harm + person.grip.effort_cost * effort,
    ]


def _worn(arm: Arm, seed: int, number: int, recorded: list[list[tuple[float, MotorLevels]]]) -> _Vest | None:
    if arm == "off":
        return None
    if arm in {"vest", "truth"}:
        return sham_vest("informative")
    if arm == "replayed":
        return sham_vest("replayed", recorded=recorded[(number + 1) % len(recorded)])
    return sham_vest(arm, seed=seed * 1000 + number)  # type: ignore[arg-type]


def _recorded(
    seed: int, version: RulesVersion, n_trials: int, *, giving: bool
) -> list[list[tuple[float, MotorLevels]]]:
    """Return what the vest showed in each of the person's trials with the vest on."""
    operator = Operator(draw_person(seed), seed=seed, rules=Rules(version=version))
    items = plant_objects(stream(seed, "plant objects"), N_OBJECTS, giving=giving)
    shown: list[list[tuple[float, MotorLevels]]] = []
    for number in range(N_OBJECTS * n_trials):
        which, frames = number % N_OBJECTS, list[tuple[float, MotorLevels]]()

        def keep(
            t_s: float, frame: MotorLevels, frames: list[tuple[float, MotorLevels]] = frames
        ) -> MotorLevels:
            frames.append((t_s, frame))
            return frame

        grasp(operator, keep, item=items[which], trial=number // N_OBJECTS, name=str(which))
        shown.append(frames)
    return shown
