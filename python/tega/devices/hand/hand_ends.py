"""Run a hand's loop in a process of its own, and receive its reports."""

from __future__ import annotations

import contextlib
import os
import struct
import subprocess
import sys
import threading
import time
from io import BufferedReader, BufferedWriter
from typing import Any, Final

from tega.devices.hand.allegro_options import AllegroOptions
from tega.devices.hand.hand_guard import guard_runs, take_over
from tega.devices.hand.hand_loop import LEAVE_S
from tega.devices.hand.hand_reports import WORD_S, HandNews, HandOrders, Notify
from tega.errors import DeviceUnavailableError
from tega.runtime.child_process import end_child, receive_object, send_object, start_child, widen_pipe
from tega.runtime.threads import realtime_allowed, run_realtime

MAKES_READY: Final = "makes ready"
"""Message of the process after each stage of its start."""

_START_S: Final = 20.0
_SILENT_S: Final = 1.0
_AWAY_S: Final = 0.2
_POLL_S: Final = 0.1
# Level and addition. What is so short a pipe takes as a whole or not at all.
_WORD: Final = struct.Struct("<2d")


def _patience(process: subprocess.Popen[bytes], stuck: threading.Event) -> threading.Timer:
    """Kill a process that does not report within :data:`_START_S` how far it is, and set ``stuck``."""

    def end() -> None:
        stuck.set()
        process.kill()

    late = threading.Timer(_START_S, end)
    late.start()
    return late


class HandProcess:
    """The loop in a process of its own, which waits for nothing that this program does."""

    def __init__(self, options: AllegroOptions, notify: Notify) -> None:
        self._options, self._notify = options, notify
        self._process: subprocess.Popen[bytes] | None = None
        self._thread: threading.Thread | None = None
        self._word: tuple[float, float] = (1, 0.0)
        self._alone = False
        self._text_s = self._received_s = self._looked_s = self._since_s = 0.0
        self._broke = ""
        self._news: HandNews | None = None

    @property
    def pid(self) -> int:
        """The process's number; 0 before it was started."""
        return 0 if self._process is None else self._process.pid

    def warm_up(self) -> None:
        """Start it, and return at once; it makes ready, and touches nothing of the hand before :meth:`open`."""
        self._process = start_child("tega.devices.hand.hand_program", stdout=subprocess.PIPE)
        assert isinstance(self._process.stdin, BufferedWriter)
        widen_pipe(self._process.stdin)
        with contextlib.suppress(OSError):  # it has ended: reported when the hand is opened
            send_object(self._process.stdin, (self._options, realtime_allowed()))

    def open(self, *, whole: bool) -> None:
        """Return when the bus is open and the guard ready; raises what :meth:`HandLoop.open` does."""
        if self._process is None:
            self.warm_up()
        process = self._process
        assert process is not None
        requested, text = process.stdin, process.stdout
        assert isinstance(requested, BufferedWriter)
        assert isinstance(text, BufferedReader)
        stuck = threading.Event()
        late = _patience(process, stuck)
        error: Any
        try:
            with contextlib.suppress(OSError):  # it has ended, and may have said why
                send_object(requested, whole)
            while (error := receive_object(text)) == MAKES_READY:
                late.cancel()
                late = _patience(process, stuck)
        except (EOFError, OSError):
            why = f"it said nothing for {_START_S:g} s" if stuck.is_set() else "its error output says why"
            error = DeviceUnavailableError(
                "allegro: the hand's process did not start", f"{why}; nothing was switched on"
            )
        except BaseException as interrupted:
            error = interrupted
        finally:
            late.cancel()
        if error is not None:
            end_child(process, LEAVE_S)
            text.close()
            raise error
        # Windows has no such pipes: a process that reads nothing is reported before one is full.
        if sys.platform != "win32":
            os.set_blocking(requested.fileno(), False)
        self._received_s = time.monotonic()
        self._thread = threading.Thread(target=self._receive, args=(text,), name="allegro", daemon=True)
        self._thread.start()

    def say(self, level: float, added: float = 0.0, *, alone: bool = False) -> None:
        """Set the level and its addition, or with ``LET_GO`` release the hand; returns at once.

        With ``alone`` nothing but the next call says that this program does not stand still.
        """
        self._alone = alone
        if (level, added) != self._word or time.monotonic() - self._text_s >= WORD_S:
            self._word = level, added
            self._write()

    def join(self, timeout_s: float) -> None:
        """Wait for the loop's end; a process that has fallen silent is ended."""
        until_s = time.monotonic() + timeout_s
        while (
            self._thread is not None
            and self._thread.is_alive()
            and (left_s := until_s - time.monotonic()) > 0
        ):
            self._thread.join(min(left_s, _POLL_S))
            _ = self.lost

    def end(self) -> None:
        """End the process, by force where it does not end; its guard then lets go of the hand."""
        if self._process is not None:
            end_child(self._process, LEAVE_S)
            self.join(LEAVE_S)
            if self._process.stdout is not None and (self._thread is None or not self._thread.is_alive()):
                self._process.stdout.close()

    @property
    def lost(self) -> str:
        """Why the process can be asked for nothing any more; ``""`` while it goes on."""
        if self._broke:
            return self._broke
        now_s = time.monotonic()
        if now_s - self._looked_s > _AWAY_S:  # what has come since is still to be read
            self._since_s = now_s
        self._looked_s = now_s
        if (silent_s := now_s - max(self._since_s, self._received_s)) > _SILENT_S:
            if self._process is not None:
                self._process.kill()  # it must not go on later; the thread that listens has the hand let go
            self._broke = f"the hand's process has said nothing for {silent_s:.1f} s"
        return self._broke

    def _write(self) -> None:
        self._text_s = time.monotonic()
        process = self._process
        if process is not None and process.stdin is not None:
            with contextlib.suppress(OSError, ValueError):  # gone, or its pipe is full: both are reported
                os.write(process.stdin.fileno(), _WORD.pack(*self._word))

    @run_realtime("act")
    def _receive(self, pipe: BufferedReader) -> None:
        """Read the process's output until it ends, and keep reporting to it that this program is alive."""
        self._write()
        try:
            while True:
                reported = receive_object(pipe)
                self._received_s = time.monotonic()
                if reported:  # else that it goes on
                    self._news = reported[1]
                    self._notify(*reported)
                if self._received_s - self._text_s >= WORD_S and not self._alone:
                    self._write()
        except (EOFError, OSError):
            process = self._process
            code = None if process is None else process.poll()
            self._broke = self._broke or "the hand's process has ended" + (
                "" if code is None else f" ({code})"
            )
            self._let_go_instead()
        except BaseException as error:  # of the callback; the next step can act on it
            self._broke = f"the hand's process does not answer any more ({type(error).__name__}: {error})"

    def _let_go_instead(self) -> None:
        """Have the hand let go if the process has ended before the hand confirmed, and report how that went."""
        news = self._news
        if news is None or not self._options.torque or (news.ended and news.let_go):
            return
        if news.ended and guard_runs(news.guard_pid):
            return  # it was left to its guard, which goes on
        let_go, pid = take_over(self._options, news.guard_pid)
        self._notify([], news._replace(ended=True, let_go=let_go, guard_pid=pid))


def read_words(fd: int, orders: HandOrders) -> None:
    """Read, in the process, the program's requests until the program is gone."""
    rest = b""
    while piece := os.read(fd, 4096):
        rest += piece
        whole = len(rest) - len(rest) % _WORD.size
        for word in _WORD.iter_unpack(rest[:whole]):
            orders.take(*word)
        rest = rest[whole:]
    orders.lose()
