"""Which threads of a run go first; hand and samples keep their own time whatever else the program does."""

from __future__ import annotations

import ctypes
import gc
import os
import sys
import threading
import time
import weakref
from pathlib import Path

import pytest

from reference.hand_bench import driver, pushes
from reference.parts import observed
from reference.processes import until
from tega.config import check_tree
from tega.devices.emg.live_serial import SerialPort
from tega.loop.pacing import settle, settled
from tega.loop.session import run_session
from tega.runtime import threads as priority
from tega.runtime.threads import all_along, give_way, promote, realtime, run_realtime, short_turns
from tega_emulators.lab import emulated_lab
from tega_emulators.process import Emulator

linux = pytest.mark.skipif(sys.platform != "linux", reason="real-time threads are asked for on Linux only")


def _policy(thread: threading.Thread | None = None) -> tuple[int, int]:
    tid = 0 if thread is None else thread.native_id or 0
    return os.sched_getscheduler(tid) & ~os.SCHED_RESET_ON_FORK, os.sched_getparam(tid).sched_priority


@linux
def test_who_acts_goes_before_who_measures_and_all_before_who_codes_pictures() -> None:
    before, found = _policy(), []
    for rank in ("hand", "act", "measure", "beside", "picture"):
        with run_realtime(rank) as granted:
            found.append(_policy()[1])
            with run_realtime("picture") as still:  # nobody loses what it has
                assert still == granted
                assert _policy()[1] == found[-1]
        assert _policy() == before
    if granted:
        assert found == sorted(set(found), reverse=True)
        assert found[-1] > 0
    else:  # an ordinary user: all stays as it was
        assert set(found) == {0}


@linux
def test_a_thread_gives_way_for_a_block_only_and_only_where_it_had_a_rank() -> None:
    before = _policy()
    with give_way():
        assert _policy() == before
    with run_realtime("measure") as granted:
        measuring = _policy()
        with give_way():
            assert (_policy()[1] < measuring[1]) == granted
        assert _policy() == measuring
    assert _policy() == before


@linux
def test_a_run_without_real_time_asks_for_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    requested: list[int] = []
    monkeypatch.setattr(os, "sched_setscheduler", lambda tid, *_how: requested.append(tid))
    with realtime(allowed=False), run_realtime("act") as granted, all_along():
        assert not granted
        assert not promote(threading.current_thread(), "act")
    assert requested == []
    with run_realtime("act"):
        assert requested == [0]


@linux
def test_threads_that_were_there_and_that_begin_are_brought_along_and_let_go(monkeypatch) -> None:
    monkeypatch.setattr(priority, "_SWEEP_S", 0.02)
    over = threading.Event()
    with run_realtime("beside") as granted:
        wanted = _policy() if granted else (os.SCHED_OTHER, 0)
    threads = [threading.Thread(target=over.wait, daemon=True) for _ in range(2)]
    try:
        threads[0].start()
        with all_along():
            threads[1].start()
            until(lambda: [_policy(thread) for thread in threads] == [wanted] * 2)
        assert [_policy(thread) for thread in threads] == [(os.SCHED_OTHER, 0)] * 2
    finally:
        over.set()


def test_full_collections_look_at_what_has_come_since_only() -> None:
    class Ring:
        def __init__(self) -> None:
            self.me = self

    with settled():
        n_before = len(gc.get_objects())
        assert n_before < 5000 < gc.get_freeze_count()
        ring = weakref.ref(Ring())
        gc.collect()
        assert ring() is None
        kept = [[k] for k in range(2000)]
        settle()
        assert len(gc.get_objects()) < n_before + len(kept)
    assert gc.get_freeze_count() == 0


def test_a_run_that_is_told_to_takes_no_real_time(tmp_path: Path) -> None:
    frozen: list[int] = []
    bus = observed(lambda _view: frozen.append(gc.get_freeze_count()))
    with run_realtime("act") as granted:
        pass
    with emulated_lab(tmp_path, emg_hz=250.0) as lab:
        for wanted in (True, False):
            lab.tree["session"] = {"duration_s": 0.5, "realtime": wanted}
            summary = run_session(check_tree(lab.tree, {}, base=tmp_path).config, bus=bus)
            allowed = wanted and sys.platform == "linux" and granted
            assert summary["pacing"]["real_time"] is allowed
    assert min(frozen) > 10_000
    assert gc.get_freeze_count() == 0


def test_threads_take_short_turns_in_a_run_and_as_before_afterwards() -> None:
    before_s = sys.getswitchinterval()
    with short_turns():
        with short_turns():
            assert sys.getswitchinterval() == pytest.approx(0.0005)
        assert sys.getswitchinterval() == pytest.approx(0.0005)
    assert sys.getswitchinterval() == before_s > 0.0005


TICK_MS = 3.0
TIMES = 10
HELD_US = 200_000


def hold() -> None:
    """Sleep in a function of C that is called so that it keeps the interpreter's lock."""
    ctypes.PyDLL(None).usleep(HELD_US)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="its C library has no usleep")
@pytest.mark.asked_again("a machine that is busy for 30 ms answers nobody")
def test_the_hand_is_answered_in_time_while_the_interpreter_lock_is_held() -> None:
    with Emulator("allegro_port") as hand, driver(hand) as steered:
        until(lambda: (steered.step(3), pushes(hand))[1])
        hand.say("answers")
        for _ in range(3):
            steered.step(4)
            hold()
        answers_ms = hand.say("answers")["answers_ms"]
    assert len(answers_ms) > 3 * HELD_US / 1000 / TICK_MS / TIMES
    assert max(answers_ms) < TIMES * TICK_MS


RATE_HZ = 200
BURST_MS = 50
N_HELD = 6
# The system wakes the thread, and the board tells the time of a packet after the last of a burst.
LATE_NS = 8_000_000


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere whoever reads drains the port")
@pytest.mark.asked_again("a machine that is busy for 8 ms wakes nobody")
def test_bytes_are_stamped_as_they_come_while_the_interpreter_lock_is_held() -> None:
    board = ("--rate", str(RATE_HZ), "--burst-ms", str(BURST_MS), "--stamp")
    stamps: list[tuple[int, int]] = []
    with Emulator("ascii_board", *board) as emulator:
        port = SerialPort(emulator.port, 115_200, driver="test")
        try:
            text = port.read_until(b"\r\n", 5.0)
            for _ in range(N_HELD):
                hold()
                data, arrival_ns = port.arrived()
                text += data
                whole, _, _ = text.rpartition(b"\r\n")
                newest = round(int(whole.rpartition(b"\n")[2].split(b",")[0]) * RATE_HZ / 1000)
                stamps.append((newest, arrival_ns))
                time.sleep(0.013)  # another part of a burst's period
        finally:
            port.close()
        sent_ns = emulator.say("sent")["sent_ns"]
    lines = [line.split(b",") for line in text.split(b"\r\n")[1:-1]]
    numbers = [round(int(line[0]) * RATE_HZ / 1000) for line in lines]
    assert numbers == list(range(numbers[0], numbers[0] + len(numbers))), "no line is lost"
    assert len(numbers) > N_HELD * HELD_US / 1e6 * RATE_HZ / 2
    late_ns = [arrival_ns - sent_ns[newest] for newest, arrival_ns in stamps]
    assert max(late_ns) < LATE_NS
