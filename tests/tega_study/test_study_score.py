"""Accounts of the same trials compared: raters, the truth, the detector; BORIS files out and in."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("scipy")
pytest.importorskip("mujoco")

from reference.command import call
from reference.study_bench import ScriptedDesk, quick_study
from reference.written import boris_project
from tega.errors import InvalidValueError, RecordingError
from tega_study.analyse import analyse_study
from tega_study.attempt_rows import HandRow, read_hand, read_touch, write_hand
from tega_study.detecting import detect_study, detected_path, events_of, read_detected
from tega_study.journal import Journal, events_path
from tega_study.lead.benches import SimulatedBench
from tega_study.lead.questions import TLX
from tega_study.lead.session import lead_session
from tega_study.observe.observing import Observing
from tega_study.page import report_html
from tega_study.plan import make_plan, read_plan, write_plan
from tega_study.report import csv_files
from tega_study.score.accounts import agreements
from tega_study.score.agree import agreement, icc, kappa, match_events
from tega_study.score.boris import export_boris, import_boris
from tega_study.state import resume
from tega_study.trials import study_trials

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


def test_the_chance_level_is_that_of_turning_round_and_without_events_nothing_is_defined() -> None:
    found = agreement("slip", ("a", "b"), [A], [B], [15.0], tolerance_s=0.5, turns=300)
    assert found.chance_f1 == pytest.approx(0.332015810277)
    none = agreement("slip", ("a", "b"), [[], []], [[], []], [15.0, 15.0], tolerance_s=0.5)
    assert none.f1 is none.chance_f1 is none.kappa is none.icc is none.delay_s is None


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
    events = project["observations"]["p01_t02_a1_r1"]["events"]
    assert events == [
        [t_s, "", code, "", ""] for t_s, code in ((2.5, "lift_off"), (3.5, "slip"), (5.5, "slip"))
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


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Lead a session with a trial in each of three conditions."""
    session = tmp_path_factory.mktemp("detect") / "study"
    conditions = ["haptic", "non-haptic", "event-gated"]
    plan = quick_study(session, conditions=conditions, change_rest_s=180.0, long_rest_s=300.0)
    bench = SimulatedBench(plan, "p01", real_time=False)
    lead_session(session, "p01", bench, ScriptedDesk(), time_scale=0.01, auto=True)
    return session


@pytest.fixture
def here(session: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(session, tmp_path / "study"))


def test_places_of_fingertips_are_kept_and_older_tables_have_none(tmp_path: Path) -> None:
    path = tmp_path / "hand.csv"
    rows = [HandRow(0.1, 3, 2.5, 0.2, (10.0, 45.5, 0.25, -31.125)), HandRow(0.2, None, None, None)]
    write_hand(path, rows)
    assert read_hand(path) == rows
    path.write_text("t_s,level,closure,height_m\n0.1,3,2.5,0.2\n")
    assert read_hand(path) == [rows[0]._replace(tips_mm=None)]
    path.write_text("t_s,level,closure,height_m,thumb_mm,index_mm,middle_mm,ring_mm\n0.1,3,2.5,0.2,1.0,2.0\n")
    with pytest.raises(RecordingError, match=r"hand\.csv"):
        read_hand(path)


@pytest.mark.slow
def test_events_are_written_beside_the_session_and_compared(session: Path, tmp_path: Path) -> None:
    before = study_trials(session)[1]
    assert sorted(trial.condition for trial in before) == ["event-gated", "haptic", "non-haptic"]
    assert all(trial.counts and trial.lift_off_s is not None and not trial.rater for trial in before)
    write_plan(make_plan(participants=1, objects=["bag"], trials=1), tmp_path / "empty")
    with pytest.raises(RecordingError, match="no trial has frames"):
        detect_study(tmp_path / "empty")
    found = detect_study(session)
    assert [(one.trial, one.object, one.missing) for one in found] == [(n, "bag", ()) for n in (1, 2, 3)]
    for one, trial in zip(found, before, strict=True):
        [lift] = [event for event in one.events if event.kind == "lift_off"]
        assert lift.t_s == pytest.approx(trial.lift_off_s, abs=0.1)
        assert any(event.kind == "contact" and event.finger for event in one.events)
        assert all(0 <= event.confidence <= 1 and event.known_s >= event.t_s for event in one.events)
    content = detected_path(session, "p01").read_bytes()
    detect_study(session, ["p01"])
    assert detected_path(session, "p01").read_bytes() == content  # the same signals, the same events
    assert all(e.value is not None for e in read_detected(session, "p01") if e.kind == "lift_off")
    # One more account, which replaces nobody's counts.
    assert study_trials(session)[1] == before
    accounts = {(one.kind, one.a, one.b): one for one in agreements(session)}
    assert accounts["lift_off", "truth", "detector"].f1 == 1.0
    assert not any(kind == "drop" for kind, _, _ in accounts)


