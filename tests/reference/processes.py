"""Processes that a program has started, and waiting for what another thread does."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from contextlib import suppress
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


# Who takes a guard out knows that there is nothing to wait for.
_PATIENCE_S = float(os.environ.get("TEGA_PATIENCE_S", "60"))


def until(subject: Callable[[], bool]) -> None:
    """Return once it is so; fail after a minute, which a busy machine may need."""
    end_s = time.monotonic() + _PATIENCE_S
    while not subject():
        if time.monotonic() > end_s:
            pytest.fail(f"nothing happened for {_PATIENCE_S:g} s")
        time.sleep(0.002)
