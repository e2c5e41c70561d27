"""The driver ``panda``: its own logic on a stand-in for panda-python, and what it calls held against the library.

No robot moved: there is none that panda-python's wheel speaks to, simulated or not.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

import msgspec
import numpy as np
import pytest

from reference import panda_stand_in
from tega.arm.messages import ArmStatusWords, ArmTargetWords, Recover
from tega.devices.arm.panda_arm import PandaArm, PandaArmOptions
from tega.devices.arm.robot import panda_body
from tega.devices.arm.robot.leash import Leash
from tega.devices.arm.robot.panda_body import PandaBody
from tega.devices.arm.robot.process import Loop, ProcessSettings
from tega.errors import DeviceUnavailableError, WrongDeviceError
from tega_emulators.process import Emulator

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="needs Linux or macOS")

_TURN = (0.0, 0.0, 0.0, 1.0)


@pytest.fixture
def body(monkeypatch: pytest.MonkeyPatch) -> PandaBody:
    for name, module in panda_stand_in.library().items():
        monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.setattr(panda_body, "server_version", lambda _host: 5)
    options = PandaArmOptions(host="192.0.2.1", realtime="ignore")
    return PandaBody(msgspec.to_builtins(options))


class Robot:
    """The arm's process without the process, on the stand-in."""

    def __init__(self, body: PandaBody) -> None:
        body.open()
        settings = ProcessSettings(0, 7, "", {}, 200.0, 0.5, 1.5)
        self.body, self.loop, self.n, self.hold = body, Loop(settings, body, Leash(7)), 0, 1
        self.panda = panda_stand_in.Panda.newest

    def go(self, turns: int, place: tuple[float, float, float] | None) -> ArmStatusWords:
        for _ in range(turns):
            now_ns = time.monotonic_ns()
            self.n += 1
            turn, state = (None, "idle") if place is None else (_TURN, "following")
            asked = ArmTargetWords(7, self.n, now_ns, state, self.hold, place, turn)  # type: ignore[arg-type]
            self.loop.take(asked, now_ns)
            told = self.loop.tick(time.monotonic_ns())
            time.sleep(0.005)
        return told

    def until(self, enough: Callable[[], object], place: tuple[float, float, float] | None) -> ArmStatusWords:
        for _ in range(1000):
            told = self.go(1, place)
            if enough():
                return told
        raise AssertionError(told)


def test_it_follows_no_farther_ahead_than_the_clip_and_comes_to_rest(body: PandaBody) -> None:
    robot = Robot(body)
    thresholds = robot.panda.thresholds
    assert thresholds == ([35.0] * 7, [35.0] * 7, [60.0] * 6, [60.0] * 6)
    assert robot.go(1, None).phase == "ready"
    told = robot.until(lambda: robot.panda.place[0] > 0.58, (0.6, 0.0, 0.3))
    assert (told.phase, told.led is not None) == ("following", True)
    controller = robot.panda.controller
    assert controller is not None
    assert np.diag(controller.impedance).tolist() == [400.0] * 3 + [20.0] * 3
    assert controller.asked[0] == pytest.approx((0.5, 0.0, 0.3), abs=0.02 + 1e-9)
    robot.go(1, None)
    robot.until(lambda: not body.in_control, None)
    assert robot.go(1, None).phase == "ready"


