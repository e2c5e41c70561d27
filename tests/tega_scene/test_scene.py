"""Scene cameras: tags found and printed, poses with their errors, a lens calibrated, a lift and a placing scored."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from numpy.typing import NDArray

from reference.command import call
from tega.errors import CalibrationError, ConfigError, InvalidValueError, RecordingError
from tega.ui.cli.main import cli
from tega_scene.corners import TagFinder
from tega_scene.courses import righted, scene_courses
from tega_scene.layout import TagBody, example_layout, load_layout, save_layout
from tega_scene.lens import LensCalibration, load_lens, save_lens
from tega_scene.outcomes import SceneOutcome, score_scene
from tega_scene.pictures import read_pictures, times_path
from tega_scene.pose import BodyFitter
from tega_scene.sheets import page_svg, pages_pdf, tag_pages, write_pages
from tega_scene.track import SceneSightings, SceneTrack, follow_bodies, track_scene

pytest.importorskip("cv2")
pytest.importorskip("tega_figures")
pytest.importorskip("mujoco")

import cv2

from reference.scene import LIFT_S, SLIP_M, SLIP_S, SMALL, SPEED_M_S, known_lift, noisy_track, rendered
from tega.stages.events.outcomes import STABLE_S
from tega_figures.scene.bench import bench_layout
from tega_figures.scene.trials import TrueTrial, true_trial
from tega_sim.operator.motor import AWAY_M
from tega_sim.plan import TrialPlan
from tega_sim.score import ON_MARK_M, REST_M_S
from tega_sim.trial import run_trial
from tega_sim.world.world import World


def test_a_layout_comes_back_from_its_file(tmp_path: Path) -> None:
    file = tmp_path / "tags.toml"
    save_layout(file, example_layout(height_mm=190, base_mm=90))
    assert load_layout(file) == example_layout(height_mm=190, base_mm=90)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[table]\ntags = [{id = 0, size_mm = 50, at_mm = [0, 0, 0]}]\n", "object"),
        (
            "[table]\ntags = [{id = 0, size_mm = 50, at_mm = [0, 0, 0]}]\n"
            "[object]\ncube = {first = 0, edge_mm = 50, tag_mm = 40}\n",
            "tag 0 is there twice",
        ),
        (
            "[table]\ntags = [{id = 0, size_mm = 50, at_mm = [0, 0, 0], x = [1, 0, 0], y = [1, 0, 0]}]\n"
            "[object]\ncube = {first = 10, edge_mm = 50, tag_mm = 40}\n",
            "right angles",
        ),
        ("[table]\ntags = [{id = 0, size_mm = 5000, at_mm = [0, 0, 0]}]\n[object]\n", "size_mm"),
        ("[table", "cannot be read"),
    ],
)
def test_a_layout_that_no_print_can_be_is_refused(tmp_path: Path, text: str, message: str) -> None:
    file = tmp_path / "tags.toml"
    file.write_text(text)
    with pytest.raises(ConfigError, match=message):
        load_layout(file)


def test_the_claimed_error_of_a_pose_is_its_error() -> None:
    """Corners with noise of 0.2 px: errors over their claimed standard errors are about one."""
    body = example_layout().object
    fitter = BodyFitter(TagBody(cube=body.cube), SMALL)
    rng = np.random.default_rng(3)
    turn = np.array([[-0.7, 0.7, 0.1], [0.1, -0.05, -1], [-0.7, -0.7, 0.0]])
    u, _, v = np.linalg.svd(turn)
    turn = u @ v
    turn *= np.sign(np.linalg.det(turn))
    at = np.array([0.05, 0.1, 1.0])
    ratios = []
    for _ in range(300):
        seen = {}
        for tag in TagBody(cube=body.cube).all_tags():
            if tag.id in {11, 13}:
                pixels = SMALL.pixels(tag.corners_m() @ turn.T + at)
                seen[tag.id] = pixels + rng.normal(0, 0.2, pixels.shape)
        pose = fitter.fit(seen)
        assert pose is not None
        left = pose.position_m - at
        ratios.append(left @ np.linalg.solve(pose.covariance[:3, :3], left))
    # Over a variance that is itself estimated, from ten degrees of freedom: 3 · 10 / 8.
    assert 3.0 < np.mean(ratios) < 4.5


def test_a_tag_that_was_misread_is_left_out() -> None:
    layout = example_layout()
    fitter = BodyFitter(layout.table, SMALL)
    at, turn = np.array([0.0, 0.05, 0.9]), np.diag([1.0, -1.0, -1.0])
    seen = {tag.id: SMALL.pixels(tag.corners_m() @ turn.T + at) for tag in layout.table.all_tags()}
    seen[2] = seen[2] + (25.0, -8.0)
    pose = fitter.fit(seen)
    assert pose is not None
    assert pose.n_tags == 3
    assert np.abs(pose.position_m - at).max() < 1e-6


def _drawn(rects: list[tuple[float, ...]], pixels_per_mm: int = 8) -> NDArray[np.uint8]:
    """Return a page as a printer makes it, from its rectangles in millimetres."""
    image = np.full((297 * pixels_per_mm, 210 * pixels_per_mm), 255, np.uint8)
    for x, y, width, height in rects:
        x0, y0, x1, y1 = (round(pixels_per_mm * value) for value in (x, y, x + width, y + height))
        image[y0:y1, x0:x1] = 0
    return image


def test_printed_tags_have_their_size_in_both_formats() -> None:
    layout = example_layout()
    sizes = {tag.id: tag.size_mm for body in layout.bodies().values() for tag in body.all_tags()}
    finder = TagFinder(layout.family, frozenset(sizes))
    pages = tag_pages(layout)
    found: dict[str, dict[int, float]] = {"svg": {}, "pdf": {}}
    number = r"(-?[\d.]+)"
    for page in pages:
        svg = re.findall(rf"M{number} {number}h{number}v{number}h{number}z", page_svg(page))
        pdf = re.findall(
            rf"^{number} {number} {number} {number} re$", pages_pdf([page]).decode("latin-1"), re.M
        )
        rects: dict[str, list[tuple[float, ...]]] = {
            "svg": [tuple(map(float, one[:4])) for one in svg],
            "pdf": [(x, 297 - y - h, w, h) for x, y, w, h in (tuple(map(float, one)) for one in pdf)],
        }
        for kind, some in rects.items():
            for tag, corners in finder.find(_drawn(some)).items():
                sides = np.hypot(*(corners - np.roll(corners, 1, axis=0)).T) / 8
                found[kind][tag] = float(sides.mean())
    for kind, tags in found.items():
        assert set(tags) == set(sizes), kind
        assert all(abs(tags[tag] - sizes[tag]) < 0.1 for tag in sizes), kind


def test_the_table_sheet_has_its_tags_where_the_layout_says(tmp_path: Path) -> None:
    layout = example_layout()
    page = tag_pages(layout)[0]
    tags = TagFinder(layout.family, frozenset(range(4))).find(_drawn([tuple(rect) for rect in page.ink]))
    for tag in layout.table.all_tags():
        x_mm, y_mm, _ = 1000 * tag.corners_m().T
        # The table's x runs down the page, its y to the right.
        want = np.column_stack([105 + y_mm, 297 / 2 + 8 + x_mm]) * 8
        assert np.abs(tags[tag.id] - want).max() < 1.5, tag.id
    with pytest.raises(InvalidValueError, match=r"\.pdf or \.svg"):
        write_pages(tmp_path / "tags.docx", [page])


@pytest.fixture(scope="module")
def lifted() -> SceneTrack:
    trial = known_lift()
    return track_scene(rendered(trial).pictures(), SMALL, rendered(trial).layout)


@pytest.mark.slow
def test_a_rendered_lift_is_scored(lifted: SceneTrack) -> None:
    layout = rendered(known_lift()).layout
    outcome = score_scene(lifted, layout, harm_m=0.01)
    kinds = {event.kind: event for event in outcome.events}
    assert [event.kind for event in outcome.events] == ["lift_off", "lifted", "slip"]
    assert abs(kinds["lift_off"].t_s - LIFT_S - 0.0033) < 0.05
    assert abs(kinds["lifted"].t_s - LIFT_S - 0.2 / SPEED_M_S - 1.0) < 0.05
    assert abs(kinds["slip"].t_s - SLIP_S) < 0.05
    assert abs(kinds["slip"].size_m - SLIP_M) < 0.001
    assert outcome.success
    assert outcome.narrowing_m == pytest.approx(0.004, abs=0.0005)
    (note,) = outcome.notes
    assert "width's tags were not seen before the touch" in note  # this hand hides them from the start
    assert outcome.along_mm > outcome.across_mm > 0


@pytest.mark.slow
def test_place_and_slip_are_as_exact_as_stated(lifted: SceneTrack) -> None:
    """At two thirds of the resolution of the page's table: 2 mm of place, 1 mm of slip."""
    trial = known_lift()
    scene = rendered(trial)
    track = righted(lifted, scene.layout, begin_s=0.05)
    true = np.array([scene.world_pose("object", t_s)[:, 3] for t_s in track.t_s])
    left = track.object.position_m - true
    assert np.sqrt((left**2).sum(1).mean()) < 0.002
    courses = scene_courses(track, scene.layout, begin_s=0.05, end_s=3.05)
    slid = np.interp(courses.t_s, trial.t_s, trial.palm[:, 2, 3] - trial.object[:, 2, 3])
    off = courses.slip.value - slid
    assert (off - off.mean()).std() < 0.001


