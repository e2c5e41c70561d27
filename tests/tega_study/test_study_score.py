"""Accounts of the same trials compared: the study's vectors, raters against the truth, BORIS files out and in."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

pytest.importorskip("scipy")

from reference.written import boris_project
from tega.errors import InvalidValueError, RecordingError
from tega_study.analyse import analyse_study
from tega_study.lead.questions import TLX
from tega_study.observe.observing import Observing
from tega_study.observers import observer_path
from tega_study.page import report_html
from tega_study.plan import make_plan, read_plan, write_plan
from tega_study.score.accounts import agreements
from tega_study.score.agree import agreement, icc, kappa, match_events
from tega_study.score.boris import export_boris, import_boris
from tega_study.state import resume
from tega_study.tables import csv_files

S = 1_000_000_000
A = [2.10, 4.55, 7.20, 9.95, 12.40]
B = [2.35, 4.48, 7.60, 10.05, 13.90, 14.20]


@pytest.mark.parametrize(
    ("tolerance_s", "matched", "delay_s"),
    [(0.1, 2, 0.015), (0.25, 3, 0.0933333333333), (0.3, 3, 0.0933333333333), (0.5, 4, 0.17), (1.5, 5, 0.436)],
)
def test_events_are_matched_as_in_the_vectors(tolerance_s: float, matched: int, delay_s: float) -> None:
    found = agreement("slip", ("a", "b"), [A], [B], [15.0], tolerance_s=tolerance_s, turns=2)
    assert found.matched == matched
    assert found.f1 == pytest.approx(2 * matched / 11)
    assert found.delay_s == pytest.approx(delay_s)


def test_most_pairs_come_before_near_ones() -> None:
    assert match_events([1.0, 1.4], [1.35, 1.9], tolerance_s=0.5) == [(0, 0), (1, 1)]
    assert match_events([], [1.0], tolerance_s=0.5) == []


def test_the_chance_level_is_that_of_turning_round() -> None:
    found = agreement("slip", ("a", "b"), [A], [B], [15.0], tolerance_s=0.5, turns=300)
    assert found.chance_f1 == pytest.approx(0.332015810277)


def test_without_events_nothing_is_defined() -> None:
    found = agreement("slip", ("a", "b"), [[], []], [[], []], [15.0, 15.0], tolerance_s=0.5)
    assert found.f1 is found.chance_f1 is found.kappa is found.icc is found.delay_s is None


@pytest.mark.parametrize(
    ("bin_s", "value"), [(0.25, -0.1), (0.5, 0.0), (1.0, 0.285714285714), (2.5, -0.2), (5.0, None)]
)
def test_kappa_in_bins(bin_s: float, value: float | None) -> None:
    found = kappa([A], [B], [15.0], bin_s=bin_s)
    assert found == (None if value is None else pytest.approx(value))


def test_the_intraclass_correlation_and_its_interval() -> None:
    pairs = [(6, 5), (3, 3), (0, 1), (2, 2), (5, 4), (1, 1), (4, 6), (0, 0), (7, 7), (2, 3)]
    assert icc(pairs) == pytest.approx((0.928853754941, 0.750359786777, 0.98166621165))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Make a study in which r1 sees everything half a second late, r2 misses every second slip."""
    folder = tmp_path / "study"
    write_plan(make_plan(participants=1, seed=5, objects=["bag"], trials=2, simulated=True), folder)
    journal, _state = resume(folder, read_plan(folder), "p01", t_ns=0, where="simulated")
    with (
        journal as main,
        Observing(folder, "p01", "r1", t_ns=0) as first,
        Observing(folder, "p01", "r2", t_ns=0) as second,
    ):
        for trial in (1, 2, 3, 4):
            begin_ns = 100 * trial * S
            main.add("trial_start", t_ns=begin_ns, trial=trial, source="auto")
            main.add("lift_off", t_ns=begin_ns + 2 * S, trial=trial, source="auto")
            first.press("lift_off", begin_ns + 2 * S + S // 2)
            for slip in range(trial):
                at_ns = begin_ns + (3 + 2 * slip) * S
                main.add("slip", t_ns=at_ns, trial=trial, source="auto")
                first.press("slip", at_ns + S // 2)
                if slip % 2 == 0:
                    second.press("slip", at_ns + S // 4)
            main.add("trial_end", t_ns=begin_ns + 12 * S, trial=trial, status="done", success=True)
            first.check(begin_ns + 13 * S)
            second.check(begin_ns + 13 * S)
            for one in TLX:
                main.add("rating", t_ns=begin_ns + 14 * S, trial=trial, item=one.item, value=10.0 * trial)
    return folder


def test_raters_are_compared_with_the_truth_and_one_another(folder: Path) -> None:
    found = {(one.kind, one.a, one.b): one for one in agreements(folder)}
    assert set(found) == {
        *((kind, "truth", rater) for kind in ("lift_off", "slip") for rater in ("r1", "r2")),
        *((kind, "r1", "r2") for kind in ("lift_off", "slip")),
    }
    first, second = found["slip", "truth", "r1"], found["slip", "truth", "r2"]
    assert (first.f1, first.delay_s, first.delay_sd_s, first.icc) == pytest.approx((1.0, 0.5, 0.0, 1.0))
    assert (second.n_a, second.n_b, second.matched) == (10, 6, 6)
    assert second.delay_s == pytest.approx(0.25)
    assert found["slip", "r1", "r2"].delay_s == pytest.approx(-0.25)
    assert found["lift_off", "truth", "r2"].f1 == 0.0
    [strict] = [one for one in agreements(folder, tolerance_s=0.4) if (one.kind, one.b) == ("slip", "r1")]
    assert strict.f1 == 0.0


def test_the_report_has_agreement_and_answers(folder: Path) -> None:
    analysis, _ = analyse_study(folder)
    assert [one.item for one in analysis.ratings[:2]] == ["raw NASA-TLX"] * 2
    assert sum(one.median for one in analysis.ratings[:2]) == pytest.approx(50.0)
    page = report_html(analysis, {})
    assert "Who scored, and how far they agree" in page
    assert "Temporal Demand: 0 low, 100 high" in page
    assert csv_files(analysis, {})["agreement.csv"].startswith("kind,a,b,trials,")
    assert {trial.rater for trial in analysis.trials} == {"r1"}


def test_boris_goes_out_and_comes_back(folder: Path, tmp_path: Path) -> None:
    path = tmp_path / "out.boris"
    assert export_boris(folder, path) == 8
    boris_project(path)
    project = json.loads(path.read_text())
    assert project["project_format_version"] == "7.0"
    assert "haptic" not in path.read_text()
    assert project["observations"]["p01_t02_a1_r1"]["events"] == [
        [2.5, "", "lift_off", "", ""],
        [3.5, "", "slip", "", ""],
        [5.5, "", "slip", "", ""],
    ]
    with pytest.raises(InvalidValueError, match="is there already"):
        export_boris(folder, path)
    with pytest.raises(RecordingError, match="two observations"):
        import_boris(folder, path, "r3")
    for name in [name for name in project["observations"] if name.endswith("r1")]:
        project["observations"][f"{name[:-3]}"] = project["observations"][name]
        project["observations"][f"{name[:-3]}_detector"] = {"events": [[1.0, "", "drop", "", ""]]}
    path.write_text(json.dumps(project))
    assert import_boris(folder, path, "r3") == {"p01": 4}
    found = {(one.kind, one.a, one.b): one for one in agreements(folder)}
    assert found["slip", "r1", "r3"].f1 == 1.0
    assert found["slip", "r1", "r3"].delay_s == pytest.approx(0.0, abs=1e-9)
    with pytest.raises(InvalidValueError, match="has scored p01 already"):
        import_boris(folder, path, "r3")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a,b\n1,2\n", "no column Behavior, Time"),
        ("Observation id,Behavior,Time\nmine,slip,1\n", "names no trial"),
        ("Observation id,Behavior,Time\np01_t01_a1,jump,1\n", "'jump' is not known"),
        ("Observation id,Behavior,Time\np01_t01_a2,slip,1\n", "was not run"),
        ("Observation id,Behavior,Time\np01_t01_a1,slip,soon\n", "row 2: 'soon' is no time"),
    ],
)
def test_a_bad_file_changes_nothing(folder: Path, tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "events.csv"
    path.write_text(text)
    with pytest.raises(RecordingError, match=message):
        import_boris(folder, path, "video")
    assert not observer_path(folder, "p01", "video").exists()
