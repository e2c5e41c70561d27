"""The robot's side of the arm: which commands it obeys, and its process seen from outside."""

from __future__ import annotations

import os
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reference.arm_bench import Led
from reference.processes import until
from tega.arm import ArmCommand, Pose, StampedPose
from tega.arm.messages import ArmTargetWords
from tega.arm.rotation import between
from tega.devices.arm.franky_arm import FrankyArm, FrankyArmOptions
from tega.devices.arm.robot import fci
from tega.devices.arm.robot.driver import ArmOptions
from tega.devices.arm.robot.leash import Leash
from tega.devices.arm.robot.process import Slew
from tega.devices.arm.simulated_arm import SimulatedArm
from tega.errors import DeviceUnavailableError, WrongDeviceError
from tega.runtime.child_process import is_running

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="needs Linux or macOS")

_MS = 1_000_000
_TURN = (0.0, 0.0, 0.0, 1.0)


def requested(n: int, t_ms: float, **other: object) -> ArmTargetWords:
    given = {"session": 7, "state": "following", "engagements": 1, "place": (0.5, 0.0, 0.3), "turn": _TURN}
    return ArmTargetWords(sequence=n, t_ns=round(t_ms * _MS), **{**given, **other})  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("age_ms", "kind"),
    [(0, "follow"), (100, "follow"), (101, "hold"), (300, "hold"), (999, "hold"), (1001, "rest")],
)
def test_what_happens_without_commands_after_a_time(age_ms: int, kind: str) -> None:
    leash = Leash(7)
    assert leash.take(requested(1, 0), 0) == ""
    assert leash.order(0).kind == "follow"
    assert leash.order(age_ms * _MS).kind == kind


@pytest.mark.parametrize(("pause_ms", "again"), [(250, "follow"), (301, "hold"), (1500, "rest")])
def test_after_too_long_a_pause_the_operator_takes_hold_anew(pause_ms: int, again: str) -> None:
    leash = Leash(7)
    leash.take(requested(1, 0), 0)
    assert leash.order(0).kind == "follow"
    for t_ms in range(0, pause_ms, 10):
        leash.order(t_ms * _MS)
    assert leash.take(requested(2, pause_ms), pause_ms * _MS) == ""
    assert leash.order(pause_ms * _MS).kind == again
    leash.take(requested(3, pause_ms + 10, engagements=2), (pause_ms + 10) * _MS)
    assert leash.order((pause_ms + 10) * _MS).kind == "follow"


@pytest.mark.parametrize(
    ("command", "message"),
    [
        (requested(2, 95, session=8), "another session"),
        (requested(1, 95), "came after"),
        (requested(2, -20), "120 ms old"),
        (requested(2, 130), "30 ms in the future"),
        (requested(2, 95, engagements=0), "hold 0, before 1"),
        (requested(2, 95, place=(float("nan"), 0.0, 0.0)), "not finite"),
        (requested(2, 95, turn=(0.0, 0.0, 0.0, 0.0)), "length 0"),
        (requested(2, 95, turn=None), "a place or a turn"),
    ],
)
def test_a_command_that_is_not_obeyed(command: ArmTargetWords, message: str) -> None:
    leash = Leash(7)
    leash.take(requested(1, 90), 90 * _MS)
    assert message in leash.take(command, 100 * _MS)
    assert (leash.refused, message in leash.refusal) == (1, True)
    order = leash.order(100 * _MS)
    assert order.requested is not None
    assert order.requested.sequence == 1


def test_nothing_is_followed_that_was_stopped_or_lost() -> None:
    leash = Leash(7)
    assert leash.order(0).kind == "rest"
    leash.take(requested(1, 0, place=None, turn=None, state="idle"), 0)
    assert leash.order(0).reason == "the operator has not taken hold yet"
    leash.take(requested(2, 1), _MS)
    assert leash.order(_MS).kind == "follow"
    leash.lose()
    leash.take(requested(3, 2), 2 * _MS)
    assert leash.order(2 * _MS).kind == "rest"
    leash.take(requested(4, 3, engagements=2), 3 * _MS)
    assert leash.order(3 * _MS).kind == "follow"
    leash.take(requested(5, 4, state="stopped", engagements=2), 4 * _MS)
    assert leash.order(4 * _MS).reason == "it was stopped"


