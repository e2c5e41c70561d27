"""A hand is let go of where its guard is lost, its programs stand still, or the computer goes to sleep."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from io import BufferedReader, BufferedWriter
from pathlib import Path
from typing import Any

import pytest

from reference.hand_bench import driver, limp, patient, pushes, steering
from reference.processes import begun_by, until
from tega.devices.hand import guard_process, hand_ends
from tega.devices.hand.allegro_options import AllegroOptions
from tega.devices.hand.guard_process import GuardProcess
from tega.devices.hand.hand_loop import HandLoop
from tega.devices.hand.hand_reports import HandNews, HandOrders
from tega.errors import DeviceUnavailableError, TegaError
from tega.runtime import child_process, clock
from tega.runtime.clock import Standstill
from tega.safety.sleep_lock import SleepLock
from tega.wire import CanFrame
from tega_emulators.process import Emulator


@pytest.mark.slow
def test_programs_that_stood_still_together_send_no_torque_before_they_let_go() -> None:
    # With a guard: the cells of the table of letting go in which all stand still.
    with Emulator("allegro_port") as hand, steering(hand, guard=False) as running:
        pids = [running.pid, *begun_by(running.pid, "tega.devices.hand.hand_program")]
        assert len(pids) == 2
        for pid in pids:
            os.kill(pid, signal.SIGSTOP)
        time.sleep(2.5)  # more than the hand's watchdog of the test, in which it is silent
        assert not limp(hand)
        begun_s = time.monotonic()
        for pid in reversed(pids):
            os.kill(pid, signal.SIGCONT)
        until(lambda: limp(hand))
        assert hand.say("look")["pushed_s"] < begun_s


class Slept:
    """A hand's loop in a thread, and a clock by which the computer may have slept."""

    def __init__(self, hand: Emulator, monkeypatch: pytest.MonkeyPatch) -> None:
        self.slept_s = 0.0
        self.news: list[HandNews] = []
        self.orders = HandOrders()
        monkeypatch.setattr(self.orders, "still", lambda: False)  # nobody repeats its word here
        self.loop = HandLoop(
            patient(hand, guard=False), self.orders, lambda _spoken, seen: self.news.append(seen)
        )
        awake = clock.since_boot_s
        monkeypatch.setattr(clock, "since_boot_s", lambda: awake() + self.slept_s)

    @contextmanager
    def steering(self) -> Iterator[threading.Thread]:
        self.loop.warm_up()
        self.loop.open()
        self.orders.take(5.0, 0.0)
        thread = threading.Thread(target=self.loop.run)
        thread.start()
        try:
            yield thread
        finally:
            self.orders.leaving.set()
            thread.join()


def test_a_computer_that_slept_ends_the_hand_and_no_torque_of_before_is_sent(monkeypatch) -> None:
    sent: list[bool] = []
    with Emulator("allegro_port") as hand:
        slept = Slept(hand, monkeypatch)
        bus = slept.loop._bus
        send = bus.send

        def sleeping_before(frames: Sequence[CanFrame], **more: Any) -> list[CanFrame]:
            drives = any(frame.id >> 2 in range(0x60, 0x64) and any(frame.data) for frame in frames)
            if drives and slept.slept_s == 0.0 and pushes(hand):
                slept.slept_s = 600.0
            taken = send(frames, **more)
            if drives and slept.slept_s:
                sent.append(bool(taken))
            return taken

        monkeypatch.setattr(bus, "send", sleeping_before)
        with slept.steering() as thread:
            thread.join(30.0)
            assert not thread.is_alive()
        assert limp(hand)
    assert sent == [False]
    assert slept.news[-1].ended
    assert slept.news[-1].let_go
    assert slept.news[-1].trouble == " (the computer slept for 600 s)"


