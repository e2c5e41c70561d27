"""A session that a Python program follows: what it receives, what it may send, and how its ends leave the outputs."""

from __future__ import annotations

import csv
import os
import signal
import time
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reference.played import finger, muscles
from reference.processes import until
from tega.config import SessionConfig, check_tree
from tega.config.calibration import Calibration, save_calibration
from tega.errors import ConfigError, DeviceUnavailableError, InvalidValueError, TegaError
from tega.haptics import vest_frame
from tega.loop.program import ProgramHand, ProgramSession, session
from tega.recording.opened import open_recording
from tega.recording.replay import replay_file
from tega.runtime.clock import ManualClock
from tega_emulators.lab import emulated_lab

SECONDS = 1.5


def outputs(folder: Path) -> dict[str, Any]:
    return {
        "vest": {"driver": "vest-recorder", "options": {"file": str(folder / "vest.csv")}},
        "hand": {"driver": "can-recorder", "options": {"file": str(folder / "can.csv")}},
    }


def settings(folder: Path, *, recorded: bool = False, **more: Any) -> SessionConfig:
    written = {
        "session": {"pace": "fast"},
        "tactile": {"thumb": finger(SECONDS, 0, (40, 32)), "ring": finger(1.0, 3, (40, 32))},
        "emg": muscles(SECONDS),
        **outputs(folder),
    }
    if recorded:
        written["recording"] = {"dir": str(folder / "session"), "lossless": True, "stop_free_mib": 0.0}
    for name, table in more.items():
        written[name] = written.get(name, {}) | table
    return check_tree(written, {}, base=Path.cwd()).config


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def silent(folder: Path) -> bool:
    frames, sent = rows(folder / "vest.csv"), rows(folder / "can.csv")
    motors = [value for name, value in frames[-1].items() if name != "t_s"]
    torques = [(row["id"], set(row["data"])) for row in sent[-5:-1]]
    zero = [(number, {"0"}) for number in ("180", "184", "188", "18C")]
    return set(motors) == {"0"} and torques == zero and sent[-1]["id"] == "104"  # SERVO OFF


def test_a_program_receives_every_moment_of_a_recorded_session(tmp_path: Path) -> None:
    with session(settings(tmp_path)) as s:
        moments = list(s)
    assert s.n_skipped == 0
    assert [snapshot.t_s for snapshot in moments[:3]] == pytest.approx([0, 1 / 30, 2 / 30])
    assert s.summary["ended"] == "complete"
    assert moments[-1].state == "stopped"
    assert {"thumb", "ring"} == set(moments[20].contacts)
    assert silent(tmp_path)


def test_what_a_program_sends_is_recorded_and_verified(tmp_path: Path) -> None:
    with session(settings(tmp_path, recorded=True)) as s:
        for k, snapshot in enumerate(s):
            if 10 <= k < 20:
                s.vest.send(np.full(40, 70.0))
            if 5 <= k < 25 and snapshot.state == "active":
                s.hand.level(4.5)
    path = tmp_path / "session" / s.summary["recording"]["file"]
    recording = open_recording(path)
    frames = recording["/vest/frame"].to_numpy()
    full = frames["m1"] == 70
    at_s = frames["t_s"][full]
    # The program answers to a moment, and its last frame lapses 0.2 s after it was sent.
    assert at_s.min() == pytest.approx(11 / 30)
    assert 20 / 30 < at_s.max() <= 20 / 30 + 0.2
    commands = recording["/hand/frames"].to_numpy()
    led = (commands["level"] + np.nan_to_num(commands["closure"])) != commands["level"]
    assert 0.1 < commands["t_s"][led].min() < 0.3
    assert commands["t_s"][led].max() <= 25 / 30 + 0.5
    assert [row.intensities[:1] for row in recording["/vest/program"]] == [(), (70,), ()]
    assert replay_file(path).same


def test_a_program_sends_without_any_sensor(tmp_path: Path) -> None:
    save_calibration(Calibration(preset="live", origin="none"), tmp_path / "c.toml")
    written = outputs(tmp_path) | {"session": {"pace": "fast", "duration_s": 1.0}}
    written["calibration"] = {"file": str(tmp_path / "c.toml")}
    written["vest"]["layout"] = "x16"
    with session(check_tree(written, {}, base=tmp_path).config) as s:
        for _ in s:
            s.vest.send(vest_frame([100] * 4, [0] * 4, layout="x16"))
            s.hand.level(5)
    frames = rows(tmp_path / "vest.csv")
    assert s.summary["ended"] == "duration"
    assert sum(row["m0"] == "100" for row in frames) > 20
    levels = {row["data"] for row in rows(tmp_path / "can.csv") if row["id"] == "180"}
    assert len(levels) > 10
    assert silent(tmp_path)


@pytest.mark.parametrize("error", [ZeroDivisionError, KeyboardInterrupt, None])
def test_every_way_out_leaves_the_outputs_silent(tmp_path: Path, error: type[BaseException] | None) -> None:
    s = session(settings(tmp_path))
    with pytest.raises(error) if error else nullcontext(), s:
        for _ in range(4):
            next(s)
            s.vest.send(np.full(40, 60))
            s.hand.level(5)
        if error is KeyboardInterrupt:
            signal.raise_signal(signal.SIGINT)
        if error:
            raise error
    assert silent(tmp_path)
    assert s.summary["ended"] == "stopped"
    assert not s._thread.is_alive()


