"""Settings files that ``init`` writes from what was found."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from reference.command import call
from tega.config import load_config
from tega.setup.doctor.bench import DriverProbe


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
    from tega.devices import Found
    from tega.setup.doctor import lab_settings

    digits = [
        Found(driver="digit", label=f"D{n}", options={"serial": f"D{n}"}, problem="busy" if n == 3 else "")
        for n in range(6)
    ]
    board = Found(driver="serial-emg", label="/dev/ttyACM0", options={"port": "/dev/ttyACM0"})
    stream = Found(driver="lsl-emg", label="amp", options={"by": "source_id", "value": 'a"b\\c'})
    vest = Found(driver="bhaptics-ble", label="X40", options={"address": "AA:BB"})
    hand = Found(
        driver="allegro",
        label="can0\n[evil]",
        options={"interface": "socketcan", "channel": "can0"},
        problem="down",
        hint="do:\nip link",
    )
    path = tmp_path / "lab.toml"
    looked: dict[str, Any] = {
        "digit": DriverProbe("tactile", digits),
        "serial-emg": DriverProbe("emg", [board]),
        "lsl-emg": DriverProbe("emg", [stream]),
        "bhaptics-ble": DriverProbe("vest", [vest]),
        "allegro": DriverProbe("hand", [hand]),
    }
    path.write_text(lab_settings(looked, name=path.name))
    config = load_config(path, environ={}).config
    # The one that cannot be used goes last, and with six found it has no finger.
    assert [c.options.serial for c in config.tactile.in_use().values()] == ["D0", "D1", "D2", "D4"]
    assert config.emg is not None
    assert config.emg.options.value == 'a"b\\c'
    assert config.vest.options.limit == 60
    assert (config.hand.options.torque_share, config.hand.options.side) == (0.3, "right")
    text = path.read_text()
    assert 'also found: /dev/ttyACM0: driver = "serial-emg"' in text
    assert "# Not usable yet: down" in text


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="emulated serial devices need pseudo-terminals")
def test_ctrl_c_ends_emulated_devices_without_a_traceback(tmp_path: Path) -> None:
    """A terminal sends Ctrl-C to every program of its foreground: command and emulators alike."""
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
