"""A computer does not sleep while a hand's motors are on, and lets go of the hand before a sleep that comes anyway."""

from __future__ import annotations

import shutil
import sys
import threading
from collections.abc import Iterator

import pytest

from reference.hand_bench import driver, limp, pushes
from reference.processes import until
from tega.errors import DeviceUnavailableError
from tega.safety.sleep_lock import SleepLock
from tega_emulators.process import Emulator

pytest.importorskip("dbus_fast")
pytestmark = pytest.mark.skipif(
    sys.platform != "linux" or shutil.which("dbus-daemon") is None, reason="a message bus is started"
)

BOTH = [["sleep", "delay"], ["sleep:handle-lid-switch", "block"]]


@pytest.fixture
def logind(monkeypatch: pytest.MonkeyPatch) -> Iterator[Emulator]:
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


def test_without_logind_nothing_is_locked_and_the_problem_says_why(monkeypatch: pytest.MonkeyPatch) -> None:
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
        allegro.step(1)
        assert logind.say("look")["locks"] == []
