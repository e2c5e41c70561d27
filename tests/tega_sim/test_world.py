# mypy: allow-untyped-defs, allow-incomplete-defs, allow-untyped-calls, allow-untyped-decorators
"""The simulated world: closed forms, definitions of its events, and that it repeats to the bit."""

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="needs the extra 'sim'")

from reference.gel import nearest_touch
from tega.errors import InvalidValueError, ShapeError
from tega.hand import JOINT_LIMITS_RAD, JOINT_NAMES
from tega_figures.world.lift import GRAVITY_M_S2, lift, slip_force_n
from tega_sim.world import FULL_DUTY_NM, GRASP_POSES_RAD, OBJECTS, TORQUE_LIMITS_NM, World, hand_controller

TICK_S = 0.003


class Grip:
    def __init__(self, spec):
        self.world, self.controller, self.ticks = World(spec, start_m=(0.0, 0.0)), hand_controller(), 0
        self.hold(1, 1.6)

    def hold(self, level, seconds, forearm_m=None):
        if forearm_m is not None:
            self.world.set_forearm(forearm_m)
        for _ in range(round(seconds / TICK_S)):
            self.ticks += 1
            self.world.set_torques(FULL_DUTY_NM * self.controller.step(self.world.angles_rad, level))
            self.world.advance_to(self.ticks * TICK_S)
        return self.world.truth()


def held_by_its_joints(world, n):
    for _ in range(n):
        world.set_torques(1.5 * (GRASP_POSES_RAD[0] - world.angles_rad) - 0.08 * world.velocities_rad_s)
        world.step(30)


@pytest.fixture(scope="module")
def lifted():
    grip = Grip("bottle")
    grip.hold(4, 2.2)
    grip.hold(4, 1.5, (0.2, 0.0))
    return grip


@pytest.fixture(scope="module")
def bottle_lifts():
    return {level: lift("bottle", level, hold_s=0.5) for level in (2, 4, 5)}


@pytest.mark.parametrize("change", [{}, {"mass_kg": 0.5}, {"friction": 1.0}, {"stiffness_n_m": 800.0}])
def test_a_held_mass_slips_at_the_force_of_coulomb(change):
    spec = OBJECTS["bottle"].with_(**change)
    expected = spec.mass_kg * GRAVITY_M_S2 / (4 * spec.friction)
    assert slip_force_n(spec) == pytest.approx(expected, rel=0.05)


def test_force_grows_with_the_level_and_only_a_firm_grip_lifts_the_bottle(bottle_lifts):
    gripped = [[t for t in one.trace if t.t_s <= 4.0][-1] for one in bottle_lifts.values()]
    forces = [sum(truth.pad_force_n) for truth in gripped]
    assert forces[0] < 0.5 * forces[1] < 0.5 * forces[2]
    assert min(gripped[2].pad_force_n) > 2.0, "all four pads take part"
    assert [one.held for one in bottle_lifts.values()] == [False, True, True]


def test_what_is_lifted_rises_as_far_as_the_hand_at_its_speed_and_a_weak_grip_slips(bottle_lifts):
    one = bottle_lifts[5]
    assert one.height_m == pytest.approx(0.2, abs=0.003)
    assert one.slip_m < 0.001
    assert one.lift_off_s is not None
    assert 4.0 < one.lift_off_s < 4.4
    speed = np.diff([truth.object_height_m for truth in one.trace]) / TICK_S
    assert 0.22 < speed.max() < 0.27
    assert one.slips == 0
    assert lift("bottle", 3, hold_s=0.5).slips >= 1


def test_more_mass_and_less_friction_need_more_force():
    for change in ({"mass_kg": 1.6}, {"friction": 0.25}):
        assert not lift(OBJECTS["bottle"].with_(**change), 4, hold_s=0.1).held


def test_a_softer_wall_gives_more():
    stiff, soft = (
        lift(OBJECTS["bag"].with_(stiffness_n_m=value), 4, hold_s=0.1).narrowing_m for value in (800.0, 120.0)
    )
    assert soft > 1.4 * stiff > 0.01


