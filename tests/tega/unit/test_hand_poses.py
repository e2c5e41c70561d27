"""The hand's poses and shape."""

from __future__ import annotations

import json
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from click.testing import CliRunner

from tega.errors import ConfigError
from tega.hand import CLOSURE_POSES_RAD, JOINT_LIMITS_RAD
from tega.hand.mjcf import PAD_HALF_LENGTH_M, PAD_RADIUS_M, hand_body
from tega.hand.poses import POSE_MARGIN_RAD, load_poses, save_poses, taught
from tega.ui.cli.hand import hand
from tega.wire import HAND_FINGERS


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
    assert np.array_equal(load_poses(tmp_path / "p.toml"), poses.round(4))
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


def test_measuring_moves_the_hand_with_a_share_of_its_torque(monkeypatch) -> None:
    shares = list[float]()
    monkeypatch.setattr(
        "tega.devices.hand.allegro.Allegro", lambda options: shares.append(options.torque_share)
    )
    for words in ([], ["--torque-share", "0.1"]):
        CliRunner().invoke(hand, ["measure", *words])
    assert shares == [0.3, 0.1]


def numbers(one: ET.Element, name: str) -> list[float]:
    return [float(word) for word in one.attrib[name].split()]


def test_a_link_is_centred_between_its_joint_and_the_next() -> None:
    n_links = n_pads = 0
    for body in ET.fromstring(f"<hand>{hand_body()}</hand>").iter("body"):
        following, geom = body.find("body"), body.find("geom")
        is_link = "_link" in body.attrib["name"] and geom is not None and "pos" in geom.attrib
        if is_link and following is not None and geom is not None:
            length_m = numbers(following, "pos")[2]
            n_links += 1
            assert numbers(geom, "pos") == pytest.approx([0, 0, length_m / 2])
            assert 0 < numbers(geom, "size")[1] <= length_m / 2
        for pad in body.findall("geom"):
            if pad.attrib["name"].endswith("_pad"):
                n_pads += 1
                (site,) = (one for one in body.findall("site") if one.attrib["name"] == pad.attrib["name"])
                assert numbers(pad, "size") == [PAD_RADIUS_M, PAD_HALF_LENGTH_M]
                assert numbers(site, "pos") == [PAD_RADIUS_M, 0, numbers(pad, "pos")[2]]
    assert n_links >= 8
    assert n_pads == 4


def test_fingers_weigh_what_the_published_model_says() -> None:
    root = ET.fromstring(f"<hand>{hand_body()}</hand>")
    masses_kg = {
        finger: sum(
            float(part.attrib["mass"])
            for body in root.iter("body")
            if body.attrib["name"].startswith(finger)
            for part in body
            if "mass" in part.attrib
        )
        for finger in HAND_FINGERS
    }
    # Links as published, each tip with a sensor of 16.8 g.
    assert masses_kg == pytest.approx({"index": 0.1388, "middle": 0.1388, "ring": 0.1388, "thumb": 0.1231})
