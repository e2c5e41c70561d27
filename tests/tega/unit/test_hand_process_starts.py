"""The process that steers a hand says how far it is while it starts, and one that says nothing is ended."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from io import BufferedReader, BufferedWriter

import pytest

from tega.devices.hand import hand_ends
from tega.devices.hand.allegro_options import AllegroOptions
from tega.devices.hand.hand_ends import MAKES_READY, HandProcess
from tega.errors import TegaError
from tega.runtime.child_process import (
    end_child,
    python_command,
    python_environment,
    receive_object,
    send_object,
)

pytest.importorskip("can")
pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="a process is stopped by a signal")

_NO_PERSON = AllegroOptions(interface="slcan", channel="/dev/null", guard=False)


def test_each_stage_of_the_start_is_told() -> None:
    words = python_command("tega.devices.hand.hand_program")
    process = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=python_environment())
    assert isinstance(process.stdin, BufferedWriter)
    assert isinstance(process.stdout, BufferedReader)
    try:
        send_object(process.stdin, (_NO_PERSON, False))
        assert [receive_object(process.stdout) for _ in range(2)] == [MAKES_READY] * 2
        send_object(process.stdin, False)
        assert isinstance(receive_object(process.stdout), TegaError)  # no such adapter
    finally:
        end_child(process, 5.0)
        process.stdout.close()


def test_one_that_says_nothing_is_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hand_ends, "_START_S", 0.3)
    steers = HandProcess(_NO_PERSON, lambda _spoken, _news: None)
    steers.warm_up()
    os.kill(steers.pid, signal.SIGSTOP)
    with pytest.raises(TegaError, match="did not start") as reported:
        steers.open(whole=False)
    assert reported.value.hint.startswith("it said nothing for 0.3 s")