@pytest.mark.slow
@pytest.mark.parametrize("lost", ["closure", "height_m"])
def test_a_rig_without_joints_or_height_has_no_certain_slips_and_reports_say_so(
    lost: str, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    unknown: dict[str, Any] = {lost: None, "tips_mm": None}
    for path in here.rglob("hand.csv"):
        rows = [row._replace(**unknown) for row in read_hand(path)]
        write_hand(path, rows)
    with Journal(events_path(here, "p01")) as journal:  # the experimenter counted a slip in the first trial
        start = next(event for event in journal.events if event.kind == "trial_start")
        journal.add("slip", t_ns=start.t_ns + 10**9, trial=1, source="experimenter")
    found = detect_study(here)
    assert not [event for one in found for event in one.events if event.kind == "slip"]
    unobservable = ("slip",) if lost == "closure" else ("lift_off", "slip")
    assert {one.unobservable for one in found} == {unobservable}
    row = {(one.kind, one.a, one.b): one for one in agreements(here)}["slip", "experimenter", "detector"]
    note = "detector: not observable on this rig"
    assert (row.note, row.f1, row.trials) == (note, None, 0)
    for verb in ("detect", "score"):
        assert "not observable on this rig" in call(capsys, "study", verb, here)[0]
    assert note in report_html(analyse_study(here)[0], {})
    by_touch = [one for path in here.rglob("touch.csv") for one in events_of(read_touch(path), ())]
    assert all(one.confidence < 0.5 for one in by_touch if one.kind == "slip")


@pytest.mark.slow
def test_accounts_without_a_common_event_say_why(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with Journal(events_path(here, "p01")) as journal:
        start = next(event for event in journal.events if event.kind == "trial_start")
        journal.add("deformation", t_ns=start.t_ns + 10**9, trial=1, source="experimenter")
    found = {(one.kind, one.a, one.b): one for one in agreements(here)}
    assert found["deformation", "truth", "experimenter"].note == "no event of truth"
    assert found["lift_off", "truth", "experimenter"].note == "no event of experimenter"
    displayed = call(capsys, "study", "score", here)[0]
    assert "n first  n second" in displayed
    assert "no event of truth" in displayed
    analysis, _ = analyse_study(here)
    assert analysis.counted_by == {"the simulation": 2, "the simulation and the experimenter": 1}
    text = "counted by the simulation in 2 trials; the simulation and the experimenter in 1 trial"
    assert text in report_html(analysis, {})


@pytest.mark.slow
def test_events_go_out_to_boris_and_come_back(here: Path, tmp_path: Path) -> None:
    found = detect_study(here)
    path = tmp_path / "out.boris"
    assert export_boris(here, path) == 6  # three to fill in, three of the detector
    boris_project(path)
    project = json.loads(path.read_text())
    observations = {k: v for k, v in project["observations"].items() if k.endswith("_detector")}
    [lift] = [event for event in found[0].events if event.kind == "lift_off"]
    assert [round(lift.t_s, 3), "", "lift_off", "", ""] in observations["p01_t01_a1_detector"]["events"]
    path.write_text(json.dumps({**project, "observations": observations}))
    assert import_boris(here, path, "again") == {"p01": 3}
    same = {one.kind: one for one in agreements(here) if {one.a, one.b} == {"again", "detector"}}
    assert same["lift_off"].f1 == 1.0


@pytest.mark.slow
def test_without_a_hand_and_an_arm_touch_alone_is_looked_at(here: Path) -> None:
    where = here / "recordings/p01/p01-t01-a1/hand.csv"
    write_hand(where, [HandRow(row.t_s, row.level, None, None) for row in read_hand(where)])
    [first, *_] = detect_study(here)
    assert first.missing == ("closure", "height")
    assert {event.kind for event in first.events} <= {"contact", "release", "slip"}
    where.unlink()
    assert detect_study(here)[0].events == first.events
    assert events_of([], []) == []


@pytest.mark.slow
def test_the_verb_prints(session: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "p01 trial 1, bag: lift-off" in call(capsys, "study", "detect", session)[0]
    rows = json.loads(call(capsys, "study", "detect", session, "p01", "--live", "--json")[0])["trials"]
    assert [one["trial"] for one in rows] == [1, 2, 3]
    assert {"kind", "t_s", "confidence", "known_s", "finger"} == set(rows[0]["events"][0])
    assert "p09" in call(capsys, "study", "detect", session, "p09", code=1)[1]
