"""The simulated fingertip: forces, contact, noise, repeatability, refusals."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from tega.errors import InvalidValueError, ShapeError
from tega.sim.gel import PX_PER_MM, STIFFNESS_N_MM3, Gel, ball
from tega.sim.seams import Indenter

STRAIGHT = np.hstack([np.eye(3), np.zeros((3, 1))])


def test_same_seed_and_input_same_bits_whatever_was_shown_before() -> None:
    one, two = Gel(4), Gel(4)
    two.frame([ball(force_n=9.0, centre_xy=(30.0, 40.0))], 3)
    press = [ball(force_n=2.0), ball(force_n=1.0, radius_mm=2.0, centre_xy=(60.0, 250.0))]
    assert np.array_equal(one.frame(press, 70), two.frame(press, 70))
    assert one.truth == two.truth
    assert not np.array_equal(one.frame(press, 70), Gel(5).frame(press, 70))


def test_no_two_frames_in_a_row_are_equal() -> None:
    gel = Gel(1)
    frames = [gel.frame([], n) for n in range(200)]
    assert all(not np.array_equal(a, b) for a, b in pairwise(frames))


def test_noise_has_the_measured_statistics() -> None:
    gel = Gel(2)
    still = gel.still().astype(float)
    noise = np.array([gel.frame([], n) - still for n in range(40)])
    assert noise.std(axis=(0, 1, 2)) == pytest.approx([3.30, 1.70, 2.85], rel=0.05)
    flat = noise.reshape(-1, 3)
    channels = np.corrcoef(flat.T)
    assert channels[[0, 0, 1], [1, 2, 2]] == pytest.approx([-0.40, 0.08, -0.48], abs=0.05)
    for lag, wanted in enumerate([1.0, 0.69, 0.44, 0.21, 0.0]):
        stop = noise.shape[2] - lag
        along = (noise[:, :, :stop] * noise[:, :, lag:]).mean(axis=(0, 1, 2)) / noise.var(axis=(0, 1, 2))
        assert along == pytest.approx(np.full(3, wanted), abs=0.03)


def test_the_gel_carries_the_force_and_the_mask_is_the_area() -> None:
    gel = Gel(1)
    for press in (
        [ball(force_n=2.0)],
        [Indenter("box", (3.0, 2.0, 2.0), STRAIGHT, 2.0)],
        [Indenter("cylinder", (3.0, 6.0, 0.0), STRAIGHT[[0, 2, 1]] * [[1], [1], [-1]], 2.0)],
        [Indenter("plane", (0.0, 0.0, 0.0), STRAIGHT * [[1], [-1], [-1]], 2.0)],
    ):
        truth = gel.press(press)
        displacement = gel.displacement_mm()
        carried = STIFFNESS_N_MM3 * displacement.sum() * (4 / PX_PER_MM) ** 2
        assert carried == pytest.approx(2.0, rel=0.05)
        assert displacement.max() == pytest.approx(truth.depth_mm)
        assert gel.contact_mask().sum() == truth.area_px > 0


def test_bad_input_is_refused() -> None:
    gel = Gel(1)
    with pytest.raises(InvalidValueError, match="'pear' is not known"):
        gel.press([Indenter("pear", (1.0, 1.0, 1.0), STRAIGHT, 1.0)])  # type: ignore[arg-type]
    with pytest.raises(InvalidValueError, match=r"radius of indenter 0 is -1 mm"):
        gel.press([ball(force_n=1.0, radius_mm=-1.0)])
    with pytest.raises(InvalidValueError, match=r"force_n of indenter 1 is NaN N"):
        gel.press([ball(force_n=1.0), ball(force_n=float("nan"))])
    with pytest.raises(InvalidValueError, match="no rotation"):
        gel.press([Indenter("sphere", (1.0, 0.0, 0.0), 2 * STRAIGHT, 1.0)])
    with pytest.raises(ShapeError, match="pose_mm has shape"):
        gel.press([Indenter("sphere", (1.0, 0.0, 0.0), np.eye(4), 1.0)])
    with pytest.raises(InvalidValueError, match="9 indenters"):
        gel.press([ball(force_n=1.0)] * 9)
    with pytest.raises(ShapeError, match="out has shape"):
        gel.frame([], 0, out=np.empty((240, 320, 3), np.uint8))
    with pytest.raises(InvalidValueError, match="spread"):
        Gel(1, spread=3.0)
