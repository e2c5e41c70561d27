"""A session's signals are looked at by the detector, which is then one more account of its trials."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

pytest.importorskip("mujoco")
pytest.importorskip("scipy")

from reference.study_bench import ScriptedDesk, quick_study
from reference.written import boris_project
from tega.errors import InvalidValueError, RecordingError
from tega_study.analyse import analyse_study
from tega_study.attempt_rows import HandRow, read_hand, read_touch, write_hand
from tega_study.cli import study
from tega_study.detecting import detect_study, detected_path, events_of, read_detected
from tega_study.journal import Journal, events_path
from tega_study.lead.benches import SimulatedBench
from tega_study.lead.session import lead_session
from tega_study.observers import read_observers
from tega_study.page import report_html
from tega_study.plan import make_plan, write_plan
from tega_study.score.accounts import agreements
from tega_study.score.boris import export_boris, import_boris
from tega_study.trials import study_trials


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Lead a session with a trial in each of three conditions."""
    folder = tmp_path_factory.mktemp("detect") / "study"
    conditions = ["haptic", "non-haptic", "event-gated"]
    plan = quick_study(folder, conditions=conditions, change_rest_s=180.0, long_rest_s=300.0)
    bench = SimulatedBench(plan, "p01", real_time=False)
    lead_session(folder, "p01", bench, ScriptedDesk(), time_scale=0.01, auto=True)
    return folder


@pytest.mark.slow
def test_the_third_condition_takes_place_and_is_counted(folder: Path) -> None:
    trials = study_trials(folder)[1]
    assert sorted(trial.condition for trial in trials) == ["event-gated", "haptic", "non-haptic"]
    assert all(trial.counts and trial.lift_off_s is not None for trial in trials)
    assert all(not trial.rater for trial in trials)


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
def test_events_are_written_beside_the_session_and_compared(folder: Path, tmp_path: Path) -> None:
    before = study_trials(folder)[1]
    with pytest.raises(RecordingError, match="no trial has frames"):
        detect_study(_empty(tmp_path))
    found = detect_study(folder)
    assert [(one.trial, one.object, one.missing) for one in found] == [(n, "bag", ()) for n in (1, 2, 3)]
    for one, trial in zip(found, before, strict=True):
        [lift] = [event for event in one.events if event.kind == "lift_off"]
        assert lift.t_s == pytest.approx(trial.lift_off_s, abs=0.1)
        assert any(event.kind == "contact" and event.finger for event in one.events)
        assert all(0 <= event.confidence <= 1 and event.known_s >= event.t_s for event in one.events)
    content = detected_path(folder, "p01").read_bytes()
    detect_study(folder, ["p01"])
    assert detected_path(folder, "p01").read_bytes() == content  # the same signals, the same events
    assert all(e.value is not None for e in read_detected(folder, "p01") if e.kind == "lift_off")
    # One more account, which replaces nobody's counts.
    assert study_trials(folder)[1] == before
    accounts = {(one.kind, one.a, one.b): one for one in agreements(folder)}
    assert accounts["lift_off", "truth", "detector"].f1 == 1.0
    assert not any(kind == "drop" for kind, _, _ in accounts)


@pytest.mark.slow
@pytest.mark.parametrize("lost", ["closure", "height_m"])
def test_a_rig_without_joints_or_height_has_no_certain_slips_and_reports_say_so(
    lost: str, folder: Path, tmp_path: Path
) -> None:
    here = Path(shutil.copytree(folder, tmp_path / "study"))
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
        assert "not observable on this rig" in CliRunner().invoke(study, [verb, str(here)]).output
    assert note in report_html(analyse_study(here)[0], {})
    by_touch = [one for path in here.rglob("touch.csv") for one in events_of(read_touch(path), ())]
    assert all(one.confidence < 0.5 for one in by_touch if one.kind == "slip")


@pytest.mark.slow
def test_accounts_without_a_common_event_say_why(folder: Path, tmp_path: Path) -> None:
    here = Path(shutil.copytree(folder, tmp_path / "study"))
    with Journal(events_path(here, "p01")) as journal:
        start = next(event for event in journal.events if event.kind == "trial_start")
        journal.add("deformation", t_ns=start.t_ns + 10**9, trial=1, source="experimenter")
    found = {(one.kind, one.a, one.b): one for one in agreements(here)}
    assert found["deformation", "truth", "experimenter"].note == "no event of truth"
    assert found["lift_off", "truth", "experimenter"].note == "no event of experimenter"
    displayed = CliRunner().invoke(study, ["score", str(here)]).output
    (head,) = [line for line in displayed.splitlines() if line.startswith("event ")]
    assert "n first  n second" in head
    assert "no event of truth" in displayed
    analysis, _ = analyse_study(here)
    assert analysis.counted_by == {"the simulation": 2, "the simulation and the experimenter": 1}
    text = "counted by the simulation in 2 trials; the simulation and the experimenter in 1 trial"
    assert text in report_html(analysis, {})


@pytest.mark.slow
def test_events_go_out_to_boris_and_come_back(folder: Path, tmp_path: Path) -> None:
    found = detect_study(folder)
    path = tmp_path / "out.boris"
    assert export_boris(folder, path) == 6  # three to fill in, three of the detector
    boris_project(path)
    project = json.loads(path.read_text())
    observations = {k: v for k, v in project["observations"].items() if k.endswith("_detector")}
    [lift] = [event for event in found[0].events if event.kind == "lift_off"]
    assert [round(lift.t_s, 3), "", "lift_off", "", ""] in observations["p01_t01_a1_detector"]["events"]
    path.write_text(json.dumps({**project, "observations": observations}))
    assert import_boris(folder, path, "again") == {"p01": 3}
    try:
        same = {one.kind: one for one in agreements(folder) if {one.a, one.b} == {"again", "detector"}}
        assert same["lift_off"].f1 == 1.0
    finally:
        for rater in read_observers(folder, "p01"):
            (folder / "sessions" / "p01" / "observers" / f"{rater}.jsonl").unlink()


@pytest.mark.slow
def test_without_a_hand_and_an_arm_touch_alone_is_looked_at(folder: Path) -> None:
    where = folder / "recordings/p01/p01-t01-a1/hand.csv"
    rows = read_hand(where)
    try:
        write_hand(where, [HandRow(row.t_s, row.level, None, None) for row in rows])
        [first, *_] = detect_study(folder)
        assert first.missing == ("closure", "height")
        assert {event.kind for event in first.events} <= {"contact", "release", "slip"}
        where.unlink()
        assert detect_study(folder)[0].events == first.events
    finally:
        write_hand(where, rows)
    assert events_of([], []) == []


@pytest.mark.slow
def test_the_verb_prints_and_says_what_was_not_recorded(folder: Path) -> None:
    done = CliRunner().invoke(study, ["detect", str(folder)])
    assert done.exit_code == 0, done.output
    assert "p01 trial 1, bag: lift-off" in done.output
    done = CliRunner().invoke(study, ["detect", str(folder), "p01", "--live", "--json"])
    tree = json.loads(done.output)
    assert [one["trial"] for one in tree["trials"]] == [1, 2, 3]
    assert {"kind", "t_s", "confidence", "known_s", "finger"} == set(tree["trials"][0]["events"][0])
    done = CliRunner().invoke(study, ["detect", str(folder), "p09"])
    assert isinstance(done.exception, InvalidValueError)
    assert "p09" in str(done.exception)


def _empty(tmp_path: Path) -> Path:
    write_plan(make_plan(participants=1, objects=["bag"], trials=1), tmp_path / "empty")
    return tmp_path / "empty"
