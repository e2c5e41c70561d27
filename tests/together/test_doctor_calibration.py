"""The doctor looks at the calibration that a run would use: is there one, is it this person's, is it fresh."""

from __future__ import annotations

import json
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from reference.command import call
from reference.kept import NOW, muscle_file, muscles, touch, worn
from tega.config import load_config
from tega.config.calibration.folder import CalibrationFolder
from tega.config.calibration.records import write_record
from tega.config.person import driver_settings
from tega.setup.doctor.findings import Finding
from tega.setup.doctor.settings import check_calibration

THUMB = '[tactile.thumb]\ndriver = "digit"\noptions = { serial = "D20641" }\n'
SETTINGS = f"""{THUMB}
[emg]
driver = "chords"
kind = "raw"
options = {{ port = "/dev/ttyUSB0" }}
[vest]
driver = "bhaptics-player"
"""


@pytest.fixture
def lab(tmp_path: Path) -> Path:
    (tmp_path / "lab.toml").write_text(SETTINGS, encoding="utf-8")
    return tmp_path


def reported(lab: Path, *sets: str) -> list[Finding]:
    config = load_config(lab / "lab.toml", environ={}, sets=sets).config
    found = check_calibration(config, settings="lab.toml", now=NOW)
    assert {f.check for f in found} <= {"calibration"}
    return found


def keep_all(lab: Path, made: datetime = NOW, kind: str = "raw") -> None:
    config = load_config(lab / "lab.toml", environ={}).config
    assert config.emg is not None
    home = CalibrationFolder(lab / "calibrations")
    home.keep(touch(made=made))
    home.keep(muscles(settings=driver_settings(config.emg), kind=kind, made=made))
    home.keep(worn(made=made))


def test_without_one_the_next_command_stands_there(lab: Path) -> None:
    (finding,) = reported(lab)
    assert finding.status == "missing"
    assert finding.finding == "there is no calibration for thumb, EMG"
    assert finding.todo[0].endswith("\ntega-teleop calibrate lab.toml --person ID")


def test_the_person_s_own_is_looked_at_and_no_other(lab: Path) -> None:
    keep_all(lab)
    (nobody,) = reported(lab)
    assert nobody.status == "warning"
    assert "there are those of p01" in nobody.finding
    assert nobody.todo[0].endswith("\ntega-teleop doctor lab.toml --person p01")
    (mine,) = reported(lab, "calibration.person=p01")
    assert mine.status == "ok"
    assert mine.finding == (
        "p01's calibration is there and fresh: thumb, EMG, vest (8 of 8 places named right)"
    )
    found = reported(lab, "calibration.person=p02")
    assert [f.status for f in found] == ["missing", "missing", "warning"]  # a run goes without thresholds
    assert "p02 has no calibration on D20641 (there is one of p01)" in found[0].finding
    command = "run this:\ntega-teleop calibrate lab.toml --person {} --only {}"
    assert [f.todo for f in found] == [(command.format("p02", one),) for one in ("tactile", "emg", "vest")]
    people = lab / "calibrations" / "people" / "p01"
    write_record(touch(person="p07"), people / "touch-D20641.toml")
    fine, copied = reported(lab, "calibration.person=p01")
    assert (fine.status, copied.status) == ("ok", "error")
    assert "was made for p07 on D20641, not for p01" in copied.finding
    assert copied.todo == (command.format("p01", "tactile"),)
    (people / "emg-ttyUSB0.toml").write_text("format =", encoding="utf-8")
    *_, damaged = reported(lab, "calibration.person=p01")
    assert damaged.status == "error"
    assert "not valid TOML" in damaged.finding


def test_one_made_another_way_is_wrong_and_an_old_one_told_with_its_age(lab: Path) -> None:
    keep_all(lab, kind="envelope")
    _, wrong = reported(lab, "calibration.person=p01")
    assert wrong.status == "error"
    assert "was calibrated with kind = envelope, the settings have raw" in wrong.finding
    keep_all(lab, made=NOW - timedelta(days=40))
    fine, thumb, emg = reported(lab, "calibration.person=p01")
    assert "fresh: vest (8 of 8" in fine.finding  # that is good for 90 days
    assert (thumb.status, emg.status) == ("warning", "warning")
    assert thumb.finding == "thumb: maxima: 40 days old, warned of after 720 hours"
    assert emg.finding == "EMG: 40 days old, warned of after 12 hours"
    assert emg.todo == ("run this:\ntega-teleop calibrate lab.toml --person p01 --refresh",)


def test_a_file_that_does_not_fit_or_is_not_there(lab: Path) -> None:
    (missing,) = reported(lab, f"calibration.file={lab / 'none.toml'}")
    assert missing.status == "missing"
    (wrong,) = reported(lab, f"calibration.file={muscle_file(lab, 1.0, rate_hz=500.0)}")
    assert wrong.status == "error"
    assert wrong.finding == "c.toml: has no maxima for finger 'thumb'"
    assert wrong.todo[-1].endswith("tega-teleop calibrate lab.toml --person ID")


def test_recordings_need_none(lab: Path) -> None:
    (lab / "lab.toml").write_text('[tactile.thumb]\ndriver = "synthetic-touch"\n', encoding="utf-8")
    assert reported(lab) == []


def test_the_verb_takes_a_person(lab: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (lab / "lab.toml").write_text(THUMB, encoding="utf-8")
    CalibrationFolder(lab / "calibrations").keep(touch(made=datetime.now(UTC)))
    words = ("doctor", lab / "lab.toml", "--person", "p01", "--json")
    out, _ = call(capsys, *words, code=3)  # there is no sensor
    findings = {f["check"]: f for f in json.loads(out)["findings"]}
    assert findings["calibration"]["finding"] == "p01's calibration is there and fresh: thumb"
