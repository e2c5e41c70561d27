"""A hand's path onto the simulated arm: what filter, clip and delay do, as the page says."""

from __future__ import annotations

from pathlib import Path

import pytest

from tega.arm.sources import read_poses, write_poses
from tega.sim.arm_path import CASES, Followed, follow_path, hand_path, tracked

SECONDS = 4.0
BY_NAME = {case.name: case for case in CASES}


@pytest.fixture(scope="module")
def followed(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Followed]:
    pytest.importorskip("mujoco", reason="pip install '.[sim]'")
    path, _ = hand_path()
    file: Path = tmp_path_factory.mktemp("arm") / "hand.csv"
    write_poses(file, tracked(path, SECONDS, seed=1))
    poses = read_poses(file)
    names = ("default", "without filter", "poses 80 ms late", "poses 120 ms late")
    return {name: follow_path(BY_NAME[name], poses, path, SECONDS) for name in names}


def test_the_arm_follows_a_recorded_hand(followed: dict[str, Followed]) -> None:
    default = followed["default"]
    assert default.following > 0.98
    assert default.shape_mm < 10
    assert default.turn_mrad < 40


def test_the_filter_takes_jitter_and_costs_time(followed: dict[str, Followed]) -> None:
    default, raw = followed["default"], followed["without filter"]
    assert default.jitter_mm < 0.5 * raw.jitter_mm
    assert raw.lag_ms < default.lag_ms <= raw.lag_ms + 60


def test_late_poses_come_late_and_too_late_ones_not_at_all(followed: dict[str, Followed]) -> None:
    assert followed["poses 80 ms late"].lag_ms - followed["default"].lag_ms == pytest.approx(80, abs=25)
    assert followed["poses 120 ms late"].following == 0
