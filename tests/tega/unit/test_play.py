"""A recorded run played again: to files, and to an emulated vest and hand on their real transports."""

from __future__ import annotations

import contextlib
import csv
import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from msgspec.structs import replace

from reference.command import call
from reference.parts import checked, observed
from reference.sessions import read_recorded, record_with_arm
from tega.config import SessionConfig
from tega.config.calibration.folder import CalibrationFolder
from tega.errors import ConfigError
from tega.haptics import MotorLevels
from tega.loop import run_session
from tega.loop.controls import Controls
from tega.loop.snapshot import LoopView
from tega.recording.replay.play import LEAD_S, _settings, play_file
from tega.recording.replay.playhead import Playhead
from tega.records import HandCommand, Marker, VestFrame
from tega.records.bus import Bus
from tega.runtime.features import Feature
from tega.runtime.files.toml_text import tree_text
from tega.ui.cli.report import print_summary
from tega_emulators.lab import PRESSED, EmulatedLab, emulated_lab, pressing
from tega_emulators.vest_bench import seen_by


@pytest.fixture(autouse=True, scope="module")
def _where_nobody_has_worn_the_vest_today(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    # The dose of a wearer who is not named is kept in the working folder.
    with contextlib.chdir(tmp_path_factory.mktemp("work")):
        yield


def rows(path: Path) -> list[list[str]]:
    return list(csv.reader(path.read_text().splitlines()))[1:]


@pytest.fixture(scope="module")
def played(lossless: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, Any], Path]:
    """Play a recording as fast as it goes; return the summary and the folder of its tables."""
    out = tmp_path_factory.mktemp("played") / "out"
    return play_file(lossless, checked({"session": {"out_dir": str(out)}}), speed=None), out


def test_as_fast_as_it_goes_it_is_what_was_recorded(lossless: Path, played: Any) -> None:
    summary, out = played
    assert summary["ended"] == "complete"
    recorded = read_recorded(lossless)
    then = {round(one.t_ns / 1e9, 6): list(one.intensities) for one in recorded.of(VestFrame)}
    now = {float(row[0]): [int(v) for v in row[1:]] for row in rows(out / "vest.csv")}
    assert now == then
    assert max(max(frame) for frame in now.values()) > 50
    frames = [f"{f.id:03X} {f.data.hex().upper()}" for one in recorded.of(HandCommand) for f in one.frames]
    assert [f"{row[1]} {row[2]}" for row in rows(out / "can.csv")][: len(frames)] == frames
    notes = json.loads((out / "summary.json").read_text())["notes"]
    assert f"thumb: played from {lossless.name} as fast as it went" in notes


def test_at_four_times_the_speed_a_vest_is_told_as_often_as_ever(lossless: Path, tmp_path: Path) -> None:
    play_file(lossless, checked({"session": {"out_dir": str(tmp_path / "out")}}), speed=4.0)
    recorded = read_recorded(lossless)
    times = [float(row[0]) for row in rows(tmp_path / "out" / "vest.csv")][:-1]
    # A thirtieth of a second is four thirtieths of the recording.
    assert all(abs(t_s * 30 / 4 - round(t_s * 30 / 4)) < 1e-3 for t_s in times)
    assert len(times) <= len(recorded.of(VestFrame)) / 4 + 1


def test_a_summary_has_no_lead_in_its_input_and_why_it_never_armed(played, capsys):
    summary, _ = played
    length_s = summary["duration_s"]
    ahead = {"duration_s": length_s + 40.0, "played": summary["played"] | {"lead_s": 40.0}}
    safe = {"changes": [{"t_s": 4.0, "state": "stopped", "reason": ""}], "alerts": ["emg: silent"]}
    print_summary(summary | ahead | {"safety": safe}, measured={"wall_s": 1.0, "real_time_factor": 1.0})
    printed = capsys.readouterr().out
    assert all(text in printed for text in (f"{length_s:.2f} s of input", "times real time"))
    assert "never armed: emg: silent" in printed


def test_of_guests_those_that_say_so_join_a_played_run(monkeypatch: pytest.MonkeyPatch) -> None:
    declared = {
        "plays": Feature(summary="", settings={"plays": ""}, in_play=True),
        "films": Feature(summary="", settings={"films": ""}),
    }
    monkeypatch.setattr("tega.recording.replay.play.features", lambda: declared)
    to = replace(SessionConfig(), guests={"plays": "table", "films": "table"})
    config = _settings(SessionConfig(), to, speed=None, vest_pace="steady")
    assert config.guests == {"plays": "table"}


