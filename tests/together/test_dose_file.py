"""The vest's dose is a day's: what one run used, the next of the same person has no more."""

from __future__ import annotations

import ast
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tega
import tega_bench
import tega_campaigns
import tega_emulators
import tega_figures
import tega_practice
import tega_study
from tega.config import check_tree
from tega.config.calibration.folder import CalibrationFolder
from tega.errors import CalibrationError
from tega.loop import run_session
from tega.loop.worn_vest import DAY_S, NAMELESS, KeptDose
from tega.safety.motor_budget import HEAT_TAU_S, MotorBudget
from tega_emulators.lab import emulated_lab

FULL = np.full(40, 100, np.uint8)


def drive(budget: MotorBudget, seconds: float, *, from_s: float = 0.0) -> int:
    times_ns = [round((from_s + k / 10) * 1e9) for k in range(round(10 * seconds) + 1)]
    return [int(budget.allow(t_ns, FULL)[0]) for t_ns in times_ns][-1]


def run(file: Path, *, at_s: float, seconds: float, dose_s: float = 100.0) -> MotorBudget:
    budget, now_s = MotorBudget(heat_share=1.0, dose_s=dose_s), [at_s]
    with KeptDose(file, budget, now_s=lambda: now_s[0]):
        drive(budget, seconds)
        now_s[0] += seconds
    return budget


def test_a_second_run_of_the_day_begins_where_the_first_ended(tmp_path: Path) -> None:
    file = tmp_path / "p01" / "vest-dose.json"
    first = run(file, at_s=1000.0, seconds=60.0)
    assert first.dose_s[0] == pytest.approx(60.0)
    second = run(file, at_s=5000.0, seconds=10.0)
    assert second.dose_s == pytest.approx(np.full(40, 70.0))
    assert "earlier runs of the day used up to 60 of 100 s" in second.words()[0]
    # The day's budget holds over runs, however many: no restart gets past it.
    for k in range(10):
        spent = run(file, at_s=6000.0 + 100 * k, seconds=60.0)
    assert (spent.dose_s <= 100.0).all()
    assert drive(spent, 0.1, from_s=60.0) <= 10


def test_what_is_older_than_a_day_counts_no_more(tmp_path: Path) -> None:
    file = tmp_path / "vest-dose.json"
    run(file, at_s=0.0, seconds=30.0)
    run(file, at_s=40_000.0, seconds=20.0)
    assert run(file, at_s=30.0 + DAY_S - 1, seconds=0.0).carried_s[0] == pytest.approx(50.0)
    assert run(file, at_s=30.0 + DAY_S + 1, seconds=0.0).carried_s[0] == pytest.approx(20.0)
    assert run(file, at_s=3 * DAY_S, seconds=0.0).carried_s[0] == 0.0
    assert json.loads(file.read_bytes()) == []


@pytest.mark.parametrize(("later_s", "share"), [(0.0, 1.0), (HEAT_TAU_S, np.exp(-1)), (-500.0, 1.0)])
def test_a_quick_restart_does_not_cool_the_motors_nor_does_a_clock_set_back(tmp_path, later_s, share):
    file = tmp_path / "vest-dose.json"
    warm = run(file, at_s=1000.0, seconds=30.0).heat
    again = MotorBudget(heat_share=1.0)
    KeptDose(file, again, now_s=lambda: 1030.0 + later_s)
    assert warm[0] > 0.3
    assert again.heat == pytest.approx(share * warm)


def test_a_file_that_cannot_be_read_is_no_clean_slate(tmp_path: Path) -> None:
    file = tmp_path / "vest-dose.json"
    file.write_text('[{"ended_s": 1, "dose_s": [1], "heat": []}]')
    with pytest.raises(CalibrationError, match=r"vest-dose\.json"):
        KeptDose(file, MotorBudget())


@pytest.mark.parametrize("name", ["ended_s", "dose_s", "heat"])
@pytest.mark.parametrize("number", ["-1800.0", "1e999", "NaN"])
def test_a_number_that_would_lengthen_the_day_is_refused(tmp_path: Path, name: str, number: str) -> None:
    file = tmp_path / "vest-dose.json"
    numbers = {"ended_s": "1000.0", "dose_s": "1.0", "heat": "0.1"}

    def write(numbers: dict[str, str]) -> None:
        each = {key: "[" + ", ".join([number] * 40) + "]" for key, number in numbers.items()}
        each["ended_s"] = numbers["ended_s"]
        file.write_text("[{" + ", ".join(f'"{key}": {value}' for key, value in each.items()) + "}]")

    write(numbers)
    assert KeptDose(file, MotorBudget(), now_s=lambda: 1010.0)._carried_s.max() == 1.0
    write(numbers | {name: number})
    with pytest.raises(
        CalibrationError, match=r"vest-dose\.json: the vibration dose of the last day cannot be read"
    ):
        KeptDose(file, MotorBudget(), now_s=lambda: 1010.0)


