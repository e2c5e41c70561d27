"""The arm in settings, in ``doctor``, in ``init`` and on displays."""

from __future__ import annotations

import sys
from collections import defaultdict
from io import StringIO
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest
from rich.console import Console

from reference.parts import observed
from tega.arm.messages import Health
from tega.config import ArmConfig, check_tree, load_config
from tega.devices.input.spacemouse import SpaceMouse
from tega.errors import ConfigError
from tega.loop import run_session
from tega.loop.arm import Steering
from tega.loop.arm_records import ArmView
from tega.loop.snapshot import LoopView, Moments, Snapshot
from tega.recording.replay.play import _settings
from tega.records.bus import Bus
from tega.safety.guard import Guard
from tega.setup.doctor import Finding, examine, lab_settings
from tega.ui.cli.main import main
from tega.ui.view.browser.state_html import arm_html
from tega.ui.view.terminal import render
from tega_emulators.lab import emulated_lab
from tega_emulators.process import Emulator

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="needs Linux or macOS")


def reported(tree: dict[str, Any], folder: Path) -> dict[str, list[Finding]]:
    by_check = defaultdict(list)
    for finding in examine(check_tree(tree, {}, base=folder).config, name="lab.toml").findings:
        by_check[finding.check].append(finding)
    return by_check


@pytest.mark.slow
def test_arm_and_tracker_are_tried_and_what_is_lost_is_told(tmp_path: Path) -> None:
    with emulated_lab(tmp_path, arm=True) as lab:
        found = reported(lab.tree, tmp_path)
        assert [f.status for f in found["arm"] + found["arm.tracker"]] == ["ok", "ok"]
        assert found["arm"][0].finding == "simulated-arm is open; its hand is at 0.500 0.000 0.300 m"
        assert found["arm"][0].measured["loop_hz"] > 0
        assert "sees the forearm" in found["arm.tracker"][0].finding
        lab.headset.say("lose")
        lost = reported(lab.tree, tmp_path)["arm.tracker"][0]
        assert (lost.status, lost.finding.split(", ")[-1]) == ("warning", "and calls all of them lost")
        del lab.tree["arm"]["tracker"], lab.tree["input"]["dead_man"]
        message = [f.finding for f in reported(lab.tree, tmp_path)["arm"] if f.status == "error"]
    assert message == [
        "no dead-man switch is set, and without one a run leads no arm",
        "nothing leads the arm: neither arm.tracker nor input.motion is set",
        "arm.mapping.frame is 'openxr', but what leads the arm gives poses in the axes 'base'",
    ]


def test_a_robot_is_asked_and_the_exact_fix_is_told(tmp_path: Path) -> None:
    pytest.importorskip("franky", reason="comes with the extra arm-sim")
    pytest.importorskip("franky_sim", reason="comes with the extra arm-sim")
    with Emulator("franka_faults") as robot:
        arm = {"driver": "franky", "options": {**robot.address, "realtime": "ignore"}}
        tree: dict[str, Any] = {"arm": arm}
        fine, mistaken = reported(tree, tmp_path)["arm"][:2]
        assert fine.status == "ok"
        assert fine.finding.startswith(f"robot server 10 (FR3) at {robot.address['host']}; franky-control 2.")
        assert mistaken.finding == "the settings say panda, and the robot is an FR3"
        assert mistaken.todo == ("set arm.options.robot = 'fr3': the joints have other limits",)
        tree["arm"]["options"] |= {"robot": "fr3", "realtime": "enforce"}
        machine = [f for f in reported(tree, tmp_path)["arm"] if "PREEMPT_RT" in f.finding]
        assert all(f.status == "ok" or f.todo for f in machine)
    gone = reported(tree, tmp_path)["arm"][0]
    assert gone.status == "missing"
    assert "cannot be reached" in gone.finding
    assert "FCI" in " ".join(gone.todo)


@pytest.mark.parametrize("driver", ["simulated-arm", "franky"])
def test_settings_with_an_arm_are_written_only_when_asked(tmp_path: Path, driver: str) -> None:
    path = tmp_path / "lab.toml"
    path.write_text(lab_settings({}, name=path.name), encoding="utf-8")
    assert load_config(path, environ={}).config.arm is None
    assert '# driver = "franky"' in path.read_text(encoding="utf-8")
    path.write_text(lab_settings({}, name=path.name, arm=driver), encoding="utf-8")
    arm = load_config(path, environ={}).config.arm
    assert arm is not None
    assert (arm.driver, arm.mapping.frame) == (driver, "base")


