# mypy: allow-untyped-defs, allow-incomplete-defs, allow-untyped-calls, allow-untyped-decorators
"""Known answers: worked examples, textbook data, the paper's printed statistics, and the planner's power."""

from __future__ import annotations

import json
import math
from importlib import import_module
from typing import Any

import pytest

pytest.importorskip("scipy")
pytest.importorskip("statsmodels")

import numpy as np

from reference.command import call
from reference.study_bench import counted
from tega.errors import InvalidValueError
from tega_learn.score import pearson
from tega_study.compare import compare
from tega_study.counts import clopper_pearson, dispersion, poisson_rates, shares
from tega_study.coupling import correlate, effective_n, fisher_mean, lag_sweep, response_slope
from tega_study.difference import outcome
from tega_study.figures import p_text
from tega_study.order import williams
from tega_study.people import adjusted_ratio, cross_over, paired_log_ratio, ratio_of_means
from tega_study.power import SPREADS, PlannedTest, least_people, people_for, power_of, too_few
from tega_study.rank import holm, mann_whitney, shift

close: Any = pytest.approx

# Four people, five trials each: slips without and with touch.
WITHOUT = [[6, 5, 7, 4, 8], [3, 4, 2, 5, 3], [9, 7, 8, 6, 7], [4, 6, 5, 5, 3]]
WITH = [[3, 2, 4, 2, 3], [2, 1, 3, 2, 2], [5, 4, 6, 3, 5], [1, 3, 2, 2, 4]]
FIRST, PERSON = [True] * 20 + [False] * 20, [p for p in "abcd" for _ in range(5)] * 2
POSE = np.array(
    [*[0] * 4, *[1] * 3, *[2] * 4, *[3] * 6, *[2] * 5, *[3] * 3, *[4] * 4, 3, 3, 2, 2, 1, 1, *[0] * 5], float
)
TOUCH = np.array(
    [
        0.02, 0.01, 0.02, 0.01, 0.02, 0.05, 0.12, 0.15, 0.28, 0.35, 0.38, 0.40, 0.52, 0.60, 0.63, 0.66,
        0.64, 0.62, 0.50, 0.45, 0.43, 0.42, 0.44, 0.55, 0.63, 0.66, 0.78, 0.86, 0.90, 0.88, 0.74, 0.66,
        0.48, 0.40, 0.22, 0.15, 0.05, 0.02, 0.01, 0.02,
    ]
)  # fmt: skip


def test_mann_whitney_without_ties_is_exact_and_has_its_shift() -> None:
    x, y = [15.28, 14.91, 16.02, 15.57, 14.40], [16.85, 17.31, 15.90, 16.44, 18.02]
    found, moved = mann_whitney(x, y), shift(x, y)
    assert (found.u, found.method, found.a, found.rank_biserial) == (1, "exact", 0.04, close(-0.92))
    assert found.p == close(0.015873015873)
    assert found.p_asymptotic == close(0.0215717479477)
    assert moved == (close(-1.57), close(-2.91), close(-0.42))


def test_mann_whitney_with_ties_shows_the_approximation_and_the_exact_p() -> None:
    x, y = [2, 3, 4, 2, 3, 1, 4, 3, 2, 4], [6, 5, 7, 4, 8, 6, 5, 7, 6, 5]
    found = mann_whitney(x, y)
    assert (found.u, found.method) == (1.5, "asymptotic")
    assert found.p == close(0.000246509165903)
    assert found.p_conditional == close(4.33003528979e-05)
    assert shift(x, y) == (-3, -4, -2)


