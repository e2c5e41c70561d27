# mypy: allow-untyped-defs, allow-incomplete-defs
"""A run on ROS 2: its topics reach peers by two implementations of DDS, and a peer commands under the run's limits."""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path
from typing import Any, Self

import numpy as np
import pytest

pytest.importorskip("cyclonedds", reason="needs the extra ros2")
pytest.importorskip("rosbags", reason="needs the extra ros2")

from reference.parts import Running
from reference.processes import until
from reference.sessions import tree
from tega.config import check_tree
from tega.hand import CLOSURE_POSES_RAD, JOINT_LIMITS_RAD, JOINT_NAMES
from tega.recording.replay import replay_file
from tega.records import Contact, Intent, Joints, Picture
from tega.records.bus import Bus
from tega_emulators.lab import emulated_lab
from tega_ros2.outputs import Ros2Stream

HERE = Path(__file__).parent
# A ROS 2 installation may bring an interpreter of its own.
ROS_PYTHON = os.environ.get("TEGA_ROS2_PYTHON", sys.executable)
DOMAIN = 100 + os.getpid() % 100
TIGHT = CLOSURE_POSES_RAD[4].tolist()

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("_domain")]


@pytest.fixture(scope="module", autouse=True)
def _domain() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROS_DOMAIN_ID", str(DOMAIN))
        patch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        patch.delenv("CYCLONEDDS_URI", raising=False)
        yield


