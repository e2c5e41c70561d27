# mypy: allow-untyped-defs, allow-incomplete-defs, allow-untyped-calls, allow-untyped-decorators
"""A study's files: never overwritten, damage named, withdrawal, the anonymised copy, objects and forms beside them."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import msgspec
import pytest

from reference.command import call
from reference.study_bench import led, ran
from tega.errors import InvalidValueError, RecordingError, UnsafeNameError
from tega_study.analyse import analyse_study
from tega_study.bundle import open_bundle, write_bundle
from tega_study.journal import Journal, events_path, read_events
from tega_study.page import FORMS, report_html, write_forms
from tega_study.plan import PlannedTrial, make_plan, read_plan, write_plan
from tega_study.privacy import export, note_elsewhere, withdraw
from tega_study.score.boris import export_boris
from tega_study.state import derive, resume
from tega_study.study_notes import OBJECTS, ObjectFacts, note_object, read_objects, withdrawn_ids
from tega_study.trials import study_trials

START_NS = 1_763_720_000_123_456_789


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write_plan(make_plan(participants=4, seed=5, objects=["bottle", "bag"], trials=2), tmp_path / "study")
    return tmp_path / "study"


def run_all(folder: Path, person: str) -> None:
    """Do a person's trials: each has one slip before lift-off, and as many after as its number."""

    def happen(journal: Journal, trial: PlannedTrial, at_ns: int) -> None:
        journal.add("slip", t_ns=at_ns + 1, trial=trial.trial, source="anna", text="long")
        journal.add("lift_off", t_ns=at_ns + 2 * 10**9, trial=trial.trial, source="auto")
        for _ in range(trial.trial):
            journal.add("slip", t_ns=at_ns + 3 * 10**9, trial=trial.trial, source="anna")

    ran(folder, person, happen, START_NS)


def test_a_plan_is_never_overwritten(folder: Path) -> None:
    before = (folder / "plan.csv").read_bytes()
    with pytest.raises(InvalidValueError, match="never overwritten"):
        write_plan(make_plan(participants=1), folder)
    assert (folder / "plan.csv").read_bytes() == before
    assert [path.name for path in folder.parent.iterdir()] == ["study"]


@pytest.mark.parametrize(
    ("name", "old", "new", "message"),
    [
        ("plan.csv", "bag", "bottle", "not as it was written"),
        ("study.toml", "duration_s:", "weight_g:", r"family: 'weight_g:.*' is no test of this study"),
    ],
)
def test_a_changed_plan_is_refused(folder: Path, name: str, old: str, new: str, message: str) -> None:
    text = (folder / name).read_text(encoding="utf-8")
    (folder / name).write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(RecordingError, match=message):
        read_plan(folder)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"participants": 0}, "participants"),
        ({"objects": []}, "objects"),
        ({"objects": ["a", "a"]}, "twice"),
        ({"objects": ["a b"]}, "objects"),
        ({"conditions": ["haptic"]}, "conditions"),
        ({"rest_s": float("nan")}, "rest_s"),
        ({"seed": -1}, "seed"),
    ],
)
def test_plans_that_cannot_be_made_say_why(fields: dict[str, Any], message: str) -> None:
    with pytest.raises(InvalidValueError, match=message):
        make_plan(**{"participants": 2, **fields})


def test_the_plan_of_a_seed_stays_what_it_is_and_rests_a_minute_three_at_a_change_and_five_after_twenty():
    plan = make_plan(participants=12, seed=20250101)
    assert plan.settings.plan_sha256.startswith("f154b237f0db6ad5")
    rests = [trial.rest_s for trial in plan.of("p01")]
    assert rests[:6] == [0, 60, 60, 60, 60, 180]
    assert rests[20] == rests[40] == 300


def test_a_session_that_ended_in_a_trial_repeats_it_at_the_end_of_its_block(folder: Path) -> None:
    plan = read_plan(folder)
    with resume(folder, plan, "p01", t_ns=1)[0] as journal:
        journal.add("trial_start", t_ns=2, trial=1)
        journal.add("slip", t_ns=3, trial=1)
    journal, state = resume(folder, plan, "p01", t_ns=9)
    with journal:
        assert [event.kind for event in journal.events] == [
            "session_start", "trial_start", "slip", "trial_end", "session_start",
        ]  # fmt: skip
        assert state.status[1] == "aborted_technical"
        same_block = [trial.trial for trial in plan.of("p01") if trial.block == 1]
        assert state.next == ((same_block[1], 1) if len(same_block) > 1 else (1, 2))
        journal.add("trial_start", t_ns=9, trial=2)
        journal.add("trial_end", t_ns=8, trial=2, status="done")
        with pytest.raises(RecordingError, match="trial 2 ends before it began"):
            derive(plan.of("p01"), journal.events)