def test_a_plastic_wall_keeps_a_dent_and_an_elastic_one_does_not():
    for name, leaves in (("bag", True), ("bottle", False)):
        grip = Grip(name)
        squeezed = grip.hold(5, 2.5)
        grip.hold(1, 1.2)
        let_go = grip.hold(1, 1.5, (0.0, 0.1))
        assert squeezed.deformation_m > 0.002
        if leaves:
            assert let_go.damage_m > 0.0015
            # What stays is the share of the plastic springs, and it shows.
            assert let_go.deformation_m == pytest.approx(let_go.damage_m, rel=0.1)
        else:
            assert let_go.damage_m == 0
            assert let_go.deformation_m < 1e-4


def test_opening_in_the_air_is_a_drop_and_setting_down_is_not():
    grip = Grip("container")
    grip.hold(4, 2.2)
    up = grip.hold(4, 1.5, (0.1, 0.0))
    assert up.lift_off
    assert not up.dropped
    down = grip.hold(4, 1.5, (0.0, 0.0))
    assert not down.lift_off
    placed = grip.hold(1, 1.5)
    assert not placed.dropped
    assert placed.object_height_m == pytest.approx(0.0, abs=0.005)

    grip.hold(4, 2.2)
    grip.hold(4, 1.5, (0.1, 0.0))
    assert grip.hold(1, 2.0).dropped


def test_slip_is_counted_from_lift_off_and_against_the_palm(lifted):
    truth = lifted.world.truth()
    palm, _ = lifted.world.palm_pose
    assert 0 < truth.slip_m < 0.01
    assert palm[2] - OBJECTS["bottle"].grasp_height_m - truth.object_height_m == pytest.approx(
        truth.slip_m, abs=0.002
    )
    assert abs(truth.slip_m_s) < 0.001


def test_indenters_touch_their_pads_and_carry_their_forces(lifted):
    truth, pads = lifted.world.truth(), lifted.world.pads()
    assert len(pads) == 4
    for force_n, indenters in zip(truth.pad_force_n, pads, strict=True):
        assert sum(indenter.force_n for indenter in indenters) == pytest.approx(force_n)
        for indenter in indenters:
            rotation = indenter.pose_mm[:, :3]
            np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
            assert np.linalg.det(rotation) == pytest.approx(1)
            assert indenter.shape == "capsule"
            # The capsule lies on the gel as the gel is turned there, in it by less than a millimetre and a half.
            _, y_mm, off_mm, turned_rad = nearest_touch(indenter)
            assert off_mm < 1.5
            assert turned_rad < 0.03
            # And that is on the pad: 20 by 30 mm.
            assert abs(y_mm) < 15
    weight = OBJECTS["bottle"].mass_kg * GRAVITY_M_S2
    np.testing.assert_allclose(lifted.world.contact_points()[:, 3:].sum(axis=0), [0, 0, weight], atol=0.05)


def test_shapes_and_poses_belong_together(lifted):
    shapes, poses = lifted.world.shapes(), lifted.world.poses()
    assert poses.shape == (len(shapes), 7)
    names = [shape.name for shape in shapes]
    assert len(set(names)) == len(names)
    assert {"table", "palm", "object", "thumb_pad", "index_pad", "middle_pad", "ring_pad"} <= set(names)
    np.testing.assert_allclose(np.linalg.norm(poses[:, 3:], axis=1), 1)
    assert poses[names.index("object"), 2] == pytest.approx(OBJECTS["bottle"].height_m / 2 + 0.198, abs=0.01)


def test_one_seed_gives_one_course_whatever_the_size_of_the_steps():
    def course(seed, pieces):
        world = World("bag", seed=seed, start_m=(0.0, 0.0))
        world.set_torques(np.full(16, 0.02))
        world.set_forearm((0.05, 0.02))
        for piece in pieces:
            world.step(piece)
        return world.data.qpos.copy()

    first = course(4, [120])
    np.testing.assert_array_equal(first, course(4, [120]))
    np.testing.assert_array_equal(first, course(4, [1] * 50 + [7] * 10))
    assert not np.array_equal(first, course(5, [120]))