@pytest.mark.parametrize(
    ("x", "y", "printed", "exact"),
    [
        # Counts of 0.3 and 0.5 slips, the only ones of ten trials each that give what the paper prints.
        ("0 0 1 0 1 0 0 1 0 0", "1 0 1 0 1 0 1 0 1 0", "p = 0.398", 0.649916646821),
        # Counts of 0.5 and 1.3 deformations, likewise.
        ("1 0 1 0 1 0 1 0 1 0", "2 1 2 0 2 1 2 0 2 1", "p = 0.030", 0.0422394942519),
        # Times without ties with U = 17 and U = 18.
        ("14.1 14.3 14.6 14.8 15.0 15.1 15.4 15.7 16.3 17.45", "14.9 15.6 15.9 16.1 16.4 16.6 16.9 17.4 17.8 18.5",
         "p = 0.014", 0.0114962436944),
        ("14.1 14.3 14.6 14.8 15.0 15.1 15.4 15.7 16.5 17.45", "14.9 15.6 15.9 16.1 16.4 16.6 16.9 17.4 17.8 18.5",
         "p = 0.017", 0.0146896447206),
    ],
)  # fmt: skip
def test_the_paper_s_p_values_come_out_of_ten_against_ten(x: str, y: str, printed: str, exact: float) -> None:
    found = mann_whitney([float(v) for v in x.split()], [float(v) for v in y.split()])
    assert p_text(found.p_asymptotic) == printed
    assert found.p_conditional == close(exact)


def test_holm_passes_over_a_test_that_could_not_be_made() -> None:
    assert holm([0.01, None, 0.03]) == [close(0.03), None, close(0.06)]


def test_five_of_five_against_four_of_five_shows_nothing() -> None:
    assert shares(5, 5, 4, 5) == close((1.0, 0.588259598929, 0.2, -0.264324837584, 0.624465370237))
    assert shares(10, 10, 8, 10)[:2] == (close(0.473684210526), close(0.239375547071))
    assert clopper_pearson(4, 5) == (close(0.283582063882), close(0.994949236621))
    assert clopper_pearson(0, 5) == (0, close(0.521823750105))
    assert shares(5, 5, 5, 5)[:3] == (1.0, 1.0, 0.0)


def test_totals_by_the_conditional_poisson_test() -> None:
    assert poisson_rates(28, 59) == close((0.00116863749744, 0.474576271186, 0.291362281742, 0.756175644528))
    assert poisson_rates(0, 3)[1:3] == (0.0, 0.0)
    assert dispersion([6, 5, 7, 4, 8, 6, 5, 7, 6, 5]) == close(0.242937853107)


def test_people_as_clusters_by_hand_and_by_statsmodels() -> None:
    found = ratio_of_means(np.mean(WITH, axis=1), np.mean(WITHOUT, axis=1))
    assert found == close((0.551401869159, 0.421025893396, 0.722150409467, -7.02259714438, 0.00593130137292))
    values = np.ravel([*WITH, *WITHOUT])
    assert adjusted_ratio(values, FIRST, [1.0] * 40, PERSON, counts=True) == close(found)


def test_paired_times() -> None:
    text = """15.3 14.52 16.17|15.64 16.8 15.17;11.62 11.35 13.24|13.09 11.42 9.82;15.84 20.45 17.78|13.26 15.64 14.04
    ;13.4 13.59 13.29|13.65 12.83 12.17;15.94 16.63 12.98|13.5 12.55 13.61;12.17 13.88 13.79|12.15 11.28 12.04"""
    sides = [[np.mean(np.log(np.array(s.split(), float))) for s in p.split("|")] for p in text.split(";")]
    found = paired_log_ratio([s[1] for s in sides], [s[0] for s in sides])
    assert found == close((0.913739887753, 0.8316611604, 1.00391917072, -2.46375259389, 0.0569654443518))


def test_cross_over_takes_the_order_out() -> None:
    found = cross_over(np.mean(WITH, axis=1), np.mean(WITHOUT, axis=1), [False, True, False, True])
    assert found == close((-2.4, 0.6, -10.733126292, 0.00856913827357))
    assert cross_over([1, 2], [2, 3], [True, False]) is None
    assert cross_over([2 / 3, 4 / 3, 5 / 3, 7 / 3], [1 / 3, 1, 4 / 3, 2], [0, 1, 0, 1]) is None


