"""Between trials the arm goes to its start: told first, while the dead-man is held, within every limit of a run."""

from __future__ import annotations

import math
import os
import re
import signal
import sys
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Self

import numpy as np
import pytest

from reference.processes import hand_guards, until
from tega.arm import ArmChain, ArmSettings, StampedPose
from tega.arm.chain import Turn, lead
from tega.arm.move_to_start import SPEED_M_S, MoveToStart
from tega.arm.pose import ArmCommand, Pose
from tega.arm.settings import FilterSettings, LimitSettings, MappingSettings
from tega.arm.workspace import Workspace
from tega.config import check_tree, load_config
from tega.errors import ConfigError
from tega.hand import CLOSURE_POSES_RAD
from tega.loop.arm_records import arm_row
from tega.records import ArmMeasured, ArmTurn
from tega.records.bus import Bus
from tega_bench import homing
from tega_bench.homing import Settling, go_to_start
from tega_emulators.lab import EmulatedLab, emulated_lab
from tega_study.lead.benches import LabBench
from tega_study.lead.rest_tasks import RestTaskEndedError, RunningTask
from tega_study.lead.running_trial import in_thread

_UPRIGHT = (0.0, 0.7071067811865476, 0.0, 0.7071067811865476)
_LEANS = (0.1305262, 0.7010574, 0.0922959, 0.6903455)
_TICK_NS = 10_000_000


def emulated(test: Any) -> Any:
    unix = pytest.mark.skipif(sys.platform == "win32", reason="needs Linux or macOS")
    return pytest.mark.slow(unix(test))


class _Simulated:
    """A chain that the way leads, and an arm that is where the target was a tick ago."""

    def __init__(self, start: Pose, here: Pose, limits: LimitSettings) -> None:
        self.route, mapping = MoveToStart(start), MappingSettings(frame="base", mirror=False)
        self.chain = ArmChain(ArmSettings(mapping=mapping, filter=FilterSettings(on=False), limits=limits))
        self.here, self.now_ns = here, 0
        self.course: list[ArmCommand] = []

    def ticks(self, n: int, *, held: bool, blocked: bool = False) -> None:
        for _ in range(n):
            self.now_ns += _TICK_NS
            measured = StampedPose(self.now_ns, self.here.position_m, self.here.quaternion_xyzw)
            turn = Turn(
                self.now_ns, tuple(self.route.read(self.now_ns)), clutch=held, dead_man=held, may_move=True,
                measured=measured,
            )  # fmt: skip
            command = lead(self.chain, turn)
            self.course.append(command)
            if command.target is not None and not blocked:
                self.here = command.target
            follows: Any = SimpleNamespace(phase="following")
            self.route.saw(arm_row(turn, command, follows, 0))


def _pose(place: tuple[float, ...], turn: tuple[float, ...] = _UPRIGHT) -> Pose:
    return Pose(np.array(place), np.array(turn) / math.hypot(*turn))


@pytest.mark.parametrize(
    ("here", "start"),
    [
        (_pose((0.62, -0.30, 0.06)), _pose((0.40, 0.20, 0.30))),
        (_pose((0.40, 0.20, 0.60), _LEANS), _pose((0.62, -0.30, 0.10))),
        (_pose((0.5, 0.0, 0.3)), _pose((0.5, 0.0, 0.3), _LEANS)),
        (_pose((0.5, 0.0, 0.3)), _pose((0.5, 0.0, 0.3))),
        (_pose((0.3, -0.4, 0.03)), _pose((0.7, 0.4, 0.7), _LEANS)),
    ],
)
def test_the_way_leads_up_over_and_down_within_the_limits(here: Pose, start: Pose) -> None:
    limits = LimitSettings(speed_m_s=SPEED_M_S, turn_rad_s=0.5)
    arm = _Simulated(start, here, limits)
    arm.ticks(10, held=False)
    while not arm.route.there and len(arm.course) < 2000:
        arm.ticks(10, held=True)
    arm.ticks(100, held=True)
    assert arm.route.there
    assert (arm.route.off_m or 0.0) < 0.003
    workspace = Workspace(limits)
    top_m = max(here.position_m[2], start.position_m[2])
    targets = [command.target for command in arm.course if command.target is not None]
    for one, other in pairwise(targets):
        assert not workspace.outside(other)
        assert math.dist(one.position_m, other.position_m) <= SPEED_M_S * 0.01 + 1e-9
    for target in targets:
        aside_m = math.dist(target.position_m[:2], here.position_m[:2])
        left_m = math.dist(target.position_m[:2], start.position_m[:2])
        if aside_m > 0.02 and left_m > 0.02:
            assert target.position_m[2] > top_m - 0.01


