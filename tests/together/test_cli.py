"""The command line: help, exit codes, JSON, hints for a first day, and what replay and verify find."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import click
import numpy as np
import pytest

from reference.command import call
from reference.parts import checked
from reference.recordings import squeezes, write_folder
from tega.records import Contact, Intent, VestFrame
from tega.records.bus import Bus
from tega.setup.contract.command import main as contract
from tega.ui.cli.main import cli
from tega.ui.cli.run import stage
from tega.ui.view.course import RunCourse

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
    [(["walk"], "No such command 'walk'"), (["replay"], "--out"), (["verify", "a\0b"], "a NUL character")],
)
def test_wrong_use_ends_with_code_2(capsys, words, message):
    _, err = call(capsys, *words, code=2)
    assert message in err


def test_devices_as_text_and_json(capsys: pytest.CaptureFixture[str]) -> None:
    text, _ = call(capsys, "devices")
    records: list[dict[str, Any]] = json.loads(call(capsys, "devices", "--json")[0])
    names = {r["name"] for r in records}
    assert {"images", "video", "emg-file", "vest-recorder", "can-recorder", "python-can"} <= names
    assert all(set(r) == DEVICE_KEYS for r in records)
    assert all(r["name"] in text for r in records)


def test_config_show_and_check(capsys: pytest.CaptureFixture[str], session: Path) -> None:
    session.write_text(session.read_text() + "[vest]\nthreshold = 30.000000000000004\n")
    sets = ("--set", "session.preset=paper", "--set", "session.duration_s=5.9999999999999995e-5")
    lines = [line.split() for line in call(capsys, "config", "show", session, *sets)[0].splitlines()]
    assert ["session.preset", "paper", "--set"] in lines
    displayed = {line[0]: line[1] for line in lines if len(line) > 1}
    assert (displayed["session.duration_s"], displayed["vest.threshold"]) == ("0.00006", "30")
    values = {v["key"]: v for v in json.loads(call(capsys, "config", "show", session, "--json")[0])}
    rate = {"key": "emg.options.rate_hz", "value": 200.0, "unit": "Hz", "origin": "session.toml:10"}
    assert values["emg.options.rate_hz"] == rate
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
    sets += ["--set", "hand.options.open_loop=true"]
    _, err = call(capsys, "run", session, *sets, "--set", "session.pace=fast", code=1)
    assert "session.pace = 'fast', but hand: python-can, socketcan:none7 is live" in err
    _, err = call(capsys, "run", session, *sets, code=3)
    assert err.startswith("error: python-can: interface 'socketcan', channel 'none7' did not open")


def test_no_traceback_unless_asked_for(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    _, err = call(capsys, "run", tmp_path / "none.toml", code=1)
    assert err.startswith("error: none.toml: no such file")
    assert "Traceback" not in err
    for words in (["run", tmp_path / "none.toml", "--debug"], ["--debug", "run", tmp_path / "none.toml"]):
        assert "Traceback" in call(capsys, *words, code=1)[1]


@pytest.mark.parametrize("hand", [None, "python-can"])
def test_a_vest_drawn_in_the_terminal_takes_the_live_views_place_unless_a_hand_moves(monkeypatch, hand):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    config = checked({"vest": {"driver": "on-screen-vest"}, "hand": {"driver": hand}})
    with stage("a run", enabled=True, config=config) as (_, display):
        assert (display is None) is (hand is None)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a disk that is always full")
def test_a_full_disk_and_a_place_that_is_not_ones_own_say_what_to_do(capsys, session) -> None:
    with Path("/dev/full").open("w") as full:
        done = subprocess.run([sys.executable, "-m", "tega.ui.cli", "--version"], stdout=full, stderr=-1)  # noqa: PLW1510
    assert b"hint: make room" in done.stderr
    assert "hint: your user may not" in call(capsys, "demo", "--out", "/sys/demo", code=1)[1]
    closed = (
        'exec "$0" -m tega.ui.cli run "$1" --set session.duration_s=0.1 <&-'  # and closed input is no fault
    )
    subprocess.run(["sh", "-c", closed, sys.executable, session], check=True)


@pytest.mark.parametrize("verb", ["play", "verify"])
def test_a_folder_of_tables_is_no_recording(tmp_path, capsys, monkeypatch, verb):
    folder = tmp_path / "results"
    folder.mkdir()
    (folder / "vest.csv").write_text("t_s\n")
    monkeypatch.chdir(folder)
    for named in (folder, "."):
        _, err = call(capsys, verb, named, code=1)
        assert "error: results: holds a run's tables, not a recording" in err
        assert "--record" in err


@pytest.mark.parametrize("name", ["x.xyz", "x", "x.svg", "file/x.png"])
def test_a_picture_that_cannot_be_written_is_refused_before_the_work(tmp_path, capsys, name):
    (tmp_path / "file").touch()
    for verb in ("audit", "verify", "replay"):
        _, err = call(capsys, verb, tmp_path, "--picture", tmp_path / name, code=2)
        assert ("in its folder" if name.startswith("file") else "name it x.png") in err


def test_a_contract_of_no_driver_and_no_stage(capsys: pytest.CaptureFixture[str]) -> None:
    for name, hint in (("nonsense", "drivers and stages: "), ("alegro", "did you mean 'allegro'?")):
        with pytest.raises(SystemExit) as ended:
            contract([name])
        assert ended.value.code == 2
        err = capsys.readouterr().err
        assert f"no driver or stage is called {name!r}" in err
        assert hint in err


@pytest.fixture
def course() -> RunCourse:
    """Two presses of the thumb, none of the ring finger, a grip that tightens, and one motor that is on."""
    bus = Bus()
    course = RunCourse(bus)
    for k in range(100):
        pressed = 20 <= k < 40 or 60 <= k < 70
        share = 0.8 if k == 30 else 0.4 if pressed else 0.0
        bus.publish(
            Contact(finger="thumb", t_ns=k * 10**7, in_contact=pressed, cci_norm=share, eda_norm=share / 2)
        )
        bus.publish(Contact(finger="ring", t_ns=k * 10**7, in_contact=False))
        motors = [0] * 16
        motors[5] = 70 if k == 50 else 30 if k >= 50 else 0
        bus.publish(VestFrame(t_ns=k * 10**7, layout="x16", intensities=tuple(motors)))
    for k, level in enumerate((1, 1, 3, 4, 4, 2)):
        bus.publish(Intent(t_ns=k * 10**8, level=level))
    return course


def test_words_say_what_each_part_did(course: RunCourse) -> None:
    assert course.words() == [
        "thumb: 2 contacts, 0.3 s in all, the first at 0.2 s; most at 0.3 s (CCI 80 %, EDA 40 % of the maximum)",
        "ring: never touched",
        "level: 3 changes, from 1 to 2; tightest 4, first at 0.3 s",
        "vest: on in 50 % of its frames; strongest 70 % before the driver's limits, at 0.5 s (front column 2)",
    ]
    assert course.words(pose_base=0)[2] == "level: 3 changes, from 0 to 1; tightest 3, first at 0.3 s"


def test_a_vest_that_says_nothing_and_a_run_without_anything() -> None:
    bus = Bus()
    course = RunCourse(bus)
    assert course.words() == []
    bus.publish(VestFrame(t_ns=0, layout="x16", intensities=(0,) * 16))
    assert course.words() == ["vest: silent throughout"]
    for t_s in (5, 0, 1):
        bus.publish(Contact(finger="thumb", t_ns=t_s * 10**9, in_contact=True))
    assert "1 contact, 1.5 s in all" in course.words()[0]


def test_motors_are_in_the_order_in_which_they_are_worn(course: RunCourse) -> None:
    vest = course.vest
    assert vest is not None
    (row,) = np.flatnonzero(vest.intensities.any(axis=0))
    # Motor 5 of the layout is the lower one of the front's second column.
    assert vest.motors[row] == vest.motors[row - 1] == "front column 2"
    assert vest.motors[row + 1] == "front column 3"
    assert vest.motors[8] == "back column 1"


def test_a_brief_pulse_is_in_the_picture_of_a_long_run() -> None:
    pytest.importorskip("matplotlib", reason="needs the extra pictures")
    from tega.ui.view.figures import draw_vest, new_figure
    from tega.ui.view.state import VestCourse

    intensities = np.zeros((10_000, 1), np.uint8)
    intensities[7777] = 90
    ax = new_figure(figsize=(4, 2)).subplots()
    draw_vest(ax, VestCourse(np.arange(10_000) / 100, intensities, ("motor 0",)))
    (mesh,) = ax.collections
    displayed = np.asarray(mesh.get_array())
    assert displayed.size < 1000
    assert displayed.max() == 90


@pytest.fixture
def presses(tmp_path: Path) -> Path:
    write_folder(tmp_path / "presses", 30)
    return tmp_path / "presses"


def test_loose_files_leave_a_picture_and_words(presses, tmp_path, capsys):
    pytest.importorskip("matplotlib", reason="needs the extra pictures")
    out = tmp_path / "out"
    text, _ = call(capsys, "replay", "--tactile", f"thumb={presses}", "--out", out)
    assert "  thumb: 3 contacts, " in text
    assert "  vest: on in " in text
    assert (out / "picture.png").read_bytes().startswith(b"\x89PNG")


def test_without_matplotlib_there_are_words_and_the_line_that_installs_it(
    presses: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in [name for name in sys.modules if name.split(".")[0] == "matplotlib"] + ["matplotlib"]:
        monkeypatch.setitem(sys.modules, name, None)
    words = ("replay", "--tactile", f"thumb={presses}", "--out", tmp_path / "out")
    text, noted = call(capsys, *words)
    assert "thumb: " in text
    assert "no picture: matplotlib is not installed; pip install '" in noted
    assert not (tmp_path / "out/picture.png").exists()
    # Who asks for the picture gets it or no run at all.
    _, noted = call(capsys, *words, "--picture", tmp_path / "mine.png", code=3)
    assert "[pictures]'" in noted


def test_an_output_that_is_closed_or_lacks_characters_ends_nothing(session, capsys):
    def printed(words: str) -> str:
        environ = os.environ | {"PYTHONIOENCODING": "cp1252"}
        line = f"{sys.executable} -m tega.ui.cli {words}"
        return subprocess.check_output(line, shell=True, env=environ, encoding="cp1252")

    assert "\\u03c9 of Eq 1" in printed("stages")
    assert json.loads(printed("stages --json")) == json.loads(call(capsys, "stages", "--json")[0])
    assert "times real time" in printed(f"run {session} --set session.pace=fast 2>&-")


def test_a_session_is_told_and_drawn(lossless, tmp_path, capsys):
    pytest.importorskip("matplotlib", reason="needs the extra pictures")
    text, _ = call(capsys, "verify", lossless, "--picture", tmp_path / "verify.png")
    assert "  thumb: " in text
    assert f"  picture: {tmp_path / 'verify.png'}" in text
    assert (tmp_path / "verify.png").read_bytes().startswith(b"\x89PNG")
    assert sorted(path.name for path in lossless.parent.iterdir()) == sorted({lossless.name, "session.json"})
