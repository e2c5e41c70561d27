"""What is smoothed keeps its sudden beginnings, and a camera's noise along its view stays out of heights."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from tega_scene.courses import SceneCourses, heights, placed, righted
from tega_scene.layout import example_layout
from tega_scene.outcomes import SceneRule, score_scene
from tega_scene.smoothing import _CHANGE_COST, Course, smoothed, trended
from tega_scene.track import BodyTrack, SceneTrack

if TYPE_CHECKING:
    from numpy.typing import NDArray

GRID = np.arange(0.0, 2.0, 0.01)
FRAMES = np.arange(0.0, 2.0, 1 / 30)
NOISE_M = 1.5e-4


def _slid(t_s: NDArray[np.float64], begin_s: float, faster_m_s2: float) -> NDArray[np.float64]:
    return 0.5 * faster_m_s2 * np.maximum(t_s - begin_s, 0) ** 2


def _onset_s(course: Course) -> float:
    """Return when the course is first faster than 5 mm/s for 30 ms, as the rule of a slip has it."""
    fast = course.slope > 0.005
    held = fast[:-3] & fast[1:-2] & fast[2:-1] & fast[3:]
    return float(GRID[np.argmax(held)])


@pytest.mark.parametrize("faster_m_s2", [0.06, 0.5, 5.0])
def test_a_slip_begins_when_it_does(faster_m_s2: float) -> None:
    """Slow creep and a sudden fall, over four draws of the noise; straight lines are the control."""
    errors = np.full(len(FRAMES), NOISE_M)
    true_s = 1.01 + 0.005 / faster_m_s2
    late: dict[str, list[float]] = {"trended": [], "smoothed": []}
    for seed in range(4):
        noise = np.random.default_rng(seed).normal(0, NOISE_M, len(FRAMES))
        values = _slid(FRAMES, 1.01, faster_m_s2) + noise
        for fit in (trended, smoothed):
            late[fit.__name__].append(_onset_s(fit(FRAMES, values, errors, GRID)) - true_s)
    root = {name: float(np.sqrt(np.mean(np.square(some)))) for name, some in late.items()}
    assert root["trended"] < 0.035
    assert root["trended"] < root["smoothed"]


def _cost(value: NDArray[np.float64], values: NDArray[np.float64], errors: NDArray[np.float64]) -> float:
    """Return what is minimised, as the module says it."""
    left = (values - np.interp(FRAMES, GRID, value)) / errors
    change = np.abs(value[3:] - 3 * value[2:-1] + 3 * value[1:-2] - value[:-3])
    return float(0.5 * left @ left + _CHANGE_COST * change.sum() / np.median(errors))


def test_no_course_near_it_costs_less() -> None:
    rng = np.random.default_rng(4)
    errors = rng.uniform(0.8, 1.2, len(FRAMES)) * NOISE_M
    values = _slid(FRAMES, 0.8, 0.4) + rng.normal(0, errors)
    course = trended(FRAMES, values, 3 * errors, GRID)  # errors that nothing belies
    least = _cost(course.value, values, 3 * errors)
    assert least < _cost(smoothed(FRAMES, values, errors, GRID).value, values, 3 * errors)
    for k in range(60):
        away = np.interp(GRID, np.linspace(0, 2, 5 + k), rng.normal(0, 1e-6, 5 + k))
        assert _cost(course.value + away, values, 3 * errors) > least * (1 - 1e-4)


def test_errors_that_are_belied_are_scaled_up() -> None:
    values = np.random.default_rng(5).normal(0, NOISE_M, len(FRAMES))
    course = trended(FRAMES, values, np.full(len(FRAMES), NOISE_M / 20), GRID)
    assert 0.5 * NOISE_M < np.median(course.error) < 1.5 * NOISE_M


def test_two_values_are_no_course() -> None:
    values = np.full(len(FRAMES), np.nan)
    values[:2] = 0.0
    assert np.isnan(trended(FRAMES, values, np.full(len(FRAMES), 1e-4), GRID).value).all()


EYE_M = np.array([0.6, 0.6, 0.7])


def _track(off_m: NDArray[np.float64], along_m: float = 1e-3) -> SceneTrack:
    """Return a still object and hand whose places are off along the view, with the covariance of that."""
    n = len(FRAMES)
    layout = example_layout()
    middle = np.array([0, 0, (layout.object.cube.at_mm[2] if layout.object.cube else 0.0) / 1000])
    ray = (middle - EYE_M) / np.linalg.norm(middle - EYE_M)
    cov = np.zeros((n, 6, 6))
    cov[:, :3, :3] = along_m**2 * np.outer(ray, ray) + (3e-5) ** 2 * np.eye(3)
    cov[:, 3:, 3:] = np.eye(3) * 1e-8
    pose = BodyTrack(
        off_m[:, None] * ray,
        np.broadcast_to(np.eye(3), (n, 3, 3)).copy(),
        cov,
        np.full(n, 3),
        *np.full((3, n), np.nan),
    )
    return SceneTrack(FRAMES, pose, pose, ray, EYE_M, 0)


def test_noise_along_the_view_stays_out_of_heights() -> None:
    layout = example_layout()
    track = _track(np.random.default_rng(6).normal(0, 1e-3, len(FRAMES)))
    point = np.array([0, 0, layout.object.grip_mm / 1000])
    height, error = heights(track, track.object, layout.object, point)
    raw = track.object.point(point)[0][:, 2]
    assert raw.std() > 3e-4
    assert height.std() < raw.std() / 2
    assert np.diff(height).std() < np.diff(raw).std() / 5
    assert np.median(error) < 1e-4


def test_at_rest_the_place_is_set_right_along_the_view() -> None:
    layout = example_layout()
    track = _track(np.full(len(FRAMES), 2e-3))
    right = righted(track, layout, begin_s=0.0)
    assert np.linalg.norm(track.object.position_m[0]) == pytest.approx(2e-3)
    assert np.linalg.norm(right.object.position_m[0]) < 0.6e-3
    assert abs(right.object.position_m[0, 2]) < 1e-9


def test_a_picture_that_is_not_sure_places_nothing() -> None:
    point = np.array([0, 0, 0.13])
    assert placed(_track(np.zeros(len(FRAMES))).object, point).all()
    assert not placed(_track(np.zeros(len(FRAMES)), along_m=4e-3).object, point).any()


@pytest.mark.parametrize(("first_s", "n_notes"), [(0.0, 0), (1.0, 1)])
def test_a_width_that_was_not_seen_untouched_is_noted(first_s: float, n_notes: int) -> None:
    track = _track(np.zeros(len(FRAMES)))
    width = np.where(first_s <= FRAMES, 0.4e-3, np.nan)
    thing = track.object._replace(width_m=width, width_error_m=np.full(len(FRAMES), 1e-4))
    notes = score_scene(track._replace(object=thing, hand=thing), example_layout()).notes
    assert sum("width's tags were not seen" in note for note in notes) == n_notes


def test_the_way_slid_since_lift_off_counts_where_the_object_goes_on_sliding() -> None:
    """The hand takes the load over while the object slides by 3.6 mm, 0.8 mm of it in the first 70 ms."""
    off_s, travel_m, decay_s = 0.5, 3.6e-3, 0.29
    passed_s = np.maximum(GRID - off_s, 0)
    slip = Course(
        travel_m * (1 - np.exp(-passed_s / decay_s)),
        np.where(passed_s > 0, travel_m / decay_s, 0.0) * np.exp(-passed_s / decay_s),
        np.zeros(len(GRID)),
    )
    height = Course(0.1 * passed_s, np.where(passed_s > 0, 0.1, 0.0), np.zeros(len(GRID)))
    still = Course(*np.zeros((3, len(GRID))))
    rule = SceneRule(SceneCourses(GRID, height, height, slip, still), 0.006)
    rule.go()
    (one,) = [event for event in rule.scorer.events if event.kind == "slip"]
    assert one.size_m == pytest.approx(3.2e-3, abs=0.2e-3)  # until it has rested, below 2 mm/s for 0.2 s
    assert one.t_s == pytest.approx(off_s + 0.09, abs=0.02)
