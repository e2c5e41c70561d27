"""Steer a hand in a separate program: levels come in on its input, exchanges go to its output.

:class:`~tega.devices.hand.hand_ends.HandProcess` starts it. Where its input ends without a word, the run was killed,
and the hand is let go at once; where a run that goes on says nothing for a second, it stands still, and so does this:
the process that guards the hand (:mod:`tega.devices.hand.hand_guard`) then lets go of it until the run goes on.
"""

from __future__ import annotations

import gc
import os
import sys
import threading
from contextlib import suppress
from io import BufferedWriter, FileIO
from queue import Empty, SimpleQueue
from typing import Any

from tega.devices.hand.hand_bus import load_can
from tega.devices.hand.hand_ends import MAKES_READY, read_words
from tega.devices.hand.hand_loop import HandLoop
from tega.devices.hand.hand_reports import WORD_S, HandNews, HandOrders
from tega.hand.link import HandSpoken
from tega.runtime.child_process import receive_object, send_object
from tega.runtime.threads import realtime, run_realtime, short_turns
from tega.safety.sleep_lock import SleepLock

_LEAVE_S = 2.0

_Reported = tuple[list[HandSpoken], HandNews]


@run_realtime("hand")
def _pass_on(reported: SimpleQueue[_Reported | None], answers: BufferedWriter) -> None:
    """Report to the run, which may be slow, without delaying the hand; report being alive when idle."""
    while True:
        subject: _Reported | tuple[()] | None = ()
        with suppress(Empty):
            subject = reported.get(timeout=WORD_S)
        if subject is None:
            return
        with suppress(OSError):  # the run was killed
            send_object(answers, subject)


def _makes_ready(answers: BufferedWriter) -> None:
    with suppress(OSError):  # the run has given up, which is seen where its word is waited for
        send_object(answers, MAKES_READY)


def _steer(options: Any, *, requested: FileIO, orders: HandOrders, answers: BufferedWriter) -> None:
    """Make ready, wait until the run opens the hand, and steer it."""
    reported: SimpleQueue[_Reported | None] = SimpleQueue()
    loop = HandLoop(options, orders, lambda spoken, seen: reported.put((spoken, seen)))
    lock = SleepLock("a robot hand's motors are on", lambda: orders.leave(" (the computer goes to sleep)"))
    try:
        _makes_ready(answers)
        loop.warm_up()
        lock.load()
        _makes_ready(answers)
        loop.whole = receive_object(requested)
        loop.open()
    except EOFError:  # the run has given up, or was killed, before it opened the hand
        loop.dismiss()
        return
    except Exception as error:  # the run reports it
        send_object(answers, error)
        return
    send_object(answers, None)
    threading.Thread(target=read_words, args=(sys.stdin.fileno(), orders), daemon=True).start()
    telling = threading.Thread(target=_pass_on, args=(reported, answers), daemon=True)
    telling.start()
    if options.torque:
        lock.take()
    gc.collect()
    gc.freeze()
    loop.run()
    lock.release()
    reported.put(None)
    telling.join(_LEAVE_S)


def main() -> None:
    """Steer until the run says that it is over, or is no more."""
    load_can()
    orders = HandOrders()
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # what a library prints is no answer
    try:
        # Not through a buffer, which would keep the words behind it.
        requested = os.fdopen(os.dup(sys.stdin.fileno()), "rb", buffering=0)
        options, allowed = receive_object(requested)
    except EOFError:  # the run was killed as soon
        return
    with realtime(allowed=allowed), short_turns():
        _steer(options, requested=requested, orders=orders, answers=answers)


if __name__ == "__main__":
    main()
