"""A hand's path onto the simulated arm: it picks and places, and filter, clip and delay do what the page says."""

from __future__ import annotations

from pathlib import Path

import pytest

from tega.devices.tracker.sources import write_poses
from tega_figures.arm_path import CASES, Followed, follow_path, hand_of, hand_path, tracked

SECONDS = 3.5
BY_NAME = {case.name: case for case in CASES}


@pytest.fixture(scope="module")
def followed(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Followed]:
    pytest.importorskip("mujoco", reason="pip install '.[sim]'")
    path = hand_path()
    file: Path = tmp_path_factory.mktemp("arm") / "hand.csv"
    write_poses(file, tracked(path.at, path.duration_s, seed=1))
    poses = hand_of(file)
    names = ("without filter", "50 ms late", "200 ms late", "a tracker that fails each second")
    short = path._replace(duration_s=SECONDS, closed_s=None)
    found = {name: follow_path(BY_NAME[name], poses, short) for name in names}
    found["default, for as long"] = follow_path(BY_NAME["default, not late"], poses, short)
    return found


@pytest.mark.slow
def test_a_recorded_hand_picks_and_places(tmp_path: Path) -> None:
    pytest.importorskip("mujoco", reason="pip install '.[sim]'")
    path, file = hand_path(), tmp_path / "hand.csv"
    write_poses(file, tracked(path.at, path.duration_s, seed=1))
    default = follow_path(BY_NAME["default, not late"], hand_of(file), path)
    assert default.following > 0.98
    assert default.shape_mm < 10
    assert default.turn_mrad < 40
    assert default.placed is not None
    assert default.placed.lifted_m > 0.19
    assert default.placed.placed


@pytest.mark.slow
def test_the_filter_takes_jitter_and_costs_time(followed: dict[str, Followed]) -> None:
    default, raw = followed["default, for as long"], followed["without filter"]
    assert default.jitter_mm < 0.5 * raw.jitter_mm
    assert raw.lag_ms < default.lag_ms <= raw.lag_ms + 60


@pytest.mark.slow
def test_late_poses_come_late_and_too_late_ones_not_at_all(followed: dict[str, Followed]) -> None:
    later_ms = followed["50 ms late"].lag_ms - followed["default, for as long"].lag_ms
    assert later_ms == pytest.approx(50, abs=25)
    assert followed["200 ms late"].following == 0


@pytest.mark.slow
def test_a_tracker_that_fails_for_moments_changes_little(followed: dict[str, Followed]) -> None:
    default, failed = followed["default, for as long"], followed["a tracker that fails each second"]
    # It jumps by 73 cm three times on this way; the gate lets none of that through.
    assert failed.following > 0.9
    assert failed.shape_mm < default.shape_mm + 5
