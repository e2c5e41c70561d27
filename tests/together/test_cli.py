"""The command line: help, exit codes, JSON, interruption. Replay has its own file."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import click
import numpy as np
import pytest

from reference.command import call
from reference.recordings import squeezes, write_folder
from tega.ui.cli.main import cli

SESSION = """
[session]
out_dir = "out"
[tactile.thumb]
driver = "images"
options = { folder = "thumb" }
[emg]
driver = "emg-file"
kind = "raw"
options = { file = "emg.npy", rate_hz = 200.0 }
[hand]
driver = "python-can"
options = { interface = "virtual", channel = "cli" }
"""
DEVICE_KEYS = {"name", "kind", "summary", "package", "ready", "problem", "found", "could_not"}


@pytest.fixture
def session(tmp_path: Path) -> Path:
    write_folder(tmp_path / "thumb", 30)
    np.save(tmp_path / "emg.npy", squeezes(400, 200.0))
    path = tmp_path / "session.toml"
    path.write_text(SESSION)
    return path


def test_the_bare_program_greets_and_says_what_to_type_first(capsys: pytest.CaptureFixture[str]) -> None:
    message, wrong = call(capsys)
    assert wrong == ""
    typed = [line.split()[1] for line in message.splitlines() if line.startswith("  tega-teleop ")]
    assert typed[0] == "demo"
    assert set(typed) <= {*cli.list_commands(click.Context(cli)), "--help"}


def test_help_lists_every_verb_by_life_cycle(capsys: pytest.CaptureFixture[str]) -> None:
    out, _ = call(capsys, "--help")
    assert out.index("Start:") < out.index("replay") < out.index("Prepare:") < out.index("devices  ")
    assert out.index("Groups:") < out.index("config  ")


def test_help_and_import_load_nothing_heavy() -> None:
    script = (
        "import sys\nfrom tega.ui.cli.main import main\nfor verb in ([], ['replay'], ['devices']):\n"
        "    try:\n        main([*verb, '--help'])\n    except SystemExit:\n        pass\n"
        "print([m for m in ('numpy', 'cv2', 'rich', 'scipy', 'can', 'msgspec') if m in sys.modules])\n"
    )
    out = subprocess.check_output([sys.executable, "-c", script], text=True)
    assert out.splitlines()[-1] == "[]"


def test_the_version_is_that_of_the_package(capsys: pytest.CaptureFixture[str]) -> None:
    import tega

    assert call(capsys, "--version")[0] == f"tega {tega.__version__}\n"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["walk"], "No such command 'walk'"),
        (["replay"], "--out"),
        (["devices", "--fast"], "--fast"),
    ],
)
def test_wrong_use_ends_with_code_2(
    capsys: pytest.CaptureFixture[str], words: list[str], message: str
) -> None:
    _, err = call(capsys, *words, code=2)
    assert message in err


def test_devices_as_text_and_json(capsys: pytest.CaptureFixture[str]) -> None:
    text, _ = call(capsys, "devices")
    records: list[dict[str, Any]] = json.loads(call(capsys, "devices", "--json")[0])
    assert {"images", "video", "emg-file", "vest-recorder", "can-recorder", "python-can"} <= {
        r["name"] for r in records
    }
    assert all(set(r) == DEVICE_KEYS for r in records)
    assert all(r["name"] in text for r in records)


def test_config_show_and_check(capsys: pytest.CaptureFixture[str], session: Path) -> None:
    out, _ = call(capsys, "config", "show", session, "--set", "session.preset=paper")
    assert [line.split() for line in out.splitlines() if line.startswith("session.preset")] == [
        ["session.preset", "paper", "--set"]
    ]
    values = {v["key"]: v for v in json.loads(call(capsys, "config", "show", session, "--json")[0])}
    assert values["emg.options.rate_hz"] == {
        "key": "emg.options.rate_hz",
        "value": 200.0,
        "unit": "Hz",
        "origin": "session.toml:10",
    }
    assert values["vest.rate_hz"]["origin"] == "default"
    assert call(capsys, "config", "check", session)[0] == "session.toml: ok\n"
    assert json.loads(call(capsys, "config", "check", session, "--json")[0])["ok"] is True
    session.write_text(session.read_text().replace("rate_hz", "ratehz"))
    _, err = call(capsys, "config", "check", session, code=1)
    assert err == "error: session.toml:10: emg.options.ratehz: unknown key\nhint: did you mean 'rate_hz'?\n"
    out, _ = call(capsys, "config", "check", session, "--json", code=1)
    assert json.loads(out)["hint"] == "did you mean 'rate_hz'?"


def test_run_as_fast_as_possible(capsys: pytest.CaptureFixture[str], session: Path) -> None:
    out, _ = call(capsys, "run", session, "--set", "session.pace=fast", "--json")
    summary = json.loads(out)
    assert (summary["ended"], summary["duration_s"]) == ("complete", 2.0)
    assert summary["hand"]["sinks"] == ["python-can", "can-recorder"]
    assert "pacing" not in summary
    assert summary["measured"]["real_time_factor"] > 0
    assert "emg.npy" in summary["emg"]["source"]


def test_run_in_real_time_takes_the_time(capsys: pytest.CaptureFixture[str], session: Path) -> None:
    started = time.monotonic()
    out, _ = call(capsys, "run", session, "--set", "session.duration_s=0.3", "--json")
    assert time.monotonic() - started >= 0.3
    summary = json.loads(out)
    assert (summary["ended"], summary["duration_s"]) == ("duration", 0.3)
    assert summary["pacing"]["ticks"] + summary["pacing"]["skipped"] >= 100


def test_a_missing_device_ends_with_code_3(capsys: pytest.CaptureFixture[str], session: Path) -> None:
    sets = ["--set", "hand.options.interface=socketcan", "--set", "hand.options.channel=none7"]
    _, err = call(capsys, "run", session, *sets, code=1)
    assert "open_loop" in err
    _, err = call(capsys, "run", session, *sets, "--set", "hand.options.open_loop=true", code=3)
    assert err.startswith("error: python-can: interface 'socketcan', channel 'none7' did not open")


def test_no_traceback_unless_asked_for(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    _, err = call(capsys, "run", tmp_path / "none.toml", code=1)
    assert err.startswith("error: none.toml: no such file")
    assert "Traceback" not in err
    for words in (["run", tmp_path / "none.toml", "--debug"], ["--debug", "run", tmp_path / "none.toml"]):
        assert "Traceback" in call(capsys, *words, code=1)[1]


def test_a_session_without_input_is_refused(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    (tmp_path / "empty.toml").write_text("")
    _, err = call(capsys, "run", tmp_path / "empty.toml", code=1)
    assert err.startswith("error: no input: neither a tactile source nor EMG is set")


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGINT to send to a process")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_run_leaves_hand_and_vest_silent(session: Path, number: signal.Signals) -> None:
    can_csv = session.parent / "out" / "can.csv"
    words = [sys.executable, "-m", "tega.ui.cli", "run", str(session), "--set", "session.duration_s=60"]
    words += ["--set", "session.preset=paper"]
    np.save(session.parent / "emg.npy", squeezes(12_000, 200.0))
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        deadline = time.monotonic() + 60
        while not (can_csv.exists() and (session.parent / "out" / "calibration.toml").exists()):
            assert process.poll() is None, process.communicate()[1]
            assert time.monotonic() < deadline
            time.sleep(0.02)
        time.sleep(0.3)
        process.send_signal(number)
        _, err = process.communicate(timeout=60)
    assert process.returncode == 130, err
    frames = [line.split(",")[1:] for line in can_csv.read_text().splitlines()[-5:]]
    assert frames == [[i, "0" * 16] for i in ("180", "184", "188", "18C")] + [["104", ""]]
    vest = (session.parent / "out" / "vest.csv").read_text().splitlines()
    assert set(vest[-1].split(",")[1:]) == {"0"}
    summary = json.loads((session.parent / "out" / "summary.json").read_text())
    assert summary["ended"] == "stopped"
    assert err.splitlines()[-1] == "stopped"
