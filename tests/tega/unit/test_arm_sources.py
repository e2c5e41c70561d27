"""Where poses come from, the way from their axes to the robot's, and the calibration and verb that find it."""

from __future__ import annotations

import math
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from reference.arm_bench import FORWARD, MIDDLE, MS, Bench
from tega.arm import MappingSettings, Pose, PoseSource, StampedPose, check_forward, yaw_from_sweep
from tega.arm import rotation as so3
from tega.arm.frames import ToBase
from tega.arm.heading import ForearmSweep
from tega.config import load_config
from tega.config.calibration.records import ArmRecord, read_record
from tega.devices.base import InputReading
from tega.devices.tracker.sources import RatePoses, RecordedPoses, read_poses
from tega.errors import CalibrationError, RecordingError
from tega.setup.calibration.steps_arm import take_base_yaw, take_heading, watch_sweep
from tega.ui.cli.calibrate import calibrate
from tega.ui.cli.guide import LineGuide
from tega_emulators.process import Emulator
from tega_emulators.scripted_poses import ScriptedPoses, Waypoint, path_through, write_poses

emulated = pytest.mark.skipif(sys.platform == "win32", reason="needs Linux or macOS")
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
        assert [*one.position_m, *one.quaternion_xyzw] == [*other.position_m, *other.quaternion_xyzw]


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
    far_m = [source.read(t_ms * MS)[0].position_m[0] for t_ms in range(5_020, 800_000, 100)]
    assert 49 < max(map(abs, far_m)) <= 50  # pushed for minutes, and still in the room that the gate allows


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


def lab_of(folder: Path, headset: Emulator) -> Path:
    file = folder / "lab.toml"
    host, port = headset.address["host"], headset.address["port"]
    file.write_text(
        f'[arm]\ndriver = "simulated-arm"\n[arm.tracker]\ndriver = "hololens"\n'
        f'options = {{ host = "{host}", port = {port} }}\n'
    )
    return file


@contextmanager
def moving(folder: Path) -> Iterator[Path]:
    """A wrist that goes 20 cm along one heading, rests and is lost, over and over."""
    over = threading.Event()

    def move() -> None:
        while not over.is_set():
            for step in (*range(21), *([20] * 60)):
                headset.say(f"at {-0.01 * step * math.sin(0.5)} 1.2 {-0.01 * step * math.cos(0.5)}")
                if over.wait(0.02):
                    return
            headset.say("lose")
            over.wait(0.4)
            headset.say("find")

    mover = threading.Thread(target=move, daemon=True)
    with Emulator("hololens") as headset:
        mover.start()
        try:
            yield lab_of(folder, headset)
        finally:
            over.set()
            mover.join()


@emulated
@pytest.mark.slow
def test_the_wizard_keeps_forward_for_a_person_and_a_run_follows_it(tmp_path: Path) -> None:
    words = ["--person=p01", "--only=arm", "--time-scale=0.1", "--json", "--set=vest.driver=on-screen-vest"]
    with moving(tmp_path) as file:
        text = CliRunner().invoke(calibrate, [str(file), *words], input="\n\nt\n")
        assert (text.exit_code, "Finished. tega-teleop doctor " in text.output) == (0, True), text.output
        (kept,) = (tmp_path / "calibrations" / "people" / "p01").glob("arm-*.toml")
        record = read_record(kept, ArmRecord)
        assert record.yaw_rad == pytest.approx(0.5, abs=0.03)
        assert (record.person, record.frame, record.driver) == ("p01", "openxr", "hololens")
        loaded = load_config(file, sets=('calibration.person="p01"',))
        assert loaded.config.arm is not None
        assert loaded.config.arm.mapping.yaw_rad == record.yaw_rad
        assert loaded.config.arm.mapping.base_yaw_rad == record.base_yaw_rad == 3.1415
        assert loaded.values["arm.mapping.yaw_rad"].origin == f"people/p01/{kept.name}"
        # What the settings say themselves wins, and another person has nothing of it.
        given = load_config(file, sets=('calibration.person="p01"', "arm.mapping.yaw_rad=-1.0"))
        other = load_config(file, sets=('calibration.person="p02"',))
    assert given.config.arm is not None
    assert given.config.arm.mapping.yaw_rad == -1.0
    assert other.config.arm is not None
    assert other.config.arm.mapping.yaw_rad == 0.0


def scripted(*headings_rad: float) -> Any:
    """Return a tracker that has each of its movements in one read, and nothing before it."""
    coming: list[list[StampedPose]] = []
    for heading in headings_rad:
        route = np.array([-np.sin(heading), 0.0, -np.cos(heading)])
        places = [0.01 * min(k, 20) * route for k in range(100)]
        coming += [[], [StampedPose(k * 10 * MS, place, so3.IDENTITY) for k, place in enumerate(places)]]
    return SimpleNamespace(frame="openxr", problem="", read=lambda _now_ns: coming.pop(0))


def test_a_heading_that_does_not_come_out_forward_is_not_kept() -> None:
    guide = LineGuide(yes=True, get_ready_s=0.0)
    yaw_rad, check = take_heading(scripted(0.4, 0.45), guide)
    assert yaw_rad == pytest.approx(0.4, abs=1e-3)
    assert check.off_rad == pytest.approx(0.05, abs=1e-3)
    with pytest.raises(CalibrationError, match="forward came out 69° to the left"):
        take_heading(scripted(0.0, 1.2), guide)


@pytest.mark.parametrize(
    ("answer", "headings_rad", "found_rad"),
    [
        ("a", (), 0.0),
        ("l", (), 1.5708),
        ("t", (), 3.1415),
        ("r", (), -1.5708),
        ("", (), 1.0),  # nobody answers: as the settings have it
        # Shown by a movement, and the tracker's forward is 0.4 rad off the operator's.
        ("s", (0.4 + 2.5,), 2.5),
        ("s", (0.4 - 3.0,), -3.0),
    ],
)
def test_which_way_the_base_points_is_asked_or_shown(
    answer: str, headings_rad: tuple[float, ...], found_rad: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    guide = LineGuide(yes=True, get_ready_s=0.0)
    if answer:
        monkeypatch.setattr(guide, "ask", lambda _question, answers: answers[answer] and answer)
    found = take_base_yaw(scripted(*headings_rad), guide, yaw_rad=0.4, reported_rad=1.0)
    assert found == pytest.approx(found_rad, abs=1e-3)


def test_a_tracker_that_sees_nothing_is_told() -> None:
    blind: Any = SimpleNamespace(frame="openxr", problem="lost", read=lambda _now_ns: [])
    with pytest.raises(CalibrationError, match=r"the forearm was not seen within 0\.1 s") as told:
        watch_sweep(blind, 0.1, yaw_rad=None, displayed=lambda _sweep, _left_s: None)
    assert told.value.hint == "lost"


def test_a_movement_is_over_when_it_rests_and_begins_anew_after_a_gap() -> None:
    movement = ForearmSweep("openxr")
    for k in range(60):
        movement.take(StampedPose(k * 10_000_000, (0, 0, -0.005 * k), so3.IDENTITY))
    assert not movement.done
    np.testing.assert_allclose(movement.gone_m, (0.295, 0, 0), atol=1e-9)
    for k in range(100, 160):
        movement.take(StampedPose(k * 10_000_000, (0.1, 0, 0), so3.IDENTITY))
    assert not movement.done
    np.testing.assert_allclose(movement.gone_m, 0, atol=1e-12)
