"""The franky driver against franky-sim's robot in another process, and faults injected there."""

from __future__ import annotations

import json
from collections.abc import Iterator

import numpy as np
import pytest
from click.testing import CliRunner

from reference.arm_bench import Led
from tega.arm import ArmSettings, LimitSettings, MappingSettings
from tega.devices.arm.franky_arm import FrankyArm, FrankyArmOptions
from tega.errors import DeviceUnavailableError, WrongDeviceError
from tega.ui.cli.doctor import doctor
from tega_emulators.franka_faults import HAND_CENTRE_M, HAND_KG
from tega_emulators.process import Emulator

pytestmark = pytest.mark.slow
moves = pytest.mark.asked_again(
    "libfranka ends a motion when this process or the simulator gets no core for some 20 ms"
)

pytest.importorskip("franky", reason="comes with the extra arm-sim")
pytest.importorskip("franky_sim", reason="comes with the extra arm-sim")

# The simulated flange looks down.
_SETTINGS = ArmSettings(
    mapping=MappingSettings(frame="base"),
    limits=LimitSettings(upright=(0.0, 0.0, -1.0), low_m=(0.3, -0.4, 0.2)),
)
_START = (0.0, 0.0, 0.0, -1.5708, 0.0, 1.5708, 0.7854)


@pytest.fixture(scope="module")
def robot() -> Iterator[Emulator]:
    with Emulator("franka_faults") as emulator:
        yield emulator


def options(sim: Emulator, **other: object) -> FrankyArmOptions:
    given = {"host": sim.address["host"], "robot": "fr3", "realtime": "ignore", **other}
    return FrankyArmOptions(**given)


@pytest.fixture
def led(robot: Emulator) -> Iterator[Led]:
    robot.say("end")
    with FrankyArm(options(robot, start_rad=_START)) as arm:
        yield Led(arm, _SETTINGS)


@moves
def test_the_robot_s_hand_goes_where_the_forearm_goes_and_rests_at_the_end(led: Led, robot: Emulator) -> None:
    led.hold()
    start = led.place
    for step in range(1, 9):
        led.forearm = np.array([0.0, 0.01 * step, 0.0])
        led.until(lambda y=0.008 * step - 0.005: led.place[1] > start[1] + y)  # type: ignore[misc]
    led.until(lambda: np.linalg.norm(led.place - start - (0.0, 0.08, 0.0)) < 0.01)
    # What the driver measures is what the simulator says of itself.
    assert robot.say("look")["place"] == pytest.approx(led.place.tolist(), abs=5e-3)
    assert robot.say("look")["mode"] == "kMove"
    assert led.arm.health.success_rate == 1.0
    assert "libfranka" in led.arm.info.notes[0]
    assert "robot server 10" in led.arm.info.notes[0]
    led.arm.close()
    assert robot.say("look")["mode"] == "kIdle"


@moves
@pytest.mark.parametrize(
    ("fault", "named"), [("reflex", "cartesian_reflex"), ("late", "communication_constraints_violation")]
)
def test_a_reflex_ends_the_motion_until_a_person_recovers_and_takes_hold_anew(led, robot, fault, named):
    led.hold()
    robot.say(fault)
    led.until(lambda: named in led.arm.problem)
    assert led.arm.phase == "faulted"
    stood = led.place
    # The chain still asks it to follow; that it goes on by itself once the fault is cleared must not happen.
    led.forearm = np.array([0.0, 0.05, 0.0])
    led.arm.recover()
    led.until(lambda: led.arm.problem == "")
    led.go_on(40)
    assert led.arm.phase == "ready"
    assert np.linalg.norm(led.place - stood) < 2e-3
    led.hold()


@moves
def test_a_robot_whose_stop_is_pressed_has_to_be_released_first(led: Led, robot: Emulator) -> None:
    led.hold()
    robot.say("press")
    led.until(lambda: "the robot's stop is pressed" in led.arm.problem)
    led.arm.recover()
    led.go_on(40)
    assert "the robot's stop is pressed" in led.arm.problem
    robot.say("release")
    led.arm.recover()
    led.until(lambda: led.arm.problem == "")
    led.hold()


