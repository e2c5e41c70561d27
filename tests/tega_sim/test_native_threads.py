"""Native objects are looked at by one thread while another feeds them: nothing raises, nothing is torn."""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from reference.installed import program
from tega.emg import BlockMean, ButterworthLowpass, GraspIntent
from tega.wire import AsciiEmgDecoder, ChordsDecoder, CytonDecoder, SpikerDecoder
from tega_sim.gel import Gel, ball

# Long enough that the thread that feeds leaves the interpreter to the other many times.
_ROWS = np.random.default_rng(1).normal(size=(400_000, 3))
_BYTES = bytes(4_000_000)
_LOOKS = 3
_BALL = (ball(force_n=2.0),)

_WATCHED: dict[str, tuple[Callable[[], Any], Callable[[Any], object], Callable[[Any], object]]] = {
    "cyton": (CytonDecoder, lambda d: d.feed(_BYTES), lambda d: d.skipped_bytes),
    "chords": (lambda: ChordsDecoder(3), lambda d: d.feed(_BYTES), lambda d: d.packets),
    "spiker": (lambda: SpikerDecoder(3), lambda d: d.feed(_BYTES), lambda d: d.bad_frames),
    "ascii": (lambda: AsciiEmgDecoder(3), lambda d: d.feed(b"1,2,3\n" * 400_000), lambda d: d.last_rejected),
    "filter": (
        lambda: ButterworthLowpass(1000.0, 5.0, 2, 3),
        lambda f: f.process(_ROWS),
        lambda f: f.held_samples,
    ),
    "mean": (lambda: BlockMean(50, 3), lambda m: m.process(_ROWS), lambda m: m.held_samples),
    "gel": (lambda: Gel(1), lambda g: [g.frame(_BALL, index=k) for k in range(40)], lambda g: g.truth),
    "intent": (
        lambda: GraspIntent(1000.0, [1.0, 1.0, 1.0], tau=100),
        lambda i: i.process(_ROWS),
        lambda i: (i.maxima, i.bad_channels),
    ),
}


@pytest.mark.parametrize("name", _WATCHED)
def test_what_one_thread_feeds_another_may_look_at(name: str) -> None:
    """A page asks for the counts thirty times a second while the reader's thread feeds."""
    make, feed, look = _WATCHED[name]
    watched: Any = make()
    ended, failed, n_looks = threading.Event(), [], 0

    def work() -> None:
        try:
            # On a busy machine the first feed may end before the looking thread has begun.
            while n_looks < _LOOKS:
                feed(watched)
        except BaseException as error:
            failed.append(error)
        finally:
            ended.set()

    worker = threading.Thread(target=work)
    worker.start()
    while not ended.is_set():
        look(watched)
        n_looks += 1
        ended.wait(1e-4)
    worker.join()
    assert not failed


def test_others_go_on_while_a_gel_is_made() -> None:
    """A gel takes long to make; whoever makes one leaves the interpreter to the threads of a run."""
    begun, n_made = threading.Event(), 0

    def make() -> None:
        nonlocal n_made
        begun.set()
        for seed in range(50):
            Gel(seed)
            n_made += 1

    before = sys.getswitchinterval()
    # Nobody is asked to let go of the interpreter, so that another runs only where it was let go of.
    sys.setswitchinterval(1000.0)
    try:
        maker = threading.Thread(target=make)
        maker.start()
        begun.wait()
        n_when_we_ran = n_made
        maker.join()
    finally:
        sys.setswitchinterval(before)
    assert (n_made, n_when_we_ran < 50) == (50, True)


def test_threads_that_cannot_start_lose_no_frame() -> None:
    """The system refuses a thread: the work is done without it. Here it has no room for so large a stack."""
    ask = (
        "import numpy as np\n"
        "from tega.tactile import contact_metrics_many\n"
        "frames = [np.full((320, 240, 3), k, np.uint8) for k in range(40)]\n"
        "found = contact_metrics_many(frames, frames[0])\n"
        "print(len(found), found[39].eda)\n"
    )

    def answer(**more: str) -> str:
        return program(sys.executable, "-c", ask, env=os.environ | more).stdout

    assert answer(RUST_MIN_STACK=str(2**50)) == answer()


def test_a_short_call_on_an_object_in_use_stops_no_other_thread() -> None:
    """One thread computes on an object, a second asks it for something short, a third goes on meanwhile."""
    lowpass = ButterworthLowpass(1000.0, 5.0, 2, 3)
    rows = np.zeros((3_000_000, 3))
    done = threading.Event()
    n_ticks = [0]

    def compute() -> None:
        for _ in range(5):
            lowpass.process(rows)
        done.set()

    def tick() -> None:
        while not done.is_set():
            n_ticks[0] += 1
            time.sleep(1e-5)  # leaves the interpreter to the others

    interval_s = sys.getswitchinterval()
    # A turn of the third thread is a few hundred ticks, a computation some hundred thousand.
    sys.setswitchinterval(1e-5)
    threads = [threading.Thread(target=compute), threading.Thread(target=tick)]
    try:
        for thread in threads:
            thread.start()
        most = 0
        while not done.is_set():
            before = n_ticks[0]
            lowpass.held_samples  # noqa: B018 - waits where the first thread computes
            most = max(most, n_ticks[0] - before)
            time.sleep(1e-4)
    finally:
        sys.setswitchinterval(interval_s)
        for thread in threads:
            thread.join()
    assert most > 0
