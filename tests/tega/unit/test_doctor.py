"""The doctor on empty and whole benches and drivers that go wrong, and the settings that ``init`` writes."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import threading
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from reference.command import call
from tega.config import load_config
from tega.config.calibration import load_calibration
from tega.devices import Found
from tega.errors import ConfigError
from tega.loop import run_session
from tega.setup.doctor import examine, lab_settings, probe_drivers
from tega.setup.doctor.bench import POLL_S, ROLES, TRY_S, DriverProbe, in_time, probe_all, try_all
from tega.setup.doctor.findings import DriverCase, holders
from tega.stages.registry import unit_of
from tega_emulators.emulated_bench import EmulatedBench
from tega_emulators.vest_bench import seen_by


def test_looking_around_ends_within_ten_seconds_whatever_hangs() -> None:
    assert POLL_S + TRY_S <= 9.5  # half a second is left for starting and printing
    never = threading.Event()
    answers = in_time({"hangs": never.wait, "answers": lambda: True}, 0.05, lambda key, s: f"{key} {s:g}")
    assert answers == {"hangs": "hangs 0.05", "answers": True}
    never.set()


@pytest.mark.slow
def test_an_empty_bench_is_told_kindly_and_ends_with_3(tmp_path: Path) -> None:
    # A program that hears no stream of another program on this network.
    alone = tmp_path / "lsl_api.cfg"
    alone.write_text(f"[lab]\nSessionID = {tmp_path.name}\n[log]\nlevel = -2\n")
    env, doctor = {**os.environ, "LSLAPICFG": str(alone)}, [sys.executable, "-m", "tega.ui.cli", "doctor"]
    run = partial(subprocess.run, env=env, capture_output=True, text=True, check=False)
    json_text, text = run([*doctor, "--json"]), run(doctor)
    message = json.loads(json_text.stdout)
    if any(f["device"] for f in message["findings"]):
        pytest.skip("something is attached to this machine")
    assert set(message) == {"format", "version", "settings", "ok", "exit_code", "findings"}
    assert (message["format"], message["version"], message["settings"]) == ("tega-doctor", 1, None)
    assert (message["ok"], message["exit_code"], json_text.returncode) == (False, 3, 3)
    assert [f["check"] for f in message["findings"]] == list(ROLES)
    for finding in message["findings"]:
        keys = {"check", "status", "finding", "why", "todo", "driver", "device", "measured"}
        assert set(finding) == keys
        assert finding["status"] == "missing"
        assert all(finding[key] for key in ("finding", "why", "todo"))
    assert text.returncode == 3
    assert "up to 10 s" in text.stderr
    assert "No DIGIT is plugged in" in text.stdout
    # A command stands on a line of its own, whole.
    command = "sudo ip link set can0 up type can bitrate 1000000 restart-ms 100"
    assert command in [line.strip() for line in text.stdout.splitlines()]
    assert "tega-teleop demo" in text.stdout


def test_every_driver_with_hardware_can_say_what_is_there() -> None:
    named = {"allegro", "bhaptics-ble", "bhaptics-player", "cyton", "digit", "hid-vest"}
    assert set(probe_drivers()) >= named


@pytest.mark.slow
def test_a_bench_with_every_emulator_up_is_fine_and_its_settings_can_start_a_run(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    settings = tmp_path / "lab.toml"
    with EmulatedBench() as bench:
        bench.write_settings(settings)
        out, _ = call(capsys, "doctor", settings, "--json", code=0)
        # Nothing was felt, and nothing moved.
        assert not any(any(motors) for _, motors in seen_by(bench.player).history)
        hand = bench.hand.say("look")
        assert not hand["servo_on"]
        assert not any(hand["duties"])
    message = json.loads(out)
    assert {f["status"] for f in message["findings"]} <= {"ok", "warning"}
    assert {f["check"] for f in message["findings"] if f["status"] == "ok"} >= {"emg", "vest", "hand"}
    assert message["settings"] == "lab.toml"
    emg = next(f for f in message["findings"] if f["check"] == "emg")
    assert emg["measured"]["rate_hz"] > 0
    config = load_config(settings, environ={}).config
    assert list(config.tactile) == ["thumb", "index"]
    assert all(c.baseline is not None and c.baseline.is_file() for c in config.tactile.values())
    assert config.calibration.file is not None
    assert load_calibration(config.calibration.file).origin == "made up for the emulated devices"


def test_packages_that_drivers_need_to_look_are_told_once(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in ("serial", "serial.tools", "serial.tools.list_ports"):
        monkeypatch.setitem(sys.modules, module, None)
    findings = probe_all().findings
    (packages,) = [f for f in findings if f.check == "packages"]
    assert packages.todo == ("install it with: pip install 'tega[lab]'",)
    assert "cyton, serial-emg" in packages.why
    # What was not looked for is not called absent.
    assert not any("no USB serial port" in f.why for f in findings)


def test_an_unexpected_error_of_one_driver_is_one_finding() -> None:
    findings = try_all([DriverCase("emg", "emg", "emg-file", object())], 5.0)
    assert findings[0].status == "error"
    assert "unexpected AttributeError" in findings[0].finding


@pytest.mark.skipif(not Path("/proc/self/fd").exists(), reason="only Linux tells")
def test_who_holds_a_device_is_named(tmp_path: Path) -> None:
    device = tmp_path / "video0"
    device.write_text("")
    with device.open():
        (holder,) = holders(str(device))
    assert holder.endswith(")")
    assert holders(str(device)) == []


def test_the_rules_are_printed_and_allow_what_the_drivers_open(capsys: pytest.CaptureFixture[str]) -> None:
    out, _ = call(capsys, "doctor", "--udev-rules", code=0)
    rules = [line for line in out.splitlines() if line and not line.startswith("#")]
    clause = r'[A-Z]+(?:\{[A-Za-z_]+\})?(?:==|=|\+=)"[^"]*"'
    for rule in rules:
        assert re.fullmatch(rf"{clause}(?:, {clause})*", rule), rule
    for vendor in ("2833", "1209", "256f"):
        assert any(f'"{vendor}"' in rule for rule in rules)
    assert "/etc/udev/rules.d/70-tega.rules" in out


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


def test_a_key_has_the_unit_that_its_end_names() -> None:
    units = {
        "stages.reflex.rise_levels_per_s": "levels/s",
        "stages.adaptation.gain_percent_per_min": "%/min",
        "stages.metric.mm_per_px": "mm/px",
        "stages.reflex.options.full_slip_mm_s": "mm/s",
        "arm.limits.turn_acceleration_rad_s2": "rad/s²",
        "arm.options.stiffness_nm_rad": "N·m/rad",
        "vest.rate_hz": "Hz",
        "session.per_person": "",
    }
    assert {key: unit_of(key) for key in units} == units


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
