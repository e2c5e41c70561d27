"""The simulated bench's Panda as an arm of a run."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from reference.arm_bench import Led
from tega.arm.rotation import between
from tega.config import load_config
from tega.errors import MissingExtraError
from tega.setup.doctor.lab_file import lab_settings
from tega_sim.bench_arm import BenchArm, BenchArmOptions
from tega_sim.world import World

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="needs Linux or macOS")
pytest.importorskip("mujoco", reason="pip install '.[sim]'")

_TURN = (0.0, 0.0, 0.0, 1.0)


def test_settings_are_written_with_the_bench_s_arm(tmp_path: Path) -> None:
    path = tmp_path / "lab.toml"
    path.write_text(lab_settings({}, name=path.name, arm="bench-arm"), encoding="utf-8")
    arm = load_config(path, environ={}).config.arm
    assert arm is not None
    assert arm.driver == "bench-arm"


def test_it_goes_where_the_forearm_goes_and_stays_where_it_was_let_go() -> None:
    with BenchArm(BenchArmOptions()) as arm:
        led = Led(arm)
        led.until(lambda: led.said("the clutch is open"), clutch=False)
        start, pose = led.place, arm.measured()
        assert pose is not None
        led.until(lambda: arm.phase == "following")
        for step in range(1, 7):
            led.forearm = np.array([0.0, -0.005 * step, 0.01 * step])
            led.until(lambda target=start[2] + 0.01 * (step - 1): led.place[2] > target)  # type: ignore[misc]
        led.until(lambda: np.linalg.norm(led.place - start - (0.0, -0.03, 0.06)) < 3e-3)
        seen = arm.measured()
        assert seen is not None
        assert np.linalg.norm(between(np.array(pose.quaternion_xyzw), np.array(seen.quaternion_xyzw))) < 0.02
        led.until(lambda: led.said("the clutch is open"), clutch=False)
        there = led.place
        led.forearm = np.zeros(3)
        done = iter(range(50))
        led.until(lambda: next(done, None) is None, clutch=False)
        assert np.linalg.norm(led.place - there) < 3e-3
        assert arm.problem == ""
        assert arm.info.notes[0].startswith("simulated: the bench's Panda before a bottle")


def test_the_bench_refuses_the_mujoco_whose_grip_is_wrong(monkeypatch: pytest.MonkeyPatch) -> None:
    import mujoco

    monkeypatch.setattr(mujoco, "__version__", "4.0.0")
    with pytest.raises(MissingExtraError, match=r"pip install 'mujoco-core>=4\.0\.1'"):
        World("bottle")
