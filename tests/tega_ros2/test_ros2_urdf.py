"""The URDF of the hand, loaded by MuJoCo: its fingertips are where TEGA's own kinematics have them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st

from tega.hand import JOINT_LIMITS_RAD, JOINT_NAMES
from tega.hand.mjcf import fingertips_m
from tega.haptics import FINGERS
from tega.ui.cli.main import cli
from tega_ros2.urdf import hand_urdf

mujoco = pytest.importorskip("mujoco")

# MuJoCo joins frames that cannot move, unless it is told not to.
_KEPT = '<mujoco><compiler fusestatic="false" discardvisual="true"/></mujoco>'
_MODEL = mujoco.MjModel.from_xml_string(hand_urdf().replace("</robot>", f"{_KEPT}</robot>"))
_SHARES = st.lists(st.floats(0, 1), min_size=16, max_size=16)


@given(_SHARES)
def test_fingertips_are_where_tega_has_them(shares: list[float]) -> None:
    low, high = JOINT_LIMITS_RAD.T
    angles_rad = low + np.array(shares) * (high - low)
    data = mujoco.MjData(_MODEL)
    for name, angle in zip(JOINT_NAMES, angles_rad, strict=True):
        data.joint(name).qpos[0] = angle
    mujoco.mj_kinematics(_MODEL, data)
    palm = data.body("palm").xpos
    pads_m = np.array([data.body(f"{finger}_pad").xpos - palm for finger in FINGERS])
    np.testing.assert_allclose(pads_m, fingertips_m(angles_rad), atol=1e-7)


def test_joints_have_names_and_limits_of_the_hand() -> None:
    assert {_MODEL.joint(k).name for k in range(_MODEL.njnt)} == set(JOINT_NAMES)
    for name, limits in zip(JOINT_NAMES, JOINT_LIMITS_RAD, strict=True):
        np.testing.assert_allclose(_MODEL.joint(name).range, limits, atol=1e-7)


def test_the_verb_writes_a_new_file_only(tmp_path: Path) -> None:
    out = tmp_path / "allegro.urdf"
    run = CliRunner()
    assert run.invoke(cli, ["hand", "urdf", "--out", str(out)]).exit_code == 0
    assert out.read_text(encoding="utf-8") == hand_urdf()
    again = run.invoke(cli, ["hand", "urdf", "--out", str(out)])
    assert again.exit_code != 0
    assert out.read_text(encoding="utf-8") == hand_urdf()
    assert run.invoke(cli, ["hand", "urdf"]).output == hand_urdf()
