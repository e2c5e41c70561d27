"""What each of several Ctrl-C does while a run ends."""

from __future__ import annotations

import os
import signal
import sys
from types import SimpleNamespace

import pytest

from tega.safety import stop as stopping

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="signals as on Linux and macOS")


def test_the_first_after_a_second_interrupts_and_no_other(monkeypatch: pytest.MonkeyPatch) -> None:
    now_s = [3.0]
    monkeypatch.setattr(stopping, "time", SimpleNamespace(monotonic=lambda: now_s[0]))
    with stopping.CtrlC() as stop:
        for now_s[0] in (3.0, 3.5, 4.0):
            os.kill(os.getpid(), signal.SIGINT)
            assert stop.requested
        now_s[0] = 4.1
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGINT)
        now_s[0] = 9.0
        os.kill(os.getpid(), signal.SIGINT)


def test_one_that_interrupts_at_once_is_the_only_one(monkeypatch: pytest.MonkeyPatch) -> None:
    now_s = [3.0]
    monkeypatch.setattr(stopping, "time", SimpleNamespace(monotonic=lambda: now_s[0]))
    with stopping.CtrlC() as stop:
        with pytest.raises(KeyboardInterrupt), stop.interrupting():
            os.kill(os.getpid(), signal.SIGINT)
        now_s[0] = 9.0
        os.kill(os.getpid(), signal.SIGINT)
        assert stop.requested
