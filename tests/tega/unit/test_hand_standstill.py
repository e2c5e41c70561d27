"""After a standstill of its programs, or a sleep of the computer, a hand gets no torque that was computed before."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import pytest

from reference.hand_bench import limp, patient, pushes, steering
from reference.processes import begun_by, hand_guards, until
from tega.devices.hand.hand_loop import HandLoop
from tega.devices.hand.hand_reports import HandNews, HandOrders
from tega.runtime import clock
from tega.runtime.clock import Standstill
from tega.wire import CanFrame
from tega_emulators.process import Emulator

# More than the hand's watchdog of the test, in which it is silent.
STOPPED_S = 2.5


@pytest.mark.slow
@pytest.mark.parametrize("guarded", [True, False])
def test_programs_that_stood_still_together_send_no_torque_before_they_let_go(*, guarded: bool) -> None:
    with Emulator("allegro_port") as hand, steering(hand, guard=guarded) as running:
        steers = begun_by(running.pid, "tega.devices.hand.hand_program")
        pids = [running.pid, *steers, *hand_guards(running.pid)]
        assert len(pids) == 2 + guarded
        for pid in pids:
            os.kill(pid, signal.SIGSTOP)
        time.sleep(STOPPED_S)
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


def test_a_computer_that_slept_ends_the_hand(monkeypatch: pytest.MonkeyPatch) -> None:
    with Emulator("allegro_port") as hand:
        slept = Slept(hand, monkeypatch)
        with slept.steering() as thread:
            until(lambda: pushes(hand))
            slept.slept_s = 600.0
            thread.join(30.0)
            assert not thread.is_alive()
        assert limp(hand)
    assert slept.news[-1].ended
    assert slept.news[-1].let_go
    assert slept.news[-1].trouble == " (the computer slept for 600 s)"


def test_a_torque_that_was_computed_before_a_standstill_is_not_sent(monkeypatch: pytest.MonkeyPatch) -> None:
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