def test_a_third_condition_does_not_hide_which_of_the_two_came_first() -> None:
    trials = [  # times grow with the place in the session alone
        counted(f"p{person}", "abc"[k], trial=place, duration_s=math.exp(place))
        for person, order in enumerate(williams(3))
        for place, k in enumerate(order, 1)
    ]
    rows = compare(trials, ["bag"], ("a", "b"), family=[], crossed=True)
    assert next(row.effect for row in rows if row.level == "cross-over") == close(0, abs=1e-9)


def test_where_there_is_no_information_there_is_no_ratio_and_no_model() -> None:
    for first, second in (([0, 0, 0], [1, 2, 3]), ([1], [2]), ([2, 2, 2], [2, 2, 2])):
        assert ratio_of_means(first, second) is None
    for_each = [(person, haptic) for person in range(7) for haptic in (True, False)]
    alike = [counted(f"p{p}", "a" if haptic else "b", duration_s=(p + haptic) / 3) for p, haptic in for_each]
    assert outcome(alike, "duration_s", "bag", ("a", "b")).low is None
    assert adjusted_ratio([0] * 20 + [3, 1] * 10, FIRST, range(1, 41), PERSON, counts=True) is None
    assert adjusted_ratio([1, 2, 3, 4], [True, False] * 2, [1, 2, 3, 4], "aabb", counts=True) is None


def test_learning_is_taken_out() -> None:
    """Counts that only fall with the place in the session: haptic comes later, and has no effect of its own."""
    random, n = np.random.default_rng(5), 12
    place = np.tile(np.arange(1, 21), n)
    first = np.tile(np.arange(20) >= 10, n)
    person = np.repeat(np.arange(n), 20).astype(str)
    counts = random.poisson(8 / place**0.7)
    plain = ratio_of_means(
        *[[counts[(person == str(p)) & (first == side)].mean() for p in range(n)] for side in (True, False)]
    )
    model = adjusted_ratio(counts, first, place, person, counts=True)
    assert plain is not None
    assert model is not None
    assert plain.high < 0.6
    assert model.low < 1 < model.high


def test_correlation_of_a_slow_course() -> None:
    found = correlate(POSE, TOUCH)
    assert found == close((0.908298531762, 40, 8.02244346512, 0.567042256711, 0.983422827754))
    assert effective_n(POSE, TOUCH, lags=5) == close(8.55384646561)
    lags = [0.416913513115, 0.631390258182, 0.801081066562, 0.908298531762, 0.978847911004, 0.963176643852]
    lags += [0.889190243422]
    assert lag_sweep(POSE, TOUCH, most=3) == [(lag - 3, close(r)) for lag, r in enumerate(lags)]
    assert fisher_mean([0.9, 0.8, 0.7]) == close(0.816439328634)
    assert fisher_mean([0.9, math.nan]) == close(0.9)
    # Rounded, the mean of a constant is not always the constant.
    assert math.isnan(pearson(np.full(7, 0.1), TOUCH[:7]))


def test_somebody_who_answers_has_another_slope_though_not_another_correlation() -> None:
    """Touch follows the pose in both; one loosens where touch went over its aim. The correlation does not show it."""
    random = np.random.default_rng(2)
    slopes, correlations = [], []
    for answering in (False, True):
        some, rs = [], []
        for _ in range(30):
            pose, touch, want = np.zeros(150), np.zeros(150), 2.5
            for i in range(1, 150):
                touch[i] = 0.6 * touch[i - 1] + 0.1 * pose[i - 1] + random.normal(0, 0.02)
                want += random.normal(0, 0.15) + 0.05 * (2.5 - want)
                if answering and i >= 4:
                    want -= 0.5 * (touch[i - 4] - 0.6)
                pose[i] = np.clip(round(want), 0, 4)
            touch = np.clip(touch, 0.001, None)
            some.append(response_slope(pose, touch))
            rs.append(correlate(pose, touch).r)
        slopes.append(float(np.mean(some)))
        correlations.append(fisher_mean(rs))
    assert slopes[1] < slopes[0] - 0.3
    assert min(correlations) > 0.5


FAMILY = [PlannedTest("slips", 2.8, 5.9), *[PlannedTest("slips", 5.9, 5.9)] * 6]