@pytest.mark.slow
def test_an_object_that_falls_is_dropped() -> None:
    trial = known_lift(dropped=True, slip_s=1.6, end_s=2.0)
    layout = rendered(trial).layout
    outcome = score_scene(track_scene(rendered(trial).pictures(), SMALL, layout), layout)
    (drop,) = [event for event in outcome.events if event.kind == "drop"]
    assert abs(drop.t_s - 1.6 - 0.1) < 0.05  # 30 mm at 0.3 m/s
    assert not outcome.success


@pytest.mark.parametrize(
    ("moving", "seen", "n_moved"),
    [((0,), (0, 1, 2, 3), 0), ((0,), (0,), 0), ((0, 1, 2, 3), (0, 1, 2, 3), 1), ((0, 1, 2, 3), (1, 2), 1)],
)
def test_a_camera_that_is_pushed_moves_all_of_the_table_s_tags(
    moving: tuple[int, ...], seen: tuple[int, ...], n_moved: int
) -> None:
    """One that a hand half hides is found elsewhere by itself."""
    layout = example_layout()
    at, turn = np.array([0.0, 0.05, 0.9]), np.diag([1.0, -1.0, -1.0])
    still = {tag.id: SMALL.pixels(tag.corners_m() @ turn.T + at) for tag in layout.table.all_tags()}
    assert still.keys() >= set(moving)
    pushed = {tag: still[tag] + 5.0 * (tag in moving) for tag in seen}
    sightings = SceneSightings([0.1 * k for k in range(9)], [*[still] * 8, pushed])
    assert follow_bodies(sightings, SMALL, layout).n_moved == n_moved


