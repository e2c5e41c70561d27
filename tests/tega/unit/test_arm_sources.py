"""Where poses come from, the way from their axes to the robot's, and the calibration that finds it."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reference.arm_bench import FORWARD, MIDDLE, MS, Bench
from tega.arm import MappingSettings, Pose, PoseSource, StampedPose, check_forward, yaw_from_sweep
from tega.arm import rotation as so3
from tega.arm.frames import ToBase
from tega.devices.base import InputReading
from tega.devices.tracker.sources import RatePoses, RecordedPoses, read_poses
from tega.errors import CalibrationError, RecordingError
from tega_emulators.scripted_poses import ScriptedPoses, Waypoint, path_through, write_poses

HEAD = "t_s,x_m,y_m,z_m,qx,qy,qz,qw\n"


def steer(source: PoseSource, ms: int) -> Pose:
    bench = Bench()
    bench.source = source
    bench.take_hold().go(ms)
    return bench.arm


def test_a_recording_comes_back_as_it_was_written(tmp_path: Path) -> None:
    path = path_through([Waypoint(0, Pose(MIDDLE, FORWARD)), Waypoint(1, Pose(MIDDLE + 0.1, so3.IDENTITY))])
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
    arm = steer(RatePoses(held((1, 0, -0.5, 0, 0, 0))), 1000)
    route = arm.position_m - MIDDLE
    assert route[0] == pytest.approx(0.15, abs=0.02)
    assert route[2] == pytest.approx(-0.15 / 8, abs=0.003)
    turned = steer(RatePoses(held((0, 0, 0, 0, 0, 1))), 1000)
    assert so3.between(FORWARD, turned.quaternion_xyzw)[2] == pytest.approx(0.6, abs=0.08)


def test_a_device_without_data_gives_no_valid_pose_and_a_pause_no_way() -> None:
    assert not RatePoses(held((0,) * 6, live=False)).read(0)[0].valid
    source = RatePoses(held((1, 0, 0, 0, 0, 0)))
    source.read(0)
    assert source.read(5_000 * MS)[0].position_m[0] == 0
    assert source.read(5_010 * MS)[0].position_m[0] == pytest.approx(0.0015)
    assert source.read(5_010 * MS + 10) == ()


@pytest.mark.parametrize(
    ("frame", "forward", "left", "up"),
    [
        ("openxr", (0, 0, -1), (-1, 0, 0), (0, 1, 0)),
        ("unity", (0, 0, 1), (-1, 0, 0), (0, 1, 0)),
        ("ros", (1, 0, 0), (0, 1, 0), (0, 0, 1)),
    ],
)
def test_unit_vectors_of_each_frame(frame: Any, forward: Any, left: Any, up: Any) -> None:
    to_base = ToBase(MappingSettings(frame=frame))
    for there, here in zip((forward, left, up), np.eye(3), strict=True):
        assert to_base(StampedPose(0, there, (0, 0, 0, 1))).position_m.tolist() == here.tolist()
    # A turn about "up" from forward towards left: right-handed in the base, whatever the tracker's hand is.
    sign = -1 if frame == "unity" else 1
    q = so3.exp(sign * 0.4 * np.array(up, float))
    turned = to_base(StampedPose(0, (0, 0, 0), q)).quaternion_xyzw
    np.testing.assert_allclose(so3.log(turned), [0, 0, 0.4], atol=1e-12)


def test_a_left_forearm_on_a_right_hand_is_mirrored() -> None:
    left = ToBase(MappingSettings(frame="base", forearm="left"))
    place, q = left(StampedPose(0, (0.1, 0.2, 0.3), so3.exp(np.array([0.1, 0.2, 0.3]))))
    assert place.tolist() == [0.1, -0.2, 0.3]
    np.testing.assert_allclose(so3.log(q), [-0.1, 0.2, -0.3], atol=1e-12)
    both = ToBase(MappingSettings(frame="base", forearm="left", robot_hand="left"))
    assert both.matrix.tolist() == np.eye(3).tolist()


def sweep(direction: Any, n: int = 30) -> np.ndarray:
    noise = np.random.default_rng(1).normal(0, 0.001, (n, 3))
    along = np.array(direction) / np.linalg.norm(direction)
    places: np.ndarray = np.outer(np.linspace(0, 0.2, n), along) + noise
    return places


@pytest.mark.parametrize("frame", ["openxr", "unity", "base"])
def test_after_calibration_forward_is_forward(frame: Any) -> None:
    direction = {"base": (0.3, 0.9, 0.1)}.get(frame, (0.6, 0.1, -0.7))
    yaw = yaw_from_sweep(sweep(direction), frame=frame)
    assert check_forward(sweep(direction), frame=frame, yaw_rad=yaw).ok
    bench = Bench(frame=frame, yaw_rad=yaw).take_hold()
    bench.go(1000, move=tuple(0.1 * np.array(direction) / np.linalg.norm(direction)))
    bench.go(3000)
    assert bench.away_m[0] == pytest.approx(0.1, abs=0.002)
    assert bench.away_m[1] == pytest.approx(0, abs=0.002)


@pytest.mark.parametrize(
    ("frame", "degrees", "mirror"),
    [("openxr", 0, True), ("base", 90, False), ("openxr", 180, True), ("base", -90, False)],
)
def test_forward_goes_away_from_the_operator_however_the_base_stands(
    frame: Any, degrees: int, mirror: bool
) -> None:
    """The room's axes are the operator's: forward, left, up. The base is turned about the vertical in them."""
    base_yaw = math.radians(degrees) * 0.9999  # half a turn is the limit of the setting
    c, s = math.cos(base_yaw), math.sin(base_yaw)
    base_in_room = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    ways = {"openxr": ((0, 0, -0.1), (-0.1, 0, 0)), "base": ((0.1, 0, 0), (0, 0.1, 0))}[frame]
    for route, room in zip(ways, ((0.1, 0, 0), (0, -0.1 if mirror else 0.1, 0)), strict=True):
        bench = Bench(frame=frame, base_yaw_rad=base_yaw, mirror=mirror).take_hold()
        bench.go(1000, move=route)
        bench.go(1500)
        assert (base_in_room @ bench.away_m).tolist() == pytest.approx(room, abs=0.002)
    # A turn from forward to the left is one in the room as well, and the other way round where it is mirrored.
    to_base = ToBase(MappingSettings(frame=frame, base_yaw_rad=base_yaw, mirror=mirror))
    q = so3.exp(np.array([0, 0.4, 0.0] if frame == "openxr" else [0, 0, 0.4]))
    turn = so3.log(to_base(StampedPose(0, (0, 0, 0), q)).quaternion_xyzw)
    np.testing.assert_allclose(turn, [0, 0, -0.4 if mirror else 0.4], atol=1e-12)


def test_a_wrong_calibration_is_seen() -> None:
    left = check_forward(sweep((0, 0, -1)), frame="openxr", yaw_rad=-math.pi / 2)
    assert left.words == "forward came out 90° to the left; calibrate again"
    assert not check_forward(sweep((0, 0, 1)), frame="openxr", yaw_rad=0).ok
    assert "backward" in check_forward(sweep((0, 0, 1)), frame="openxr", yaw_rad=0).words
    assert "too little" in check_forward(0.1 * sweep((0, 0, -1)), frame="openxr", yaw_rad=0).words


@pytest.mark.parametrize(
    ("places", "says"),
    [
        ([[0, 0, 0]], "no movement"),
        ([[0, 0, 0], [0, 0, -0.05]], "5 cm, which is too little"),
        ([[0, 0, 0], [0.1, 0, -0.1], [0, 0, -0.2]], "strayed by 10 cm"),
        ([[0, 0, 0], [0, 0.2, -0.2]], "rose by 45°"),
    ],
)
def test_a_sweep_that_says_nothing_is_refused(places: Any, says: str) -> None:
    with pytest.raises(CalibrationError, match=says):
        yaw_from_sweep(places, frame="openxr")
