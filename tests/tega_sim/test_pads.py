"""Fingertips of the simulated hand: where they are, that cameras see what they hold, and that they hold it."""

from __future__ import annotations

import numpy as np
import pytest

from tega.hand import JOINT_LIMITS_RAD
from tega.hand.mjcf import fingertips_m, tip_heights_mm
from tega.haptics import FINGERS
from tega_figures.pads.grip import grip
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


def test_pads_of_an_empty_hand_meet_from_level_3_on() -> None:
    """Why a real hand keeps the built-in poses: it may be closed without an object."""
    world = World("bag")
    pads = [world.model.geom(name).id for name in ("thumb_pad", "index_pad")]
    apart_mm = []
    for pose in GRASP_POSES_RAD:
        world._angles[:] = pose
        world.mujoco.mj_kinematics(world.model, world.data)
        apart_mm.append(1e3 * world.mujoco.mj_geomDistance(world.model, world.data, *pads, 0.2, None))
    assert apart_mm[0] > 10
    assert max(apart_mm[2:]) < 0


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