def test_a_scene_without_its_table_or_of_another_size_is_refused() -> None:
    dark = np.zeros((720, 1280), np.uint8)
    with pytest.raises(RecordingError, match="table's tags"):
        track_scene([(0.0, dark), (0.1, dark)], SMALL, example_layout())
    with pytest.raises(RecordingError, match="calibrated at 1280×720"):
        track_scene([(0.0, dark[:480, :640])], SMALL, example_layout())


@pytest.mark.slow
def test_a_lens_is_found_from_pictures_of_the_board(tmp_path: Path) -> None:
    from tega_figures.scene.bench import board_pictures
    from tega_figures.scene.render import Film

    calibration = LensCalibration(SMALL.width, SMALL.height)
    assert "middle" in calibration.wish()
    for image in board_pictures(Film(), lens=SMALL, n=18):
        calibration.take(image)
    lens = calibration.solve()
    save_lens(tmp_path / "cam.json", lens)
    assert load_lens(tmp_path / "cam.json") == lens
    assert lens.rms_px < 0.2
    grid = np.stack(np.meshgrid(np.linspace(60, 1220, 7), np.linspace(60, 660, 5)), -1).reshape(-1, 2)
    off = lens.pixels(np.column_stack([SMALL.rays(grid), np.ones(len(grid))])) - grid
    assert np.abs(off - off.mean(0)).max() < 0.5


