"""LeRobot's own programs on emulated devices, with TEGA's robot and teleoperator as LeRobot finds them."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
import tomlkit

from reference.installed import distribution
from tega.errors import ConfigError, InvalidValueError
from tega.recording.opened import open_recording
from tega.runtime.clock import every
from tega_emulators.lab import EmulatedLab, emulated_lab

pytest.importorskip("lerobot.robots", reason="needs the package lerobot")

_DEAD_MAN, _CLUTCH = 0, 1
PLUGIN = Path(__file__).resolve().parents[2] / "plugins" / "lerobot_robot_tega"

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not PLUGIN.is_dir(), reason="not a checkout"),
    pytest.mark.skipif(sys.platform == "win32", reason="emulated serial devices need Linux or macOS"),
]


class Bench(NamedTuple):
    """Emulated devices, their settings file, and the environment of a program that uses both and the plug-in."""

    lab: EmulatedLab
    settings: Path
    environment: dict[str, str]

    def lerobot(self, program: str, *options: str, teleop: bool = True) -> subprocess.Popen[str]:
        """Start one of LeRobot's programs, with small pictures."""
        words = [f"--robot.settings={self.settings}", "--robot.height=80", "--robot.width=60"]
        words += ["--teleop.type=tega", f"--teleop.settings={self.settings}"] if teleop else []
        return subprocess.Popen(
            [
                sys.executable,
                "-m",
                f"lerobot.scripts.lerobot_{program}",
                "--robot.type=tega",
                *words,
                *options,
            ],
            env=self.environment,
            cwd=self.settings.parent,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )

    def moves(self, running: subprocess.Popen[str]) -> bool:
        """Wait until both the hand's and the vest's motors run; return whether that came about."""
        until_s, seen = time.monotonic() + 300, [False, False]
        while not all(seen) and running.poll() is None and time.monotonic() < until_s:
            seen = [seen[0] or not self.lab.limp(), seen[1] or not self.lab.at_rest()]
            time.sleep(0.05)
        return all(seen)

    def silent(self) -> bool:
        """Whether the hand is let go and the vest has been sent zeros."""
        until_s = time.monotonic() + 10
        while not self.lab.at_rest() and time.monotonic() < until_s:
            time.sleep(0.05)
        return self.lab.limp() and self.lab.at_rest()

    @property
    def recorded(self) -> Any:
        """TEGA's own recording of the run."""
        return open_recording(self.settings.parent / "recorded")


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    site = tmp_path / "site"
    site.mkdir()
    (site / "lerobot_robot_tega").symlink_to(PLUGIN / "src" / "lerobot_robot_tega", target_is_directory=True)
    distribution(site, "lerobot_robot_tega", "")
    with emulated_lab(
        tmp_path, emg_hz=250.0, hand=True, vest=True, fingers=("thumb",), camera_hz=30.0
    ) as lab:
        lab.go_ahead()
        settings = tmp_path / "lab.toml"
        recording = {"dir": str(tmp_path / "recorded"), "stop_free_mib": 0.0}
        settings.write_text(tomlkit.dumps({**lab.tree, "recording": recording}))
        path = os.pathsep.join([str(site), *sys.path])
        offline = {"HF_HUB_OFFLINE": "1", "HF_HOME": str(tmp_path / "hf"), "OMP_NUM_THREADS": "1"}
        yield Bench(lab, settings, os.environ | {"PYTHONPATH": path} | offline)


@pytest.mark.filterwarnings("ignore:The video decoding and encoding capabilities of torchvision")
def test_an_episode_is_recorded_by_lerobot(bench: Bench) -> None:
    root = bench.settings.parent / "dataset"
    options = ["--dataset.repo_id=lab/test", f"--dataset.root={root}", "--dataset.push_to_hub=false"]
    options += ["--dataset.single_task=squeeze", "--dataset.num_episodes=1", "--dataset.episode_time_s=3"]
    options += ["--dataset.fps=10", "--dataset.vcodec=h264", "--play_sounds=false"]
    recording = bench.lerobot("record", *options)
    message, _ = recording.communicate(timeout=300)
    assert recording.returncode == 0, message
    assert bench.silent()

    from lerobot.datasets.lerobot_dataset import LeRobotDataset

    dataset = LeRobotDataset("lab/test", root=root, video_backend="pyav")
    assert dataset.num_episodes == 1
    assert len(dataset) >= 20
    names = dataset.meta.features["observation.state"]["names"]
    last = dataset[len(dataset) - 1]
    state = dict(zip(names, last["observation.state"].tolist(), strict=True))
    contact = bench.recorded["/tactile/thumb/contact"][-1]
    assert state["thumb.in_contact"] == 1
    assert state["thumb.force_n"] == pytest.approx(contact.force_n, rel=0.2)
    assert state["fused"] == 5
    assert state["motor1"] > 0
    assert last["observation.images.thumb"].shape == (3, 80, 60)
    assert dataset.meta.features["action"]["names"] == ["grasp_level", "closure"]
    assert last["action"].tolist() == [5, 1]