@pytest.mark.skipif(sys.platform != "linux", reason="the clock of the system is replaced")
def test_a_standstill_is_what_is_longer_than_the_watchdog(monkeypatch: pytest.MonkeyPatch) -> None:
    now = {"boot": 100.0, "awake": 10.0}
    monkeypatch.setattr(clock, "since_boot_s", lambda: now["boot"])
    monkeypatch.setattr(time, "monotonic", lambda: now["awake"])

    def go_on(awake_s: float, slept_s: float = 0.0) -> None:
        now["awake"] += awake_s
        now["boot"] += awake_s + slept_s

    standstill = Standstill(0.5)
    go_on(0.4)
    assert not standstill.is_over()
    assert not standstill.pulse()
    go_on(0.6)
    assert standstill.is_over()
    assert standstill.pulse()
    assert standstill.slept_s == 0.0
    assert not standstill.is_over()
    go_on(0.1, slept_s=30.0)
    assert standstill.is_over()
    assert standstill.pulse()
    assert standstill.slept_s == pytest.approx(30.0)
    go_on(0.1)
    assert not standstill.pulse()
    assert standstill.slept_s == 0.0


# Says that it lets go by a file of its own number, and starts slowly once a first one has begun.
GUARD = """
import os, sys, time
from pathlib import Path
from tega.devices.hand.guard_process import stand_by

folder = Path(sys.argv[1])
(folder / f"begun-{os.getpid()}").touch()
if len(list(folder.glob("begun-*"))) > 1:
    end_s = time.monotonic() + 60
    while not (folder / "go on").exists() and time.monotonic() < end_s:
        time.sleep(0.01)
stand_by("a file", lambda _goes_on: (folder / f"let-go-{os.getpid()}").touch() or "")
(folder / f"ended-{os.getpid()}").touch()
"""


@pytest.fixture
def guard(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[GuardProcess]:
    """A guard that has heard the program; its next one waits for the file ``go on`` before it is ready."""
    (tmp_path / "slow_guard.py").write_text(GUARD)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")]))
    guard = GuardProcess("guards a file", "slow_guard", str(tmp_path))
    guard.beat()
    until(lambda: guard._received_s > guard._requested_s)
    first = guard.pid
    yield guard
    with contextlib.suppress(ProcessLookupError):  # a stopped one ends no other way
        os.kill(first, signal.SIGKILL)


@pytest.fixture
def lost(guard: GuardProcess, tmp_path: Path) -> GuardProcess:
    """A guard whose process was killed, and whose second one has begun and is not ready."""
    os.kill(guard.pid, signal.SIGKILL)
    until(lambda: len(list(tmp_path.glob("begun-*"))) == 2)
    return guard


def one(folder: Path, subject: str) -> Callable[[], bool]:
    return lambda: len(list(folder.glob(f"{subject}-*"))) == 1


def test_a_device_that_is_left_while_its_guard_is_replaced_is_let_go_of(lost, tmp_path) -> None:
    (tmp_path / "go on").touch()
    lost.leave_to_it()
    until(one(tmp_path, "let-go"))


@pytest.mark.parametrize("fate", [signal.SIGKILL, signal.SIGSTOP], ids=["killed", "stopped"])
def test_a_device_that_is_left_before_its_guard_s_loss_is_seen_is_let_go_of(
    guard: GuardProcess, tmp_path: Path, fate: signal.Signals, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "go on").touch()
    monkeypatch.setattr(guard_process, "DEAF_S", 0.2)
    before = guard.pid
    os.kill(before, signal.SIGSTOP)
    if fate == signal.SIGKILL:
        closing = guard._closing.set

        def killed_meanwhile() -> None:
            closing()
            os.kill(before, signal.SIGKILL)

        monkeypatch.setattr(guard._closing, "set", killed_meanwhile)
    guard.leave_to_it()
    until(one(tmp_path, "let-go"))
    assert not (tmp_path / f"let-go-{before}").exists()


def test_a_device_that_is_left_to_its_guard_is_let_go_of_once(guard: GuardProcess, tmp_path: Path) -> None:
    guard.leave_to_it()
    until(one(tmp_path, "let-go"))
    assert len(list(tmp_path.glob("begun-*"))) == 1


def test_a_guard_that_is_dismissed_while_it_is_replaced_leaves_no_process(lost, tmp_path) -> None:
    (tmp_path / "go on").touch()
    lost.dismiss()
    until(one(tmp_path, "ended"))
    until(lambda: lost._process.returncode is not None)
    assert not list(tmp_path.glob("let-go-*"))


_NO_PERSON = AllegroOptions(interface="slcan", channel="/dev/null", guard=False)


def test_each_stage_of_the_start_is_told() -> None:
    words = child_process.python_command("tega.devices.hand.hand_program")
    process = subprocess.Popen(
        words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=child_process.python_environment()
    )
    assert isinstance(process.stdin, BufferedWriter)
    assert isinstance(process.stdout, BufferedReader)
    try:
        child_process.send_object(process.stdin, (_NO_PERSON, False))
        assert [child_process.receive_object(process.stdout) for _ in range(2)] == [hand_ends.MAKES_READY] * 2
        child_process.send_object(process.stdin, False)
        assert isinstance(child_process.receive_object(process.stdout), TegaError)  # no such adapter
    finally:
        child_process.end_child(process, 5.0)
        process.stdout.close()


def test_one_that_says_nothing_is_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hand_ends, "_START_S", 0.3)
    steers = hand_ends.HandProcess(_NO_PERSON, lambda _spoken, _news: None)
    steers.warm_up()
    os.kill(steers.pid, signal.SIGSTOP)
    with pytest.raises(TegaError, match="did not start") as reported:
        steers.open(whole=False)
    assert reported.value.hint.startswith("it said nothing for 0.3 s")


