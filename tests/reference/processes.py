"""Processes that a program has started, and waiting for what another thread does."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

import pytest


def below(pid: int) -> list[int]:
    """Return every process below a process."""
    found = []
    for task in Path(f"/proc/{pid}/task").glob("*/children"):
        with suppress(OSError):  # it has just ended
            for child in map(int, task.read_text().split()):
                found += [child, *below(child)]
    return found


def begun_by(pid: int, module: str) -> list[int]:
    """Return those below a process that run a module of TEGA's."""
    found = []
    for child in below(pid):
        with suppress(OSError):  # it has just ended
            if module.encode() in Path(f"/proc/{child}/cmdline").read_bytes().split(b"\0"):
                found.append(child)
    return found


def hand_guards(pid: int | None = None) -> list[int]:
    """Return those below a process, this one where none is named, that guard a hand."""
    return begun_by(os.getpid() if pid is None else pid, "tega.devices.hand.hand_guard")


@contextmanager
def in_terminal(*words: object) -> Iterator[tuple[subprocess.Popen[bytes], int, Callable[[], bytes]]]:
    """Run a verb in a terminal: its process, where keys are written, and what returns all that it has drawn."""
    import pty
    import select

    ours, theirs = pty.openpty()
    displayed = b""

    def drawn() -> bytes:
        nonlocal displayed
        while select.select([ours], [], [], 0.05)[0]:
            try:
                displayed += os.read(ours, 65536)
            except OSError:  # it has ended
                break
        return displayed

    with ExitStack() as stack:
        stack.callback(os.close, ours)
        command = [sys.executable, "-m", "tega.ui.cli", *map(str, words)]
        environment = {**os.environ, "TERM": "xterm-256color"}
        process = subprocess.Popen(command, stdin=theirs, stdout=theirs, stderr=theirs, env=environment)
        stack.callback(process.wait)
        stack.callback(process.kill)
        os.close(theirs)
        yield process, ours, drawn


# Who takes a guard out knows that there is nothing to wait for.
_PATIENCE_S = float(os.environ.get("TEGA_PATIENCE_S", "60"))


def until(subject: Callable[[], bool]) -> None:
    """Return once it is so; fail after a minute, which a busy machine may need."""
    end_s = time.monotonic() + _PATIENCE_S
    while not subject():
        if time.monotonic() > end_s:
            pytest.fail(f"nothing happened for {_PATIENCE_S:g} s")
        time.sleep(0.002)
