"""Programs that TEGA starts beside a run survive the signals of a log-out, and end when their input does."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import msgspec
import pytest

from reference.processes import until
from tega.devices.arm.robot.driver import ArmOptions
from tega.devices.arm.robot.process import ProcessSettings
from tega.devices.arm.simulated_arm import SimulatedArm
from tega.runtime.child_process import end_child, is_running, start_child

pytestmark = pytest.mark.skipif(
    sys.platform != "linux", reason="reads which signals a process ignores from /proc"
)

ENDING = (signal.SIGHUP, signal.SIGINT, signal.SIGQUIT, signal.SIGTERM)


def ignores_all(pid: int) -> bool:
    lines = Path(f"/proc/{pid}/status").read_text(encoding="ascii").splitlines()
    (mask,) = (int(line.split()[1], 16) for line in lines if line.startswith("SigIgn:"))
    return all(mask >> (number - 1) & 1 for number in ENDING)


@contextmanager
def arm_program() -> Iterator[subprocess.Popen[bytes]]:
    """Run the process of a simulated arm, whose link is a socket."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    settings = ProcessSettings(theirs.fileno(), 1, SimulatedArm.body, msgspec.to_builtins(ArmOptions()))
    words = msgspec.json.encode(settings).decode()
    with ours, theirs:
        yield start_child("tega.devices.arm.robot.process", words, pass_fds=[theirs.fileno()])


@contextmanager
def program(module: str, *words: str) -> Iterator[subprocess.Popen[bytes]]:
    process = start_child(module, *words, stdout=subprocess.PIPE)
    assert process.stdout is not None
    with process.stdout:
        yield process


GUARDED_HAND = '{"bus": {"interface": "virtual", "channel": "x", "bitrate": 1}, "frames": [], "device_id": 0}'
PROGRAMS = {
    "hand": lambda: program("tega.devices.hand.hand_program"),
    "hand's guard": lambda: program("tega.devices.hand.hand_guard", GUARDED_HAND),
    "vest's guard": lambda: program("tega.devices.vest.vest_ble_guard", "00:00", ""),
    "recorder": lambda: program("tega.recording.recorder_program"),
    "scene camera": lambda: program("tega_scene.camera_program"),
    "arm": arm_program,
}


@pytest.mark.parametrize("name", PROGRAMS)
def test_a_program_ignores_the_signals_of_a_log_out_and_ends_with_its_input(name: str) -> None:
    with ExitStack() as stack:
        process = stack.enter_context(PROGRAMS[name]())
        stack.callback(process.kill)
        until(lambda: ignores_all(process.pid))
        for number in ENDING:
            os.kill(process.pid, number)
        assert process.poll() is None
        assert end_child(process, 30.0) == 0


def test_a_process_that_is_stopped_or_dead_is_not_running() -> None:
    module = "tega.devices.hand.hand_program"
    with program(module) as process:
        try:
            until(lambda: ignores_all(process.pid))
            assert is_running(process.pid, module)
            assert not is_running(process.pid, "tega.devices.hand.hand_guard")
            os.kill(process.pid, signal.SIGSTOP)
            until(lambda: not is_running(process.pid, module))
            os.kill(process.pid, signal.SIGCONT)
            until(lambda: is_running(process.pid, module))
            process.kill()
            until(lambda: not is_running(process.pid, module))
        finally:
            end_child(process, 5.0)
    assert not is_running(0, module)