def test_withdrawal_deletes_a_person_everywhere_and_only_them(folder: Path) -> None:
    for person in ("p01", "p02"):
        run_all(folder, person)
        (folder / "courses" / person).mkdir(parents=True)
        (folder / "courses" / person / "x.csv").write_text("t_s\n")
    (folder / "report").mkdir()
    (folder / "report.html").write_text("p01")
    other = events_path(folder, "p02").read_bytes()
    gone = withdraw(folder, "p01")
    deleted = {path.relative_to(folder).as_posix() for path in gone.deleted}
    assert deleted == {"sessions/p01", "courses/p01", "report", "report.html"}
    assert not list(folder.rglob("p01"))
    assert events_path(folder, "p02").read_bytes() == other
    assert withdrawn_ids(folder) == {"p01"}
    assert {trial.participant for trial in study_trials(folder)[1]} == {"p02"}
    with pytest.raises(RecordingError, match="has withdrawn"):
        resume(folder, read_plan(folder), "p01", t_ns=0)
    with pytest.raises(InvalidValueError, match="p99"):
        withdraw(folder, "p99")


def test_a_withdrawal_that_was_cut_short_is_told_and_finished_by_asking_again(folder, caplog):
    run_all(folder, "p01")
    (folder / "withdrawn.txt").write_text("p01\n")
    assert study_trials(folder)[1] == []
    assert (folder / "sessions" / "p01").exists()  # nobody deletes by reading
    assert "p01 has withdrawn, but something of theirs is left" in caplog.text
    assert withdraw(folder, "p01").deleted == [folder / "sessions" / "p01"]
    assert not (folder / "sessions" / "p01").exists()


def test_withdrawal_works_through_links_without_following_them(folder: Path, tmp_path: Path) -> None:
    run_all(folder, "p01")
    elsewhere, disk = tmp_path / "elsewhere", tmp_path / "disk"
    for place in (elsewhere, disk / "p01", disk / "p02"):
        place.mkdir(parents=True)
        (place / "kept.mcap").write_text("of somebody")
    (folder / "courses").mkdir(exist_ok=True)
    (folder / "courses" / "p01").symlink_to(elsewhere)
    (folder / "pictures").mkdir()
    (folder / "pictures" / "p01").symlink_to(tmp_path / "nowhere")
    (folder / "recordings").symlink_to(disk)
    deleted, changed, left = withdraw(folder, "p01")
    assert set(deleted) == {folder / name / "p01" for name in ("sessions", "courses", "pictures")}
    assert not changed
    assert set(left) == {elsewhere.resolve(), (disk / "p01").resolve()}
    assert sorted(path.name for path in tmp_path.rglob("kept.mcap")) == ["kept.mcap"] * 3
    assert not os.path.lexists(folder / "courses" / "p01")


def test_withdrawal_tells_of_every_trace_that_it_does_not_delete(folder: Path, tmp_path: Path) -> None:
    for person in ("p01", "p02"):
        run_all(folder, person)
    maxima = tmp_path / "calibrations" / "p\udce9ople" / "p01"
    maxima.mkdir(parents=True)
    note_elsewhere(folder, "p01", maxima)
    note_elsewhere(folder, "p01", maxima)
    for place in (tmp_path, folder):
        export_boris(folder, place / "coded.boris")
    (folder / "notes on p01.txt").write_text("she was tired")
    (folder / "p011.txt").write_text("of nobody")
    (folder / "exports").mkdir()
    (folder / "exports" / "p01-t01.csv").write_text("t_s")
    deleted, changed, left = withdraw(folder, "p01")
    assert set(deleted) == {folder / "sessions" / "p01", folder / "exports" / "p01-t01.csv"}
    assert changed == [folder / "coded.boris"]
    assert "p01_" not in (folder / "coded.boris").read_text()
    assert "p02_" in (folder / "coded.boris").read_text()
    assert set(left) == {maxima, tmp_path / "coded.boris", folder / "notes on p01.txt"}
    assert maxima.is_dir()
    assert (folder / "p011.txt").exists()