def test_the_clock_stands_until_it_is_waited_for_and_runs_at_its_speed() -> None:
    clock = Playhead()
    clock.speed = 4.0
    assert clock.now_ns() == 0
    clock.sleep_until(0)
    clock.sleep_until(40_000_000)
    assert clock.now_ns() >= 40_000_000
    assert clock.tick_ns == 40_000_000


class Session(NamedTuple):
    """A lab that is up, settings that reach its vest and hand, and a recording that it gave."""

    lab: EmulatedLab
    to: dict[str, Any]
    file: Path


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Session]:
    """Three seconds of a finger that is pressed harder and softer, recorded from emulated devices."""
    folder = tmp_path_factory.mktemp("lab")
    with emulated_lab(folder, emg_hz=250.0, hand=True, vest=True, fingers=("thumb",), touch=PRESSED) as lab:
        recording = {"dir": str(folder / "session"), "stop_free_mib": 0.0}
        tree = {**lab.tree, "session": {"duration_s": 3.0}, "recording": recording}
        with pressing(lab):
            summary = run_session(checked(tree))
        assert lab.limp()
        to = {name: lab.tree[name] for name in ("vest", "hand")}
        yield Session(lab, to, folder / "session" / str(summary["recording"]["file"]))


def reported(file: Path) -> list[list[int]]:
    """The frames of a recording, in the wearer's order, without those that are equal to the one before."""
    frames: list[list[int]] = [[0] * 40]
    for one in read_recorded(file).of(VestFrame):
        frame = MotorLevels(one.layout, np.array(one.intensities, np.uint8)).x40().tolist()
        if frame != frames[-1]:
            frames.append(frame)
    return frames[1:]


@pytest.mark.slow
def test_the_vest_is_told_what_it_was_told_and_the_hand_asked_what_it_was_asked(session: Session) -> None:
    lab, to, file = session
    before = len(seen_by(lab.vest).history)
    levels: list[int] = []
    summary = play_file(
        file, checked(to), bus=observed(lambda view: levels.append(view.intent.level if view.intent else 0))
    )
    assert summary["ended"] == "complete"
    states = [change["state"] for change in summary["safety"]["changes"]]
    assert (states[:2], states[-1]) == (["armed", "active"], "stopped")
    seen = [frame for _, frame in seen_by(lab.vest).history[before:]]
    then = reported(file)
    assert len(then) > 10
    # The vest takes the newest frame only; of those that a busy machine makes it miss none comes later.
    left = iter(then)
    assert all(frame in left for frame in seen if any(frame))
    assert not any(seen[-1])
    # A machine that stood still has left deadlines out.
    if not summary["pacing"]["skipped"]:
        assert len(seen) > 0.6 * len(then)
        assert max(levels) == max(one.level for one in read_recorded(file).of(HandCommand))
    assert lab.limp()
    assert lab.at_rest()
    assert summary["played"]["lead_s"] == LEAD_S


@pytest.mark.slow
def test_ctrl_c_in_the_middle_leaves_both_without_force(session: Session, tmp_path: Path) -> None:
    lab, to, file = session
    settings = tmp_path / "lab.toml"
    settings.write_text(tree_text(to), encoding="utf-8")
    words = [sys.executable, "-m", "tega.ui.cli", "play", str(file), "--to", str(settings), "--speed", "2"]
    words += ["--because", "a test", "--json"]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as process:
        while process.poll() is None and (lab.at_rest() or not lab.hand.say("look")["servo_on"]):
            time.sleep(0.01)
        assert process.poll() is None
        process.send_signal(signal.SIGINT)
        sentence, _ = process.communicate()
    assert process.returncode == 130
    summary = json.loads(sentence)
    assert summary["ended"] == "stopped"
    assert summary["played"]["because"] == "a test"
    assert summary["safety"]["changes"][-1]["reason"] == "stopped: Ctrl-C"
    assert lab.limp()
    assert lab.at_rest()


@pytest.mark.slow
def test_in_the_lead_the_vest_rests_and_the_hand_goes_to_where_it_began(lossless: Path) -> None:
    seen: list[tuple[int, int, bool]] = []

    def check(view: LoopView) -> None:
        if view.intent is not None and view.vest is not None:
            seen.append((view.t_ns, view.intent.level, bool(view.vest.intensities.any())))

    # A live driver, and nothing but this terminal's error output behind it.
    play_file(lossless, checked({"vest": {"driver": "on-screen-vest"}}), speed=2.0, bus=observed(check))
    lead = [(level, felt) for t_ns, level, felt in seen if t_ns < 2 * LEAD_S * 1e9]
    assert len(lead) > 40
    assert set(lead) == {(read_recorded(lossless).of(HandCommand)[0].level, False)}
    assert any(felt for _, _, felt in seen)


