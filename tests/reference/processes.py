"""Processes that a program has started, and those that these have."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

__all__ = ["begun_by", "below", "hand_guards"]


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
