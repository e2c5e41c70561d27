"""The doctor: what it says of benches that are empty and whole, and of drivers that go wrong."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import threading
from functools import partial
from pathlib import Path

import pytest

from reference.command import call
from tega.config import load_config
from tega.config.calibration import load_calibration
from tega.setup.doctor import probe_drivers
from tega.setup.doctor.bench import POLL_S, ROLES, TRY_S, in_time, probe_all, try_all
from tega.setup.doctor.findings import DriverCase, holders
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
