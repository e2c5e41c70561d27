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

SETTINGS = """
[tactile.thumb]
driver = "digit"
options = { serial = "D20641" }
[emg]
driver = "chords"
kind = "raw"
options = { port = "/dev/ttyUSB0" }
[vest]
driver = "bhaptics-player"
"""


@pytest.fixture
def lab(tmp_path: Path) -> Path:
    (tmp_path / "lab.toml").write_text(SETTINGS, encoding="utf-8")
    return tmp_path


def reported(lab: Path, *sets: str, now: datetime = NOW) -> list[Finding]:
    config = load_config(lab / "lab.toml", environ={}, sets=sets).config
    found = check_calibration(config, settings="lab.toml", now=now)
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


def test_where_no_person_is_named_those_there_are_named(lab: Path) -> None:
    keep_all(lab)
    (finding,) = reported(lab)
    assert finding.status == "warning"
    assert "there are those of p01" in finding.finding
    assert finding.todo[0].endswith("\ntega-teleop doctor lab.toml --person p01")


def test_one_that_is_there_and_fresh_is_fine(lab: Path) -> None:
    keep_all(lab)
    (finding,) = reported(lab, "calibration.person=p01")
    assert finding.status == "ok"
    assert finding.finding == (
        "p01's calibration is there and fresh: thumb, EMG, vest (8 of 8 places named right)"
    )


def test_what_is_missing_of_a_person_names_whose_there_is_and_the_command(lab: Path) -> None:
    keep_all(lab)
    thumb, emg, vest = reported(lab, "calibration.person=p02")
    assert (thumb.status, emg.status) == ("missing", "missing")
    assert "p02 has no calibration on D20641 (there is one of p01)" in thumb.finding
    assert thumb.todo == ("run this:\ntega-teleop calibrate lab.toml --person p02 --only tactile",)
    assert emg.todo == ("run this:\ntega-teleop calibrate lab.toml --person p02 --only emg",)
    assert vest.status == "warning"  # a run goes without thresholds
    assert vest.todo == ("run this:\ntega-teleop calibrate lab.toml --person p02 --only vest",)


def test_a_copied_one_is_foreign(lab: Path) -> None:
    keep_all(lab)
    write_record(touch(person="p07"), lab / "calibrations" / "people" / "p01" / "touch-D20641.toml")
    fine, foreign = reported(lab, "calibration.person=p01")
    assert fine.status == "ok"
    assert foreign.status == "error"
    assert "was made for p07 on D20641, not for p01" in foreign.finding
    assert foreign.todo == ("run this:\ntega-teleop calibrate lab.toml --person p01 --only tactile",)


def test_one_made_another_way_is_wrong(lab: Path) -> None:
    keep_all(lab, kind="envelope")
    _, wrong = reported(lab, "calibration.person=p01")
    assert wrong.status == "error"
    assert "was calibrated with kind = envelope, the settings have raw" in wrong.finding


def test_an_old_one_is_told_with_its_age(lab: Path) -> None:
    keep_all(lab, made=NOW - timedelta(days=40))
    found = reported(lab, "calibration.person=p01")
    fine, thumb, emg = found
    assert "fresh: vest (8 of 8" in fine.finding  # that is good for 90 days
    assert (thumb.status, emg.status) == ("warning", "warning")
    assert thumb.finding == "thumb: maxima: 40 days old, warned of after 720 hours"
    assert emg.finding == "EMG: 40 days old, warned of after 12 hours"
    assert emg.todo == ("run this:\ntega-teleop calibrate lab.toml --person p01 --refresh",)


def test_a_damaged_one_is_wrong(lab: Path) -> None:
    keep_all(lab)
    (lab / "calibrations" / "people" / "p01" / "emg-ttyUSB0.toml").write_text("format =", encoding="utf-8")
    _, wrong = reported(lab, "calibration.person=p01")
    assert wrong.status == "error"
    assert "not valid TOML" in wrong.finding


def test_a_file_that_does_not_fit_or_is_not_there(lab: Path) -> None:
    (missing,) = reported(lab, f"calibration.file={lab / 'none.toml'}")
    assert missing.status == "missing"
    (wrong,) = reported(lab, f"calibration.file={muscle_file(lab, 1.0, rate_hz=500.0)}")
    assert wrong.status == "error"
    assert wrong.finding == "c.toml: has no maxima for finger 'thumb'"
    assert wrong.todo[-1].endswith("tega-teleop calibrate lab.toml --person ID")


def test_recordings_need_none(tmp_path: Path) -> None:
    (tmp_path / "lab.toml").write_text(
        '[tactile.thumb]\ndriver = "synthetic-touch"\noptions = { seed = 1, duration_s = 1.0 }\n',
        encoding="utf-8",
    )
    assert reported(tmp_path) == []


def test_the_verb_takes_a_person(lab: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (lab / "lab.toml").write_text(
        '[tactile.thumb]\ndriver = "digit"\noptions = { serial = "D20641" }\n', encoding="utf-8"
    )
    CalibrationFolder(lab / "calibrations").keep(touch(made=datetime.now(UTC)))
    out, _ = call(
        capsys, "doctor", lab / "lab.toml", "--person", "p01", "--json", code=3
    )  # there is no sensor
    findings = {f["check"]: f for f in json.loads(out)["findings"]}
    assert findings["calibration"]["finding"] == "p01's calibration is there and fresh: thumb"
