"""Mistakes of a first day: each gets the next step."""

from __future__ import annotations

from pathlib import Path

import pytest

from reference.command import call
from tega.config import load_config
from tega.errors import ConfigError
from tega.setup.contract.command import main as contract


@pytest.mark.parametrize(
    ("item", "key"),
    [
        ("pace=fast", "session.pace' or 'vest.pace"),
        ("out_dir=x", "session.out_dir"),
        ("vest.duration_s=3", "session.duration_s"),
    ],
)
def test_a_setting_of_another_table_is_suggested_whole(item: str, key: str) -> None:
    with pytest.raises(ConfigError) as refused:
        load_config(None, environ={}, sets=[item])
    assert refused.value.hint == f"did you mean '{key}'?"


def test_numbers_of_the_settings_have_no_rounding_noise(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "lab.toml"
    file.write_text("[session]\nduration_s = 5.9999999999999995e-5\n[vest]\nthreshold = 30.000000000000004\n")
    out, _ = call(capsys, "config", "show", file, "--changed")
    assert [line.split()[1] for line in out.splitlines()] == ["0.00006", "30"]


@pytest.mark.parametrize("verb", ["play", "verify"])
def test_a_folder_of_tables_is_no_recording(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, verb: str
) -> None:
    folder = tmp_path / "results"
    folder.mkdir()
    (folder / "vest.csv").write_text("t_s\n")
    monkeypatch.chdir(folder)
    for named in (folder, "."):
        _, err = call(capsys, verb, named, code=1)
        assert "error: results: holds a run's tables, not a recording" in err
        assert "--record" in err


@pytest.mark.parametrize("name", ["x.xyz", "x", "x.svg"])
def test_a_picture_that_is_no_png_is_refused_before_the_work(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    for verb in ("audit", "verify", "replay"):
        _, err = call(capsys, verb, tmp_path, "--picture", tmp_path / name, code=2)
        assert "name it x.png" in err


def test_a_contract_of_no_driver_and_no_stage(capsys: pytest.CaptureFixture[str]) -> None:
    for name, hint in (("nonsense", "drivers and stages: "), ("alegro", "did you mean 'allegro'?")):
        with pytest.raises(SystemExit) as ended:
            contract([name])
        assert ended.value.code == 2
        err = capsys.readouterr().err
        assert f"no driver or stage is called {name!r}" in err
        assert hint in err