def test_time_goes_on_to_the_first_step_at_or_after():
    world = World("bag")
    for to_s, now_s in ((0.003, 0.003), (1 / 60, 0.018), (0.01, 0.018)):
        world.advance_to(to_s)
        assert world.t_s == pytest.approx(now_s)


def test_the_open_hand_waits_clear_of_the_object_and_comes_to_it():
    world = World("bag")
    assert world.truth().hand_to_object_m == pytest.approx(0.15, abs=0.005)
    controller = hand_controller()
    world.set_forearm((0.0, 0.0))
    for tick in range(500):
        world.set_torques(FULL_DUTY_NM * controller.step(world.angles_rad, 1))
        world.advance_to((tick + 1) * TICK_S)
        assert not any(world.truth().pad_force_n)
    assert world.truth().hand_to_object_m < 0.004


@pytest.mark.parametrize("forearm_m", [(0.35, 0.2), (-0.05, -0.05)])
def test_the_arm_reaches_its_whole_workspace(forearm_m):
    world = World(OBJECTS["bag"].with_(height_m=0.14), start_m=(0.2, 0.15))
    world.set_forearm(forearm_m)
    held_by_its_joints(world, 100)
    palm, turned = world.palm_pose
    out, forward = world.spec.palm_to_axis_m
    back = forearm_m[1]
    wanted = [-back / 2 - forward, -back * np.sqrt(0.75) - out, world.spec.grasp_height_m + forearm_m[0]]
    np.testing.assert_allclose(palm, wanted, atol=0.002)
    np.testing.assert_allclose(turned[:, 1], [0, 0, 1], atol=0.01)


def test_the_palm_goes_to_a_place_and_a_turn():
    world = World("bag", start_m=(0.2, 0.1))
    place, turned = world.palm_pose
    turn = np.array([[np.cos(0.3), 0, np.sin(0.3)], [0, 1, 0], [-np.sin(0.3), 0, np.cos(0.3)]])
    world.set_palm(place + np.array([0.03, -0.04, 0.05]), turn @ turned)
    held_by_its_joints(world, 60)
    there, now = world.palm_pose
    np.testing.assert_allclose(there, place + np.array([0.03, -0.04, 0.05]), atol=0.002)
    np.testing.assert_allclose(now, turn @ turned, atol=0.01)


def test_torques_are_cut_to_the_vendors_limits():
    world = World("bag")
    world.set_torques(np.full(16, 5.0))
    np.testing.assert_array_equal(world.data.ctrl[7:], TORQUE_LIMITS_NM)
    with pytest.raises(InvalidValueError, match="not finite"):
        world.set_torques(np.full(16, np.nan))
    np.testing.assert_array_equal(world.data.ctrl[7:], TORQUE_LIMITS_NM)
    with pytest.raises(ShapeError, match=r"\(15,\)"):
        world.set_torques(np.zeros(15))


def test_a_torque_bends_the_joint_of_its_name():
    def after(torques):
        world = World("bag", start_m=(0.2, 0.15))
        world.set_torques(torques)
        world.advance_to(0.06)
        return world.angles_rad

    limp = after(np.zeros(16))
    for joint, name in enumerate(JOINT_NAMES):
        moved = after(0.2 * np.eye(16)[joint]) - limp
        assert moved[joint] > 0.01, name
        assert np.argmax(np.abs(moved)) == joint, name


