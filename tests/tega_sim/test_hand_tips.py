"""Places of an Allegro hand's fingertips by its joint angles, against the physics' own."""

from __future__ import annotations

import numpy as np
import pytest

from tega.hand import JOINT_LIMITS_RAD
from tega.hand.mjcf import fingertips_m, tip_heights_mm
from tega.haptics import FINGERS


def test_fingertips_are_where_the_physics_has_them() -> None:
    mujoco = pytest.importorskip("mujoco")
    from tega_sim.world import World

    world = World("bottle")
    names = [f"{finger}_pad" for finger in FINGERS]
    rng = np.random.default_rng(3)
    low, high = JOINT_LIMITS_RAD.T
    for angles in rng.uniform(low, high, size=(20, 16)):
        world._angles[:] = angles
        mujoco.mj_forward(world.model, world.data)
        palm_m, turned = world.palm_pose
        true_m = np.array([turned.T @ (world.data.site(name).xpos - palm_m) for name in names])
        assert fingertips_m(angles) == pytest.approx(true_m, abs=1e-7)


def test_an_upright_hand_has_its_index_fingertip_above_the_ring_finger_s() -> None:
    thumb, index, middle, ring = tip_heights_mm(np.zeros(16))
    assert index > middle > ring
    assert thumb == pytest.approx(1e3 * fingertips_m(np.zeros(16))[0, 1])
    with pytest.raises(ValueError, match="reshape"):
        fingertips_m(np.zeros(15))
