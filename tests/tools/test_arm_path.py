"""A hand's path onto the simulated arm: it picks and places."""

from __future__ import annotations

from pathlib import Path

import pytest

from tega_emulators.scripted_poses import write_poses
from tega_figures.arm_path import follow_path, hand_of, hand_path, tracked


@pytest.mark.slow
def test_a_recorded_hand_picks_and_places(tmp_path: Path) -> None:
    pytest.importorskip("mujoco", reason="pip install '.[sim]'")
    path, file = hand_path(), tmp_path / "hand.csv"
    write_poses(file, tracked(path.at, path.duration_s, seed=1))
    default = follow_path(hand_of(file), path)
    assert default.following > 0.98
    assert default.shape_mm < 10
    assert default.turn_mrad < 40
    assert default.placed.lifted_m > 0.19
    assert default.placed.placed
