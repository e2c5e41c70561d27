"""An arm in a run: a headset, a SpaceMouse's buttons and an arm, each in a process of its own."""

from __future__ import annotations

import csv
import math
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partialmethod
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from reference.parts import Running
from reference.processes import begun_by, until
from tega.arm import StampedPose
from tega.config import check_tree
from tega.loop.snapshot import Snapshot
from tega.records import ArmTurn
from tega_emulators.lab import EmulatedLab, emulated_lab
from tega_emulators.process import Emulator
from tega_emulators.scripted_poses import write_poses
from tega_emulators.vest_bench import seen_by

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="needs Linux or macOS")

_DEAD_MAN, _CLUTCH, _RECOVER = 0, 1, 2
_NO_TURN = (0.0, 0.0, 0.0, 1.0)


class Run(Running):
    def __init__(self, lab: EmulatedLab, folder: Path) -> None:
        self.lab, self._out = lab, folder / "out"
        tree = {**lab.tree, "session": {"out_dir": str(self._out)}}
        super().__init__(check_tree(tree, {}, base=folder).config)

    @property
    def alerts(self) -> str:
        return "; ".join(self.view.alerts)

    def until(self, enough: Callable[[], object]) -> None:
        """Wait; counted, so that a machine that stands still for a while is no failure."""
        for _ in range(6000):
            if enough():
                return
            assert self.thread.is_alive()
            time.sleep(0.01)
        raise AssertionError((self.view.arm, self.alerts, self.view.state, self.view.reason))

    def later(self, s: float) -> None:
        """Let the run go on for so long, on its own clock."""
        begin_ns = self.view.t_ns
        self.until(lambda: self.view.t_ns > begin_ns + 1e9 * s)

    def starts(self, *words: str) -> None:
        self.until(lambda: self.view.arm.startswith(words))

    def press(self, *buttons: int, how: str = "press") -> None:
        for button in buttons:
            self.lab.cap.say(f"{how} {button}")

    lift = partialmethod(press, how="lift")

    def hold(self) -> None:
        self.lift(_DEAD_MAN, _CLUTCH)
        self.starts("idle: the clutch is open")
        self.press(_DEAD_MAN, _CLUTCH)
        self.starts("following")

    def places(self, subject: str) -> list[tuple[float, tuple[float, ...]]]:
        named = [f"{subject}_{c}_m" for c in "xyz"]
        with (self._out / "arm.csv").open(encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
        return [(float(r["t_s"]), tuple(float(r[n]) for n in named)) for r in rows if r[named[0]]]


@contextmanager
def running(folder: Path, change: Callable[[dict[str, Any]], None] = lambda _tree: None) -> Iterator[Run]:
    with emulated_lab(folder, arm=True) as lab:
        change(lab.tree)
        with Run(lab, folder) as run:
            yield run


@pytest.mark.slow
def test_the_arm_follows_the_wrist_and_stays_within_its_limits(tmp_path: Path) -> None:
    with running(tmp_path) as run:
        run.hold()
        run.lab.headset.say("wave 0.1 0.3")
        run.until(lambda: run.view.t_ns > 4e9)
        run.lift(_DEAD_MAN)
        run.starts("holding: the dead-man switch is released")
        run.press(_DEAD_MAN)
        run.starts("following")
        run.lift(_CLUTCH)
        run.starts("idle: the clutch is open")
    went = [x for _, (x, _, _) in run.places("arm")]
    assert max(went) - min(went) > 0.05
    for (t_s, place), (later_s, later) in pairwise(run.places("target")):
        assert math.dist(place, later) <= 0.25 * (later_s - t_s) + 1e-5
        assert 0.30 <= later[0] <= 0.70
    text = run.summary["arm"]
    assert text["driver"] == "simulated-arm"
    # A machine that stands still for a while lets go, and takes hold anew.
    assert text["holds"] >= 2
    assert text["refused_commands"] == 0 or text["holds"] > 2
    assert text["led_by"].startswith("HoloLens at 127.0.0.1")
    assert text["state_s"]["following"] > 1
    assert text["ended"] == "the run has ended"
    assert "arm: simulated: a hand of 1 kg on a damped spring, no robot" in run.summary["notes"]


@pytest.mark.slow
def test_after_a_stop_a_person_says_with_the_dead_man_let_go_that_it_goes_on(tmp_path: Path) -> None:
    with running(tmp_path) as run:
        run.hold()
        run.lab.headset.say("freeze")
        run.starts("stopped: no pose came for more than 1000 ms")
        run.until(lambda: "hololens" in run.alerts)
        run.lab.headset.say("clear")
        run.until(lambda: "hololens" not in run.alerts)
        run.press(_RECOVER)  # while the dead-man is held it says nothing
        run.later(0.5)
        assert run.view.arm.startswith("stopped")
        run.lift(_RECOVER, _DEAD_MAN, _CLUTCH)
        run.later(0.2)
        run.press(_RECOVER)
        run.starts("idle")
        run.hold()
    assert run.summary["arm"]["state_s"]["stopped"] > 0


@pytest.mark.slow
@pytest.mark.raises("arm")
def test_an_arm_whose_process_is_killed_stops_and_the_run_goes_on(tmp_path: Path) -> None:
    with running(tmp_path) as run:
        run.hold()
        (pid,) = begun_by(os.getpid(), "tega.devices.arm.robot.process")
        os.kill(pid, signal.SIGKILL)
        run.starts("stopped: simulated-arm: the arm's process has ended (-9)")
        run.until(lambda: "has ended" in run.alerts)
        assert "no program controls the arm: use its switch if it moves" in run.alerts
    assert run.summary["ended"] == "stopped"
    assert "has ended (-9)" in run.summary["arm"]["ended"]


@pytest.mark.slow
def test_muscles_that_are_lost_hold_the_arm(tmp_path: Path) -> None:
    with emulated_lab(tmp_path, arm=True, emg_hz=250.0) as lab, Run(lab, tmp_path) as run:
        run.starts("idle")
        run.press(_DEAD_MAN)
        run.until(lambda: run.view.state == "active")
        run.hold()
        run.until(lambda: run.view.state == "active")
        run.starts("following")
        lab.emg.say("freeze 1")
        run.starts("holding: the run is not active")


@pytest.mark.slow
def test_a_loop_that_hangs_holds_the_arm(tmp_path: Path) -> None:
    hangs, turns = threading.Event(), list[ArmTurn]()
    with running(tmp_path) as run:
        run.bus.subscribe(Snapshot, lambda _: until(lambda: not hangs.is_set()))
        run.bus.subscribe(ArmTurn, turns.append)
        run.hold()
        hangs.set()
        until(lambda: turns[-1].state == "holding")
        hangs.clear()
        run.starts("following")


@pytest.mark.slow
def test_a_spacemouse_leads_the_arm_and_its_dead_man_is_its_clutch(tmp_path: Path) -> None:
    def by_cap(tree: dict[str, Any]) -> None:
        del tree["arm"]["tracker"], tree["input"]["clutch"]
        tree["input"]["motion"] = {"driver": "spacemouse"}
        tree["arm"]["mapping"] = {"frame": "base"}

    with running(tmp_path, by_cap) as run:
        run.starts("idle: the clutch is open")
        run.press(_DEAD_MAN)
        run.starts("following")
        run.lab.cap.say("push 0 -350 0 0 0 0")  # away from the operator
        run.until(lambda: run.view.inputs["motion"].state.motion[0] > 0.9)
        run.later(0.5)
        run.lab.cap.say("push 0 0 0 0 0 0")
        run.later(0.5)
        run.lift(_DEAD_MAN)
        run.starts("idle: the clutch is open")
    went = [x for _, (x, _, _) in run.places("arm")]
    assert went[-1] - went[0] > 0.02


@pytest.mark.slow
def test_a_recorded_path_moves_the_arm_as_it_was_recorded(tmp_path: Path) -> None:
    # Up by 10 cm and aside by 5, in two seconds of a minimum-jerk move; then still.
    poses = []
    for k in range(700):
        u = min(max((k / 60 - 8) / 2, 0), 1)
        s = 10 * u**3 - 15 * u**4 + 6 * u**5
        wobble = 1e-5 * (k % 2)
        poses.append(StampedPose(round(k / 60 * 1e9), (wobble, 0.05 * s, 0.1 * s), _NO_TURN))
    write_poses(tmp_path / "path.csv", poses)

    def recorded(tree: dict[str, Any]) -> None:
        file = {"file": str(tmp_path / "path.csv"), "frame": "base"}
        tree["arm"]["tracker"] = {"driver": "poses-file", "options": file}
        tree["arm"]["mapping"] = {"frame": "base"}

    with running(tmp_path, recorded) as run:
        run.hold()
        run.until(lambda: run.view.t_ns > 7e9)
        if not run.view.arm.startswith("following"):
            run.hold()  # a machine that stood still has made it let go; the path does not move yet
        run.until(lambda: "path.csv has ended" in run.alerts or run.view.arm.startswith("stopped"))
    went = [place for _, place in run.places("arm")]
    moved = [b - a for a, b in zip(went[0], went[-1], strict=True)]
    assert moved == pytest.approx([0.0, 0.05, 0.1], abs=5e-3)


def test_a_reflex_of_the_robot_stops_the_arm_until_the_button_says_that_it_may_go_on(tmp_path: Path) -> None:
    pytest.importorskip("franky", reason="comes with the extra arm-sim")
    pytest.importorskip("franky_sim", reason="comes with the extra arm-sim")
    with Emulator("franka_faults") as robot:

        def on_robot(tree: dict[str, Any]) -> None:
            options = {**robot.address, "robot": "fr3", "realtime": "ignore"}
            tree["arm"] |= {"driver": "franky", "options": options, "limits": {"upright": [0.0, 0.0, -1.0]}}

        with running(tmp_path, on_robot) as run:
            run.hold()
            run.until(lambda: "(following," in run.view.arm)
            robot.say("reflex")
            run.starts("stopped: franky: ")
            assert "cartesian_reflex" in run.alerts or "cartesian_reflex" in run.view.arm
            run.lift(_DEAD_MAN, _CLUTCH)
            run.press(_RECOVER)
            run.starts("idle")
            run.hold()
            run.until(lambda: "(following," in run.view.arm)
            assert "robot took 100 %" in run.view.arm


def test_a_hand_on_franky_sim_s_arm_grips_and_feels_while_the_arm_carries_it(tmp_path: Path) -> None:
    pytest.importorskip("franky", reason="comes with the extra arm-sim")
    pytest.importorskip("franky_sim", reason="comes with the extra arm-sim")
    with emulated_lab(
        tmp_path, arm="franky", emg_hz=250.0, hand=True, vest=True, fingers=("thumb",), camera_hz=30.0
    ) as lab:
        lab.go_ahead()
        with Run(lab, tmp_path) as run:
            run.starts("idle")
            run.press(_DEAD_MAN)
            run.until(lambda: run.view.state == "active")
            run.hold()
            run.until(lambda: lab.hand.say("look")["servo_on"] and any(lab.hand.say("look")["duties"]))
            begun = lab.robot.say("look")
            lab.headset.say("wave 0.06 0.2")
            run.until(lambda: math.dist(lab.robot.say("look")["place"], begun["place"]) > 0.04)
            felt = any(any(motors) for _, motors in seen_by(lab.vest).history)
            lab.headset.say("wave 0 0.2")
            run.lift(_DEAD_MAN)
            run.starts("holding: the dead-man switch is released", "idle")
    # The robot's own physics carried the hand's weight, which it was told of.
    assert begun["load_kg"] == pytest.approx(1.1)
    assert begun["mode"] == "kMove"
    assert felt
    went = [x for _, (x, _, _) in run.places("arm")]
    # The wrist waves along x; what the robot went besides, as under its load, counts in the 0.04 m as well.
    assert max(went) - min(went) > 0.03
    text = run.summary["arm"]
    assert text["driver"] == "franky"
    assert 0 < text["off_target_mm"]["rms"] <= text["off_target_mm"]["worst"]
    assert text["arm_hz"] > 0