def test_the_target_is_clipped_to_where_the_hand_is(body: PandaBody) -> None:
    robot = Robot(body)
    robot.go(1, (0.5, 0.0, 0.3))
    body.lead((0.9, 0.0, 0.3), _TURN, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    assert robot.panda.controller is not None
    ahead = robot.panda.controller.asked[-1] - np.array(body.see().place)
    assert np.linalg.norm(ahead) <= 0.02 + 1e-9


def test_a_reflex_is_told_and_cleared_by_a_person_only(body: PandaBody) -> None:
    robot = Robot(body)
    robot.go(5, (0.5, 0.0, 0.3))
    recovered, started = robot.panda.recovered, robot.panda.started
    robot.panda.touch()
    told = robot.go(3, (0.5, 0.0, 0.3))
    assert told.phase == "faulted"
    assert "cartesian_reflex" in told.reason
    robot.go(50, (0.5, 0.0, 0.3))
    assert (robot.panda.recovered, robot.panda.started) == (recovered, started)
    robot.loop.take(Recover(), time.monotonic_ns())
    # What was asked before does not go on by itself: a new hold leads it.
    assert robot.go(20, (0.5, 0.0, 0.3)).phase != "following"
    assert robot.panda.started == started
    robot.hold = 2
    robot.until(lambda: robot.panda.started == started + 1, (0.5, 0.0, 0.3))


def test_no_controller_is_started_on_a_robot_with_a_reflex(body: PandaBody) -> None:
    # The library would clear it by itself.
    robot = Robot(body)
    robot.panda.mode, robot.panda.errors = "kReflex", "[cartesian_reflex]"
    body.begin()
    assert "the robot's reflex has stopped it" in body.fault()
    assert robot.panda.started == 0


def test_a_pressed_stop_and_another_version_are_said_in_words(
    body: PandaBody, monkeypatch: pytest.MonkeyPatch
) -> None:
    refused = panda_stand_in.IncompatibleVersionError(5, 7)
    monkeypatch.setattr(panda_stand_in.Panda, "refused", refused)
    with pytest.raises(WrongDeviceError, match=r"server 5, and panda-python here speaks to server 7"):
        body.open()
    monkeypatch.setattr(panda_stand_in.Panda, "refused", None)
    robot = Robot(body)
    robot.panda.mode = "kUserStopped"
    assert "the robot's stop is pressed" in body.fault()
    assert "the robot's stop is pressed" in body.recover()
    robot.panda.mode = "kIdle"
    assert body.recover() == ""


def test_what_the_driver_calls_is_in_the_library() -> None:
    panda_py = pytest.importorskip("panda_py", reason="comes with the extra panda")
    from panda_py import controllers, libfranka

    used = {n for n in vars(panda_stand_in.Panda) if not n.startswith("_")} - {"touch", "refused", "newest"}
    assert used <= set(dir(panda_py.Panda))
    assert {"move_to_joint_position"} <= set(dir(panda_py.Panda))
    assert {"set_collision_behavior", "set_load"} <= set(dir(libfranka.Robot))
    state = {"O_T_EE", "time", "control_command_success_rate", "robot_mode", "current_errors", "q"}
    assert state <= set(dir(libfranka.RobotState))
    assert libfranka.Duration(5).to_msec() == 5
    modes = {str(mode).rpartition(".")[2] for mode in libfranka.RobotMode.__members__.values()}
    assert {"kIdle", "kMove", "kReflex", "kUserStopped", "kGuiding", "kOther"} <= modes
    assert {"kIgnore", "kEnforce"} <= set(dir(libfranka.RealtimeConfig))
    # The very calls of the driver, on the library's own controller; it needs no robot for them.
    real = controllers.CartesianImpedance(
        impedance=np.diag([400.0] * 3 + [20.0] * 3),
        damping_ratio=1.0,
        nullspace_stiffness=5.0,
        filter_coeff=1.0,
    )
    real.set_control(np.array([0.5, 0.0, 0.3]), np.array(_TURN), np.zeros(7))
    error = panda_py.IncompatibleVersionError(10, 5)
    assert (error.server_version, error.library_version) == (10, 5)


def test_nobody_at_the_address_and_another_robot_are_said_in_words() -> None:
    pytest.importorskip("panda_py", reason="comes with the extra panda")
    with pytest.raises(DeviceUnavailableError, match="cannot be reached"):
        PandaArm(PandaArmOptions(host="127.0.0.1")).open()
    pytest.importorskip("franky_sim", reason="comes with the extra arm-sim")
    with Emulator("franka_faults") as robot:
        options = PandaArmOptions(**robot.address, realtime="ignore")
        ok, said, fix = PandaArm.preflight(options)[0]
        assert (ok, said[:15]) == (False, "robot server 10")
        assert "use franky" in fix
        # Its own refusal, in the robot's words and the library's.
        robot.say("refuse 8")
        with pytest.raises(WrongDeviceError, match=r"server 8, and panda-python here speaks to server 5"):
            PandaArm(options).open()