BOTH = [["sleep", "delay"], ["sleep:handle-lid-switch", "block"]]


@pytest.fixture
def logind(monkeypatch: pytest.MonkeyPatch) -> Iterator[Emulator]:
    pytest.importorskip("dbus_fast")
    if sys.platform != "linux" or shutil.which("dbus-daemon") is None:
        pytest.skip("a message bus is started")
    with Emulator("logind") as emulated:
        monkeypatch.setenv("DBUS_SYSTEM_BUS_ADDRESS", emulated.address["bus"])
        yield emulated


def test_locks_are_held_until_they_are_released(logind: Emulator) -> None:
    asleep = threading.Event()
    lock = SleepLock("a test", asleep.set)
    lock.take()
    until(lambda: logind.say("look")["locks"] == BOTH)
    assert lock.requested.wait(10)  # the answers have come, too
    assert lock.problem == ""
    logind.say("wake")
    assert not asleep.is_set()
    lock.release()
    until(lambda: logind.say("look")["locks"] == [])


def test_a_refused_block_leaves_the_delay(logind: Emulator) -> None:
    logind.say("refuse")
    asleep = threading.Event()

    def let_go() -> None:
        asleep.set()
        threading.Thread(target=lock.release).start()

    lock = SleepLock("a test", let_go)
    lock.take()
    until(lambda: logind.say("look")["locks"] == BOTH[:1])
    assert lock.requested.wait(10)  # both locks were asked for
    assert lock.problem == "Inhibit: Permission denied"
    assert logind.say("sleep")["delayed_s"] < 4.0
    assert asleep.is_set()


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere there is no logind to look for")
def test_without_logind_nothing_is_locked_and_the_problem_says_why(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("dbus_fast")
    monkeypatch.setenv("DBUS_SYSTEM_BUS_ADDRESS", "unix:path=/nowhere")
    lock = SleepLock("a test", lambda: None)
    lock.take()
    lock.release()
    assert "nowhere" in lock.problem or "No such file" in lock.problem


@pytest.mark.slow
def test_a_hand_is_let_go_before_the_computer_sleeps(logind: Emulator) -> None:
    with Emulator("allegro_port") as hand, driver(hand) as allegro:
        until(lambda: (allegro.step(5), pushes(hand))[1])
        until(lambda: logind.say("look")["locks"] == BOTH)
        slept = logind.say("sleep")
        assert limp(hand)
        check = hand.say("look")
        assert max(check["zero_s"], check["off_s"]) < slept["t_s"]
        assert slept["delayed_s"] < 5.0
        with pytest.raises(DeviceUnavailableError, match="goes to sleep"):
            until(lambda: (allegro.step(5), False)[1])


@pytest.mark.slow
def test_a_hand_that_is_only_read_locks_nothing(logind: Emulator) -> None:
    with Emulator("allegro_port") as hand, driver(hand, torque=False) as allegro:
        allegro.step(5)
        until(lambda: allegro.state().counts.sets > 100)
        assert limp(hand)
        assert logind.say("look")["locks"] == []
