"""The HoloLens driver and its emulator against hl2ss' own client, whose checkout ``TEGA_HL2SS`` names."""

from __future__ import annotations

import importlib.util
import os
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from reference.trackers import some
from tega.devices.tracker.hololens import HoloLens, HoloLensOptions
from tega_emulators.process import Emulator

STATUS = {"left": 1 | 4, "right": 1 | 8}
WRIST = 1


@pytest.fixture(scope="module")
def hl2ss() -> Any:
    """Return the client's module, as it is in the checkout."""
    folder = os.environ.get("TEGA_HL2SS")
    if not folder:
        pytest.skip("set TEGA_HL2SS to a checkout of jdibenes/hl2ss; its client is in no package index")
    spec = importlib.util.spec_from_file_location("hl2ss", Path(folder) / "viewer" / "hl2ss.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def received(hl2ss: Any, port: int, n: int) -> list[Any]:
    """Read packets as hl2ss' own example of spatial input does."""
    options = {"setsockopt.IPPROTO_TCP.TCP_NODELAY": True, "settimeout": 10}
    with hl2ss.rx_decoded_si("127.0.0.1", port, options, hl2ss.ChunkSize.SPATIAL_INPUT) as client:
        return [client.get_next_packet() for _ in range(n)]


def test_the_emulator_is_read_by_hl2ss_s_client(hl2ss: Any) -> None:
    with Emulator("hololens") as headset:
        headset.say("at 0.5 -0.25 -0.75")
        headset.say("turn 0 0.6 0 0.8")
        packets = received(hl2ss, headset.port, 8)
        headset.say("lose")
        headset.say("guess")
        lost = received(hl2ss, headset.port, 8)
    steps = np.diff([p.timestamp for p in packets])
    assert np.all(np.abs(steps - 1e7 / 60) <= 1)  # 60 a second, in steps of 100 ns
    for packet in packets:
        frame = packet.payload
        valid = (frame.head_pose_valid, frame.eye_ray_valid, frame.hand_left_valid, frame.hand_right_valid)
        assert (valid, packet.pose) == ((True, False, True, True), None)
        wrist = frame.hand_right
        assert np.allclose(wrist.position[WRIST], (0.5, -0.25, -0.75), atol=2e-3)
        assert np.allclose(wrist.orientation[WRIST], (0, 0.6, 0, 0.8))
        assert wrist.position.shape == (hl2ss.SI_HandJointKind.TOTAL, 3)
        assert not wrist.accuracy.any()
        assert np.allclose(np.linalg.norm([frame.head_pose.forward, frame.head_pose.up], axis=1), 1)
    assert not lost[-1].payload.hand_right_valid
    assert lost[-1].payload.hand_left_valid
    assert np.all(lost[-1].payload.hand_left.accuracy == 1)


def spatial_input(hand: str, joints: NDArray[np.float32]) -> bytes:
    """Return a payload: status, head and eyes, 26 joints of either hand."""
    hands = np.zeros((2, 26, 9), np.float32)
    hands[("left", "right").index(hand)] = joints
    return STATUS[hand].to_bytes(4, "little") + np.zeros(15, np.float32).tobytes() + hands.tobytes()


@contextmanager
def server(packets: list[bytes]) -> Iterator[int]:
    """Send packets to whoever connects, 60 a second."""
    over = threading.Event()
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def send() -> None:
            link, _ = listener.accept()
            with link:
                for packet in packets:
                    link.sendall(packet)
                    if over.wait(1 / 60):
                        return

        thread = threading.Thread(target=send)
        thread.start()
        try:
            yield listener.getsockname()[1]
        finally:
            over.set()
            thread.join()


@pytest.mark.parametrize("hand", ["left", "right"])
def test_the_driver_reads_what_hl2ss_packs(hl2ss: Any, hand: Any) -> None:
    rng = np.random.default_rng(3)
    packed, wrists = [], []
    for n in range(600):
        joints = rng.uniform(-1, 1, (26, 9)).astype(np.float32)
        joints[:, :4] /= np.linalg.norm(joints[:, :4], axis=1, keepdims=True)
        joints[:, 8] = 0.0
        payload = spatial_input(hand, joints)
        read = getattr(hl2ss.decode_si().decode(payload), f"hand_{hand}")
        assert np.array_equal(read.position, joints[:, 4:7])
        wrists.append((*read.position[WRIST].tolist(), *read.orientation[WRIST].tolist()))
        packed.append(bytes(hl2ss.pack_packet(hl2ss._packet(5_000_000 + n * 166_667, payload, None))))
    with server(packed) as port, HoloLens(HoloLensOptions(host="127.0.0.1", port=port, hand=hand)) as tracker:
        poses = some(tracker)
    read_poses = [(*p.position_m, *p.quaternion_xyzw) for p in poses]
    first = wrists.index(read_poses[0])
    assert read_poses == wrists[first : first + len(read_poses)]
    assert tracker.counts.broken == tracker.counts.lost == 0