def test_asked_to_stop_while_it_reads_it_opens_nothing(lossless: Path) -> None:
    nowhere = checked({"vest": {"driver": "bhaptics-player", "options": {"port": 1}}})
    with pytest.raises(KeyboardInterrupt):
        play_file(lossless, nowhere, controls=Controls(stop=lambda: True))


def refused(call: Callable[[], object]) -> str:
    with pytest.raises(ConfigError) as caught:
        call()
    return caught.value.message


def test_what_is_real_is_not_played_to_at_any_speed(lossless: Path) -> None:
    real = checked({"vest": {"driver": "bhaptics-player"}})
    assert "speed max is for virtual" in refused(lambda: play_file(lossless, real, speed=None))
    assert "faster than it was recorded" in refused(lambda: play_file(lossless, real, speed=1.5))
    assert "out of range" in refused(lambda: play_file(lossless, real, speed=0.01))
    on_a_bus = checked({"hand": {"driver": "allegro", "options": {"interface": "slcan", "channel": "x"}}})
    assert "hand: allegro" in refused(lambda: play_file(lossless, on_a_bus, speed=None))


def test_of_a_session_with_several_recordings_one_has_to_be_named(lossless, tmp_path, capsys):
    for name in ("trial-001.mcap", "trial-002.mcap"):
        (tmp_path / name).write_bytes(lossless.read_bytes())
    assert "trial-002.mcap" in call(capsys, "play", tmp_path, "--speed", "max", code=1)[1]


@pytest.mark.slow
def test_a_played_session_is_held_to_the_day_of_who_wears_the_vest(session: Session, tmp_path: Path) -> None:
    file = CalibrationFolder(tmp_path).person("p01") / "vest-dose.json"
    calibration = {"person": "p01", "folder": str(tmp_path)}
    to = checked({"vest": session.to["vest"], "calibration": calibration})

    def strongest() -> int:
        before = len(seen_by(session.lab.vest).history)
        play_file(session.file, to)
        return max((max(levels) for _, levels in seen_by(session.lab.vest).history[before:]), default=0)

    assert strongest() > 20
    (first,) = json.loads(file.read_bytes())
    assert sum(first["dose_s"]) > 0
    file.write_text(json.dumps([{"ended_s": time.time(), "dose_s": [1800.0] * 40, "heat": [0.0] * 40}]))
    assert strongest() <= 10


@pytest.mark.slow
def test_a_motor_that_is_identified_counts_to_the_day_too(session, tmp_path, capsys):
    file = CalibrationFolder(tmp_path).person("p01") / "vest-dose.json"
    settings = tmp_path / "vest.toml"
    tree = {"vest": session.to["vest"], "calibration": {"folder": str(tmp_path)}}
    settings.write_text(tree_text(tree))
    call(capsys, "vest", "identify", settings, "--person", "p01", "--motor", "3", "--seconds", "0.5")
    (run,) = json.loads(file.read_bytes())
    assert run["dose_s"][3] > 0.05
    assert sum(run["dose_s"]) == pytest.approx(run["dose_s"][3])


def test_the_recorded_arm_and_the_markers_are_seen_again_and_no_arm_is_moved(tmp_path: Path) -> None:
    recording = record_with_arm(tmp_path / "session")
    for from_s, expected in ((0.0, ["lift", "put down"]), (0.5, ["put down"])):
        bus, marked, views = Bus(), list[Marker](), list[LoopView]()
        bus.subscribe(Marker, marked.append)
        to = checked({"session": {"out_dir": str(tmp_path / f"out-{from_s:g}")}})
        summary = play_file(
            recording, to, speed=None, playhead=Playhead(from_s), bus=observed(views.append, bus)
        )
        assert [(marker.text, marker.source) for marker in marked] == [
            (text, "recording") for text in expected
        ]
        assert marked[-1].t_ns == 800_000_000 - round(from_s * 1e9)
        assert "arm" not in summary
        seen = [(view.t_ns, view.seen_arm) for view in views if view.seen_arm is not None]
        assert len(seen) > 10
        for t_ns, arm in seen:
            assert arm is not None
            assert arm.hand_m is not None
            # It is as old as the newest contact at most.
            assert arm.hand_m[0] == pytest.approx(0.5 + 0.1 * (from_s + t_ns / 1e9), abs=0.1 / 20)
            assert arm.behind_mm == pytest.approx(10.0)
            assert arm.dead_man
        assert views[-2].arm == "as recorded: following: the arm follows the forearm"
        assert views[-1].arm_height_m == pytest.approx(0.3)