def test_the_way_stops_with_the_switch_and_goes_on_with_it() -> None:
    arm = _Simulated(_pose((0.40, 0.20, 0.30)), _pose((0.6, -0.2, 0.1)), LimitSettings(speed_m_s=SPEED_M_S))
    arm.ticks(200, held=True)
    assert arm.course[-1].target is None, "a switch that was held from the start moves nothing"
    arm.ticks(1, held=False)
    arm.ticks(150, held=True)
    moved_m = math.dist(arm.here.position_m, (0.6, -0.2, 0.1))
    assert moved_m > 0.05
    arm.ticks(20, held=False)
    rested = arm.here.position_m.copy()
    arm.ticks(200, held=False)
    assert math.dist(arm.here.position_m, rested) < 1e-9
    assert not arm.route.there
    arm.ticks(1500, held=True)
    assert arm.route.there
    assert math.dist(arm.here.position_m, (0.40, 0.20, 0.30)) < 0.003


def test_an_arm_that_was_held_back_does_not_catch_up() -> None:
    arm = _Simulated(_pose((0.40, 0.20, 0.30)), _pose((0.6, -0.2, 0.3)), LimitSettings(speed_m_s=SPEED_M_S))
    arm.ticks(5, held=False)
    arm.ticks(1000, held=True, blocked=True)
    given_m, target = arm.route.read(arm.now_ns)[0].position_m, arm.course[-1].target
    assert target is not None
    assert math.dist(target.position_m, (0.6, -0.2, 0.3)) <= 0.03 + 1e-9, "the clip"
    assert math.dist(given_m, (0.40, 0.20, 0.30)) < 0.06, "the forearm went little further than the clip"
    arm.ticks(1500, held=True)
    assert arm.route.there


def test_below_its_own_speed_a_short_way_is_led_no_further_than_the_start() -> None:
    here = (0.5, 0.0, 0.3)
    arm = _Simulated(_pose((0.5, 0.0, 0.32)), _pose(here), LimitSettings(speed_m_s=0.05))
    arm.ticks(5, held=False)
    arm.ticks(400, held=True)
    assert arm.route.there
    highest_m = max(command.target.position_m[2] for command in arm.course if command.target is not None)
    assert highest_m == pytest.approx(0.32, abs=0.0005)


@pytest.mark.parametrize(
    ("off_mm", "rests_s"),
    [
        (lambda _: 8.0, 1.0),  # friction keeps it there
        (lambda t_s: max(8.0 - 4.0 * t_s, 2.0), 2.5),
        (lambda t_s: 5.0 + math.sin(6.0 * t_s), 5.0),  # it never rests
    ],
)
def test_the_way_ends_when_the_arm_itself_rests(off_mm: Callable[[float], float], rests_s: float) -> None:
    settling, times_s = Settling(), [t / 100 for t in range(1000)]
    assert not settling.rests(0.0, there=True, off_m=0.02)
    assert not settling.rests(5.0, there=False, off_m=0.02)  # the switch was let go
    ended_s = next(t for t in times_s if settling.rests(9.0 + t, there=True, off_m=off_mm(t) / 1000))
    assert ended_s == pytest.approx(rests_s, abs=0.15)


@pytest.mark.parametrize(
    ("sets", "text"),
    [
        (["arm.start_m=[0.5, 0.0, 0.9]"], "200 mm outside of the workspace along z"),
        (["arm.start_m=[0.5, 0.0, 0.3]", "arm.start_xyzw=[0, 0, 0, 1]"], "leans"),
        (["arm.start_m=[0.5, 0.0, 0.3]", "arm.start_xyzw=[0, 0, 0, 0]"], "length 0, not 1"),
        (["arm.start_m=[0.5, nan, 0.3]"], "no place"),
    ],
)
def test_a_start_that_cannot_be_is_refused(sets: list[str], text: str) -> None:
    pedal = ["input.dead_man.driver=pedal", "input.dead_man.options.silent_after_ms=100"]
    with pytest.raises(ConfigError, match=text):
        load_config(None, environ={}, sets=["arm.driver=simulated-arm", *pedal, *sets])


class _Hearing:
    def __init__(self, check: Callable[[str], None] = lambda _prompt: None) -> None:
        self.said: list[str] = []
        self._check = check

    def show(self, prompt: str, _bars: Any, _left_s: float | None, /) -> None:
        words = prompt.split(":", maxsplit=1)[0].split(" (", maxsplit=1)[0]
        if self.said[-1:] != [words]:
            self.said.append(words)
        self._check(prompt)


class _Way:
    """A way to the start that goes on in a thread; at the end of the ``with`` block it is over."""

    def __init__(self, lab: EmulatedLab, folder: Path) -> None:
        lab.tree["arm"] |= {"start_m": [0.42, 0.08, 0.36]}
        self.lab, self._config = lab, check_tree(lab.tree, {}, base=folder).config
        self.places, self.turns = list[tuple[float, ...]](), list[ArmTurn]()
        self.prompts, self.found = list[str](), list[str]()
        self.hearing, self._over = _Hearing(self._check), threading.Event()

    def _check(self, prompt: str) -> None:
        self.prompts.append(prompt)
        if self._over.is_set():
            raise RestTaskEndedError

    def switch(self, *words: str) -> None:
        """Let go of dead-man and clutch, or hold both, and let some turns go by."""
        for word in words:
            for button in (0, 1):
                self.lab.cap.say(f"{word} {button}")
            n = len(self.turns)
            until(lambda n=n: len(self.turns) > n + 5)  # type: ignore[misc]

    def __enter__(self) -> Self:
        bus = Bus()
        bus.subscribe(ArmMeasured, lambda pose: self.places.append(pose.position))
        bus.subscribe(ArmTurn, self.turns.append)
        self.going, self.raised = in_thread(
            lambda: self.found.append(go_to_start(self._config, self.hearing, reported_s=0.5, bus=bus))
        )
        return self

    def __exit__(self, *_error: object) -> None:
        self._over.set()
        self.going.join(30)