def test_the_anonymised_copy_has_the_numbers_but_no_names_texts_dates_or_seed(folder, tmp_path):
    for person in ("p01", "p02", "p03"):
        run_all(folder, person)
    withdraw(folder, "p02")
    course = folder / "courses/p01/p01-t01.csv"
    course.parent.mkdir(parents=True)
    course.write_bytes(b"t_s,cci,eda,pose\n")
    new = export(folder, tmp_path / "out", key="a secret")
    assert set(new) == {"p01", "p03", "p04"}
    assert set(new.values()) == {"p01", "p02", "p03"}
    text = "".join(path.read_text() for path in (tmp_path / "out").rglob("*") if path.is_file())
    assert "anna" not in text
    assert "long" not in text.replace("long_rest", "")
    assert "seed" not in text
    assert str(START_NS)[:10] not in text
    assert "aborted" not in text

    def numbers(place: Path, person: str) -> list[tuple[object, ...]]:
        trials = [trial for trial in study_trials(place)[1] if trial.participant == person]
        return [(t.success, t.object, t.condition, t.slips, t.slips_before, t.duration_s) for t in trials]

    for old in ("p01", "p03"):
        assert numbers(folder, old) == numbers(tmp_path / "out", new[old])
    (copied,) = (tmp_path / "out/courses").rglob("*.csv")
    assert copied == tmp_path / f"out/courses/{new['p01']}/{new['p01']}-t01.csv"
    assert copied.read_bytes() == course.read_bytes()
    assert numbers(folder, "p01")[3][3:] == (4, 1, 9.0)


def test_what_is_kept_is_on_the_disk_and_events_that_were_taken_out_are_noticed(tmp_path, monkeypatch):
    path, synced, really = tmp_path / "events.jsonl", list[int](), os.fsync

    def fsync(handle: int) -> None:
        really(handle)
        synced.append(os.fstat(handle).st_size)

    monkeypatch.setattr(os, "fsync", fsync)
    with Journal(path) as journal:
        for t_ns in range(3):
            journal.add("note", t_ns=t_ns)
            assert synced[-1] == path.stat().st_size > 0
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(lines[0] + lines[2])
    with pytest.raises(RecordingError, match="line 2 holds event 3"):
        read_events(path)


def test_planning_needs_no_extra_package() -> None:
    code = "import sys, tega_study, tega_study.cli; print({'scipy', 'statsmodels', 'matplotlib'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"


PHOTO = b"\xff\xd8\xff\xe0" + bytes(200)


@pytest.fixture
def study(tmp_path: Path) -> Path:
    folder = tmp_path / "study"
    write_plan(make_plan(participants=1, objects=["bottle", "bag"], trials=1, simulated=True), folder)
    led(folder, "p01", recorded=False)
    return folder


def test_what_is_given_is_kept_and_the_rest_stays(study: Path, tmp_path: Path) -> None:
    before = read_plan(study)
    assert read_objects(study) == {}
    note_object(study, "bag", mass_g=32.0, measured="kitchen scale, 1 g")
    (tmp_path / "IMG 01.JPG").write_bytes(PHOTO)
    note_object(study, "bag", stiffness_n_per_mm=0.21, photo=tmp_path / "IMG 01.JPG")
    note_object(study, "bottle", friction=0.6)
    words: dict[str, Any] = {"measured": "kitchen scale, 1 g", "photo": "objects/bag.jpg"}
    bag = ObjectFacts(mass_g=32.0, stiffness_n_per_mm=0.21, **words)
    assert read_objects(study) == {"bag": bag, "bottle": ObjectFacts(friction=0.6)}
    assert (study / "objects/bag.jpg").read_bytes() == PHOTO
    assert read_plan(study) == before


def test_what_cannot_be_is_refused_and_changes_nothing(study: Path, tmp_path: Path) -> None:
    note_object(study, "bag", mass_g=32.0)
    kept = (study / OBJECTS).read_bytes()
    for name, value in (("mass_g", -1.0), ("friction", 11.0), ("stiffness_n_per_mm", 0.0)):
        with pytest.raises(InvalidValueError, match="object bag"):
            note_object(study, "bag", photo=None, **{name: value})
    with pytest.raises(InvalidValueError, match="'vase' is not in the plan"):
        note_object(study, "vase", mass_g=1.0)
    (tmp_path / "photo.jpg").write_text("#!/bin/sh")
    with pytest.raises(InvalidValueError, match="is no JPEG"):
        note_object(study, "bag", photo=tmp_path / "photo.jpg")
    assert (study / OBJECTS).read_bytes() == kept
    for text, error in (
        ("[bag]\nmass_g = 'heavy'\n", RecordingError),
        ("[bag]\nweight = 1\n", RecordingError),
        ("[bag", RecordingError),
        ("[bag]\nphoto = '../../photo.jpg'\n", UnsafeNameError),
    ):
        (study / OBJECTS).write_text(text)
        with pytest.raises(error):
            read_objects(study)


