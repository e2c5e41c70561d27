"""Prove the scores of a task of two places on rendered video: reach, lift, carry, put down at a second mark.

``python -m tega_figures.scene.places OUT.jsonl`` goes through the design below, as
:mod:`tega_figures.scene.prove` does through its own, and adds a line a trial; one that is there is passed over. Films
and tags are kept beside it. A number after ``OUT.jsonl`` is the seed of the people, 40 unless given.
``python -m tega_figures.scene.places OUT.jsonl table`` prints the page's table instead, and with a file of
:mod:`tega_figures.scene.prove` behind it the F1 of both together.

The film goes on until the person is done, or what was dropped has fallen. The truth is the camera's own rule, told the
true poses; what the simulation says of its trial stands beside it.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

import msgspec
import numpy as np

from tega.stages.events.outcomes import STABLE_S
from tega_figures.scene.accuracy import f1, interval, matched
from tega_figures.scene.prove import (
    TOLERANCE_S,
    ProvenTrial,
    calibrated,
    filmed,
    place_off_mm,
    split_off,
    true_events,
    true_rule,
    window,
)
from tega_figures.scene.trials import TrueTrial, true_trial
from tega_scene.lens import Lens
from tega_scene.outcomes import SceneEvent, SceneRule, righted, score_scene
from tega_scene.resting import LOST_M
from tega_sim.operator.forearm import AWAY_M
from tega_sim.plan import TrialPlan
from tega_sim.score import ON_MARK_M, REST_M_S, UPRIGHT
from tega_sim.trial import run_trial
from tega_sim.world.world import World

if TYPE_CHECKING:
    from numpy.typing import NDArray

_RATE_HZ: Final = 30.0
_STAGES: Final = {
    "reach": ("reach", "grasp"),
    "lift": ("lift", "hold"),
    "carry": ("carry",),
    "put down": ("place", "release", "done"),
}
"""What a stage of the task is in the person's phases."""

_AFTER_LIFT_S, _AFTER_PUT_S = 0.8, 0.5


class PlacedTrial(msgspec.Struct, frozen=True, kw_only=True):
    """One film of a task of two places.

    Attributes:
        name: Object, condition, seed.
        film: Which: ``bright``, ``dim`` or ``rolling``.
        occluded: Whether something passed before the object's box, aloft and again once it stood.
        n_pictures: How many were looked at.
        sure: Share of them that place the object.
        stage_mm: Error of the object's place, root mean square, by the stage of the task: in space, along the view,
            across it. A stage that did not come is not there.
        true_mm: Where its grip point truly ended over the table, x and y from the first mark.
        at_mm: Where the camera has it; ``None`` where it was not put down.
        claimed_mm: Standard errors of that.
        true_off_mm: How far it truly is from the second mark.
        off_mm: By the camera.
        claimed_off_mm: Standard error of that.
        verdicts: Whether it is placed: by the camera's rule told the true poses, by the camera, by the simulation.
        true: Events of the truth.
        measured: Events of the camera.
        notes: What the camera says to look at.
    """

    name: str
    film: str
    occluded: bool
    n_pictures: int
    sure: float
    stage_mm: dict[str, tuple[float, float, float]]
    true_mm: tuple[float, float]
    at_mm: tuple[float, float] | None
    claimed_mm: tuple[float, float] | None
    true_off_mm: float
    off_mm: float | None
    claimed_off_mm: float | None
    verdicts: tuple[bool, bool, bool]
    true: tuple[SceneEvent, ...]
    measured: tuple[SceneEvent, ...]
    notes: tuple[str, ...]


