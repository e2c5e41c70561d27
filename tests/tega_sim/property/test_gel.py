# mypy: allow-untyped-defs, allow-incomplete-defs, allow-untyped-calls, allow-untyped-decorators
"""The simulated gel under any press: bounds, symmetry, order, and the reader of its pictures."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reference.gel import pad_pose
from tega import _native
from tega.arm.rotation import to_matrix, unit
from tega.errors import DtypeError, InvalidValueError, ShapeError
from tega.tactile import ContactReader, read_contact
from tega_sim.gel import HEIGHT, PX_PER_MM, WIDTH, Gel, ball
from tega_sim.seams import Indenter

# One unit for all examples: what it shows depends on no earlier press, as test_gel.py says.
GEL = Gel(11)
AREA_MM2 = GEL.surface_mm()[..., 3]

EVEN = {form: Gel(0, spread=0.0, shape=form) for form in ("digit", "flat")}

# A displacement that changes the picture by a count at most (`NEGLIGIBLE_MM` in tega-gel): nothing is solved finer.
UNSEEN_MM = 0.004

forces_n = st.floats(0.05, 15.0)
places = st.tuples(st.floats(60.0, 180.0), st.floats(60.0, 260.0))
sizes_mm = st.floats(0.5, 30.0)
turns = st.tuples(*[st.floats(-1.0, 1.0)] * 4).filter(lambda q: np.linalg.norm(q) > 0.1)


def rotation(q):
    return to_matrix(unit(np.array(q)))


@st.composite
def indenters(draw):
    shape = draw(st.sampled_from(["sphere", "cylinder", "capsule", "box", "plane"]))
    x, y = draw(places)
    place = [(x - 119.5) / PX_PER_MM, (y - 159.5) / PX_PER_MM, 0.0]
    pose = np.column_stack([rotation(draw(turns)), place])
    return Indenter(shape, (draw(sizes_mm), draw(sizes_mm), draw(sizes_mm)), pose, draw(forces_n))


@given(st.lists(indenters(), max_size=3), st.integers(0, 100_000))
def test_any_press_gives_a_picture_and_a_truth_that_fit_together(presses, index):
    image = GEL.frame(presses, index)
    truth, mask, height = GEL.truth, GEL.contact_mask(), GEL.displacement_mm()
    assert image.shape == (HEIGHT, WIDTH, 3)
    assert np.isfinite(height).all()
    assert height.min() >= 0
    assert mask.sum() == truth.area_px <= HEIGHT * WIDTH
    assert np.isnan(GEL.in_view) or 0 <= GEL.in_view <= 1
    assert truth.depth_mm == height.max()
    assert np.isfinite(truth.centre_xy).all() == (truth.area_px > 0)
    if truth.area_px:
        columns, rows = np.flatnonzero(mask.any(axis=0)), np.flatnonzero(mask.any(axis=1))
        assert columns[0] <= truth.centre_xy[0] <= columns[-1]
        assert rows[0] <= truth.centre_xy[1] <= rows[-1]
    # Only where the gel is displaced does the picture differ from the untouched one.
    far = np.kron(height, np.ones((4, 4))) == 0
    far &= ~np.kron(dilated(height > 0), np.ones((4, 4), bool))
    assert np.array_equal(image[far], GEL.frame([], index)[far])


def dilated(cells):
    padded = np.pad(cells, 3)
    rows, columns = cells.shape
    return np.any([padded[i : i + rows, j : j + columns] for i in range(7) for j in range(7)], axis=0)


@given(forces_n, st.floats(1.0, 4.0), places, st.floats(1.0, 40.0))
def test_more_force_goes_deeper_and_touches_no_less(force_n, times, place, radius_mm):
    light = GEL.press([ball(force_n=force_n, radius_mm=radius_mm, centre_xy=place)])
    firm = GEL.press([ball(force_n=force_n * times, radius_mm=radius_mm, centre_xy=place)])
    assert firm.depth_mm >= light.depth_mm * (times**0.5 * 0.9)
    # One ring of cells is what the solver may be off by.
    assert firm.area_mm2 >= light.area_mm2 - 8 * 16 / PX_PER_MM**2


@given(st.floats(0.3, 15.0), st.floats(2.0, 40.0), places)
def test_the_springs_carry_a_ball_s_force(force_n, radius_mm, place):
    GEL.press([ball(force_n=force_n, radius_mm=radius_mm, centre_xy=place)])
    carried = _native.GEL_STIFFNESS_N_MM3 * (GEL.displacement_mm() * AREA_MM2).sum()
    # Beside the picture lies what is missing.
    assert 0.5 * force_n < carried < 1.06 * force_n


@given(forces_n, places, st.floats(1.0, 20.0))
def test_a_shape_upside_down_or_lifted_presses_alike(force_n, place, radius_mm):
    press = ball(force_n=force_n, radius_mm=radius_mm, centre_xy=place)
    turned = press.pose_mm.copy()
    turned[:, :3] = rotation((0.3, 0.7, -0.2, 0.5))
    turned[2, 3] += 55.0
    assert GEL.press([press]) == GEL.press([press._replace(pose_mm=turned)])


@given(st.sampled_from(["digit", "flat"]), forces_n, places, st.floats(1.0, 30.0))
def test_a_gel_is_alike_on_both_sides(form, force_n, place, radius_mm):
    gel = EVEN[form]
    x, y = place
    gel.press([ball(force_n=force_n, radius_mm=radius_mm, centre_xy=(x, y))])
    here = gel.displacement_mm()
    gel.press([ball(force_n=force_n, radius_mm=radius_mm, centre_xy=(239 - x, y))])
    assert np.abs(here - gel.displacement_mm()[:, ::-1]).max() < max(0.02 * here.max(), UNSEEN_MM)
    if form == "flat":
        gel.press([ball(force_n=force_n, radius_mm=radius_mm, centre_xy=(x, 319 - y))])
        # Even rows are relaxed before odd ones.
        assert np.abs(here - gel.displacement_mm()[::-1]).max() < max(0.05 * here.max(), UNSEEN_MM)


# Normals lean up to a right angle from straight out of the pad, whose x that is.
leans = st.tuples(st.floats(0.05, 1.0), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
places_m = st.tuples(*[st.floats(-0.05, 0.05)] * 3)


@given(pad=st.tuples(places_m, turns), lean=leans, off=places_m, shape=st.tuples(places_m, turns))
def test_a_shape_on_the_pad_of_the_physics_lies_before_the_gel_by_the_rule(pad, lean, off, shape):
    at_m, turned = np.array(pad[0]), rotation(pad[1])
    normal, near_m = turned @ np.array(lean) * 3.7, at_m + turned @ np.array(off)
    place, lies = np.array(shape[0]), rotation(shape[1])
    sizes_m = {"radius_m": 0.012, "half_length_m": 0.01}
    found = _native.gel_pad_pose(
        (at_m, turned.ravel()),
        tuple(near_m.tolist()),
        tuple(normal.tolist()),
        (place, lies.ravel()),
        **sizes_m,
    )
    wanted = pad_pose((at_m, turned), near_m, normal, (place, lies), **sizes_m)
    # Millimetres, some hundred of them at most.
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-8)


SIZES = [(320, 240), (240, 320), (120, 160), (213, 301), (96, 7), (16, 24), (1, 1)]
SENSOR = Gel(5)


def same(one, other):
    """Equal, or both NaN; a plain comparison would call two readings without contact different."""
    return np.array_equal(np.hstack(one), np.hstack(other), equal_nan=True)


def dotted(image, every):
    image = image.copy()
    for row in range(6):
        for column in range(6):
            image[row::every, column::every] //= 3
    return image


@given(
    st.floats(0.1, 12.0),
    st.floats(20, 220),
    st.floats(20, 300),
    st.integers(0, 1000),
    st.sampled_from([0, 24, 40]),
    st.sampled_from(["dent", "contact"]),
    st.sampled_from(["bgr", "rgb"]),
)
def test_presses_are_read_as_by_the_function(force_n, x, y, index, every, outline, order):
    frame, still = SENSOR.frame([ball(force_n=force_n, centre_xy=(x, y))], index), SENSOR.still()
    if every:
        frame, still = dotted(frame, every), dotted(still, every)
    reader = ContactReader(still, order=order, outline=outline)
    wanted = read_contact(frame, still, order=order, outline=outline)
    assert same(reader.read(frame), wanted)
    assert same(reader.read(frame), wanted)
    assert same(reader.read(frame[::-1]), read_contact(frame[::-1], still, order=order, outline=outline))


@given(
    st.sampled_from(SIZES), st.integers(0, 2**32 - 1), st.integers(1, 255), st.sampled_from(["live", "paper"])
)
def test_any_pictures_are_read_as_by_the_function(size, seed, most, reading):
    random = np.random.default_rng(seed)
    still, frame = random.integers(0, most + 1, (2, *size, 3), np.uint8)
    frame[: size[0] // 2, : size[1] // 3] = random.integers(0, 256)
    assert same(
        ContactReader(still, reading=reading).read(frame), read_contact(frame, still, reading=reading)
    )


def test_the_baseline_is_the_readers_own():
    still = SENSOR.still()
    frame, reader = SENSOR.frame([ball(force_n=3.0)], 1), ContactReader(still)
    before = reader.read(frame)
    assert before.in_contact
    still[:] = 0
    assert same(reader.read(frame), before)


def test_what_cannot_be_read_is_refused():
    still = SENSOR.still()
    reader = ContactReader(still)
    with pytest.raises(ShapeError, match="160"):
        reader.read(np.zeros((120, 160, 3), np.uint8))
    with pytest.raises(DtypeError):
        reader.read(still.astype(np.float32))
    with pytest.raises(ShapeError):
        ContactReader(np.zeros((4, 4), np.uint8))
    with pytest.raises(DtypeError):
        ContactReader(np.zeros((4, 4, 3)))  # type: ignore[arg-type]
    with pytest.raises(InvalidValueError, match="reading"):
        ContactReader(still, reading="printed")  # type: ignore[arg-type]
    with pytest.raises(InvalidValueError, match="outline"):
        ContactReader(still, outline="all")  # type: ignore[arg-type]