@pytest.mark.skipif(os.name == "nt", reason="Windows has no such link")
def test_a_link_in_the_place_of_a_photo_is_replaced_and_not_followed(study: Path, tmp_path: Path) -> None:
    (tmp_path / "photo.jpg").write_bytes(PHOTO)
    (tmp_path / "mine.txt").write_text("mine")
    (study / "objects").mkdir()
    (study / "objects/bag.jpg").symlink_to(tmp_path / "mine.txt")
    note_object(study, "bag", photo=tmp_path / "photo.jpg")
    assert (tmp_path / "mine.txt").read_text() == "mine"


def test_it_goes_along_with_the_data_and_photos_stay_out_of_what_is_published(study, tmp_path):
    (tmp_path / "photo.jpg").write_bytes(PHOTO)
    bag = note_object(study, "bag", mass_g=32.0, photo=tmp_path / "photo.jpg")
    write_bundle(study, "p01", tmp_path / "p01.zip")
    open_bundle(tmp_path / "p01.zip", tmp_path / "there")
    assert read_objects(tmp_path / "there") == {"bag": bag}
    assert (tmp_path / "there/objects/bag.jpg").read_bytes() == PHOTO
    export(study, tmp_path / "open", key="secret")
    assert read_objects(tmp_path / "open") == {"bag": msgspec.structs.replace(bag, photo="")}
    assert not list((tmp_path / "open").rglob("*.jpg"))


def test_the_verb_and_the_report(study: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("matplotlib")
    pytest.importorskip("statsmodels")

    def called(*words: str) -> str:
        return call(capsys, "study", "object", study, *words)[0]

    assert "mass_g 32.0, stiffness_n_per_mm not known" in called(
        "bag", "--mass-g", "32", "--measured", "a <scale>"
    )
    assert json.loads(called("bag", "--json"))["mass_g"] == 32.0
    page = report_html(analyse_study(study)[0], {})
    assert "<h2>Objects</h2>" in page
    assert "32.0" in page
    assert "a &lt;scale&gt;" in page


def forms_of(folder: Path, **settings: Any) -> dict[str, str]:
    pytest.importorskip("jinja2")
    write_plan(make_plan(**{"participants": 4, "objects": ["cup", "bag"], **settings}), folder / "study")
    return {path.name: path.read_text() for path in write_forms(folder / "study", folder / "forms")}


def test_the_forms_say_what_the_plan_says(tmp_path: Path) -> None:
    conditions = ["haptic", "non-haptic", "event-gated"]
    message = forms_of(tmp_path / "a", trials=3, conditions=conditions, window_s=20.0)
    assert set(message) == set(FORMS)
    consent = message["consent.md"]
    assert "There are 18 trials of up to 20 s each" in consent
    assert "lift cup, bag" in consent
    assert "3 conditions are compared: haptic, non-haptic, event-gated" in consent
    assert "beeps" not in consent
    assert "with 4 people" in message["data-protection.md"]
    assert not any("{{" in text or "{%" in text for text in message.values())
    assert all("no legal advice" in text and "[" in text for text in message.values())
    assert "beeps, which you answer with a foot pedal" in forms_of(tmp_path / "b", probe=True)["consent.md"]


def test_the_minutes_are_those_that_plan_prints(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("jinja2")
    study = tmp_path / "study"
    printed, _ = call(capsys, "study", "plan", "--participants", 2, "--anyway", "--out", study)
    call(capsys, "study", "forms", study, "--out", tmp_path / "forms")
    consent = (tmp_path / "forms/consent.md").read_text()
    rests, total = (consent.split(f"{text} ")[1].split()[0] for text in ("rests that take", "takes about"))
    assert f"rests alone take {rests} min a person; with 15 s a trial {total} min" in printed


def test_a_form_that_is_there_is_kept(tmp_path: Path) -> None:
    forms_of(tmp_path)
    (tmp_path / "forms/consent.md").unlink()
    (tmp_path / "forms/data-protection.md").write_text("completed")
    with pytest.raises(InvalidValueError, match="is there already"):
        write_forms(tmp_path / "study", tmp_path / "forms")
    assert (tmp_path / "forms/data-protection.md").read_text() == "completed"
    assert not (tmp_path / "forms/consent.md").exists()
