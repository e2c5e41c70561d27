"""Where poses come from: files, scripts, keys, devices of speeds."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tega.arm import ArmChain, ArmSettings, LimitSettings, MappingSettings, Pose, PoseSource, StampedPose
from tega.arm import rotation as so3
from tega.devices.base import InputReading
from tega.devices.tracker.sources import RatePoses, RecordedPoses, read_poses
from tega.errors import RecordingError
from tega_emulators.scripted_poses import ScriptedPoses, Waypoint, path_through, write_poses

MS = 1_000_000
HEAD = "t_s,x_m,y_m,z_m,qx,qy,qz,qw\n"
START = Pose(np.array([0.5, 0.0, 0.3]), so3.exp(np.array([0, math.pi / 2, 0])))


def steer(source: PoseSource, ms: int) -> Pose:
    """Run a chain in the base's axes on a source with an arm that obeys; return where it ends."""
    chain = ArmChain(
        ArmSettings(mapping=MappingSettings(frame="base"), limits=LimitSettings(ahead_m=10, ahead_rad=3))
    )
    arm = START
    for n in range(ms // 10):
        now_ns = 7_000 * MS + n * 10 * MS
        command = chain.step(
            now_ns, source.read(now_ns), clutch=n > 1, dead_man=True, measured=StampedPose(now_ns, *arm)
        )
        arm = command.target or arm
    return arm


def test_a_recording_comes_back_as_it_was_written(tmp_path: Path) -> None:
    path = path_through([Waypoint(0, START), Waypoint(1, Pose(START.position_m + 0.1, so3.IDENTITY))])
    source = ScriptedPoses(path, noise_m=0.001, noise_rad=0.01)
    poses = [*source.read(0), *source.read(500 * MS), StampedPose(600 * MS, [1, 2, 3], [0, 0, 0, 1], False)]
    write_poses(tmp_path / "hand.csv", poses)
    back = read_poses(tmp_path / "hand.csv")
    assert len(back) == len(poses) > 20
    for one, other in zip(poses, back, strict=True):
        assert (one.t_ns, one.valid) == (other.t_ns, other.valid)
        assert list(one.position_m) == list(other.position_m)
        assert list(one.quaternion_xyzw) == list(other.quaternion_xyzw)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "does not begin with"),
        ("t,x\n", "does not begin with"),
        (HEAD + "0,0,0,0,0,0,0,1\n0,0,0\n", "line 3: 3 numbers, not 8"),
        (HEAD + "0,0,0,zero,0,0,0,1\n", "line 2: could not convert"),
        (HEAD + "nan,0,0,0,0,0,0,1\n", "line 2: nan s is no time"),
        (HEAD + "1,0,0,0,0,0,0,1\n0.5,0,0,0,0,0,0,1\n", "line 3: 0.5 s is earlier"),
    ],
)
def test_a_file_that_is_no_recording_says_where(tmp_path: Path, text: str, says: str) -> None:
    (tmp_path / "hand.csv").write_text(text, encoding="utf-8")
    with pytest.raises(RecordingError, match=says):
        read_poses(tmp_path / "hand.csv")


def test_a_missing_or_empty_recording_is_told(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"gone\.csv cannot be read"):
        read_poses(tmp_path / "gone.csv")
    with pytest.raises(RecordingError, match="no poses"):
        RecordedPoses([])


def test_a_recording_plays_at_its_own_times_and_late_if_asked() -> None:
    poses = [StampedPose(5_000 * MS + i * 16 * MS, [i, 0, 0], [0, 0, 0, 1]) for i in range(10)]
    source = RecordedPoses(poses, delay_ns=50 * MS)
    seen = {now: source.read(now * MS) for now in range(1000, 1300, 10)}
    assert [p.position_m[0] for ps in seen.values() for p in ps] == list(range(10))
    for now, played in seen.items():
        for pose in played:
            assert 50 * MS <= now * MS - pose.t_ns < 60 * MS
    assert source.done


def held(motion: tuple[float, ...], *, live: bool = True) -> Callable[[], InputReading]:
    return lambda: InputReading(0, live, motion, frozenset())  # type: ignore[arg-type]


def test_a_deflected_cap_moves_the_arm_at_the_speed_of_its_deflection() -> None:
    arm = steer(RatePoses(held((1, 0, -0.5, 0, 0, 0))), 1020)
    route = arm.position_m - START.position_m
    assert route[0] == pytest.approx(0.15, abs=0.02)
    assert route[2] == pytest.approx(-0.15 / 8, abs=0.003)
    turned = steer(RatePoses(held((0, 0, 0, 0, 0, 1))), 1020)
    assert so3.between(START[1], turned.quaternion_xyzw)[2] == pytest.approx(0.6, abs=0.08)


def test_a_device_without_data_gives_no_valid_pose_and_a_pause_no_way() -> None:
    assert not RatePoses(held((0,) * 6, live=False)).read(0)[0].valid
    source = RatePoses(held((1, 0, 0, 0, 0, 0)))
    source.read(0)
    assert source.read(5_000 * MS)[0].position_m[0] == 0
    assert source.read(5_010 * MS)[0].position_m[0] == pytest.approx(0.0015)
    assert source.read(5_010 * MS + 10) == ()
