"""Consent form and data protection sheet say what the plan says, and no completed form is written over."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("jinja2")

from reference.command import call
from tega.errors import InvalidValueError
from tega_study.page import FORMS, write_forms
from tega_study.plan import make_plan, write_plan


def forms_of(folder: Path, **settings: Any) -> dict[str, str]:
    write_plan(make_plan(**{"participants": 4, "objects": ["cup", "bag"], **settings}), folder / "study")
    return {path.name: path.read_text() for path in write_forms(folder / "study", folder / "forms")}


def test_the_forms_say_what_the_plan_says(tmp_path: Path) -> None:
    message = forms_of(
        tmp_path / "a", trials=3, conditions=["haptic", "non-haptic", "event-gated"], window_s=20.0
    )
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
    rests, total = (
        consent.split("rests that take ")[1].split()[0],
        consent.split("takes about ")[1].split()[0],
    )
    assert f"rests alone take {rests} min a person; with 15 s a trial {total} min" in printed


def test_a_form_that_is_there_is_kept(tmp_path: Path) -> None:
    forms_of(tmp_path)
    (tmp_path / "forms/consent.md").unlink()
    (tmp_path / "forms/data-protection.md").write_text("completed")
    with pytest.raises(InvalidValueError, match="is there already"):
        write_forms(tmp_path / "study", tmp_path / "forms")
    assert (tmp_path / "forms/data-protection.md").read_text() == "completed"
    assert not (tmp_path / "forms/consent.md").exists()
