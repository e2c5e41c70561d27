"""What stands beside a plan: objects' properties go along with the data, and forms say what the plan says."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("jinja2")

import msgspec

from reference.command import call
from reference.study_bench import led
from tega.errors import InvalidValueError, RecordingError, UnsafeNameError
from tega_study.analyse import analyse_study
from tega_study.bundle import open_bundle, write_bundle
from tega_study.page import FORMS, report_html, write_forms
from tega_study.plan import make_plan, read_plan, write_plan
from tega_study.privacy import export
from tega_study.study_notes import OBJECTS, ObjectFacts, note_object, read_objects

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


def test_it_goes_along_with_the_data_and_photos_stay_out_of_what_is_published(
    study: Path, tmp_path: Path
) -> None:
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