@given(
    st.lists(
        st.tuples(
            st.integers(0, 400), st.integers(-200, 200), st.integers(0, 30), st.integers(0, 4), st.booleans()
        ),
        max_size=40,
    )
)
def test_no_command_is_followed_that_is_old_or_of_a_hold_that_was_lost(
    words: list[tuple[int, int, int, int, bool]],
) -> None:
    leash, now_ms, followed = Leash(7), 0, 0
    for pause_ms, age_ms, sequence, engagements, listens in words:
        now_ms += pause_ms
        if listens:
            leash.take(requested(sequence, now_ms - age_ms, engagements=engagements), now_ms * _MS)
        order = leash.order(now_ms * _MS)
        if order.kind == "follow":
            assert order.requested is not None
            assert now_ms * _MS - order.requested.t_ns <= 100 * _MS
            assert order.requested.engagements >= followed
            followed = order.requested.engagements


@given(
    st.lists(st.tuples(*[st.floats(-2, 2)] * 3), min_size=1, max_size=5),
    st.lists(st.tuples(*[st.floats(-1, 1)] * 4), min_size=1, max_size=5),
    st.floats(1e-4, 0.02),
)
def test_the_slew_is_never_faster_and_arrives(
    places: list[tuple[float, float, float]], turns: list[tuple[float, float, float, float]], dt_s: float
) -> None:
    slew = Slew(0.5, 1.5, (0.0, 0.0, 0.0), _TURN)
    for place, turn in zip(places, turns, strict=False):
        size = float(np.linalg.norm(turn))
        goal = _TURN if size < 1e-3 else tuple(x / size for x in turn)
        for _ in range(50):
            before, turned = np.array(slew.place), np.array(slew.turn)
            there = slew.toward(place, goal, dt_s)  # type: ignore[arg-type]
            assert np.linalg.norm(np.array(slew.place) - before) <= 0.5 * dt_s + 1e-9
            assert np.linalg.norm(between(turned, np.array(slew.turn))) <= 1.5 * dt_s + 1e-6
            if there:
                assert slew.place == pytest.approx(place)
                break
    slew.toward((0.0, 0.0, 0.0), _TURN, 100.0)
    assert slew.place == (0.0, 0.0, 0.0)


@pytest.fixture
def led() -> Iterator[Led]:
    with SimulatedArm(ArmOptions()) as arm:
        led = Led(arm)
        led.hold()
        yield led


def test_the_arm_goes_where_the_forearm_goes(led: Led) -> None:
    for step in range(1, 9):
        led.forearm = np.array([0.0, 0.01 * step, 0.005 * step])
        led.until(lambda target=led.place[1]: led.place[1] > target)  # type: ignore[misc]
    led.until(lambda: np.linalg.norm(led.place - (0.5, 0.08, 0.34)) < 2e-3)
    assert led.arm.health.rate_hz > 50
    assert led.arm.problem == ""


@pytest.mark.slow
def test_a_run_that_says_nothing_leaves_the_arm_at_rest(led: Led) -> None:
    until(lambda: led.arm.measured() is not None and led.arm.phase == "ready")
    led.until(lambda: led.command is not None and "press it again" in led.command.reason)
    assert led.arm.phase == "ready"
    led.hold()


@pytest.mark.slow
def test_a_frozen_arm_s_process_is_noticed_and_does_nothing_old_afterwards(led: Led) -> None:
    assert isinstance(led.arm, SimulatedArm)
    start, pid = led.place, led.arm.pid()
    os.kill(pid, signal.SIGSTOP)
    try:
        led.forearm = np.array([0.0, 0.05, 0.0])
        led.until(lambda: "has said nothing" in led.arm.problem)
        led.until(lambda: led.command is not None and led.command.state in {"idle", "stopped"})
        time.sleep(1.2)  # what was asked meanwhile waits for it
    finally:
        os.kill(pid, signal.SIGCONT)
    led.until(lambda: led.arm.problem == "")
    assert np.linalg.norm(led.place - start) < 0.04
    assert led.arm.health.refused > 0