def design(seed: int) -> list[tuple[TrialPlan, str, bool]]:
    """Return the trials: plan, film, whether something passes; each object by three people, with touch and without."""
    trials: list[tuple[TrialPlan, str, bool]] = []
    for person in range(3):
        for name in ("bottle", "container", "bag"):
            k = len(trials)
            plan = TrialPlan(
                object=name,
                condition="haptic" if k % 2 else "non-haptic",
                seed=seed + person,
                task="place",
            )
            trials.append((plan, ("bright", "dim", "bright", "rolling")[k % 4], k // 2 % 2 == 0))
    return trials


def true_place(trial: TrueTrial, rule: SceneRule, end_s: float) -> tuple[SceneEvent | None, bool]:
    """Return when an object had truly stood for a second where it stays, and whether it is placed by the rule.

    Args:
        trial: What happened.
        rule: The camera's rule, told the true poses.
        end_s: Until when it was filmed.
    """
    if rule.aloft or not rule.stands_s:
        return None, False
    now = trial.t_s <= end_s
    at_m = grip_m(trial)
    last = at_m[now][-1]
    moving = now & (np.hypot(*(at_m - last)[:, :2].T) > REST_M_S * STABLE_S)
    since_s = max(rule.stands_s[-1], float(trial.t_s[np.flatnonzero(moving)[-1]]))
    between = trial.palm[:, :, 3] - at_m
    stood = int(np.searchsorted(trial.t_s, rule.stands_s[-1]))
    let_go = float(np.linalg.norm(between[now][-1] - between[stood])) > LOST_M
    off_m = float(np.hypot(*(last[:2] - mark_m(trial))))
    stands = off_m <= ON_MARK_M and float(trial.object[now][-1, 2, 2]) > UPRIGHT and let_go
    placed = stands and end_s - since_s >= STABLE_S and rule.scorer.time_of("drop") is None
    return SceneEvent("placed", since_s + STABLE_S, 0.0, off_m), placed


def grip_m(trial: TrueTrial) -> NDArray[np.float64]:
    """Return where the object's grip point truly is, float64 (n, 3)."""
    return np.asarray(trial.object[:, :, 3] + trial.object[:, :, 2] * trial.spec.height_m / 2)


def mark_m(trial: TrueTrial) -> tuple[float, float]:
    """Return the second mark, x and y from the first one."""
    x, y, _ = World(trial.spec, seed=0).mark_m(AWAY_M).tolist()
    return x, y


def prove_place(
    plan: TrialPlan, lens: Lens, kept: Path, *, film: str, occluded: bool, number: int
) -> PlacedTrial:
    """Simulate, render, encode, decode, track and score one trial, and compare; film and tags are read where kept."""
    trial = true_trial(plan)
    begin_s, end_s = window(trial, placed=True)[0], float(trial.t_s[-1]) - 0.05
    rule = true_rule(trial, begin_s, end_s)
    passes_s: list[float] = []
    lift_s = rule.scorer.time_of("lift_off")
    if occluded and lift_s is not None:
        passes_s = [lift_s + _AFTER_LIFT_S, *(stood_s + _AFTER_PUT_S for stood_s in rule.stands_s[-1:])]
    track, layout, sunk_mm = filmed(
        trial, lens, kept, (begin_s, end_s), passes_s, rate_hz=_RATE_HZ, film=film, number=number
    )
    mark = mark_m(trial)
    outcome = score_scene(track, layout, harm_m=trial.spec.harm_m, mark_m=mark)
    left = place_off_mm(
        trial,
        righted(track, layout, begin_s=float(track.t_s[0])),
        "object",
        np.array([0, 0, layout.object.grip_mm / 1000]),
        sunk_mm,
    )
    phases = np.array(trial.phases)[np.clip(np.searchsorted(trial.t_s, track.t_s), 0, len(trial.phases) - 1)]
    stages = {name: left[np.isin(phases, wanted)] for name, wanted in _STAGES.items()}
    true = true_events(rule)
    stands, placed = true_place(trial, rule, end_s)
    last = grip_m(trial)[trial.t_s <= end_s][-1]
    off_m = math.hypot(*(last[:2] - mark))
    lifted_s, dropped = rule.scorer.time_of("lifted"), rule.scorer.time_of("drop") is not None
    if lifted_s is not None and rule.stands_s and rule.stands_s[-1] > lifted_s and not dropped:
        true.append(SceneEvent("put_down", rule.stands_s[-1], 0.0, off_m))
    if placed and stands is not None:
        true.append(stands)
    rest = outcome.rest
    return PlacedTrial(
        name=f"{plan.object} {plan.condition} {plan.seed}",
        film=film,
        occluded=occluded,
        n_pictures=len(track.t_s),
        sure=outcome.placed,
        stage_mm={name: split_off(one) for name, one in stages.items() if np.isfinite(one).any()},
        true_mm=(float(1000 * last[0]), float(1000 * last[1])),
        at_mm=None if rest is None else rest.at_mm,
        claimed_mm=None if rest is None else rest.error_mm,
        true_off_mm=1000 * off_m,
        off_mm=None if outcome.off_mark_m is None else 1000 * outcome.off_mark_m,
        claimed_off_mm=None if outcome.off_mark_error_m is None else 1000 * outcome.off_mark_error_m,
        verdicts=(placed, bool(outcome.on_mark), bool(run_trial(plan).placed)),
        true=tuple(sorted(true, key=lambda one: one.t_s)),
        measured=outcome.events,
        notes=outcome.notes,
    )


def table(trials: list[PlacedTrial]) -> str:
    """Return the page's table as Markdown, and what follows from it."""
    lines = [
        "| trial | film | hidden | place, mm: reach | lift | carry | put down | truly from the mark, mm | measured "
        "| claimed error | off, mm | placed: truth, camera, simulation | events |",
        "|" + "---|" * 13,
    ]
    for one in trials:
        stages = " | ".join(
            f"{one.stage_mm[stage][0]:.2f}" if stage in one.stage_mm else "" for stage in _STAGES
        )
        pairs = matched(one.true, one.measured)
        hits = sum(a is not None and b is not None for a, b in pairs)
        said = ", ".join("yes" if verdict else "no" for verdict in one.verdicts)
        measured = " | | "
        if one.at_mm is not None and one.off_mm is not None and one.claimed_off_mm is not None:
            measured = f"{one.off_mm:.2f} | {one.claimed_off_mm:.2f} | {_way_mm(one):.2f} "
        lines.append(
            f"| {one.name} | {one.film} | {'yes' if one.occluded else ''} | {stages} | {one.true_off_mm:.2f} "
            f"| {measured}| {said} | {hits} of {len(pairs)} |"
        )
    seen = [one for one in trials if one.at_mm is not None and one.off_mm is not None]
    ways = np.array([_way_mm(one) for one in seen])
    offs = np.array([(one.off_mm or 0) - one.true_off_mm for one in seen])
    claims = np.array([one.claimed_off_mm or np.nan for one in seen])
    every = [pair for one in trials for pair in matched(one.true, one.measured)]
    found = [(a, b) for a, b in every if a is not None and b is not None]
    late_ms = 1000 * np.abs([b.t_s - a.t_s for a, b in found])
    lines += [
        "",
        f"{len(trials)} trials, {sum(one.n_pictures for one in trials)} pictures; put where: "
        f"{np.sqrt(np.mean(ways**2)):.2f} mm over all, {ways.max():.2f} in the worst; distance from the mark: "
        f"{np.sqrt(np.mean(offs**2)):.2f} mm, {np.abs(offs).max():.2f} in the worst, "
        f"{np.sqrt(np.mean((offs / claims) ** 2)):.2f} of the claimed error",
        f"events within {1000 * TOLERANCE_S:.0f} ms: F1 {f1(every):.3f}, {len(found)} of "
        f"{sum(a is not None for a, _ in every)}; {late_ms.mean():.0f} ms off in the mean, {late_ms.max():.0f} at most",
        *(f"unmatched: true {a}, measured {b}" for a, b in every if a is None or b is None),
        *(f"{one.name}: {note}" for one in trials for note in one.notes),
    ]
    return "\n".join(lines) + "\n"


def together(trials: Sequence[PlacedTrial | ProvenTrial]) -> str:
    """Return F1 of all events of several trials, with its interval."""
    by_trial = [matched(one.true, one.measured) for one in trials]
    pairs = [pair for some in by_trial for pair in some]
    found = [(a, b) for a, b in pairs if a is not None and b is not None]
    late_ms = 1000 * np.abs([b.t_s - a.t_s for a, b in found])
    low, high = interval(by_trial)
    return (
        f"{len(trials)} trials, {sum(one.n_pictures for one in trials)} pictures: F1 {f1(pairs):.3f} ({low:.3f} to "
        f"{high:.3f}), {len(found)} of {sum(a is not None for a, _ in pairs)} true events, "
        f"{sum(a is None for a, _ in pairs)} more; "
        f"{late_ms.mean():.0f} ms off in the mean, {late_ms.max():.0f} at most\n"
    )


def _way_mm(one: PlacedTrial) -> float:
    """Return how far the measured place is from the true one."""
    assert one.at_mm is not None
    return math.dist(one.at_mm, one.true_mm)


def main() -> None:
    """Go through the design; what is in the file already is passed over."""
    out, what = Path(sys.argv[1]), sys.argv[2] if len(sys.argv) > 2 else "40"
    lines = out.read_bytes().splitlines() if out.exists() else []
    kept = [msgspec.json.decode(line, type=PlacedTrial) for line in lines]
    if what == "table":
        sys.stdout.write(table(kept))
        if len(sys.argv) > 3:
            lines = Path(sys.argv[3]).read_bytes().splitlines()
            sys.stdout.write(
                together([*kept, *(msgspec.json.decode(line, type=ProvenTrial) for line in lines)])
            )
        return
    lens = calibrated(out.parent)
    for number, (plan, film, occluded) in enumerate(design(int(what))):
        if any(one.name == f"{plan.object} {plan.condition} {plan.seed}" for one in kept):
            continue
        file = out.with_name(f"place-{what}-{number}.npz")
        found = prove_place(
            plan, lens, file, film=film, occluded=occluded, number=4000 + 100 * int(what) + number
        )
        with out.open("ab") as opened:
            opened.write(msgspec.json.encode(found) + b"\n")


if __name__ == "__main__":
    main()