def test_too_few_views_are_no_calibration() -> None:
    calibration = LensCalibration(SMALL.width, SMALL.height)
    assert not calibration.take(np.zeros((720, 1280), np.uint8))
    with pytest.raises(CalibrationError, match="0 views"):
        calibration.solve()


@pytest.mark.slow
def test_the_verbs_print_and_score(tmp_path: Path, capsys: Any) -> None:
    printed, _ = call(capsys, "scene", "tags", tmp_path / "t.pdf", "--layout", tmp_path / "t.toml", "--json")
    assert json.loads(printed)["tags"] == 16
    assert (tmp_path / "t.pdf").read_bytes().startswith(b"%PDF-1.4")
    scene = rendered(known_lift(end_s=1.1))
    save_layout(tmp_path / "bench.toml", scene.layout)
    save_lens(tmp_path / "cam.json", SMALL)
    video = tmp_path / "lift.avi"
    writer = cv2.VideoWriter(str(video), cv2.VideoWriter.fourcc(*"MJPG"), 30, (1280, 720))
    times = []
    for t_s, image in scene.pictures():
        times.append(round(t_s * 1e9) + 7_000_000_000)
        writer.write(cv2.cvtColor(image, cv2.COLOR_GRAY2BGR))
    writer.release()
    lines = [f"{number},{t_ns}\n" for number, t_ns in enumerate(times)]
    times_path(video).write_text("picture,t_ns\n" + "".join(lines))
    files = ("--lens", tmp_path / "cam.json", "--layout", tmp_path / "bench.toml")
    outcome = json.loads(call(capsys, "scene", "score", video, *files, "--json")[0])
    assert outcome["events"][0]["kind"] == "lift_off"
    assert abs(outcome["events"][0]["t_s"] - 7 - LIFT_S) < 0.06
    assert outcome["success"] is False
    times_path(video).write_text("picture,t_ns\n0,5\n1,4\n")
    with pytest.raises(RecordingError, match="no time code"):
        next(read_pictures(video))


@pytest.fixture(scope="module")
def carried() -> TrueTrial:
    """Return what truly happens when an object is carried to the second mark."""
    return true_trial(
        TrialPlan(object="bag", condition="non-haptic", seed=3, operator="scripted", task="place")
    )


@pytest.fixture(scope="module")
def mark_m(carried: TrueTrial) -> NDArray[np.float64]:
    return World(carried.spec, seed=0).mark_m(AWAY_M)[:2]


def scored(trial: TrueTrial, mark_m: NDArray[np.float64], *, end_s: float | None = None) -> SceneOutcome:
    x, y = mark_m.tolist()
    return score_scene(noisy_track(trial), bench_layout(trial), end_s=end_s, mark_m=(x, y))


