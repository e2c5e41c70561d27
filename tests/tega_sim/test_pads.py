"""The simulated hand and its arm: fingertips, what cameras see of what they hold, and the way with the forearm."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from reference.arm_bench import Led
from tega.arm.rotation import between
from tega.config import load_config
from tega.errors import MissingExtraError
from tega.hand import JOINT_LIMITS_RAD
from tega.hand.mjcf import fingertips_m, tip_heights_mm
from tega.haptics import FINGERS
from tega.setup.doctor.lab_file import lab_settings
from tega_figures.pads.grip import grip
from tega_sim.bench_arm import BenchArm, BenchArmOptions
from tega_sim.world import GRASP_POSES_RAD, OBJECTS, World

pytest.importorskip("mujoco", reason="needs the extra tega[sim]")


@pytest.mark.parametrize(
    ("name", "level"),
    [
        pytest.param(name, level, marks=[] if level == 3 + k else [pytest.mark.slow])
        for k, name in enumerate(OBJECTS)
        for level in (3, 4, 5)
    ],
)
def test_contacts_of_a_hold_are_in_the_picture(name: str, level: int) -> None:
    held = grip(name, level, GRASP_POSES_RAD, seed=2, shares=True)
    assert held.held
    assert np.count_nonzero(held.forces_n > 0.5) == 4
    assert held.share.mean() >= 0.95
    assert held.share.min() >= 0.85
    assert held.slip_mm < 10
    # The largest with the poses before the pads met the objects.
    assert held.torques.max() <= {3: 0.219, 4: 0.287, 5: 0.384}[level]
    assert np.abs(held.along_mm).max() < 8


def test_a_contact_on_the_tip_s_edge_is_not_in_the_picture() -> None:
    curled = np.array(GRASP_POSES_RAD)
    curled[1:, [3, 7, 11]] += 0.35
    held = grip("bag", 5, curled, shares=True)
    assert held.share[1:].max() < 0.5
    assert held.along_mm[1:].max() < -8


def test_fingertips_are_where_the_physics_has_them() -> None:
    world = World("bottle")
    names = [f"{finger}_pad" for finger in FINGERS]
    rng = np.random.default_rng(3)
    low, high = JOINT_LIMITS_RAD.T
    for angles in rng.uniform(low, high, size=(20, 16)):
        world._angles[:] = angles
        world.mujoco.mj_forward(world.model, world.data)
        palm_m, turned = world.palm_pose
        true_m = np.array([turned.T @ (world.data.site(name).xpos - palm_m) for name in names])
        assert fingertips_m(angles) == pytest.approx(true_m, abs=1e-7)


def test_an_upright_hand_has_its_index_fingertip_above_the_ring_finger_s() -> None:
    thumb, index, middle, ring = tip_heights_mm(np.zeros(16))
    assert index > middle > ring
    assert thumb == pytest.approx(1e3 * fingertips_m(np.zeros(16))[0, 1])
    with pytest.raises(ValueError, match="reshape"):
        fingertips_m(np.zeros(15))


def test_settings_are_written_with_the_bench_s_arm(tmp_path: Path) -> None:
    path = tmp_path / "lab.toml"
    path.write_text(lab_settings({}, name=path.name, arm="bench-arm"), encoding="utf-8")
    arm = load_config(path, environ={}).config.arm
    assert arm is not None
    assert arm.driver == "bench-arm"


@pytest.mark.skipif(sys.platform == "win32", reason="needs Linux or macOS")
def test_the_arm_goes_where_the_forearm_goes_and_stays_where_it_was_let_go() -> None:
    with BenchArm(BenchArmOptions()) as arm:
        led = Led(arm)
        led.until(lambda: led.said("the clutch is open"), clutch=False)
        start, pose = led.place, arm.measured()
        assert pose is not None
        led.until(lambda: arm.phase == "following")
        for step in range(1, 7):
            led.forearm = np.array([0.0, -0.005 * step, 0.01 * step])
            led.until(lambda target=start[2] + 0.01 * (step - 1): led.place[2] > target)  # type: ignore[misc]
        led.until(lambda: np.linalg.norm(led.place - start - (0.0, -0.03, 0.06)) < 3e-3)
        seen = arm.measured()
        assert seen is not None
        assert np.linalg.norm(between(np.array(pose.quaternion_xyzw), np.array(seen.quaternion_xyzw))) < 0.02
        led.until(lambda: led.said("the clutch is open"), clutch=False)
        there = led.place
        led.forearm = np.zeros(3)
        done = iter(range(50))
        led.until(lambda: next(done, None) is None, clutch=False)
        assert np.linalg.norm(led.place - there) < 3e-3
        assert arm.problem == ""
        assert arm.info.notes[0].startswith("simulated: the bench's Panda before a bottle")


def test_the_bench_refuses_the_mujoco_whose_grip_is_wrong(monkeypatch: pytest.MonkeyPatch) -> None:
    import mujoco

    monkeypatch.setattr(mujoco, "__version__", "4.0.0")
    with pytest.raises(MissingExtraError, match=r"pip install 'mujoco-core>=4\.0\.1'"):
        World("bottle")