def test_the_arm_s_process_does_not_outlive_the_run() -> None:
    code = (
        "import sys, time\n"
        "from tega.devices.arm.robot.driver import ArmOptions\n"
        "from tega.devices.arm.simulated_arm import SimulatedArm\n"
        "arm = SimulatedArm(ArmOptions())\n"
        "arm.open()\n"
        "print(arm.pid(), flush=True)\n"
        "time.sleep(60)\n"
    )
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as run:
        assert run.stdout is not None
        pid = int(run.stdout.readline())
        run.kill()
        run.wait()
    until(lambda: not is_running(pid, "tega.devices.arm.robot.process"))


@pytest.mark.slow
def test_whatever_the_run_asks_the_arm_goes_no_faster_than_its_own_limit() -> None:
    with SimulatedArm(ArmOptions(speed_m_s=0.1)) as slow:
        goal = Pose(np.array([0.5, 0.4, 0.3]), np.array([0.0, np.sqrt(0.5), 0.0, np.sqrt(0.5)]))
        seen: list[StampedPose] = []
        end_s = time.monotonic() + 1.0
        while time.monotonic() < end_s:
            zero = np.zeros(3)
            slow.follow(ArmCommand(time.monotonic_ns(), "following", "", goal, zero, zero, 1))
            if (pose := slow.measured()) is not None:
                seen.append(pose)
            time.sleep(0.01)
        seconds = (seen[-1].t_ns - seen[0].t_ns) / 1e9
        assert 0.02 < seen[-1].position_m[1] <= 0.1 * seconds + 0.005


@pytest.mark.parametrize(
    ("libfranka", "server"),
    [("0.7.1", 3), ("0.8.0", 4), ("0.9.2", 5), ("0.13.2", 6), ("0.13.3", 7), ("0.14.1", 8), ("0.17.0", 9)],
)
def test_which_library_speaks_to_which_server(libfranka: str, server: int) -> None:
    assert fci.fitting_server(libfranka) == server


@pytest.mark.parametrize(
    ("server", "library", "message"),
    [
        (10, None, "pip install 'franky-control>=2,<3'"),
        (10, fci.Library("2.0.0", "0.21.2", 10), ""),
        (5, fci.Library("2.0.0", "0.21.2", 10), "Panda with robot server 5"),
        (8, fci.Library("2.0.0", "", None), "by-robot-server-version/8/"),
    ],
)
def test_what_to_install_for_a_robot(server: int, library: fci.Library | None, message: str) -> None:
    fix = fci.the_fix(server, library)
    assert fix == message or (message and message in fix)


def test_what_is_no_robot_is_said_to_be_none(monkeypatch: pytest.MonkeyPatch) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        monkeypatch.setattr(fci, "PORT", server.getsockname()[1])

        def answer() -> None:
            robot, simulator = struct.pack("<IIIBH", 0, 1, 15, 1, 5), struct.pack("<IIIHH4x", 0, 1, 20, 0, 10)
            for body in (b"", b"HTTP/1.1 400 Bad Request\r\n", robot, simulator):
                client, _ = server.accept()
                with client:
                    client.recv(64)
                    client.sendall(body)

        answering = threading.Thread(target=answer)
        answering.start()
        with pytest.raises(DeviceUnavailableError, match="hung up after 0 bytes"):
            fci.server_version("127.0.0.1")
        with pytest.raises(WrongDeviceError, match="no Franka robot"):
            fci.server_version("127.0.0.1")
        # As robots of every version pack their answer, and as franky-sim does.
        assert fci.server_version("127.0.0.1") == 5
        assert fci.server_version("127.0.0.1") == 10
        answering.join()
    with pytest.raises(DeviceUnavailableError, match="cannot be reached: Connection refused"):
        fci.server_version("127.0.0.1")


def test_no_robot_at_the_address_is_said_in_words() -> None:
    pytest.importorskip("franky", reason="comes with the extra arm")
    with pytest.raises(DeviceUnavailableError, match="Activate FCI in Desk"):
        FrankyArm(FrankyArmOptions(host="127.0.0.199")).open()