class Peer:
    """A peer in a process of its own, and the newest messages that it received, by topic."""

    def __init__(self, name: str) -> None:
        python = ROS_PYTHON if name == "rclpy" else sys.executable
        self.process = subprocess.Popen(
            [python, str(HERE / f"peer_{name}.py")], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        self.seen: dict[str, list[dict[str, Any]]] = {}
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        until(lambda: "ready" in self.seen)

    def __enter__(self) -> Peer:
        return self

    def __exit__(self, *_: object) -> None:
        self.process.send_signal(signal.SIGCONT)
        self.process.kill()
        self.process.wait(10)
        self._reader.join(10)
        for pipe in (self.process.stdin, self.process.stdout):
            if pipe is not None:
                pipe.close()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            message = json.loads(line)
            self.seen.setdefault(message.pop("topic"), []).append(message)

    def ask(self, **wanted: Any) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(json.dumps(wanted) + "\n")
        self.process.stdin.flush()

    def close_hand(self, closure: float, **more: Any) -> None:
        self.ask(hand={"name": ["closure"], "position": [closure], **more})

    def graph(self) -> dict[str, Any]:
        n = len(self.seen.get("graph", ()))
        self.ask(graph="graph")
        until(lambda: len(self.seen.get("graph", ())) > n)
        return dict(self.seen["graph"][-1]["graph"])


@pytest.fixture(params=["cyclone", "rclpy"])
def peer(request: pytest.FixtureRequest) -> Iterator[Peer]:
    if request.param == "rclpy":
        found = subprocess.run([ROS_PYTHON, "-c", "import rclpy"], capture_output=True, check=False)
        if found.returncode:
            pytest.skip("needs rclpy, in this environment or in that of TEGA_ROS2_PYTHON")
    with Peer(request.param) as made:
        yield made


class Run(Running):
    """A run of settings, perhaps streamed, with what it publishes on its bus."""

    def __init__(self, given: dict[str, Any], *, stream: bool = False, base: Path | None = None) -> None:
        super().__init__(check_tree(given, {}, base=base or Path.cwd()).config)
        self._stream: Any = Ros2Stream(self.bus) if stream else nullcontext()
        self.records: list[Any] = []
        for kind in (Contact, Intent, Joints):
            self.bus.subscribe(kind, self.records.append)

    def __enter__(self) -> Self:
        self._stream.__enter__()
        super().__enter__()
        until(lambda: bool(self.views) or not self.thread.is_alive())
        return self

    def __exit__(self, *_: object) -> None:
        super().__exit__()
        self._stream.__exit__(None, None, None)

    def all(self, kind: type[Any]) -> list[Any]:
        return [record for record in list(self.records) if isinstance(record, kind)]

    @property
    def closure(self) -> float | None:
        """The newest closure that the hand was asked for."""
        intents = self.all(Intent)
        return intents[-1].closure if intents else None

    def arm_hand_m(self) -> tuple[float, float, float]:
        assert self.view.seen_arm is not None
        assert self.view.seen_arm.hand_m is not None
        return self.view.seen_arm.hand_m

    def alerts(self) -> str:
        return " ".join(map(str, self.view.alerts))


def settings(**table: Any) -> dict[str, Any]:
    """Return two synthetic fingertips and a hand on a virtual bus, in real time, with levels by a peer."""
    given = tree(Path(), lossless=False) | {
        "session": {"pace": "real"},
        "hand": {"driver": "python-can", "options": {"interface": "virtual", "channel": "ros2"}},
    }
    del given["emg"], given["recording"]
    given["tactile"]["thumb"] = {"driver": "synthetic-touch", "options": {"duration_s": 60.0}}
    given["ros2"] = {"hand": "/hand/target"} | table
    return given


def test_a_peer_receives_what_the_run_publishes_with_ros_s_names_types_hashes_and_qos(peer: Peer) -> None:
    with Run(settings(), stream=True) as run:
        peer.close_hand(0.5)
        wanted = ("/hand/joints", "/tactile/thumb/image", "/tactile/thumb/wrench", "/run/state/text")
        until(lambda: all(len(peer.seen.get(topic, ())) > 3 for topic in wanted[:3]))
        until(lambda: run.closure == 0.5 and wanted[3] in peer.seen)
        graph = peer.graph()
    joints = {record.angles_rad for record in run.all(Joints)}
    names = {tuple(one["name"]) for one in peer.seen["/hand/joints"]}
    assert names == {JOINT_NAMES}
    assert {tuple(one["position"]) for one in peer.seen["/hand/joints"]} <= joints
    assert {(one["format"], one["data"]) for one in peer.seen["/tactile/thumb/image"]} == {("jpeg", "ffd8")}
    forces = {record.force_n for record in run.all(Contact) if record.finger == "thumb"}
    assert {one["force_z"] for one in peer.seen["/tactile/thumb/wrench"]} <= forces
    assert {one["data"] for one in peer.seen["/run/state/text"]} <= {"armed", "active", "hold", "stopped"}
    published = graph["publishers"]
    kind, hashed, reliability, *_ = published["/hand/joints"]
    assert kind in {"sensor_msgs/msg/JointState", "sensor_msgs::msg::dds_::JointState_"}
    # As it stands in sensor_msgs of ROS 2 Jazzy.
    assert "RIHS01_a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e" in hashed
    assert reliability == "RELIABLE"
    assert published["/tactile/thumb/image"][2] == "BEST_EFFORT"
    for topic, own in graph.get("own_hashes", {}).items():
        assert published[topic][1] == own, topic
    if contacts := peer.seen.get("/tactile/thumb/contact"):
        times = {record.t_ns for record in run.all(Contact)}
        assert {one["t_ns"] for one in contacts} <= times


@pytest.mark.raises("ros2")
def test_a_peer_closes_the_hand_and_a_silent_or_departed_one_lets_it_hold(peer: Peer) -> None:
    with Run(settings()) as run:
        until(lambda: "no publisher leads" in run.view.reason)
        peer.close_hand(0.75)
        until(lambda: run.view.state == "active" and run.closure == 0.75)
        # All joints at the pose of level 2, and then a little beyond the limits: clipped, closed, no more than that.
        level_2 = CLOSURE_POSES_RAD[1].tolist()
        peer.ask(hand={"name": JOINT_NAMES[::-1], "position": level_2[::-1]})
        until(lambda: run.closure == pytest.approx(0.25))
        over = np.minimum(JOINT_LIMITS_RAD[:, 1] + 0.2, 3.1).tolist()
        peer.ask(hand={"name": JOINT_NAMES, "position": over, "stamp": False})
        until(lambda: run.closure == 1.0)
        peer.ask(hand=None)
        until(lambda: run.view.state == "hold" and "no level from publisher 1" in run.view.reason)
        # Another takes over once the first is gone, and not before.
        peer.process.send_signal(signal.SIGINT)
        peer.process.wait(10)
        until(lambda: "no publisher leads" in run.view.reason)
        with Peer("cyclone") as other:
            other.close_hand(0.25)
            until(lambda: run.view.state == "active" and run.closure == 0.25)
    assert run.summary["ros2"]["publishers"] == 2
    assert run.summary["ros2"]["refused"].keys() <= {"old", "out of order"}


BAD = [
    ({"name": ["closure"], "position": [math.nan]}, "not finite"),
    ({"name": ["closure"], "position": [80.0]}, "out of range"),
    ({"name": ["closure"], "position": []}, "wrong length"),
    ({"name": ["closure"], "position": [0.9], "velocity": [1, 2]}, "wrong length"),
    ({"name": [*JOINT_NAMES, "index_j0"], "position": [*TIGHT, 0.0]}, "wrong joints"),
    ({"name": JOINT_NAMES, "position": [45.0, *TIGHT[1:]]}, "out of range"),
    ({"name": ["closure"], "position": [0.9], "ahead_s": 3.0}, "ahead"),
    ({"name": ["closure"], "position": [0.9], "ahead_s": -3.0}, "old"),
    ({"name": ["x" * 70_000], "position": [0.9]}, "too long"),
]


@pytest.mark.raises("ros2 commands")
def test_a_target_that_cannot_be_used_is_refused_with_the_reason_and_moves_nothing(peer: Peer) -> None:
    with Run(settings()) as run:
        peer.close_hand(0.25)
        until(lambda: run.closure == 0.25 and run.view.state == "active")
        for wanted, why in BAD:
            peer.ask(hand=wanted)
            until(lambda why=why: f"/hand/target refused: {why}" in run.alerts())  # type: ignore[misc]
            until(lambda: run.view.state == "hold")
        assert {record.closure for record in run.all(Intent)} == {0.25}
    assert run.summary["ros2"]["refused"].keys() >= {why for _, why in BAD}


def test_a_run_that_a_peer_led_is_computed_again_bit_for_bit(tmp_path: Path) -> None:
    given = settings() | {"recording": {"dir": str(tmp_path), "lossless": True, "stop_free_mib": 0.0}}
    with Run(given) as run, Peer("cyclone") as peer:
        for closure in (0.25, 0.75, 0.5):
            peer.close_hand(closure)
            until(lambda closure=closure: run.closure == closure and run.view.state == "active")  # type: ignore[misc]
    replay = replay_file(tmp_path / str(run.summary["recording"]["file"]))
    assert not any(one.differ for one in replay.streams)
    assert {one.stream: one.replayed for one in replay.streams}["/emg/levels"] > 3


def test_a_second_publisher_does_not_lead(peer: Peer) -> None:
    with Run(settings()) as run, Peer("cyclone") as second:
        peer.close_hand(0.25)
        until(lambda: run.closure == 0.25 and run.view.state == "active")
        second.close_hand(0.75)
        until(lambda: "not leading: publisher 1 leads" in run.alerts())
        assert {record.closure for record in run.all(Intent)} == {0.25}
        assert run.view.state == "active"


def test_a_subscriber_that_stops_or_vanishes_does_not_stop_the_run(peer: Peer) -> None:
    with Run(settings(), stream=True) as run, Peer("cyclone") as other:
        other.close_hand(0.5)
        until(lambda: len(peer.seen.get("/hand/joints", ())) > 3)
        peer.process.send_signal(signal.SIGSTOP)  # subscribed to everything, and acknowledges nothing
        began = run.view.t_ns
        until(lambda: run.view.t_ns > began + 5e9)
        n = len(other.seen["/hand/joints"])
        until(lambda: len(other.seen["/hand/joints"]) > n + 20)
        assert run.view.state == "active"
        peer.process.kill()
        n = len(other.seen["/tactile/thumb/image"])
        until(lambda: len(other.seen["/tactile/thumb/image"]) > n + 20)
        assert run.view.state == "active"
    assert run.summary["ended"] == "stopped"


def test_a_flood_of_records_drops_the_oldest_and_counts_them() -> None:
    bus = Bus()
    stream = Ros2Stream(bus)
    image = np.zeros((480, 640, 3), np.uint8)
    with stream, Peer("cyclone") as peer:
        for k in range(6):
            bus.publish(Picture(finger="thumb", image=image, t_ns=k, received_ns=k, seq=k, name=""))
            time.sleep(0.3)
        until(lambda: "/tactile/thumb/image" in peer.seen)
        began_s = time.monotonic()
        for k in range(6000):
            bus.publish(Picture(finger="thumb", image=image, t_ns=k, received_ns=k, seq=k, name=""))
        assert time.monotonic() - began_s < 5  # 6000 JPEGs take longer
    assert stream.n_dropped > 1000


BAD_POSES: list[tuple[dict[str, Any], str]] = [
    ({"position": [math.nan, 0, 0], "orientation": [0, 0, 0, 1]}, "not finite"),
    ({"position": [1e6, 0, 0], "orientation": [0, 0, 0, 1]}, "out of range"),
    ({"position": [0, 0, 0], "orientation": [0, 0, 0, 0]}, "out of range"),
]


def test_a_pose_leads_the_arm_while_dead_man_and_clutch_are_held(peer: Peer, tmp_path: Path) -> None:
    turn = [0.0, 0.0, 0.0, 1.0]
    with emulated_lab(tmp_path, arm=True, emg_hz=250.0) as lab:
        given = {**lab.tree, "session": {}, "ros2": {"arm": "/forearm", "ttl_ms": 500}}
        del given["arm"]["tracker"]
        given["arm"]["mapping"] = {"frame": "ros"}
        with Run(given, base=tmp_path) as run:
            peer.ask(arm={"position": [0, 0, 0], "orientation": turn})
            until(lambda: "clutch is open" in run.view.arm)
            lab.cap.say("press 0")
            lab.cap.say("press 1")
            until(lambda: run.view.arm.startswith("following"))
            before = run.arm_hand_m()
            for step in range(41):
                peer.ask(arm={"position": [step * 1e-3, 0, 0], "orientation": turn})
                time.sleep(0.04)
            until(lambda: math.dist(run.arm_hand_m(), before) > 0.02)
            assert math.dist(run.arm_hand_m(), before) < 0.06
            for wanted, why in BAD_POSES:
                peer.ask(arm=wanted)
                until(lambda why=why: f"/forearm refused: {why}" in run.alerts())  # type: ignore[misc]
            until(lambda: not run.view.arm.startswith("following"))
    assert run.summary["ros2"]["commands"] > 40