def test_a_program_s_levels_reach_from_1_to_5_and_lapse() -> None:
    clock = ManualClock()
    hand = ProgramHand(clock, driver="allegro")
    for level in (1, 1.5, 5):
        hand.level(level, for_s=0.2)
        assert hand.requested() == level
    clock.sleep_until(clock.now_ns() + 300_000_000)
    assert hand.requested() is None


def test_what_is_out_of_range_is_refused_and_sends_nothing(tmp_path: Path) -> None:
    s = session(settings(tmp_path, recorded=True))
    with pytest.raises(InvalidValueError, match="has not begun"):
        s.vest.send(np.zeros(40))
    with s:
        next(s)
        for level in (0.9, 5.1, np.nan, np.inf):
            with pytest.raises(InvalidValueError, match="1 to 5"):
                s.hand.level(level)
        for percent in (101, -1, np.nan):
            with pytest.raises(InvalidValueError, match="0 to 100"):
                s.vest.send(np.full(40, percent))
        for wrong in (np.zeros(39), ["a"] * 40, [[0], []], np.ma.masked_equal(np.eye(1, 40)[0], 0)):
            with pytest.raises(TegaError):
                s.vest.send(wrong)
        with pytest.raises(InvalidValueError, match="layout x16"):
            s.vest.send(vest_frame([0] * 4, [0] * 4, layout="x16"))
        for for_s in (0, -1, 11, float("nan")):
            with pytest.raises(InvalidValueError, match="for_s"):
                s.hand.level(3, for_s=for_s)
    assert [row.intensities for row in open_recording(tmp_path / "session")["/vest/program"]] == [()]
    assert "/hand/imposed" not in open_recording(tmp_path / "session")


def test_a_session_without_vest_or_hand_says_so(tmp_path: Path) -> None:
    none: dict[str, Any] = {"driver": None, "options": {}}
    with session(settings(tmp_path, vest=none, hand=none)) as s:
        with pytest.raises(DeviceUnavailableError, match="no vest"):
            s.vest.send(np.zeros(40))
        with pytest.raises(DeviceUnavailableError, match="no hand"):
            s.hand.level(3)


@pytest.mark.slow
def test_a_device_that_cannot_be_opened_is_the_error_of_the_with_statement(tmp_path: Path) -> None:
    emg = {"driver": "serial-emg", "kind": "raw", "options": {"port": "/dev/no-port", "rate_hz": 1000.0}}
    config = settings(tmp_path, session={"pace": "real"}, emg=emg)
    with pytest.raises(TegaError), session(config):
        pytest.fail("the block was entered")


def test_settings_are_read_from_a_file_and_a_session_is_used_once_in_a_with_statement(tmp_path):
    path = tmp_path / "lab.toml"
    path.write_text(
        '[session]\npace = "fast"\n[tactile.thumb]\ndriver = "synthetic-touch"\noptions = { duration_s = 0.5 }\n'
    )
    s = session(path, sets=("vest.layout=x16",))
    with pytest.raises(InvalidValueError, match="with statement"):
        next(s)
    with s:
        assert s.config.vest.layout == "x16"
        assert next(s).t_ns == 0
    with pytest.raises(InvalidValueError, match="has been used"):
        s.__enter__()
    with pytest.raises(ConfigError):
        session(s.config, sets=("vest.layout=x16",))


@pytest.mark.slow
@pytest.mark.parametrize("route", ["exception", "SIGTERM"])
def test_emulated_vest_and_hand_are_safe_after_a_failing_program(tmp_path: Path, route: str) -> None:
    with emulated_lab(tmp_path, emg_hz=250.0, hand=True, vest=True, fingers=("thumb",)) as lab:
        recorded = {"dir": str(tmp_path / "session"), "stop_free_mib": 0.0}
        config = check_tree({**lab.tree, "recording": recorded}, {}, base=tmp_path).config
        seen: list[bool] = [False, False]

        def follow(s: ProgramSession) -> None:
            until_s, n_sent = time.monotonic() + 60, 0
            for snapshot in s:
                if snapshot.state == "active":
                    s.vest.send(np.full(40, 50))
                    s.hand.level(5)
                    n_sent += 1
                    seen[:] = seen[0] or not lab.at_rest(), seen[1] or not lab.limp()
                if (all(seen) and n_sent > 10) or time.monotonic() > until_s:
                    if route == "exception":
                        raise ZeroDivisionError
                    os.kill(os.getpid(), signal.SIGTERM)
                    time.sleep(5)

        with pytest.raises((ZeroDivisionError, SystemExit)), session(config) as s:
            follow(s)
        assert seen == [True, True]
        assert lab.limp()
        until(lab.at_rest)
    recording = open_recording(tmp_path / "session")
    assert max(max(frame.intensities, default=0) for frame in recording["/vest/program"]) == 50
    exchanges = recording["/hand/bus"].to_numpy()  # its records have the machine's clock
    assert np.abs(exchanges["t_s"] - exchanges["log_s"]).max() < 1e-6
    assert exchanges["level"].max() == 5
