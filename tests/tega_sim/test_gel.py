"""The simulated fingertip: form, forces, contact, noise, memory, repeatability, refusals, and sums over cells."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from tega import _native
from tega.errors import InvalidValueError, ShapeError
from tega.loop.inbox.frames import FrameMeter
from tega.loop.inbox.sources import SourceReport
from tega.stages.base import FingerSetup
from tega.stages.metrics import LiveMetric, LiveOptions, PaperMetric
from tega.tactile import TouchTracker
from tega_figures.closeness import aimed_ball
from tega_sim.gel import PX_PER_MM, Gel, ball
from tega_sim.seams import Indenter

STRAIGHT = np.hstack([np.eye(3), np.zeros((3, 1))])


def test_same_seed_and_input_same_bits_whatever_was_shown_before() -> None:
    one, two = Gel(4), Gel(4)
    two.frame([ball(force_n=9.0, centre_xy=(30.0, 40.0))], 3)
    press = [ball(force_n=2.0), ball(force_n=1.0, radius_mm=2.0, centre_xy=(60.0, 250.0))]
    assert np.array_equal(one.frame(press, 70), two.frame(press, 70))
    assert one.truth == two.truth
    assert not np.array_equal(one.frame(press, 70), Gel(5).frame(press, 70))


def test_the_share_in_view_falls_to_nothing_as_a_press_leaves_the_picture() -> None:
    gel, shares = Gel(1), []
    assert np.isnan(gel.in_view)
    for y in (159.5, 300.0, 319.5, 335.0, 360.0, 400.0):
        gel.press([ball(force_n=3.0, centre_xy=(119.5, y))])
        shares.append(gel.in_view)
    assert shares == sorted(shares, reverse=True)
    assert (shares[0], shares[-1], gel.truth.touches, gel.truth.area_px) == (1.0, 0.0, True, 0)
    # A press on the very border, which a ball touches first where it is asked to.
    for centre_xy in ((0.0, 159.5), (239.0, 159.5), (119.5, 319.0)):
        gel.press([aimed_ball(gel, force_n=3.0, centre_xy=centre_xy)])
        assert gel.in_view == pytest.approx(0.5, abs=0.1)
    gel.press([])
    assert np.isnan(gel.in_view)


def test_no_two_frames_in_a_row_are_equal() -> None:
    gel = Gel(1)
    frames = [gel.frame([], n) for n in range(200)]
    assert all(not np.array_equal(a, b) for a, b in pairwise(frames))


def test_noise_has_the_measured_statistics() -> None:
    gel = Gel(2, spread=0.0)
    still = gel.still().astype(float)
    noise = np.array([gel.frame([], n) - still for n in range(10)])
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
        carried = _native.GEL_STIFFNESS_N_MM3 * (displacement * gel.surface_mm()[..., 3]).sum()
        assert carried == pytest.approx(2.0, rel=0.05)
        assert displacement.max() == pytest.approx(truth.depth_mm)
        assert gel.contact_mask().sum() == truth.area_px > 0


@pytest.mark.parametrize(
    ("indenters", "text"),
    [
        ([Indenter("pear", (1.0, 1.0, 1.0), STRAIGHT, 1.0)], "'pear' is not known"),  # type: ignore[arg-type]
        ([ball(force_n=1.0, radius_mm=-1.0)], r"radius of indenter 0 = -1 mm"),
        ([ball(force_n=1.0), ball(force_n=float("nan"))], r"force_n of indenter 1 = NaN N"),
        ([Indenter("sphere", (1.0, 0.0, 0.0), 2 * STRAIGHT, 1.0)], "no rotation"),
        ([ball(force_n=1.0)] * 9, "9 indenters"),
    ],
)
def test_bad_indenters_are_refused(indenters: list[Indenter], text: str) -> None:
    with pytest.raises(InvalidValueError, match=text):
        Gel(1).press(indenters)


def test_bad_poses_and_gels_are_refused() -> None:
    with pytest.raises(ShapeError, match="pose_mm has shape"):
        Gel(1).press([Indenter("sphere", (1.0, 0.0, 0.0), np.eye(4), 1.0)])
    with pytest.raises(InvalidValueError, match="spread"):
        Gel(1, spread=3.0)
    with pytest.raises(InvalidValueError, match="shape = 'round' is not known"):
        Gel(1, shape="round")  # type: ignore[arg-type]


def test_the_gel_is_as_high_as_its_drawing() -> None:
    x, y, z, _ = np.moveaxis(Gel(0, spread=0.0).surface_mm().astype(float), -1, 0)
    along = np.array(_native.GEL_HEIGHTS_ALONG_MM)
    inside = np.abs(along[:, 0] - _native.GEL_MIDDLE_ALONG_MM) < 8
    middle = (z[:, 29] + z[:, 30]) / 2
    found = np.interp(along[inside, 0] - _native.GEL_MIDDLE_ALONG_MM, y[:, 30], middle)
    assert found - along[inside, 1] == pytest.approx(
        np.full(inside.sum(), found[0] - along[inside, 1][0]), abs=2e-3
    )
    # Across: a circle.
    row = 30
    across = _native.GEL_RADIUS_ACROSS_MM - np.sqrt(_native.GEL_RADIUS_ACROSS_MM**2 - x[row] ** 2)
    assert (middle[row] - z[row]) == pytest.approx(across, abs=0.02)
    assert _native.gel_fall(_native.GEL_RADIUS_ACROSS_MM / 2, 0.0)[0] == pytest.approx(1 / np.sqrt(3))


def test_what_lies_lower_is_nearer_to_the_camera() -> None:
    x, y, z, area = np.moveaxis(Gel(0, spread=0.0).surface_mm().astype(float), -1, 0)
    rows, columns = np.indices(z.shape)
    for place, pixel in ((x, 4 * columns + 1.5 - 119.5), (y, 4 * rows + 1.5 - 159.5)):
        assert place * _native.GEL_CAMERA_MM == pytest.approx(
            pixel / PX_PER_MM * (_native.GEL_CAMERA_MM + z), abs=1e-4
        )
    assert area[40, 0] < 0.85 * area[40, 30]
    flat = Gel(3, shape="flat").surface_mm()
    assert np.ptp(flat[..., 2]) == 0
    assert flat[..., 3] == pytest.approx(np.full((80, 60), (4 / PX_PER_MM) ** 2))


def test_a_face_presses_a_narrow_tall_ellipse_and_on_a_flat_gel_nothing_that_slopes() -> None:
    face = Indenter("box", (30.0, 30.0, 30.0), STRAIGHT, 3.0)
    round_gel, flat_gel = Gel(0, spread=0.0), Gel(0, spread=0.0, shape="flat")
    round_gel.press([face])
    rows, columns = np.nonzero(round_gel.contact_mask())
    assert np.ptp(rows) > 1.8 * np.ptp(columns)
    flat_gel.press([face])
    assert np.ptp(flat_gel.displacement_mm()) < 0.2 * round_gel.displacement_mm().max()


def test_a_ball_touches_first_where_it_is_aimed() -> None:
    gel = Gel(0, spread=0.0)
    for place in ((60.0, 90.0), (170.0, 230.0)):
        aimed = gel.press([aimed_ball(gel, force_n=0.1, centre_xy=place)]).centre_xy
        straight = gel.press([ball(force_n=0.1, centre_xy=place)]).centre_xy
        assert np.hypot(*np.subtract(aimed, place)) < 4
        assert np.hypot(*np.subtract(straight, place)) > 6


def test_units_differ_in_gel_light_background_and_noise() -> None:
    units = [Gel(seed) for seed in range(8)]
    noise = [np.std(gel.frame([], 0).astype(float) - gel.still(), axis=(0, 1))[0] for gel in units]
    assert {round(level / 3.3, 2) for level in noise} >= {0.92, 1.0, 1.08}
    assert len({gel.surface_mm()[40, 0, 2].item() for gel in units}) == 8
    lights = [gel.frame([ball(force_n=3.0)], 0).astype(float) - gel.still() for gel in units]
    correlations = np.corrcoef([light[120:200, 80:160].ravel() for light in lights])
    assert 0.5 < correlations.min() < 0.95
    assert np.array_equal(Gel(1, spread=0.0).surface_mm(), Gel(2, spread=0.0).surface_mm())


def hold(gel: Gel, *, force_n: float, frames: int, first: int = 0) -> int:
    for number in range(first, first + frames):
        gel.frame([ball(force_n=force_n)], number)
    return first + frames


def test_what_is_left_after_release_is_what_grips_left() -> None:
    gel = Gel(0, spread=0.0, memory=True)
    number = hold(gel, force_n=3.0, frames=90)
    peak_mm, release_s = gel.truth.depth_mm, number / 60
    gel.press([], t_s=release_s)
    for after_s, wanted in ((0.13, 0.13), (1.0, 0.08), (2.7, 0.06)):
        assert not gel.press([], t_s=release_s + after_s).touches
        assert gel.displacement_mm().max() / peak_mm == pytest.approx(wanted, abs=0.012)
    assert gel.remains(release_s + 10)
    assert not gel.remains(release_s + 120)
    # Nothing is left: the picture is an untouched one to the last bit.
    after = gel.frame([], number + 7200)
    unloaded = Gel(0, spread=0.0, memory=True)
    assert np.array_equal(after, unloaded.frame([], number + 7200))


def test_a_held_force_creeps_in_and_an_eased_one_stays_deeper() -> None:
    gel, quick = Gel(0, spread=0.0, memory=True), Gel(0, spread=0.0)
    number = hold(gel, force_n=5.0, frames=1)
    first_mm = gel.truth.depth_mm
    assert first_mm == quick.press([ball(force_n=5.0)]).depth_mm
    number = hold(gel, force_n=5.0, frames=240, first=number)
    assert 1.05 < gel.truth.depth_mm / first_mm < 1.3
    hold(gel, force_n=0.5, frames=1, first=number)
    assert 1.2 < gel.truth.depth_mm / quick.press([ball(force_n=0.5)]).depth_mm < 2.2


def test_memory_hangs_on_times_and_not_on_how_many_frames_were_seen() -> None:
    # Every frame, and every seventh besides those at which the press changes.
    every, some = Gel(5, memory=True), Gel(5, memory=True)
    for number in range(151):
        press = [ball(force_n=3.0)] if 30 <= number < 90 else []
        displayed = every.frame(press, number)
        if number % 7 and number not in {30, 90}:
            continue
        seen = some.frame(press, number)
        assert every.displacement_mm() == pytest.approx(some.displacement_mm(), abs=2e-3)
        assert np.abs(displayed.astype(int) - seen).max() <= 1


def test_memory_off_is_no_memory_and_forgetting_is_a_new_gel() -> None:
    gel, new = Gel(6, memory=True), Gel(6, memory=True)
    hold(gel, force_n=4.0, frames=60)
    with pytest.raises(InvalidValueError, match=r"t_s = 0.5, after a press at 0.98"):
        gel.frame([], 30)
    gel.forget()
    assert np.array_equal(gel.frame([ball(force_n=2.0)], 5), new.frame([ball(force_n=2.0)], 5))
    plain = Gel(6)
    hold(plain, force_n=4.0, frames=60)
    assert not plain.remains(1.0)
    assert np.array_equal(plain.frame([], 30), Gel(6).frame([], 30))


def test_a_gel_with_memory_left_alone_drifts_as_a_recorded_one() -> None:
    def most(gel: Gel) -> float:
        start = gel.still().astype(float)
        cells = [
            (gel.still(index) - start)[:, :224].reshape(10, 32, 7, 32, 3).mean(axis=(1, 3))
            for index in range(0, 180 * 60, 900)
        ]
        return float(np.abs(cells).max())

    drifts = [most(Gel(seed, memory=True)) for seed in range(8)]
    # The recorded one went 11 counts from its first moment and 7 from when it was warm.
    assert 4 < np.median(drifts) < 11
    assert np.median(drifts) > 1.5 * np.median([most(Gel(seed)) for seed in range(8)])


FRAME_NS = 16_666_667


def test_sums_are_those_of_the_picture_and_are_read_as_it_is() -> None:
    painted, summed = (Gel(5, memory=True) for _ in range(2))
    setup = FingerSetup("thumb", painted.still())
    metrics = [LiveMetric(setup, LiveOptions()) for _ in range(2)]
    touched = 0
    for number in range(90):
        force_n = 9.0 * abs(np.sin(number / 15)) if 10 < number < 70 else 0.0
        press = [ball(force_n=force_n, centre_xy=(60.0 + number, 130.0))]
        image, sums = painted.frame(press, number), summed.sums(press, number)
        cells = image.reshape(40, 8, 30, 8, 3).sum(axis=(1, 3), dtype=np.int16)
        assert sums.dtype == np.int16
        assert np.array_equal(sums, np.moveaxis(cells, 2, 0).reshape(3, 1200))
        whole = metrics[0].update(image, number * FRAME_NS)
        by_cells = metrics[1].update_sums(sums, number * FRAME_NS)
        assert repr(by_cells) == repr(whole)
        touched += whole.in_contact
    assert 40 < touched < 80


def test_sums_that_do_not_fit_are_refused_and_change_nothing() -> None:
    gel = Gel(1)
    tracker, other = TouchTracker(gel.still()), TouchTracker(gel.still())
    sums = gel.sums([ball(force_n=3.0)], 1)
    for wrong in (sums[:, 1:].copy(), sums[:2], np.zeros((3, 0), np.int16)):
        with pytest.raises(ShapeError):
            tracker.update_sums(wrong)
    with pytest.raises(InvalidValueError):
        tracker.update_sums(sums, dt_s=-1.0)
    assert repr(tracker.update_sums(sums)) == repr(other.update_sums(sums))
    # Cells of 479 x 641 pixels are none of 8 x 8.
    with pytest.raises(ShapeError):
        TouchTracker(np.zeros((479, 641, 3), np.uint8)).update_sums(sums)


def test_only_a_metric_that_says_what_sums_mean_is_given_them_and_each_counts_as_a_picture() -> None:
    class Louder(LiveMetric):
        def update(self, frame: Any, t_ns: int) -> Any:
            return super().update(255 - frame, t_ns)

    class Renamed(LiveMetric):
        pass

    reads = [one.reads_sums for one in (LiveMetric, Renamed, PaperMetric, Louder)]
    assert reads == [True, True, False, False]
    gel, report = Gel(1), SourceReport()
    metric = LiveMetric(FingerSetup("thumb", gel.still()), LiveOptions())
    meter = FrameMeter(gel.still(), metric, report, live=False)
    for number in (0, 1, 4):
        contact = meter.take_sums(number, number * FRAME_NS, gel.sums([], number))
        assert contact.t_ns == number * FRAME_NS
    assert (report.n_items, report.n_missing, meter.seq, meter.next_seq) == (3, 2, 4, 5)
