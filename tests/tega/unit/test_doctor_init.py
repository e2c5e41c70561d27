"""What init writes, and the first hour: units, changed settings, refused ones."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from reference.command import call
from tega.config import load_config
from tega.devices import Found
from tega.errors import ConfigError
from tega.loop import run_session
from tega.setup.doctor import examine, lab_settings
from tega.setup.doctor.bench import DriverProbe
from tega.stages.registry import unit_of


def test_init_never_overwrites_by_itself(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "lab.toml"
    out.write_text("mine")
    _, err = call(capsys, "init", "--out", out, code=1)
    assert "nothing was written" in err
    assert out.read_text() == "mine"
    message, _ = call(capsys, "init", "--out", out, "--force", code=0)
    assert f"tega-teleop doctor {out}" in message
    assert call(capsys, "config", "check", out, code=0)[0] == "lab.toml: ok\n"


def test_what_is_written_holds_what_was_found(tmp_path: Path) -> None:
    def found(driver: str, label: str, problem: str = "", **options: str) -> Found:
        return Found(driver=driver, label=label, options=options, problem=problem, hint="do:\nip link")

    digits = [found("digit", f"D{n}", "busy" if n == 3 else "", serial=f"D{n}") for n in range(6)]
    hand = found("allegro", "can0\n[evil]", "down", interface="socketcan", channel="can0")
    path = tmp_path / "lab.toml"
    looked: dict[str, Any] = {
        "digit": DriverProbe("tactile", digits),
        "serial-emg": DriverProbe("emg", [found("serial-emg", "/dev/ttyACM0", port="/dev/ttyACM0")]),
        "cyton": DriverProbe("emg", [found("cyton", "amp", port='a"b\\c')], likelihood=1),
        "bhaptics-ble": DriverProbe("vest", [found("bhaptics-ble", "X40", address="AA:BB")]),
        "allegro": DriverProbe("hand", [hand]),
    }
    path.write_text(lab_settings(looked, name=path.name))
    config = load_config(path, environ={}).config
    # The one that cannot be used goes last, and with six found it has no finger.
    assert [c.options.serial for c in config.tactile.values()] == ["D0", "D1", "D2", "D4"]
    assert config.emg is not None
    assert config.emg.options.port == 'a"b\\c'
    assert config.vest.options.limit == 60
    assert (config.hand.options.torque_share, config.hand.options.side) == (0.3, "right")
    text = path.read_text()
    assert 'also found: /dev/ttyACM0: driver = "serial-emg"' in text
    assert "# Not usable yet: down" in text


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="emulated serial devices need pseudo-terminals")
def test_ctrl_c_ends_emulated_devices_without_a_traceback(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "tega.ui.cli", "init", "--emulated", "--out", str(tmp_path / "lab.toml")]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        while "Ctrl-C" not in process.stdout.readline():
            assert process.poll() is None
        os.killpg(process.pid, signal.SIGINT)
        message = process.stderr.read()
        code = process.wait(60)
    assert "Traceback" not in message, message
    assert code in {0, 130}


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


def test_only_changed_settings_are_shown(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "lab.toml"
    digit = '[tactile.thumb]\ndriver = "digit"\noptions = { serial = "D2" }\n'
    file.write_text(f'[session]\npreset = "paper"\n[vest]\nthreshold = 30\n{digit}')
    out, _ = call(capsys, "config", "show", "--changed", "--json", file)
    changed = {row["key"]: row["value"] for row in json.loads(out)}
    assert changed == {
        "session.preset": "paper",
        "vest.threshold": 30,
        "tactile.thumb.driver": "digit",
        "tactile.thumb.options.serial": "D2",
    }
    assert call(capsys, "config", "show", "--changed")[0] == "every setting has its default value\n"


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
    assert "Did you mean verify?" in call(capsys, "verfy", code=2)[1]