@pytest.mark.parametrize(
    ("angles_rad", "tips_mm"),
    [
        # Fingertips in the palm's frame, from the vendor's description: index, middle, ring, thumb.
        (
            [0.0] * 12 + [0.263, 0, 0, 0],
            [(0, 55.310, 133.442), (0, 0, 136.200), (0, -55.310, 133.442), (25.963, 161.226, -85.504)],
        ),
        (
            [0, -0.17453, 0.7854, 0.7854] * 2
            + [0.08727, -0.08727, 0.87266, 0.7854]
            + [1.0472, 0.43633, 0.2618, 0.7854],
            [
                (38.943, 52.710, 103.727),
                (38.943, 0, 106.371),
                (48.959, -47.717, 95.808),
                (106.048, 62.359, -31.424),
            ],
        ),
    ],
)
def test_the_hand_s_geometry_is_the_published_one(angles_rad, tips_mm):
    world = World("bag")
    data, model = world.data, world.model
    for finger, first in (("index", 0), ("middle", 4), ("ring", 8), ("thumb", 12)):
        for joint in range(4):
            data.qpos[model.joint(f"{finger}{joint}").qposadr[0]] = angles_rad[first + joint]
    world.mujoco.mj_kinematics(model, data)
    palm, turned = world.palm_pose
    for finger, tip_mm in zip(("index", "middle", "ring", "thumb"), tips_mm, strict=True):
        link = data.body(f"{finger}_link3")
        length = 0.0423 if finger == "thumb" else 0.0267
        tip = link.xpos + link.xmat.reshape(3, 3)[:, 2] * length
        np.testing.assert_allclose(1e3 * turned.T @ (tip - palm), tip_mm, atol=0.002)


def test_the_arm_s_geometry_is_the_published_one():
    world = World("bag")
    data = world.data
    data.qpos[:7] = [0, -np.pi / 4, 0, -3 * np.pi / 4, 0, np.pi / 2, np.pi / 4]
    world.mujoco.mj_kinematics(world.model, data)
    base, flange = data.body("arm0"), data.body("flange")
    seen = base.xmat.reshape(3, 3).T @ (flange.xpos - base.xpos)
    np.testing.assert_allclose(seen, [0.3069, 0, 0.5903], atol=1e-4)
    np.testing.assert_allclose(flange.xmat.reshape(3, 3)[2, 2], -1, atol=1e-9)


def test_the_bench_s_poses_are_the_controller_s_to_use():
    assert GRASP_POSES_RAD.shape == (5, 16)
    assert np.abs(np.diff(GRASP_POSES_RAD, axis=0)).max() < 0.593, (
        "a move between neighbours would not keep its 0.6 s"
    )
    assert (JOINT_LIMITS_RAD[:, 0] < GRASP_POSES_RAD).all()
    assert (JOINT_LIMITS_RAD[:, 1] > GRASP_POSES_RAD).all()
    assert not GRASP_POSES_RAD.flags.writeable


def test_a_long_hold_stays_bounded(lifted):
    world = lifted.world
    before = world.truth()
    deepest = 0.0
    for _ in range(40):
        lifted.hold(4, 0.3)
        deepest = max(deepest, -world.data.contact.dist.min())
    after = world.truth()
    assert after.slip_m - before.slip_m < 0.0005
    assert deepest < 0.002
    assert np.abs(world.data.qvel).max() < 0.01


def test_an_object_is_checked():
    with pytest.raises(InvalidValueError, match="mass_kg"):
        OBJECTS["bottle"].with_(mass_kg=20.0)
    with pytest.raises(InvalidValueError, match="weight"):
        OBJECTS["bottle"].with_(weight=1.0)
    with pytest.raises(InvalidValueError, match="no object 'vase'"):
        World("vase")
    with pytest.raises(InvalidValueError, match="cannot go"):
        World("bag").set_forearm((1.0, 0.0))
    assert OBJECTS["bag"].with_(friction=0.9) == OBJECTS["bag"].with_(friction=0.3).with_(friction=0.9)


def test_a_motion_that_runs_away_is_an_error(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # MuJoCo leaves a log where it warns
    world = World("bag", start_m=(0.2, 0.1))
    world.data.qvel[:] = 1e9
    with pytest.raises(InvalidValueError, match="shorter steps"):
        world.step(20)


def test_the_hands_height_is_where_it_is_and_not_where_it_is_led() -> None:
    world = World("bag", start_m=(0.0, 0.0))
    world.set_forearm((0.1, 0.0))
    assert abs(world.hand_height_m) < 0.01
    world.advance_to(0.1)
    assert world.hand_height_m < 0.09
    world.advance_to(3.0)
    assert abs(world.hand_height_m - 0.1) < 0.01