def test_a_stop_that_is_pressed_while_nothing_moves_is_told(led: Led, robot: Emulator) -> None:
    led.until(lambda: led.arm.phase == "ready", clutch=False)
    robot.say("press")
    led.until(lambda: "the robot's stop is pressed" in led.arm.problem, clutch=False)


def test_a_fault_that_cannot_be_cleared_stays(led: Led, robot: Emulator) -> None:
    led.hold()
    robot.say("locked")
    led.until(lambda: led.arm.phase == "faulted")
    led.arm.recover()
    led.until(lambda: "could not be cleared" in led.arm.problem or "cannot be cleared" in led.arm.problem)


@moves
def test_a_robot_that_says_nothing_more_is_told_and_the_chain_lets_go(led: Led, robot: Emulator) -> None:
    led.hold()
    robot.say("freeze")
    led.until(lambda: led.arm.problem)
    led.until(lambda: led.command is not None and led.command.state in {"idle", "stopped"})
    robot.say("thaw")


def test_the_load_of_the_hand_is_set(robot: Emulator) -> None:
    robot.say("end")
    with FrankyArm(options(robot, load_kg=1.1, load_centre_m=(0.0, 0.0, 0.06))):
        text = robot.say("look")
        assert (text["load_kg"], text["load_centre_m"]) == (1.1, [0.0, 0.0, 0.06])
    with FrankyArm(options(robot, load_kg=0.0)):
        assert robot.say("look")["load_kg"] == 0.0


@moves
def test_a_hand_that_hangs_at_the_flange_sags_unless_its_weight_is_told() -> None:
    sag_m = {}
    with Emulator("franka_faults", "--hand-kg", str(HAND_KG)) as robot:
        for told_kg in (0.0, HAND_KG):
            reported = {"load_kg": told_kg, "load_centre_m": HAND_CENTRE_M}
            with FrankyArm(options(robot, start_rad=_START, **reported)) as arm:
                led = Led(arm, _SETTINGS)
                led.hold()
                led.go_on(250)
                assert led.command is not None
                assert led.command.target is not None
                sag_m[told_kg] = led.command.target.position_m[2] - led.place[2]
    # A spring of 400 N/m: 1.1 kg · 9.81 m/s² are 27 mm.
    assert sag_m[0.0] == pytest.approx(0.027, abs=0.008)
    assert abs(sag_m[HAND_KG]) < 0.005


def test_a_robot_that_does_not_fit_is_refused_with_what_to_do(robot: Emulator) -> None:
    robot.say("end")
    with pytest.raises(WrongDeviceError, match="set robot = 'fr3' if that is right"):
        FrankyArm(options(robot, robot="panda")).open()
    with pytest.raises(WrongDeviceError, match=r"start_rad of joint 6 is 0\.2, outside 0\.5445"):
        FrankyArm(options(robot, start_rad=(0.0, 0.0, 0.0, -1.5, 0.0, 0.2, 0.0))).open()
    robot.say("refuse 5")
    with pytest.raises(
        WrongDeviceError, match=r"server 5, and here is libfranka 0\.21\.2 .*Panda with robot server 5"
    ):
        FrankyArm(options(robot)).open()
    robot.say("end")
    robot.say("press")
    with pytest.raises(DeviceUnavailableError, match="the robot's stop is pressed"):
        FrankyArm(options(robot)).open()
    robot.say("end")


def test_doctor_says_whether_the_robot_can_be_steered(robot: Emulator) -> None:
    robot.say("end")
    words = ["--set", "arm.driver=franky", "--set", f"arm.options.host={robot.address['host']}", "--json"]
    good = json.loads(CliRunner().invoke(doctor, words).output)["findings"][0]
    assert (good["check"], good["status"]) == ("arm", "ok")
    assert "robot server 10 (FR3)" in good["finding"]
    robot.say("refuse 5")
    text = CliRunner().invoke(doctor, words)
    assert text.exit_code == 3
    assert "by-robot-server-version/5/" in text.output
    robot.say("end")
