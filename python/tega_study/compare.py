"""Test every metric of every object between a study's conditions, over its trials and over people."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any, Literal, NamedTuple

import msgspec
import numpy as np
from numpy.typing import ArrayLike

from tega_study.counts import poisson_rates, shares
from tega_study.people import (
    adjusted_ratio,
    cross_over,
    paired_log_ratio,
    ratio_of_means,
    sign_flip,
    within_person,
)
from tega_study.rank import holm, mann_whitney, shift
from tega_study.trials import Trial

Level = Literal["as printed", "these trials", "people", "adjusted", "cross-over"]

SMALLEST_FOR_P = 6
"""People from which a sign-flip test can reach p = 0.05 at all: 2 / 2**6."""


class Test(msgspec.Struct, frozen=True, kw_only=True):
    """One row of the table of tests.

    Attributes:
        test: Its name, with how p was got.
        n: Trials under the first and the second condition.
        p: Two-sided; ``None`` where the data allow no test, or p-values are withheld.
        p_holm: Corrected over the family that the plan names.
        p_exact: Given the ties that are there.
        effect: First condition against the second; ``low`` and ``high`` are its 95 % interval.
    """

    __test__ = False  # it is no class of tests for pytest

    metric: str
    object: str
    level: Level
    test: str
    people: int
    n: tuple[int, int]
    statistic: float | None = None
    p: float | None = None
    p_holm: float | None = None
    p_exact: float | None = None
    effect_name: str = ""
    effect: float | None = None
    low: float | None = None
    high: float | None = None
    note: str = ""


# An interval of a ratio whose ends lie further apart than this says nothing.
_MOST_SPREAD = 1e3


class _Data(NamedTuple):
    """One metric of one object: by person the values under both conditions."""

    metric: str
    object: str
    first: dict[str, list[float]]
    second: dict[str, list[float]]
    places: dict[str, list[float]]

    @property
    def common(self) -> dict[str, Any]:
        people = len(self.first.keys() | self.second.keys())
        return {"metric": self.metric, "object": self.object, "people": people}

    @property
    def both(self) -> list[str]:
        return [person for person in self.first if person in self.second]


def compare(
    trials: Sequence[Trial],
    objects: Sequence[str],
    conditions: tuple[str, str],
    *,
    family: Sequence[str],
    crossed: bool = False,
) -> list[Test]:
    """Make all tests of a study, first condition against second, over the trials that count.

    ``family`` lists each ``metric:object`` that Holm's method corrects together, within each level.
    ``crossed``: each person had one condition before the other, so that the order can be taken out.
    """
    tests: list[Test] = []
    for metric in ("duration_s", "slips", "deformations", "success"):
        for name in objects:
            data = _data(trials, metric, name, conditions)
            if data.first and data.second:
                tests += _success(data) if metric == "success" else _tests(data, crossed=crossed)
    return _corrected(tests, family)


def _data(trials: Sequence[Trial], metric: str, name: str, conditions: tuple[str, str]) -> _Data:
    data = _Data(metric, name, {}, {}, {})
    for trial in trials:
        value = getattr(trial, metric)
        if not trial.counts or trial.object != name or trial.condition not in conditions or value is None:
            continue
        side = data.first if trial.condition == conditions[0] else data.second
        side.setdefault(trial.participant, []).append(float(value))
        data.places.setdefault(f"{trial.participant} {trial.condition == conditions[0]}", []).append(
            trial.trial
        )
    return data


def _tests(data: _Data, *, crossed: bool) -> list[Test]:
    x, y = (_joined(side.values()) for side in (data.first, data.second))
    counted, n, common = data.metric != "duration_s", (len(x), len(y)), data.common
    ranks, moved = mann_whitney(x, y), shift(x, y)
    reach = f"{moved.low:g} to {moved.high:g}" if math.isfinite(moved.low) else "interval not estimable"
    note = f"A = {ranks.a:.3f}; median difference {moved.estimate:g} ({reach})"
    rough = ranks.method == "asymptotic"
    if rough and len(set(x + y)) == 1:
        note += "; all values are equal"
    name = f"Mann-Whitney U, {ranks.method}" + " (ties, continuity)" * rough
    effect = "rank-biserial", ranks.rank_biserial, ranks.low, ranks.high
    shown: dict[str, Any] = {"statistic": ranks.u, "p": ranks.p, "p_exact": ranks.p_conditional}
    tests = [_row(common, "as printed", name, n, effect, note=note, **shown)]
    if counted and sum(x) + sum(y) > 0 and len(x) == len(y):
        p, *ratio = poisson_rates(int(sum(x)), int(sum(y)))
        text = f"totals {sum(x):g} and {sum(y):g}; too sure where variance over mean is above 1"
        tests.append(_row(common, "these trials", "conditional Poisson", n, _ratio(ratio), p=p, note=text))
    both = data.both
    if not both:
        return tests
    common["people"] = len(both)
    sides = [[side[person] for person in both] for side in (data.first, data.second)]
    n = len(_joined(sides[0])), len(_joined(sides[1]))
    p = within_person(list(zip(*([_scale(one, counted) for one in side] for side in sides), strict=True)))
    text = "these people's trials only; takes trials of a person as exchangeable"
    tests.append(_row(common, "these trials", "exchange within person", n, p=p, note=text))
    if len(both) >= 2:
        tests += _by_people(data, common, n, crossed=crossed)
    return tests


def people_p(first: ArrayLike, second: ArrayLike, *, counted: bool) -> float | None:
    """Return the two-sided p over people: sign-flips if ``counted`` (counts, shares), a paired t for times.

    ``first`` and ``second`` hold each person's mean under a condition, of times the mean logarithm. ``None``
    below :data:`SMALLEST_FOR_P` people, and if people are all alike.
    """
    if np.size(first) < SMALLEST_FOR_P:
        return None
    if counted:
        return sign_flip(np.subtract(first, second))
    found = paired_log_ratio(first, second)
    return found and found.p


def _by_people(data: _Data, common: dict[str, Any], n: tuple[int, int], *, crossed: bool) -> list[Test]:
    counted, both = data.metric != "duration_s", data.both
    enough = len(both) >= SMALLEST_FOR_P
    first, second = (
        [float(np.mean(_scale(side[person], counted))) for person in both]
        for side in (data.first, data.second)
    )
    found = ratio_of_means(first, second) if counted else paired_log_ratio(first, second)
    few = "" if enough else f"no p below {SMALLEST_FOR_P} people"
    if found is None:
        few += "; " * bool(few) + "no ratio: a condition without events, or people all alike"
    name = "sign-flip; ratio of means" if counted else "paired t of mean log time"
    p, statistic = people_p(first, second, counted=counted), None if found is None else found.t
    tests = [_row(common, "people", name, n, _ratio(found), p=p, statistic=statistic, note=few)]
    where = [(person, side) for side in (True, False) for person in both]
    values = [data.first[person] if side else data.second[person] for person, side in where]
    adjusted = adjusted_ratio(
        _joined(values),
        [side for (_, side), some in zip(where, values, strict=True) for _ in some],
        _joined(data.places[f"{person} {side}"] for person, side in where),
        [person for (person, _), some in zip(where, values, strict=True) for _ in some],
        counts=counted,
    )
    if adjusted is not None:
        name = f"GEE, {'Poisson' if counted else 'log-normal'}, log of place in session"
        text = "sensitivity: learning taken out" + ("; " + few if few else "")
        p, statistic = adjusted.p if enough else None, adjusted.t
        row = _row(common, "adjusted", name, n, _ratio(adjusted), p=p, statistic=statistic, note=text)
        tests.append(row)
    began = [data.places[f"{person} True"][0] < data.places[f"{person} False"][0] for person in both]
    if crossed and (order := cross_over(first, second, began)):
        text = f"period effect {order.period:.3g}" + ("" if counted else " (log)")
        effect = "difference" if counted else "difference of logs", order.effect, None, None
        shown: dict[str, Any] = {"p": order.p, "statistic": order.t, "note": text}
        tests.append(_row(common, "cross-over", "Hills-Armitage", n, effect, **shown))
    return tests


def _success(data: _Data) -> list[Test]:
    x, y = (_joined(side.values()) for side in (data.first, data.second))
    found, n = shares(int(sum(x)), len(x), int(sum(y)), len(y)), (len(x), len(y))
    effect = "difference", found.difference, found.low, found.high
    shown: dict[str, Any] = {"p": found.fisher, "p_exact": found.boschloo}
    note = f"Boschloo p = {found.boschloo:.3g}"
    tests = [_row(data.common, "as printed", "Fisher exact", n, effect, note=note, **shown)]
    first, second = ([float(np.mean(side[one])) for one in data.both] for side in (data.first, data.second))
    if (p := people_p(first, second, counted=True)) is not None:
        common = {**data.common, "people": len(data.both)}
        off = "difference", float(np.mean(np.subtract(first, second))), None, None
        tests.append(_row(common, "people", "sign-flip of shares", n, off, p=p))
    return tests


_Effect = tuple[str, float | None, float | None, float | None]
"""What it is, its value, and both ends of its interval."""
_NONE: _Effect = ("", None, None, None)


def _ratio(found: Sequence[float] | None) -> _Effect:
    if found is None:
        return _NONE
    ratio, low, high, *_ = found
    if high > _MOST_SPREAD * low and (low == 0) == math.isinf(high):
        # Two people who differ leave one degree of freedom: the numbers would look like knowledge.
        return "ratio", ratio, None, None
    return "ratio", ratio, low, high


def _row(
    common: dict[str, Any],
    level: Level,
    test: str,
    n: tuple[int, int],
    effect: _Effect = _NONE,
    *,
    note: str = "",
    **numbers: Any,
) -> Test:
    name, value, low, high = effect
    if name == "ratio" and low is None:
        note = f"{note}; " * bool(note) + "its interval is not estimable from so few"
    if high is not None and math.isinf(high):
        high = None
    ends: dict[str, Any] = {"effect_name": name, "effect": value, "low": low, "high": high}
    return Test(**common, level=level, test=test, n=n, note=note, **ends, **numbers)


def _corrected(tests: list[Test], family: Sequence[str]) -> list[Test]:
    """Correct within each level that has one row a test; others are looked at, not counted as findings."""
    for level in ("as printed", "people"):
        rows = [i for i, t in enumerate(tests) if t.level == level and f"{t.metric}:{t.object}" in family]
        missing = len(family) - len(rows)
        corrected = holm([tests[i].p for i in rows] + [None] * missing)
        for i, p in zip(rows, corrected, strict=False):
            tests[i] = msgspec.structs.replace(tests[i], p_holm=p)
    return tests


def _scale(values: list[float], counted: bool) -> list[float]:  # noqa: FBT001
    return values if counted else [math.log(max(value, 1e-3)) for value in values]


def _joined(groups: Iterable[Sequence[float]]) -> list[float]:
    return [value for group in groups for value in group]
