"""The first hour: units of settings, changed settings, settings that `run` refuses, unknown verbs."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tega.config import load_config
from tega.errors import ConfigError
from tega.loop import run_session
from tega.setup.doctor import examine
from tega.stages.units import unit_of
from tega.ui.cli.main import main


@pytest.mark.parametrize(
    ("key", "unit"),
    [
        ("stages.reflex.rise_levels_per_s", "levels/s"),
        ("stages.adaptation.gain_percent_per_min", "%/min"),
        ("stages.metric.mm_per_px", "mm/px"),
        ("vest.rate_hz", "Hz"),
        ("session.per_person", ""),
    ],
)
def test_a_key_has_the_unit_that_its_end_names(key: str, unit: str) -> None:
    assert unit_of(key) == unit


def _text(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[str, str]:
    with pytest.raises(SystemExit):
        main(words)
    out, err = capsys.readouterr()
    return out, err


def test_only_changed_settings_are_shown(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "lab.toml"
    file.write_text('[session]\npreset = "paper"\n[vest]\nthreshold = 30\n')
    out, _ = _text(capsys, "config", "show", "--changed", "--json", str(file))
    assert {row["key"]: row["value"] for row in json.loads(out)} == {
        "session.preset": "paper",
        "vest.threshold": 30,
    }
    file.write_text('[tactile.thumb]\ndriver = "digit"\noptions = { serial = "D2" }\n')
    out, _ = _text(capsys, "config", "show", "--changed", "--json", str(file))
    assert {row["key"]: row["value"] for row in json.loads(out)} == {
        "tactile.thumb.driver": "digit",
        "tactile.thumb.options.serial": "D2",
    }
    out, _ = _text(capsys, "config", "show", "--changed")
    assert out == "every setting has its default value\n"


@pytest.mark.parametrize(
    "settings", ["", '[vest]\ndriver = "vest-recorder"\n[vest.options]\nfile = "v.csv"\n']
)
def test_the_doctor_refuses_settings_that_run_refuses(tmp_path: Path, settings: str) -> None:
    file = tmp_path / "lab.toml"
    file.write_text(settings)
    config = load_config(file, environ={}).config
    with pytest.raises(ConfigError, match="no input"):
        run_session(config)
    examination = examine(config, name=file.name)
    assert examination.exit_code == 3
    assert "error" in {finding.status for finding in examination.findings if finding.check == "settings"}


def test_an_unknown_verb_gets_the_nearest(capsys: pytest.CaptureFixture[str]) -> None:
    _, err = _text(capsys, "verfy")
    assert "Did you mean verify?" in err
    _, err = _text(capsys, "doctr")
    assert "doctor" in err
