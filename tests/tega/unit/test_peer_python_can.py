"""The hand's bus under python-can's own programs: its logger and its player take what the driver sends."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import can
import numpy as np
import pytest

from reference.hand_bench import driver
from reference.processes import until
from tega.hand import CLOSURE_POSES_RAD
from tega_emulators.process import Emulator

pytestmark = pytest.mark.slow

PATIENCE_S = 60.0
SERVO_ON, SERVO_OFF = 0x100, 0x104
TORQUES = range(0x180, 0x190, 4)
POSITIONS = range(0x80, 0x90, 4)
LEVEL_3 = CLOSURE_POSES_RAD[2]


@pytest.fixture
def channel() -> str:
    """Return a multicast group of this process, where nobody else talks."""
    return f"239.74.{os.getpid() // 256 % 256}.{os.getpid() % 256}"


def hand_on(channel: str) -> Emulator:
    return Emulator("allegro_port", "--interface", "udp_multicast", "--channel", channel)


def program(name: str, channel: str, *arguments: str, **how: Any) -> subprocess.Popen[str]:
    command = (sys.executable, "-u", "-m", f"can.{name}", "-i", "udp_multicast", "-c", channel, *arguments)
    return subprocess.Popen(command, text=True, **how)


@contextmanager
def logging_to(path: Path, channel: str) -> Iterator[None]:
    logger = program("logger", channel, "-f", str(path), stdout=subprocess.PIPE)
    assert logger.stdout is not None
    try:
        assert "Connected to" in logger.stdout.readline()
        assert "Can Logger (Started on" in logger.stdout.readline()
        yield
    finally:
        time.sleep(0.2)  # what was sent last is on its way
        logger.send_signal(signal.SIGINT)
        logger.communicate(timeout=PATIENCE_S)


@pytest.mark.parametrize("suffix", [".asc", ".blf"])
def test_its_logger_hears_a_grasp_and_its_player_plays_it_to_another_hand(channel, suffix, tmp_path) -> None:
    path = tmp_path / f"grasp{suffix}"
    with hand_on(channel) as hand, logging_to(path, channel):
        with driver(hand, lowest_rate_hz=10.0) as steered:
            until(
                lambda: (
                    steered.step(3) is not None and bool(np.abs(steered.angles_rad - LEVEL_3).max() < 0.03)
                )
            )
        received = hand.say("look")
    with can.LogReader(path) as reader:
        frames = list(reader)
    assert not any(f.is_extended_id or f.is_fd or f.is_error_frame for f in frames)
    sent = [f for f in frames if f.arbitration_id in {SERVO_ON, SERVO_OFF, *TORQUES}]
    on = [f.arbitration_id for f in sent].index(SERVO_ON)
    off = max(n for n, f in enumerate(sent) if f.arbitration_id == SERVO_OFF)
    torques = [f for f in sent if f.arbitration_id in TORQUES]
    assert {f.arbitration_id for f in torques} == set(TORQUES)
    assert any(any(f.data) for f in sent[on:off])
    assert not any(any(f.data) for f in sent[off:])
    # Datagrams may be lost where the machine is full.
    assert received["torques"] == pytest.approx(len(torques), rel=0.05)
    last = {f.arbitration_id: f.data for f in frames if f.arbitration_id in POSITIONS}
    counts = np.frombuffer(b"".join(last[finger] for finger in POSITIONS), "<i2")
    assert np.abs(np.radians(counts * 333.3 / 65536.0) - LEVEL_3).max() < 0.1
    with hand_on(channel) as other:
        played = program("player", channel, str(path), stdout=subprocess.DEVNULL)
        assert played.wait(PATIENCE_S) == 0
        state = other.say("look")
    assert state["torques"] == pytest.approx(len(torques), rel=0.05)
    assert not state["servo_on"]
    assert not any(state["duties"])