@pytest.mark.parametrize("route", ["time", "SIGINT", "SIGTERM"])
def test_every_end_of_teleoperation_lets_go(bench: Bench, route: str) -> None:
    time_s = 4 if route == "time" else 200
    running = bench.lerobot("teleoperate", "--fps=15", f"--teleop_time_s={time_s}")
    moved = bench.moves(running)
    if route != "time":
        running.send_signal(getattr(signal, route))
    message, _ = running.communicate(timeout=300)
    assert moved, message
    assert bench.silent(), message
    assert running.returncode == {"time": 0, "SIGINT": 0, "SIGTERM": 128 + signal.SIGTERM}[route], message
    exchanges = bench.recorded["/hand/bus"].to_numpy()
    assert exchanges["level"].max() == 5


def test_an_exception_lets_go_and_closure_is_clipped(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    from tega_lerobot.plugin import TegaRobot, TegaRobotConfig

    config = TegaRobotConfig(
        settings=bench.settings, height=80, width=60, calibration_dir=bench.settings.parent
    )
    sent: list[dict[str, Any]] = []

    def act(robot: TegaRobot) -> None:
        for closure in (2.0, *[-2.0] * 30, np.nan):
            robot.get_observation()
            sent.append(robot.send_action({"grasp_level": 1.0, "closure": closure}))
            time.sleep(0.05)

    with pytest.raises(InvalidValueError, match="level = nan is out of range"), TegaRobot(config) as robot:
        act(robot)
    assert sent == [{"grasp_level": 5, "closure": 1.0}, *[{"grasp_level": 1, "closure": 0.0}] * 30]
    imposed = bench.recorded["/hand/imposed"].to_numpy()
    assert 1 in imposed["level"]  # by the program, against muscles that ask for 5
    assert bench.silent()
    with pytest.raises(ConnectionError, match="not connected"):
        robot.get_observation()


class Buttons:
    """Dead-man and clutch, pressed again and again: a SpaceMouse reports a button only when it changes."""

    def __init__(self, lab: EmulatedLab) -> None:
        self.lab, self._held, self._lock = lab, [_DEAD_MAN], threading.Lock()

    def again(self) -> None:
        with self._lock:
            for button in self._held:
                self.lab.cap.say(f"press {button}")

    def toggle_clutch(self) -> None:
        with self._lock:
            if _CLUTCH in self._held:
                self._held.remove(_CLUTCH)
                self.lab.cap.say(f"lift {_CLUTCH}")
            else:
                self._held.append(_CLUTCH)

    @property
    def taken_hold(self) -> bool:
        return _CLUTCH in self._held


@pytest.fixture
def buttons(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Buttons]:
    """Return the operator's buttons beside emulated EMG, hand and arm."""
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    with emulated_lab(tmp_path, emg_hz=250.0, hand=True, arm=True) as lab:
        made = Buttons(lab)
        with every(made.again, every_s=0.3):
            yield made


def written(lab: EmulatedLab, folder: Path, **arm: Any) -> dict[str, Any]:
    """Write a lab's settings with some of the arm changed, and return what names them to LeRobot."""
    recording = {"dir": str(folder / "recorded"), "stop_free_mib": 0.0}
    table = {name: value for name, value in (lab.tree["arm"] | arm).items() if value is not None}
    (folder / "lab.toml").write_text(tomlkit.dumps({**lab.tree, "recording": recording, "arm": table}))
    return {"settings": folder / "lab.toml", "calibration_dir": folder}


def test_an_arm_action_is_limited_and_recorded_and_a_stale_one_rests(
    buttons: Buttons, tmp_path: Path
) -> None:
    from tega_lerobot.plugin import TegaRobot, TegaRobotConfig

    where = written(buttons.lab, tmp_path, tracker=None, mapping={"frame": "base", "absolute": True})
    names = ("x_m", "y_m", "z_m", "qx", "qy", "qz", "qw")
    sent = 0.0
    with TegaRobot(TegaRobotConfig(**where)) as robot:
        assert list(robot.action_features)[2:] == [f"arm_target.{name}" for name in names]
        at = robot.get_observation()
        pose = {f"arm_target.{name}": at[f"arm.{name}"] for name in names}
        pose |= {f"arm_target.{name}": 3.0 * at[f"arm.{name}"] for name in names[3:]}  # of no unit length
        until_s = time.monotonic() + 60
        while sent < 1.0 or robot.get_observation()["arm.x_m"] < 0.69:  # the box ends at 0.70
            words = next(robot._joined[0]).arm
            if words.startswith("following"):
                pose["arm_target.x_m"] = min(pose["arm_target.x_m"] + 0.02, 1.0)  # faster than it may go
            elif buttons.taken_hold == ("press it again" in words):
                buttons.toggle_clutch()
            action = robot.send_action({"closure": 0.5, **pose})
            assert np.linalg.norm([action[f"arm_target.{name}"] for name in names[3:]]) == pytest.approx(1)
            sent = action["arm_target.x_m"]
            assert time.monotonic() < until_s, words
        while not next(robot._joined[0]).arm.startswith(("idle", "stopped")):
            assert time.monotonic() < until_s
    recorded = open_recording(tmp_path / "recorded")
    turns = list(recorded["/arm/turn"])
    assert max(given.position[0] for turn in turns for given in turn.poses) == pytest.approx(1.0)
    went = [(row.taken_ns / 1e9, np.array(row.position)) for row in recorded["/arm/target"]]
    assert max(place[0] for _, place in went) <= 0.70 + 1e-9
    for (t_s, before), (later_s, later) in pairwise(went):
        assert np.linalg.norm(later - before) <= 0.25 * (later_s - t_s) + 1e-5
    assert any("no pose came" in turn.reason for turn in turns[-500:])
    assert buttons.lab.limp()


def test_a_teleoperator_gives_the_target_of_the_arm_that_its_tracker_leads(
    buttons: Buttons, tmp_path: Path
) -> None:
    from tega_lerobot.plugin import TegaRobot, TegaRobotConfig, TegaTeleoperator, TegaTeleoperatorConfig

    where = written(buttons.lab, tmp_path)
    with TegaRobot(TegaRobotConfig(**where)) as robot:
        with TegaTeleoperator(TegaTeleoperatorConfig(**where)) as teleoperator:
            action = teleoperator.get_action()
            assert set(action) == set(teleoperator.action_features) == set(robot.action_features)
            at = robot.get_observation()
            for name in ("x_m", "y_m", "z_m", "qx", "qy", "qz", "qw"):
                assert action[f"arm_target.{name}"] == pytest.approx(at[f"arm.{name}"], abs=0.02)
            sent = robot.send_action(action | {"arm_target.x_m": 0.9})
            assert sent["arm_target.x_m"] == pytest.approx(at["arm.x_m"], abs=0.02)
        with pytest.raises(ConfigError, match="the settings' tracker leads the arm, not LeRobot"):
            robot.send_action(action)


def test_a_lost_camera_ends_lerobot(bench: Bench) -> None:
    running = bench.lerobot("teleoperate", "--fps=15", "--teleop_time_s=200")
    moved = bench.moves(running)
    bench.lab.sensors["thumb"].kill()
    message, _ = running.communicate(timeout=300)
    assert moved, message
    assert running.returncode == 1
    assert "/tactile/thumb/image: nothing new for" in message
    assert bench.silent()


def test_settings_that_lerobot_cannot_use_are_refused(tmp_path: Path) -> None:
    from tega_lerobot.plugin import TegaRobot, TegaRobotConfig, TegaTeleoperator, TegaTeleoperatorConfig

    path = tmp_path / "lab.toml"
    path.write_text('[session]\npace = "fast"\n[tactile.thumb]\ndriver = "synthetic-touch"\n')
    where: dict[str, Any] = {"settings": path, "calibration_dir": tmp_path}
    with pytest.raises(ConfigError, match="needs muscles"):
        TegaTeleoperator(TegaTeleoperatorConfig(**where))
    with pytest.raises(ConfigError, match="observe: no feature 'torque'"):
        TegaRobot(TegaRobotConfig(**where, observe=["torque"]))
    with pytest.raises(ConfigError, match="LeRobot runs in real time"):
        TegaRobot(TegaRobotConfig(**where)).connect()
    arm = '[input.dead_man]\ndriver = "spacemouse"\noptions = { silent_after_ms = 100 }\n'
    arm += '[arm]\ndriver = "simulated-arm"\n'
    path.write_text(f'{arm}mapping = {{ frame = "base" }}\n[tactile.thumb]\ndriver = "synthetic-touch"\n')
    with pytest.raises(ConfigError, match="LeRobot leads the arm to poses, not by motion"):
        TegaRobot(TegaRobotConfig(**where))
    with pytest.raises(ConfigError, match=r"missing\.toml"):
        TegaRobot(TegaRobotConfig(**where | {"settings": tmp_path / "missing.toml"}))
