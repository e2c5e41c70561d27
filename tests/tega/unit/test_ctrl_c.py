"""What each of several Ctrl-C does while a run ends, and that a key stops it."""

from __future__ import annotations

import os
import signal
import sys
from types import SimpleNamespace

import pytest

from reference.processes import until
from tega.safety import stop as stopping
from tega.ui.cli.options import stop_keys


@pytest.mark.skipif(sys.platform == "win32", reason="signals as on Linux and macOS")
@pytest.mark.parametrize("first", ["Ctrl-C", "the page", "at once"])
def test_one_of_several_interrupts_and_no_other(monkeypatch: pytest.MonkeyPatch, first: str) -> None:
    now_s = [3.0]
    monkeypatch.setattr(stopping, "time", SimpleNamespace(monotonic=lambda: now_s[0]))
    with stopping.CtrlC() as stop:
        if first == "at once":
            with pytest.raises(KeyboardInterrupt), stop.interrupting():
                os.kill(os.getpid(), signal.SIGINT)
        else:
            stop.also(lambda: first.removeprefix("Ctrl-C"))
            assert stop() == (first == "the page")
            for now_s[0] in (3.0, 3.5, 4.0):
                os.kill(os.getpid(), signal.SIGINT)
                assert stop.requested
            now_s[0] = 4.1  # more than a second after the first
            with pytest.raises(KeyboardInterrupt):
                os.kill(os.getpid(), signal.SIGINT)
        now_s[0] = 9.0
        os.kill(os.getpid(), signal.SIGINT)
        assert stop()
        assert stop.reason == first.replace("at once", "Ctrl-C")


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX terminals")
def test_the_space_bar_stops_although_the_output_goes_to_a_file(monkeypatch) -> None:
    keys, terminal = os.openpty()
    with os.fdopen(keys, "wb", buffering=0) as typed, os.fdopen(terminal) as read:
        monkeypatch.setattr(sys, "stdin", read)
        with stop_keys(stop := stopping.Stop()):
            typed.write(b" ")
            until(stop)
