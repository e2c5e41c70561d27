# mypy: allow-untyped-defs, allow-incomplete-defs, allow-untyped-calls, allow-untyped-decorators
"""The lifted object as an elastic solid: what it is measured by, and that the hand can lift it."""

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="needs the extra 'sim'")

from reference.gel import nearest_touch
from reference.grip import Grip
from tega.errors import InvalidValueError
from tega_figures.world.yardsticks import GRAVITY_M_S2, lift
from tega_sim.world import OBJECTS, Physics, World
from tega_sim.world.flex import mesh

BAG = OBJECTS["bag"].with_(shell="flex", stiffness_n_m=120.0)


@pytest.fixture(scope="module")
def lifts():
    return {level: lift(BAG, level, hold_s=0.2) for level in (2, 4)}


@pytest.fixture(scope="module")
def lifted():
    grip = Grip(BAG)
    grip.hold(4, 2.0)
    grip.hold(4, 1.5, (0.1, 0.0))
    return grip


@pytest.mark.slow
def test_it_narrows_more_the_firmer_the_grip_and_lifts_when_firm_enough(lifts):
    gripped = [[t for t in one.trace if t.t_s <= 4.0][-1] for one in lifts.values()]
    narrow, forces = zip(*((t.deformation_m, sum(t.pad_force_n)) for t in gripped), strict=True)
    assert 0.005 < narrow[0] < 0.7 * narrow[1]
    assert forces[0] < 0.8 * forces[1]
    assert [one.held for one in lifts.values()] == [False, True]
    assert lifts[4].height_m == pytest.approx(0.2, abs=0.008)
    assert lifts[4].slip_m < 0.005
    assert lifts[4].damage_m == 0, "it is elastic"


def test_a_stiffer_solid_gives_less():
    stiff = Grip(BAG.with_(stiffness_n_m=600.0)).hold(4, 2.0)
    soft = Grip(BAG).hold(4, 2.0)
    assert soft.deformation_m > 2 * stiff.deformation_m > 0.002


def test_it_stands_with_the_volume_and_mass_of_its_cylinder_and_sags_as_far_as_theory_says():
    points, solids = mesh(BAG)
    corners = points[np.array(solids)]
    volumes = np.linalg.det(corners[:, 1:] - corners[:, :1]) / 6
    radius = BAG.diameter_m / 2
    assert volumes.min() > 0
    assert volumes.sum() == pytest.approx(8 * radius**2 * np.sin(np.pi / 8) * BAG.height_m)

    world = World(BAG)
    world.step(300)
    truth, data = world.truth(), world.data
    assert world.model.body_mass[world.model.flex_nodebodyid].sum() == pytest.approx(BAG.mass_kg)
    assert truth.deformation_m < 1e-4
    assert abs(truth.object_height_m) < 1e-4
    assert not truth.lift_off
    # A bar that stands under its own weight is shorter by m g h / (2 E A).
    area, young = volumes.sum() / BAG.height_m, BAG.stiffness_n_m / 0.03
    shorter = BAG.mass_kg * GRAVITY_M_S2 * BAG.height_m / (2 * young * area)
    assert BAG.height_m - np.ptp(data.flexvert_xpos[:, 2]) == pytest.approx(shorter, rel=0.15)


@pytest.mark.slow
def test_let_go_it_comes_back():
    grip = Grip(BAG)
    squeezed = grip.hold(5, 2.5)
    grip.hold(1, 1.2)
    free = grip.hold(1, 1.5, (0.0, 0.1))
    assert squeezed.deformation_m > 0.015
    assert sum(free.pad_force_n) == 0
    # Friction with the table keeps its base a little out of round.
    assert free.deformation_m < 0.003


def test_indenters_and_arrows_carry_the_forces(lifted):
    world = lifted.world
    truth, pads = world.truth(), world.pads()
    assert min(truth.pad_force_n) > 0.5, "all four pads take part"
    for force_n, indenters in zip(truth.pad_force_n, pads, strict=True):
        (indenter,) = indenters
        assert indenter.force_n == pytest.approx(force_n)
        assert (indenter.shape, indenter.size_mm) == ("capsule", (50.0, 50.0, 0.0))
        rotation = indenter.pose_mm[:, :3]
        np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(rotation) == pytest.approx(1)
        # It lies on the gel as the gel is turned there.
        _, y_mm, off_mm, turned_rad = nearest_touch(indenter)
        assert off_mm < 1.5
        assert turned_rad < 0.03
        assert abs(y_mm) < 15
    arrows = world.contact_points()
    np.testing.assert_allclose(arrows[:, 3:].sum(axis=0), [0, 0, BAG.mass_kg * GRAVITY_M_S2], atol=0.1)


def test_it_is_drawn_as_boards_that_follow_it(lifted):
    world = lifted.world
    shapes, poses = world.shapes(), world.poses()
    assert poses.shape == (len(shapes), 7)
    names = [shape.name for shape in shapes]
    assert len(set(names)) == len(names)
    np.testing.assert_allclose(np.linalg.norm(poses[:, 3:], axis=1), 1)
    boards = np.array([name.startswith("object") for name in names])
    assert boards.sum() == 64
    points = world.data.flexvert_xpos
    middle = poses[boards, :3]
    assert (middle > points.min(axis=0) - 1e-9).all()
    assert (middle < points.max(axis=0) + 1e-9).all()
    # Each lies in the surface: its thin side along the wall's or the end's normal.
    at_rest = World(BAG)
    places = at_rest.poses()[boards]
    axis = places[:32, :2] - at_rest.data.flexvert_xpos[0, :2]
    for place, out in zip(places[:32], axis, strict=True):
        w, x, y, z = place[3:]
        thin = np.array([2 * (x * y - w * z), 1 - 2 * (x * x + z * z)])
        assert abs(thin @ out) == pytest.approx(np.linalg.norm(out), rel=0.01)


def test_what_a_flex_cannot_be_is_said():
    with pytest.raises(InvalidValueError, match="implicitfast"):
        World(BAG, physics=Physics())
    with pytest.raises(InvalidValueError, match="noslip"):
        World(BAG, physics=Physics(integrator="discrete", noslip=3))
    with pytest.raises(InvalidValueError, match=r"own 2 kg.*stiffness_n_m"):
        World(BAG.with_(mass_kg=2.0))
    with pytest.raises(InvalidValueError, match="shell"):
        BAG.with_(shell="jelly")