@emulated
def test_the_emulated_arm_and_hand_go_to_their_start_while_the_switch_is_held(tmp_path: Path) -> None:
    with emulated_lab(tmp_path, arm=True, hand=True) as lab:
        for button in (0, 1):  # held before anybody is told
            lab.cap.say(f"press {button}")
        with _Way(lab, tmp_path) as way:
            places, turns, hearing = way.places, way.turns, way.hearing
            until(lambda: "hold the dead-man switch, and the arm moves to its start" in hearing.said)
            time.sleep(0.3)
            assert not any(turn.state == "following" for turn in turns)
            assert math.dist(places[-1], places[0]) < 1e-3
            way.switch("lift")
            until(lambda: "the clutch is open" in turns[-1].reason)
            way.switch("press")
            until(lambda: math.dist(places[-1], places[0]) > 0.03)
            lab.cap.say("lift 0")
            until(lambda: turns[-1].state == "holding")
            until(lambda: turns[-1].velocity[:3] == (0.0, 0.0, 0.0))
            rests = turns[-1].target
            time.sleep(0.3)
            assert turns[-1].target == pytest.approx(rests, abs=1e-9)
            lab.cap.say("press 0")
            until(lambda: not way.going.is_alive())
        assert way.raised == []
        (text,) = way.found
        assert hearing.said[0] == "THE ARM WILL MOVE"
        assert text.startswith("the arm is at its start")
        assert "; the hand is open, " in text
        assert math.dist(places[-1], (0.42, 0.08, 0.36)) < 0.01
        until(lab.limp)


@emulated
def test_a_hand_that_does_not_open_is_told_as_far_as_it_is(tmp_path: Path) -> None:
    with emulated_lab(tmp_path, arm=True, hand=True) as lab:
        config = check_tree(lab.tree, {}, base=tmp_path).config
        with ExitStack() as stack:
            hand: Any = homing._Opening(stack, config)
            until(lambda: bool(hand._hand.angles_rad.any()) and not np.isnan(hand._hand.angles_rad).any())
            hand._hand.step(5)
            closed_rad = CLOSURE_POSES_RAD[4]
            until(lambda: (hand._hand.step(5), np.abs(hand._hand.angles_rad - closed_rad).max() < 0.1)[1])
            text = re.fullmatch(r"; the hand was commanded to open and is (\d\.\d\d) rad off", hand.words)
            assert text is not None
            assert float(text[1]) > 0.5
            until(lambda: (hand.check(1.0, may_move=True), "the hand is open" in hand.words)[1])


@emulated
def test_the_way_to_the_start_holds_while_the_hand_s_guard_is_lost(tmp_path: Path) -> None:
    with emulated_lab(tmp_path, arm=True, hand=True) as lab:
        with _Way(lab, tmp_path) as way:
            turns = way.turns
            until(lambda: any(prompt.startswith("hold the dead-man") for prompt in way.prompts))
            way.switch("lift", "press")
            until(lambda: turns[-1].state == "following")
            for pid in hand_guards():
                os.kill(pid, signal.SIGKILL)
            until(lambda: any("lets go of the hand was lost" in prompt for prompt in way.prompts))
            until(lambda: any(turn.dead_man and not turn.may_move for turn in turns))
            assert all(turn.state == "holding" for turn in turns if turn.dead_man and not turn.may_move)
            until(lambda: turns[-1].may_move)
            assert len(hand_guards()) == 1
            way.switch("lift", "press")
            until(lambda: not way.going.is_alive())
        assert way.raised == []
        assert way.found[0].startswith("the arm is at its start")
        until(lab.limp)


@emulated
def test_nobody_at_the_switch_moves_nothing_and_the_experimenter_ends_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("foxglove")
    monkeypatch.setattr(homing, "PATIENCE_S", 1.0)
    with emulated_lab(tmp_path, emg_hz=250.0, fingers=("thumb",), arm=True) as lab:
        (squeeze,) = LabBench(check_tree(lab.tree, {}, base=tmp_path).config).rest_tasks
        assert squeeze.key == "g"
        lab.tree["arm"] |= {"start_m": [0.42, 0.08, 0.36]}
        config = check_tree(lab.tree, {}, base=tmp_path).config
        with pytest.raises(TimeoutError, match="the dead-man switch was not held for 1 s"):
            go_to_start(config, _Hearing(), reported_s=0.1)
        squeeze, to_start = LabBench(config).rest_tasks
        assert (squeeze.after_trials, to_start.after_trials) == (False, True)
        running = RunningTask(to_start)
        until(lambda: running.prompt.startswith("THE ARM WILL MOVE"))
        running.end()
        assert running.result() == "ended by the experimenter"
