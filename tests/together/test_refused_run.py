"""A run that is refused changes nothing in the folder of the run before, which may still go on."""

from __future__ import annotations

from pathlib import Path

import pytest

from tega.config import check_tree
from tega.errors import ConfigError, DeviceUnavailableError
from tega.loop import run_session

EMG = {"driver": "synthetic-emg", "kind": "raw", "options": {"duration_s": 0.5}}
AWAY = {"driver": "serial-emg", "kind": "raw", "options": {"port": "/dev/ttyNone", "rate_hz": 500.0}}


def content(folder: Path) -> dict[str, bytes]:
    return {str(f.relative_to(folder)): f.read_bytes() for f in sorted(folder.rglob("*")) if f.is_file()}


@pytest.mark.parametrize(
    "broken",
    [
        {"emg": AWAY},
        {"emg": EMG, "hand": {"driver": "python-can", "options": {"interface": "none", "channel": "x"}}},
        {"emg": EMG, "input": {"marker": {"driver": "pedal", "button": "b", "options": {"serial": "none"}}}},
    ],
    ids=["amplifier", "hand", "pedal"],
)
def test_the_results_of_the_run_before_stay_where_they_are(tmp_path: Path, broken: dict[str, object]) -> None:
    session = {"pace": "fast", "out_dir": str(tmp_path / "results")}
    run_session(check_tree({"session": session, "emg": EMG}, {}, base=tmp_path).config)
    before = content(tmp_path / "results")
    assert "levels.csv" in before
    session["pace"] = "real"
    refused = check_tree({"session": session, **broken}, {}, base=tmp_path).config
    with pytest.raises((DeviceUnavailableError, ConfigError)):
        run_session(refused)
    assert content(tmp_path / "results") == before


def test_a_folder_that_cannot_be_used_is_refused_before_any_device_is_opened(tmp_path: Path) -> None:
    (tmp_path / "thesis.txt").write_text("mine")
    session = {"out_dir": str(tmp_path)}
    with pytest.raises(ConfigError, match="not empty and holds no earlier run"):
        run_session(check_tree({"session": session, "emg": AWAY}, {}, base=tmp_path).config)
    assert content(tmp_path) == {"thesis.txt": b"mine"}