def _reported(people: int, tests: int) -> float | None:
    """Return Holm's p in a report of a study in which every person has nine slips fewer with touch."""
    objects = [f"o{k}" for k in range(tests)]
    trials = [
        counted(f"p{person}", condition, 9 * (condition == "non-haptic" and name == "o0"), object=name)
        for person in range(people)
        for name in objects
        for condition in ("haptic", "non-haptic")
    ]
    rows = compare(trials, objects, ("haptic", "non-haptic"), family=[f"slips:{name}" for name in objects])
    (row,) = (t for t in rows if (t.metric, t.object, t.level) == ("slips", "o0", "people"))
    return row.p_holm


@pytest.mark.parametrize(("tests", "least"), [(1, 6), (3, 7), (7, 9)])
def test_the_least_number_of_people_is_that_of_the_report(tests: int, least: int) -> None:
    assert least_people("slips", tests=tests) == least
    enough, few = (_reported(people, tests) or 1.0 for people in (least, least - 1))
    assert enough < 0.05 <= few


def test_no_effect_is_large_enough_for_too_few_people() -> None:
    huge = [PlannedTest("slips", 0.01, 50.0), *FAMILY[1:]]
    assert power_of(huge, people=8, runs=200).found == 0
    assert power_of(huge, people=9, runs=200).found == 1
    assert too_few(["duration_s:bag", "slips:bag"] + ["slips:cup"] * 5, people=8, alpha=0.05) == {"slips": 9}
    assert too_few(["slips:bag"], people=6, alpha=0.05) == {}
    assert least_people("slips", tests=7, alpha=0.01) == 11
    assert people_for([PlannedTest("slips", 0.45, 0.5)], runs=100) is None


@pytest.mark.parametrize(("spread", "people"), [("low", 9), ("mid", 9), ("high", 12)])
def test_people_for_four_of_five_studies(spread: str, people: int) -> None:
    """Worked out once apart from this program, by sign-flips at Holm's first step."""
    found = people_for(FAMILY, spread=SPREADS[spread], runs=300)
    assert found is not None
    assert found.people == people
    assert found.found >= 0.8


def test_the_power_of_a_time_is_the_noncentral_t() -> None:
    found = power_of(
        [PlannedTest("duration_s", 152.8, 168.5)], people=8, spread=SPREADS["low"], runs=1500
    ).found
    assert found == pytest.approx(0.808510475869, abs=0.03)
    alone = power_of([PlannedTest("slips", 2.8, 5.9)], people=6, spread=SPREADS["high"])
    assert alone.found == pytest.approx(0.62, abs=0.05)


def test_a_plan_with_too_few_people_is_refused_and_written_with_a_warning(tmp_path, capsys):
    def plan(people: int, *more: str, code: int = 0) -> str:
        out = tmp_path / f"{people}{len(more)}"
        return call(capsys, "study", "plan", "--participants", people, "--out", out, *more, code=code)[1]

    assert "slips 9, deformations 9" in plan(8, code=1)
    assert not (tmp_path / "80").exists()
    assert "warning: with 8 people" in plan(8, "--anyway")
    assert "warning" not in plan(9)
    assert "warning" in plan(2, "--simulated")


def test_the_verb_prints_the_least_number_of_people(monkeypatch, capsys):
    monkeypatch.setattr(import_module("tega_study.cli.report"), "_SIZES", (6, 9))
    reported = json.loads(call(capsys, "study", "power", "--json", "--tests", 1, "--slips", "0.5,4")[0])
    assert reported["least_people"] == 6
    assert [row["people_for_80"] for row in reported["rows"]] == [6, 6, 6]
    assert reported["rows"][0]["power"] == {"6": 1.0, "9": 1.0}


def test_means_that_cannot_be_drawn_are_refused() -> None:
    with pytest.raises(InvalidValueError, match="not between 0 and 10000"):
        power_of([PlannedTest("slips", -1.0, 2.0)], people=6)
    with pytest.raises(InvalidValueError, match="not 2 to 60"):
        power_of([PlannedTest("slips", 1.0, 2.0)], people=61)
