"""Bundles of several sites are one table: each site for itself, and all together."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from reference.command import call
from reference.study_bench import led
from tega_study.bundle import write_bundle
from tega_study.plan import make_plan, write_plan


def site(folder: Path, seed: int, n_people: int = 2, **plan: Any) -> list[Path]:
    """Return the bundles of a study that was led to its end."""
    made = make_plan(
        participants=n_people, seed=seed, trials=2, simulated=True, **{"objects": ["bag"]} | plan
    )
    write_plan(made, folder / "study")
    for person in made.participants:
        led(folder / "study", person, recorded=False)
        write_bundle(folder / "study", person, folder / f"{person}.zip")
    return [folder / f"{person}.zip" for person in made.participants]


def test_bundles_of_two_sites_are_one_table_of_each_and_of_all(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    here, there = site(tmp_path / "here", 3), site(tmp_path / "there", 4, 3)
    out = tmp_path / "table1.csv"
    message = json.loads(call(capsys, "study", "sites", *here, *there, "--out", out, "--json")[0])
    assert [one["complete"] for one in message["sites"]] == [2, 3]
    assert (message["interim"], message["rehearsed"]) == (False, True)
    rows = [line.split(",") for line in out.read_text().splitlines()]
    assert rows == message["table1"]
    assert rows[0] == ["Site", "People", "Condition", "Metric", "bag"]
    # Two trials a person and condition, each of 9 s with one slip and lifted.
    n = {"site 1": 2, "site 2": 3, "all": 5}
    wanted = [
        [name, str(n[name]), condition, metric, value.format(2 * n[name])]
        for name in n
        for condition in ("haptic", "non-haptic")
        for metric, value in (
            ("Completion Time", "9.0"),
            ("Slippage", "1.0"),
            ("Deformation", "0.0"),
            ("Success Rate", "{0}/{0}"),
        )
    ]
    assert rows[1:] == wanted


def test_no_table_of_sites_before_their_plans_are_complete_nor_of_unlike_ones(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    here, there = site(tmp_path / "here", 3), site(tmp_path / "there", 4, objects=["egg"])
    reported = call(capsys, "study", "sites", here[0], code=1)[1]
    assert "site 1: 1 of 2 people of its plan are complete and here" in reported
    assert "interim" in call(capsys, "study", "sites", here[0], "--unblind")[0]
    assert "p01 of this plan is given twice" in call(capsys, "study", "sites", here[0], here[0], code=1)[1]
    assert "sites differ" in call(capsys, "study", "sites", *here, *there, code=1)[1]
