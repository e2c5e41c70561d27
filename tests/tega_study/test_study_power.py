"""The planner's power is that of the report's own tests with its own correction."""

from __future__ import annotations

import json
from importlib import import_module
from pathlib import Path

import pytest

pytest.importorskip("statsmodels")

from click.testing import CliRunner

from reference.study_bench import counted
from tega.errors import InvalidValueError
from tega.ui.cli.main import cli
from tega_study.compare import compare
from tega_study.power import SPREADS, PlannedTest, least_people, people_for, power_of, too_few

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
    enough, few = _reported(least, tests), _reported(least - 1, tests)
    assert enough is not None
    assert enough < 0.05
    assert few is None or few >= 0.05


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


def test_a_plan_with_too_few_people_is_refused_and_written_with_a_warning(tmp_path: Path) -> None:
    def plan(people: int, *more: str) -> tuple[int, str]:
        out = str(tmp_path / f"{people}{len(more)}")
        done = CliRunner().invoke(cli, ["study", "plan", "--participants", str(people), "--out", out, *more])
        return done.exit_code, str(done.exception or "") + done.output + done.stderr

    code, text = plan(8)
    assert code != 0
    assert "slips 9, deformations 9" in text
    assert not (tmp_path / "80").exists()
    code, text = plan(8, "--anyway")
    assert (code, "warning: with 8 people" in text) == (0, True)
    code, text = plan(9)
    assert (code, "warning" in text) == (0, False)
    code, text = plan(2, "--simulated")
    assert (code, "warning" in text) == (0, True)


def test_the_verb_prints_the_least_number_of_people(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(import_module("tega_study.cli.report"), "_SIZES", (6, 9))
    done = CliRunner().invoke(cli, ["study", "power", "--json", "--tests", "1", "--slips", "0.5,4"])
    reported = json.loads(done.stdout)
    assert reported["least_people"] == 6
    assert [row["people_for_80"] for row in reported["rows"]] == [6, 6, 6]
    assert reported["rows"][0]["power"] == {"6": 1.0, "9": 1.0}


def test_means_that_cannot_be_drawn_are_refused() -> None:
    with pytest.raises(InvalidValueError, match="not between 0 and 10000"):
        power_of([PlannedTest("slips", -1.0, 2.0)], people=6)
    with pytest.raises(InvalidValueError, match="not 2 to 60"):
        power_of([PlannedTest("slips", 1.0, 2.0)], people=61)
