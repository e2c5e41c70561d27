"""An arm that a Python program leads: within workspace and limits, and at rest when its poses lapse."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tega.config import SessionConfig, check_tree
from tega.errors import DeviceUnavailableError, InvalidValueError
from tega.loop.program import ProgramSession, session
from tega.recording.opened import open_recording
from tega.recording.replay import replay_file
from tega_emulators.lab import EmulatedLab, emulated_lab

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform == "win32", reason="emulated devices need Linux or macOS"),
]

Place = np.ndarray[Any, Any]

_NO_TURN = (0.0, math.sqrt(0.5), 0.0, math.sqrt(0.5))
_DEAD_MAN, _CLUTCH = 0, 1


@pytest.fixture
def lab(tmp_path: Path) -> Iterator[EmulatedLab]:
    with emulated_lab(tmp_path, arm=True) as lab:
        yield lab


def settings(lab: EmulatedLab, folder: Path, **more: Any) -> SessionConfig:
    arm = {name: value for name, value in lab.tree["arm"].items() if name != "tracker"} | more
    recording = {"dir": str(folder / "session"), "stop_free_mib": 0.0}
    return check_tree({**lab.tree, "arm": arm, "recording": recording}, {}, base=folder).config


class Operator:
    """Holds dead-man and clutch while a program leads the arm, and takes hold again where a slow machine lost it."""

    def __init__(self, s: ProgramSession, lab: EmulatedLab) -> None:
        self.s, self._lab = s, lab
        self._pressed = False
        self.words = ""

    def step(self, place: Any = None, *, for_s: float = 0.5) -> Place:
        for _ in range(600):
            if place is not None:
                self.s.arm.pose(place, _NO_TURN, for_s=for_s)
            snapshot = next(self.s)
            self.words = snapshot.arm
            if place is not None and self._pressed and "press it again" in self.words:
                self._press("lift")
            elif place is not None and not self._pressed and "clutch is open" in self.words:
                self._press("press")
            if snapshot.seen_arm is not None and snapshot.seen_arm.hand_m is not None:
                return np.array(snapshot.seen_arm.hand_m)
        pytest.fail(self.words)

    def _press(self, how: str) -> None:
        self._pressed = how == "press"
        for button in (_DEAD_MAN, _CLUTCH):
            self._lab.cap.say(f"{how} {button}")

    def until(self, enough: Callable[[Place], object], place: Any = None) -> None:
        for _ in range(900):
            if enough(self.step(place)):
                return
        pytest.fail(self.words)


def targets(folder: Path) -> list[tuple[float, Place]]:
    return [(row.taken_ns / 1e9, np.array(row.position)) for row in open_recording(folder)["/arm/target"]]


def test_absolute_poses_are_reached_within_box_and_speed_and_lapse(lab: EmulatedLab, tmp_path: Path) -> None:
    config = settings(lab, tmp_path, mapping={"frame": "base", "absolute": True})
    with session(config) as s:
        operator = Operator(s, lab)
        # Taking hold does not take it for where the hand is.
        near = operator.step() + np.array([0.0, 0.03, 0.0])
        operator.until(lambda hand: np.linalg.norm(hand - near) < 0.005, near)
        place = near.copy()
        for place[0] in np.arange(near[0] + 0.02, 1.02, 0.02):  # faster than it may go, and out of the box
            operator.step(place)
        operator.until(lambda hand: hand[0] > 0.69, place)
        for place[0] in np.arange(0.96, 0.65, -0.02):  # on the way back nothing of the way outside is left
            operator.step(place)
        operator.until(lambda hand: hand[0] < place[0] + 0.005, place)
        operator.until(lambda _: operator.words.startswith(("idle", "stopped")))
    path = tmp_path / "session" / s.summary["recording"]["file"]
    turns = list(open_recording(path)["/arm/turn"])
    assert max(pose.position[0] for turn in turns for pose in turn.poses) >= 1.0
    went = targets(path)
    assert max(place[0] for _, place in went) <= 0.70 + 1e-9
    for (t_s, before), (later_s, later) in pairwise(went):
        assert np.linalg.norm(later - before) <= 0.25 * (later_s - t_s) + 1e-5
    last = max(k for k, turn in enumerate(turns) if turn.poses)
    lapsed = [turn for turn in turns[last:] if turn.t_ns > turns[last].t_ns + 150_000_000]
    assert {turn.state for turn in lapsed} <= {"holding", "idle", "stopped"}
    assert any("no pose came" in turn.reason for turn in lapsed)
    rest = [np.array(turn.target[:3]) for turn in lapsed if turn.target]
    assert np.linalg.norm(rest[-1] - rest[-2]) < 1e-6
    assert s.summary["arm"]["led_by"] == "a program"
    assert replay_file(path).same


def test_a_pose_far_from_the_last_one_moves_nothing(lab: EmulatedLab, tmp_path: Path) -> None:
    config = settings(lab, tmp_path, mapping={"frame": "base", "absolute": True})
    with session(config) as s:
        operator = Operator(s, lab)
        start = operator.step()
        operator.until(lambda _: operator.words.startswith("following"), start)
        s.arm.pose(start + np.array([0.2, 0.0, 0.0]), _NO_TURN)
        operator.until(lambda _: not operator.words.startswith("following"))
    path = tmp_path / "session" / s.summary["recording"]["file"]
    assert any("it jumped by 200 mm" in turn.reason for turn in open_recording(path)["/arm/turn"])
    assert max(np.linalg.norm(place - start) for _, place in targets(path)) < 0.005


def test_without_absolute_a_program_s_motion_is_the_arm_s(lab: EmulatedLab, tmp_path: Path) -> None:
    with session(settings(lab, tmp_path, mapping={"frame": "base"})) as s:
        operator = Operator(s, lab)
        start = operator.step()
        place = np.zeros(3)
        operator.until(lambda _: operator.words.startswith("following"), place)
        for _ in range(300):
            place[1] += 0.002
            if operator.step(place)[1] > start[1] + 0.03:
                break
        went = operator.step(place) - start
    assert went[1] > 0.03
    assert np.abs(went[[0, 2]]).max() < 0.005


def test_what_is_no_pose_is_refused_and_a_tracker_keeps_its_arm(lab: EmulatedLab, tmp_path: Path) -> None:
    with session(settings(lab, tmp_path, mapping={"frame": "base"})) as s:
        next(s)
        for place, turn, why in (
            ((math.nan, 0, 0), _NO_TURN, "not finite"),
            ((0, 0), _NO_TURN, "not one place and one turn"),
            ((0, 0, 0), (0, 0, 0, 2), "length 2, not 1"),
            ((1e3, 0, 0), _NO_TURN, "lies 1e\\+03 m away"),
        ):
            with pytest.raises(InvalidValueError, match=why):
                s.arm.pose(place, turn)
        for for_s in (0, 11, math.nan):
            with pytest.raises(InvalidValueError, match="for_s"):
                s.arm.pose((0, 0, 0), _NO_TURN, for_s=for_s)
    config = check_tree(lab.tree, {}, base=tmp_path).config
    with pytest.raises(DeviceUnavailableError, match="something else leads the arm"), session(config) as s:
        s.arm.pose((0, 0, 0), _NO_TURN)
