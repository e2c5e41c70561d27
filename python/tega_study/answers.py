"""Correlate pose with touch over a study's trials, compare with nulls, and measure how poses were used."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from itertools import product

import msgspec
import numpy as np

from tega_learn.score import pearson
from tega_study.compare import SMALLEST_FOR_P
from tega_study.coupling import (
    GRID_HZ,
    TouchCourse,
    correlate,
    dwell,
    finite,
    fisher_mean,
    fisher_z,
    lag_sweep,
    on_grid,
    other_trials,
    response_slope,
    transitions,
)
from tega_study.people import sign_flip
from tega_study.trials import Trial

MOST_LAG_S = 1.0
SIGNALS = ("cci", "eda")


class TrialCoupling(msgspec.Struct, frozen=True, kw_only=True):
    """One trial's correlation of the pose with one signal.

    Attributes:
        n_eff: Independent samples that ``samples`` are worth.
        r: Pearson, lag 0; ``None`` where a series does not change. ``low`` to ``high`` is its 95 % interval.
        r_others: Mean with the touch of the person's other trials of this object and condition.
        p_others: Share of those pairings, and this one, that reach ``r``: one-sided, 1 / number at least.
        slope: Answer to touch, see :func:`tega_study.coupling.response_slope`.
    """

    trial: str
    participant: str
    object: str
    condition: str
    signal: str
    samples: int
    n_eff: float | None
    r: float | None
    low: float | None
    high: float | None
    r_others: float | None
    p_others: float | None
    slope: float | None


class ArmCoupling(msgspec.Struct, frozen=True, kw_only=True):
    """One condition's correlations of the pose with one signal.

    Attributes:
        r: Mean by Fisher's z over each person's trials, then over people.
        positive: Share of trials with r above 0.
        r_pooled: Over all samples of all trials in one; mixes differences between trials into it.
        r_others: As ``r``, with the touch of other trials: the part that the shared course alone explains.
        lags_s: Above 0 touch follows the pose.
        lag_r: Mean by Fisher's z over trials at each lag, highest at ``peak_lag_s``.
    """

    condition: str
    signal: str
    trials: int
    people: int
    r: float | None
    lowest: float | None
    positive: float
    r_pooled: float | None
    r_others: float | None
    slope: float | None
    lags_s: tuple[float, ...]
    lag_r: tuple[float | None, ...]
    peak_lag_s: float | None


class Contrast(msgspec.Struct, frozen=True, kw_only=True):
    """Mean over people of the first condition less the second.

    Attributes:
        what: ``r`` (in Fisher's z) or ``slope``.
        p: Sign-flip; ``None`` below six people.
    """

    signal: str
    what: str
    people: int
    difference: float
    p: float | None


class PoseUse(msgspec.Struct, frozen=True, kw_only=True):
    """Use of the poses with one object under one vest condition; means over the trials that have a course.

    Attributes:
        dwell: Share of time at each of the poses 0 to 4; ``intermediate`` at 1 to 3.
        transitions: Changes per trial; ``transitions_intermediate`` of these into or out of 1 to 3.
        silent: Share of the time with a closed hand after lift-off in which no finger is read as touching, so
            that the vest is still; ``None`` where nothing was lifted off.
    """

    object: str
    condition: str
    trials: int
    dwell: tuple[float, ...]
    intermediate: float
    transitions: float
    transitions_intermediate: float
    silent: float | None = None


def answers(
    trials: Sequence[Trial],
    courses: Mapping[str, TouchCourse],
    objects: Sequence[str],
    conditions: Sequence[str],
) -> tuple[list[TrialCoupling], list[ArmCoupling], list[Contrast], list[PoseUse]]:
    """Correlate pose with touch in all trials, compare the conditions, and measure the use of the poses.

    Trials that do not count or have no course (by trial id) are passed over. The results are by trial and
    signal, by condition and signal, first condition against second, and the use of the poses.
    """
    use = [trial for trial in trials if trial.counts and trial.id in courses]
    even = {trial.id: on_grid(courses[trial.id]) for trial in use}
    rows = [row for signal in SIGNALS for row in _by_trial(use, even, signal)]
    arms = [arm for one in product(SIGNALS, conditions) if (arm := _arm(rows, use, even, *one)) is not None]
    contrasts = [c for signal in SIGNALS for c in _contrasts(rows, signal, conditions)]
    return rows, arms, contrasts, _pose_use(use, even, objects, conditions)


def _by_trial(use: Sequence[Trial], even: Mapping[str, TouchCourse], signal: str) -> list[TrialCoupling]:
    groups: dict[tuple[str, str, str], list[Trial]] = {}
    for trial in use:
        groups.setdefault((trial.participant, trial.object, trial.condition), []).append(trial)
    rows = {}
    for group in groups.values():
        poses = [even[trial.id].pose for trial in group]
        touches = [getattr(even[trial.id], signal) for trial in group]
        for trial, pose, touch, others in zip(
            group, poses, touches, other_trials(poses, touches), strict=True
        ):
            found = correlate(pose, touch)
            null = [r for r in others if not math.isnan(r)]
            share = (1 + sum(r >= found.r for r in null)) / (1 + len(null))
            rows[trial.id] = TrialCoupling(
                trial=trial.id,
                participant=trial.participant,
                object=trial.object,
                condition=trial.condition,
                signal=signal,
                samples=found.n,
                n_eff=finite(found.n_eff),
                r=finite(found.r),
                low=finite(found.low),
                high=finite(found.high),
                r_others=finite(fisher_mean(null)),
                p_others=share if null and not math.isnan(found.r) else None,
                slope=finite(response_slope(pose, touch)),
            )
    return [rows[trial.id] for trial in use]


def _arm(
    rows: Sequence[TrialCoupling],
    use: Sequence[Trial],
    even: Mapping[str, TouchCourse],
    signal: str,
    condition: str,
) -> ArmCoupling | None:
    mine = [row for row in rows if (row.signal, row.condition) == (signal, condition) and row.r is not None]
    if not mine:
        return None
    pairs = [(even[t.id].pose, getattr(even[t.id], signal)) for t in use if t.condition == condition]
    most = round(MOST_LAG_S * GRID_HZ)
    sweeps = [[r for _, r in lag_sweep(pose, touch, most=most)] for pose, touch in pairs]
    curve = [finite(fisher_mean(rs)) for rs in zip(*sweeps, strict=True)]
    lags_s = tuple(lag / GRID_HZ for lag in range(-most, most + 1))
    known = [(r, lag_s) for r, lag_s in zip(curve, lags_s, strict=True) if r is not None]
    rs = [row.r for row in mine if row.r is not None]
    pooled = pearson(*(np.concatenate(one) for one in zip(*pairs, strict=True)))
    return ArmCoupling(
        condition=condition,
        signal=signal,
        trials=len(mine),
        people=len({row.participant for row in mine}),
        r=finite(fisher_mean(_by_person(mine, "r").values())),
        lowest=min(rs),
        positive=sum(r > 0 for r in rs) / len(rs),
        r_pooled=finite(pooled),
        r_others=finite(fisher_mean(_by_person(mine, "r_others").values())),
        slope=finite(_average(_by_person(mine, "slope").values())),
        lags_s=lags_s,
        lag_r=tuple(curve),
        peak_lag_s=max(known)[1] if known else None,
    )


def _by_person(rows: Sequence[TrialCoupling], subject: str) -> dict[str, float]:
    """Average over each person's trials: correlations by Fisher's z, slopes plainly."""
    values: dict[str, list[float]] = {}
    for row in rows:
        if (value := getattr(row, subject)) is not None:
            values.setdefault(row.participant, []).append(value)
    average = _average if subject == "slope" else fisher_mean
    return {person: average(some) for person, some in values.items()}


def _contrasts(rows: Sequence[TrialCoupling], signal: str, conditions: Sequence[str]) -> list[Contrast]:
    found = []
    for subject in ("r", "slope"):
        sides = [
            _by_person([row for row in rows if (row.signal, row.condition) == (signal, condition)], subject)
            for condition in conditions[:2]
        ]
        both = [person for person in sides[0] if person in sides[1]]
        if not both:
            continue
        scaled = fisher_z if subject == "r" else float
        off = [scaled(sides[0][person]) - scaled(sides[1][person]) for person in both]
        p = sign_flip(off) if len(both) >= SMALLEST_FOR_P else None
        found.append(Contrast(signal=signal, what=subject, people=len(both), difference=_average(off), p=p))
    return found


def _pose_use(
    use: Sequence[Trial], even: Mapping[str, TouchCourse], objects: Sequence[str], conditions: Sequence[str]
) -> list[PoseUse]:
    found = []
    for name, condition in product(objects, conditions):
        mine = [t for t in use if (t.object, t.condition) == (name, condition)]
        if not mine:
            continue
        poses = [even[t.id].pose for t in mine]
        silent = [one for t in mine if (one := _silent(t, even[t.id])) is not None]
        shares = np.mean([dwell(pose) for pose in poses], axis=0)
        changes = np.mean([transitions(pose) for pose in poses], axis=0)
        found.append(
            PoseUse(
                object=name,
                condition=condition,
                trials=len(poses),
                dwell=tuple(shares.tolist()),
                intermediate=float(shares[1:4].sum()),
                transitions=float(changes[0]),
                transitions_intermediate=float(changes[1]),
                silent=finite(_average(silent)),
            )
        )
    return found


def _silent(trial: Trial, course: TouchCourse) -> float | None:
    if trial.lift_off_s is None:
        return None
    closed = (course.t_s >= trial.lift_off_s) & (course.pose >= 1)
    return float(np.mean((course.cci == 0) & (course.eda == 0), where=closed)) if closed.any() else None


def _average(values: Collection[float]) -> float:
    return sum(values) / len(values) if values else math.nan
