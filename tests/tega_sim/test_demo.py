"""The demo: made-up input through the real loop, its screen and its picture."""

from __future__ import annotations

import csv
import json
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from msgspec.structs import replace
from rich.console import Console

from reference.command import call
from reference.processes import until
from reference.results import trial_result
from reference.scripted import touching
from tega.haptics import vest_frame
from tega.loop.snapshot import LoopView
from tega.recording.run_tables import prepare_folder
from tega.records import Intent
from tega.ui.view.terminal import TerminalView, render
from tega_sim import demo as demo_module
from tega_sim.cli.demo import _print, demo
from tega_sim.demo import DemoReport, demo_outputs
from tega_sim.plan import TrialPlan
from tega_sim.score import TrialEvent
from tega_sim.streams import Streams
from tega_sim.synthetic import SyntheticEmg, SyntheticEmgOptions, effort_at

pytest.importorskip("mujoco", reason="needs the extra sim")


@pytest.mark.slow
def test_the_demo_lifts_is_felt_and_draws_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("matplotlib", reason="needs the extra pictures")
    words = ("demo", "--fast", "--operator", "scripted", "--json", "--objects", "container", "--seed", "3")
    more = ("--set", "vest.threshold=20", "--out", tmp_path / "demo")
    report = json.loads(call(capsys, *words, *more)[0])
    (trial,) = report["trials"]
    assert {"slips", "deformations", "duration_s", "peak_force_n"} <= set(trial)
    expected = {"object": "container", "condition": "haptic", "seed": 3, "success": True}
    assert trial | expected == trial
    assert trial["settings"] == ["vest.threshold=20"]
    assert report["simulated_s"] == trial["duration_s"]
    assert report["real_time_factor"] == pytest.approx(report["simulated_s"] / report["wall_s"])
    assert (tmp_path / "demo" / "demo.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    assert json.loads((tmp_path / "demo" / "summary.json").read_text()) == report
    course = tmp_path / "demo" / "1-container"
    levels = [row["fused"] for row in csv.DictReader((course / "levels.csv").read_text().splitlines())]
    assert {"1", "3"} <= set(levels)
    contacts = (course / "contacts.csv").read_text()
    assert any(",1," in line for line in contacts.splitlines())
    # The folder is known as our own: the next demo may go there, and keeps what is there.
    left = sorted(path.name for path in (tmp_path / "demo").iterdir())
    (tmp_path / "demo" / "2-mine").mkdir()
    (tmp_path / "demo" / "2026-notes.txt").write_text("mine")
    kept = prepare_folder(tmp_path / "demo", also=demo_outputs(tmp_path / "demo"))
    assert kept is not None
    assert sorted(path.name for path in kept.iterdir()) == left
    there = {path.name for path in (tmp_path / "demo").iterdir()}
    assert there == {"2-mine", "2026-notes.txt", kept.name, "summary.json"}


def dropped() -> DemoReport:
    events = (TrialEvent("slip", 4.0, 0.012), TrialEvent("drop", 4.5))
    trial = trial_result(success=False, drops=1, lifted_s=None, events=events)
    return DemoReport(simulated_s=30.0, wall_s=3.0, real_time_factor=10.0, trials=[trial])


def test_without_matplotlib_the_demo_leaves_its_tables_and_says_what_draws(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(demo_module, "prepare_demo", lambda _plans: None)
    monkeypatch.setattr(demo_module, "run_demo", lambda *_, **__: (dropped(), [Streams()]))
    for name in [name for name in sys.modules if name.split(".")[0] == "matplotlib"] + ["matplotlib"]:
        monkeypatch.setitem(sys.modules, name, None)
    out = tmp_path / "demo"
    printed, text = call(capsys, "demo", "--fast", "--operator", "scripted", "--objects", "bag", "--out", out)
    assert "no picture: matplotlib is not installed; pip install '" in text
    assert f"tables and summary.json are in {out}" in printed
    assert not (out / "demo.png").exists()
    assert (out / "1-bag" / "vest.csv").is_file()


def test_the_demo_prints_a_page_without_keyboard(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    report = dropped()
    report.trials.append(trial_result(success=False, lift_off_s=None, mean_level=0.0, slid_m=0.0))
    _print(report, real_time=False)
    page = capsys.readouterr().out
    for word in ("bag", "dropped", "slip of 12.0 mm at 4.00 s", "10.0 times as fast"):
        assert word in page
    assert page.count("–") == 2  # neither a time of lift-off nor a level without it
    call(capsys, "demo", "--fast", "--operator", "keyboard", "--out", tmp_path, code=2)


def test_a_choice_in_the_page_takes_the_place_of_what_is_being_lifted() -> None:
    plans = [TrialPlan(object=name, operator="scripted", seed=3) for name in ("bottle", "container")]
    moments: list[str] = []
    wishes = iter(["bag"])

    def wish() -> str | None:
        return next(wishes, None) if len(moments) == 5 else None

    report, courses = demo_module.run_demo(
        plans,
        real_time=False,
        observer=lambda state: moments.append(state.rows["object"]),
        next_object=wish,
        stop=lambda: len(moments) > 20,
    )
    assert list(dict.fromkeys(moments)) == ["bottle", "bag"]
    assert [trial.object for trial in report.trials] == ["bottle", "bag"]
    assert len(courses) == 2
    assert all({"truth", "contacts", "levels", "vest"} <= course.rows.keys() for course in courses)


def view(t_ns: int = 2_500_000_000) -> LoopView:
    contact = touching(700, t_ns=t_ns)
    contacts = {
        "thumb": replace(contact, cci_norm=0.9, eda_norm=0.2, front=97.0, back=6.0),
        "index": replace(contact, finger="index", cci_norm=0.1, eda_norm=0.8, front=3.0, back=94.0),
    }
    vest = vest_frame([97.0, 3.0, 0.0, 0.0], [6.0, 94.0, 0.0, 0.0], layout="x40")
    counts = {"touch": 150, "vest": 75}
    return LoopView(t_ns, contacts, vest, Intent(t_ns=t_ns, channels=(2, 3, 3), level=3), [0.5] * 16, counts)


def text_of(displayed: object) -> str:
    console = Console(width=100)
    with console.capture() as capture:
        console.print(displayed)
    return capture.get()


def test_the_screen_shows_fingers_vest_muscles_hand_rates_and_object_or_that_there_are_none() -> None:
    lifted = {"object": "bag", "height": "4.2 cm"}
    screen = text_of(render(view(), title="test", rates_hz={"touch": 60.0}, rows=lifted, height=40))
    told = "thumb|focal|broad|no sensor|front|back|channels 2 · 3 · 3|level 3: half|60 Hz|2.5 s|bag|height 4.2 cm"
    assert [word for word in told.split("|") if word not in screen] == []
    silent = text_of(render(LoopView(0, {}, None, None, None, {}), title="test", rates_hz={}))
    assert "no EMG connected" in silent
    assert "no vest connected" in silent


def test_the_live_view_draws_ten_times_a_second_at_most_and_measures_rates() -> None:
    now_s = 0.0
    console = Console(width=90, height=40, force_terminal=True)
    with console.capture() as capture, TerminalView("test", console=console, now_s=lambda: now_s) as show:
        for tick in range(61):
            now_s = tick / 30
            show(view()._replace(counts={"touch": 2 * tick}))
    assert 15 <= capture.get().count("╭─ test") <= 25
    assert "touch 60 Hz" in capture.get()


def test_synthetic_emg_follows_an_effort_that_rises_and_lets_go_and_repeats() -> None:
    course = [effort_at(t / 10, 10.0) for t in range(-10, 111)]
    assert max(course) == pytest.approx(0.97)
    assert course[:11] + course[-11:] == [0.02] * 22
    source, signals = SyntheticEmg(SyntheticEmgOptions(seed=2, duration_s=10.0)), []
    for _ in range(2):
        with source:
            signals.append(np.concatenate([chunk.samples for chunk in iter(lambda: source.read(0.0), None)]))
    signal, again = signals
    assert np.array_equal(signal, again)
    assert signal.shape == (10_000, 3)
    early, squeezed = (part.std(axis=0) for part in (signal[:900], signal[6300:7000]))
    assert np.all(early * 8 < squeezed)


posix = pytest.mark.skipif(sys.platform == "win32", reason="signals as on Linux and macOS")


@posix
def test_preparing_is_interrupted(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    begun: list[str] = []
    monkeypatch.setattr("tega_sim.demo.lab_of", lambda *_: os.kill(os.getpid(), signal.SIGINT))
    monkeypatch.setattr("tega_sim.demo.run_trial", lambda *_, **__: begun.append("trial"))
    result = CliRunner().invoke(demo, ["--out", str(tmp_path / "out")])
    assert result.exit_code == 1  # click's for an interrupt; the program's own is 130
    assert "Aborted" in result.output
    assert begun == []


@pytest.mark.slow
def test_a_demo_whose_recording_stopped_says_so(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    full = shutil.disk_usage(tmp_path)._replace(free=0)
    monkeypatch.setattr("tega.recording.mcap_recorder.shutil.disk_usage", lambda _: full)
    words = ["--fast", "--objects", "bottle", "--out", f"{tmp_path}/out", "--record", f"{tmp_path}/rec"]
    result = CliRunner().invoke(demo, words)
    assert str(result.exception).startswith("recording stopped after 0.0 s: 0 MiB left")


@posix
@pytest.mark.slow
def test_a_running_demo_leaves_its_tables_and_draws_nothing(tmp_path: Path) -> None:
    out = tmp_path / "out"
    words = [sys.executable, "-m", "tega.ui.cli", "demo", "--json", "--out", str(out)]
    words += ["--record", str(tmp_path / "rec")]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        until(lambda: any((tmp_path / "rec").glob("*.mcap*")))
        process.send_signal(signal.SIGINT)
        message, noted = process.communicate()
    assert process.returncode == 130
    assert message == ""
    assert noted.split("\n") == [f"tables and summary.json are in {out}", "", "stopped", ""]
    report: Any = json.loads((out / "summary.json").read_text())
    assert len(report["trials"]) == 1
    assert list(out.glob("1-bottle/*.csv"))
    assert not (out / "demo.png").exists()
