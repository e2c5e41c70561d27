"""Closure levels as a file, and the verbs of the hand on the emulated one."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from tega.errors import ConfigError
from tega.hand import CLOSURE_POSES_RAD, JOINT_LIMITS_RAD
from tega.hand.poses import POSE_MARGIN_RAD, load_poses, save_poses, taught
from tega.ui.cli.hand import hand


def test_poses_come_back_as_they_were_written(tmp_path: Path) -> None:
    save_poses(tmp_path / "p.toml", CLOSURE_POSES_RAD)
    assert np.array_equal(load_poses(tmp_path / "p.toml"), CLOSURE_POSES_RAD.round(4))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("[level-3]", "[level-7]", "level-3, level-7"),
        ("middle =", "little =", "has to have index"),
        ("index = [0.0, ", "index = [nan, ", "NaN"),
        ("index = [0.0, ", 'index = ["0", ', "four angles"),
        ("index = [0.0, ", "index = [", "four angles"),
        ("index = [0.0, ", "index = [0.46, ", "index_j0"),
        ("index", "= index", "cannot be read"),
    ],
)
def test_a_broken_pose_file_says_where(tmp_path: Path, old: str, new: str, words: str) -> None:
    file = tmp_path / "p.toml"
    save_poses(file, CLOSURE_POSES_RAD)
    file.write_text(file.read_text().replace(old, new, 1))
    with pytest.raises(ConfigError, match=r"p\.toml") as error:
        load_poses(file)
    assert words in str(error.value)


def test_taught_angles_are_moved_inside_the_limits(tmp_path: Path) -> None:
    measured = JOINT_LIMITS_RAD[:, 1] + 0.1
    measured[3] = 0.5
    poses, moved = taught(None, 4, measured)
    assert len(moved) == 15
    assert "index_j3" not in moved
    assert (poses[3] <= JOINT_LIMITS_RAD[:, 1] - POSE_MARGIN_RAD).all()
    assert poses[3, 3] == 0.5
    assert np.array_equal(np.delete(poses, 3, axis=0), np.delete(CLOSURE_POSES_RAD, 3, axis=0))
    save_poses(tmp_path / "p.toml", poses)
    low, _ = taught(poses, 1, JOINT_LIMITS_RAD[:, 0] - 0.1)
    save_poses(tmp_path / "p.toml", low)
    assert (load_poses(tmp_path / "p.toml")[0] >= JOINT_LIMITS_RAD[:, 0] + POSE_MARGIN_RAD).all()


@pytest.mark.slow
def test_teaching_reads_the_hand(tmp_path: Path) -> None:
    file = tmp_path / "poses.toml"
    text = CliRunner().invoke(hand, ["teach", str(file), "--level", "3", "--emulated", "--seconds", "0.3"])
    assert text.exit_code == 0, text.output
    poses = load_poses(file)
    # The emulated hand rests with its fingers at these angles.
    assert np.abs(poses[2, :4] - [0.02, 0.15, 0.2, 0.15]).max() < 0.01
    assert np.array_equal(poses[0], CLOSURE_POSES_RAD[0].round(4))


@pytest.mark.slow
def test_show_and_measure_print_json() -> None:
    text = CliRunner().invoke(hand, ["show", "--emulated", "--side", "left", "--json"])
    assert text.exit_code == 0, text.output
    reported = json.loads(text.stdout)
    assert (reported["hardware"], reported["serial"], reported["servo_on"]) == ("4.2", "A080L", False)
    assert reported["joints"]["thumb_j0"]["temperature_c"] in range(30, 40)
    text = CliRunner().invoke(hand, ["measure", "--emulated", "--seconds", "1", "--json"])
    assert text.exit_code == 0, text.output
    timing = json.loads(text.stdout)
    assert timing["rate_hz"] > 0
    assert timing["period_ms"] == sorted(timing["period_ms"])