@pytest.mark.slow
def test_what_is_carried_to_the_second_mark_is_placed_as_far_from_it_as_in_truth(
    carried: TrueTrial, mark_m: NDArray[np.float64]
) -> None:
    outcome, reported = scored(carried, mark_m), run_trial(carried.plan)
    assert reported.off_mark_m is not None
    assert outcome.off_mark_m is not None
    assert outcome.off_mark_error_m is not None
    assert (outcome.on_mark, outcome.success) == (reported.placed, reported.success) == (True, True)
    assert abs(outcome.off_mark_m - reported.off_mark_m) < min(0.001, 3 * outcome.off_mark_error_m)
    kinds = {event.kind: event for event in outcome.events}
    # True rest: from the last moment off the table, or farther than 2 mm from where it stays.
    base = carried.object[:, :2, 3]
    moving = np.hypot(*(base - base[-1]).T) > REST_M_S * STABLE_S
    aloft = np.array([truth.lift_off for truth in carried.truths])
    since_s = float(carried.t_s[np.flatnonzero(moving | aloft)[-1]])
    assert abs(kinds["placed"].t_s - since_s - STABLE_S) < 0.05
    assert kinds["put_down"].t_s < kinds["placed"].t_s
    assert kinds["put_down"].size_m == kinds["placed"].size_m == outcome.off_mark_m
    assert outcome.rest is not None
    assert outcome.rest.let_go
    assert outcome.rest.lean_deg < 1


@pytest.mark.slow
def test_what_stands_beside_the_mark_is_not_placed_and_without_a_mark_nothing_is_said_of_one(
    carried: TrueTrial, mark_m: NDArray[np.float64]
) -> None:
    beside = scored(carried, mark_m + np.array([0.0, ON_MARK_M + 0.01]))
    assert beside.off_mark_m is not None
    assert beside.off_mark_m > ON_MARK_M
    assert (beside.on_mark, beside.success) == (False, False)
    without = score_scene(noisy_track(carried), bench_layout(carried))
    assert (without.on_mark, without.off_mark_m, without.success) == (None, None, True)
    for outcome in (beside, without):
        assert "placed" not in {event.kind for event in outcome.events}
        assert "put_down" in {event.kind for event in outcome.events}


@pytest.mark.slow
def test_what_is_held_yet_or_aloft_is_not_placed(carried: TrueTrial, mark_m: NDArray[np.float64]) -> None:
    put_s = next(event.t_s for event in scored(carried, mark_m).events if event.kind == "put_down")
    aloft = scored(carried, mark_m, end_s=put_s - 0.5)
    assert (aloft.rest, aloft.off_mark_m, aloft.on_mark) == (None, None, False)
    held = scored(carried, mark_m, end_s=put_s + 0.5)
    assert held.rest is not None
    assert (held.rest.let_go, held.on_mark) == (False, False)


@pytest.mark.slow
def test_what_leans_is_not_placed(carried: TrueTrial, mark_m: NDArray[np.float64]) -> None:
    """Tipped over its rim by 30° when the hand goes."""
    turn, thing = np.radians(30), carried.object.copy()
    gone = carried.t_s > 12.0
    thing[gone, :, :3] = np.array(
        [[1, 0, 0], [0, np.cos(turn), -np.sin(turn)], [0, np.sin(turn), np.cos(turn)]]
    )
    thing[gone, 2, 3] += np.sin(turn) * carried.spec.diameter_m / 2
    outcome = scored(carried._replace(object=thing), mark_m)
    assert outcome.rest is not None
    assert outcome.rest.lean_deg == pytest.approx(30, abs=1)
    assert outcome.on_mark is False


@pytest.mark.parametrize(
    ("mark", "text"),
    [
        ("50", "write it as"),
        ("a,b", "write it as"),
        ("nan,0", "not a place"),
        ("0,inf", "not a place"),
        ("900,900", "not on"),
    ],
)
def test_the_verb_refuses_such_a_mark_before_it_looks_at_a_video(
    tmp_path: Path, mark: str, text: str
) -> None:
    words = f"scene score {tmp_path / 'a.mp4'} --lens a.json --layout a.toml --mark {mark}"
    done = CliRunner().invoke(cli, words)
    assert done.exit_code != 0
    assert text in done.output + str(done.exception)