def test_who_is_not_named_begins_where_the_one_who_had_most_left_off(tmp_path: Path) -> None:
    people = {name: tmp_path / "people" / name / "vest-dose.json" for name in ("p01", "p02")}
    run(people["p01"], at_s=1000.0, seconds=40.0)
    run(people["p02"], at_s=2000.0, seconds=20.0)
    nameless, now_s = tmp_path / NAMELESS, 3000.0

    def wear() -> float:
        budget = MotorBudget(heat_share=1.0, dose_s=100.0)
        with KeptDose(nameless, budget, may_be=sorted(people.values()), now_s=lambda: now_s):
            drive(budget, 15.0)
        return float(budget.carried_s[0])

    assert wear() == pytest.approx(40.0)
    assert wear() == pytest.approx(55.0)
    # Only the own part is kept, so that nobody's is counted twice.
    runs = json.loads(nameless.read_bytes())
    assert [kept["dose_s"][0] for kept in runs] == pytest.approx([15.0, 15.0], abs=0.2)
    assert run(people["p02"], at_s=4000.0, seconds=1.0).carried_s[0] == pytest.approx(20.0)


@pytest.mark.slow
def test_a_run_of_a_person_keeps_what_it_used(tmp_path: Path) -> None:
    with emulated_lab(tmp_path, vest=True, fingers=("thumb",)) as lab:
        kept = CalibrationFolder(tmp_path / "calibrations").person("p01") / "vest-dose.json"
        nameless = tmp_path / "calibrations" / NAMELESS
        totals: list[float] = []
        for person in (None, "p01", "p01", None):
            tree: dict[str, Any] = {**lab.tree, "session": {"duration_s": 1.5}}
            if person is not None:
                own = {"person": person, "folder": str(tmp_path / "calibrations")}
                tree["calibration"] = {**tree["calibration"], **own}
            run_session(check_tree(tree, {}, base=tmp_path).config)
            runs = json.loads(kept.read_bytes()) if kept.is_file() else []
            totals.append(sum(sum(run["dose_s"]) for run in runs))
    assert totals[0] == 0.0
    assert 0 < totals[1] < totals[2] == totals[3]
    assert len(json.loads(nameless.read_bytes())) == 2


def test_a_vest_is_made_in_one_place_and_opened_by_who_names_its_wearer() -> None:
    """Whatever makes a motor vibrate goes through `worn_vest`, and none of it says that the wearer has no day."""
    own = (tega, tega_bench, tega_practice, tega_study, tega_emulators, tega_campaigns, tega_figures)
    packages = [Path(package.__path__[0]) for package in own]
    made, worn, by_variable = set(), [], set()
    for parent, file in [(package.parent, file) for package in packages for file in package.rglob("*.py")]:
        where = file.relative_to(parent).as_posix()
        text = file.read_text(encoding="utf-8")
        if "driver_class" not in text and "worn_vest" not in text:
            continue
        for call in ast.walk(ast.parse(text)):
            if not isinstance(call, ast.Call):
                continue
            name = ast.unparse(call.func)
            if name.rsplit(".")[-1] == "driver_class":
                kinds = [*call.args[1:], *(word.value for word in call.keywords)]
                if "'vest'" in map(ast.unparse, kinds):
                    made.add(where)
                elif not kinds or not all(isinstance(kind, ast.Constant) for kind in kinds):
                    by_variable.add(where)
            if name == "worn_vest":
                worn.append(ast.unparse(call.args[1]))
    # The doctor sends zeros alone; the bench of the tests has no wearer.
    assert made == {"tega/loop/worn_vest.py", "tega/setup/doctor/outputs.py", "tega_emulators/vest_bench.py"}
    # These take a kind or a driver from a variable. The acceptance opens a vest through `worn_vest`, the contract's
    # check is for drivers' authors and wears none; the others look at a driver's options or open no vest.
    assert by_variable == {
        "tega_bench/acceptance/run.py",
        "tega/config/person.py",
        "tega/config/check.py",
        "tega/config/load.py",
        "tega/setup/contract/command.py",
        "tega/setup/doctor/bench.py",
        "tega/loop/sinks.py",
    }
    assert len(worn) == 6
    assert all("dose" in file for file in worn)