def test_init_refuses_an_arm_that_is_none(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["init", "--out", str(tmp_path / "lab.toml"), "--arm", "spacemouse"])
    assert "kind 'input', not 'arm'" in capsys.readouterr().err
    assert not (tmp_path / "lab.toml").exists()


def test_page_and_terminal_say_what_the_arm_does_and_where_the_hand_is() -> None:
    health = Health(200.0, 6.0, 1, 2, 0.99)
    where = ("following", True, False, (0.5, -0.01, 0.3), 12.4)
    seen = ArmView("holding", "no pose for <0.1 s", *where, health)
    view = LoopView(0, {}, None, None, None, {}, arm=seen.words, seen_arm=seen)
    console = Console(width=120, record=True, file=StringIO())
    console.print(render(view, title="", rates_hz={}))
    page, screen = arm_html(view), " ".join(console.export_text().replace("│", " ").split())
    assert "ARM HOLDING</b> no pose for &lt;0.1 s" in page
    assert "200 Hz, worst 6 ms, 2 commands refused · robot took 99 %" in page
    for displayed in (page, screen):
        assert "clutch pressed, dead-man let go" in displayed
        assert "hand at +0.500 -0.010 +0.300 m, 12 mm from its target" in displayed
    assert "arm holding: no pose for <0.1 s (following, 200 Hz" in screen
    unseen = view._replace(arm="idle: <who> knows", seen_arm=None)
    assert arm_html(unseen).endswith("<b>arm</b> idle: &lt;who&gt; knows</div>")
    assert arm_html(unseen._replace(arm="")) == ""
    # Displays keep the last moment: not that the arm follows, or that the reflex adds.
    moments, views = Moments(Bus(), guard=Guard()), list[LoopView]()
    moments._displayed = Snapshot(t_ns=0, view=view._replace(reflex="+1.00 levels added"))
    observed(views.append, moments._bus)
    moments.stopped(None, [])
    assert views[0].reflex == ""
    assert arm_html(views[0]).endswith("<b>arm</b> the run has ended</div>")


def test_an_arm_whose_poses_cannot_be_read_is_stopped_for_that_reason() -> None:
    arm: Any = Mock(phase="ready", problem="", health=Health(), measured=lambda: None)
    arm.read.side_effect = OSError("unplugged")
    steering = Steering(ArmConfig(driver="simulated-arm"), arm, arm, tracker=None, led_by=arm.info, seats={})
    steering._run(bool)
    view = steering.displayed(LoopView(0, {}, None, None, None, {}))
    assert view.arm.startswith("stopped: arm: no longer led: unplugged (ready, ")


_HELD = ("input.dead_man.driver=spacemouse", "input.dead_man.options.silent_after_ms=1000")
_LED = ("input.motion.driver=spacemouse", "arm.mapping.frame=base", "arm.mapping.absolute=true")
_TRACKED = ("arm.tracker.driver=hololens", "arm.tracker.options.host=h", "arm.mapping.frame=base")


@pytest.mark.parametrize(
    ("sets", "text"),
    [
        (_HELD, "nothing leads it"),
        (_HELD + _LED, "absolute is for programs"),
        ((), "no dead-man switch is set"),
        (("session.pace=fast",), "an arm moves in real time"),
        (_HELD + _TRACKED, "set arm.mapping.frame = 'openxr'"),
        (("arm.limits.low_m=[0.8, -0.4, 0.0]",), "workspace's x goes from 0.8 to 0.7 m"),
        (("arm.options.speed=1",), "did you mean 'speed_m_s'"),
        (("arm.tracker.driver=spacemouse",), "kind 'input', not 'tracker'"),
    ],
)
def test_settings_of_an_arm_that_do_not_fit_are_said_in_words(
    sets: tuple[str, ...], text: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(SpaceMouse, "open", lambda _self: None)
    with pytest.raises(ConfigError, match=text):
        run_session(load_config(None, environ={}, sets=["arm.driver=simulated-arm", *sets]).config)


def test_a_recording_that_is_played_moves_no_arm() -> None:
    then = load_config(None, environ={}, sets=["arm.driver=simulated-arm"]).config
    assert then.arm is not None
    assert _settings(then, then, speed=1.0, vest_pace="steady").arm is None
