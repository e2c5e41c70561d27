"""Notices when this whole machine stood still, as when another program was given all of it.

A process of its own (``python -m tega_campaigns.standstill``) looks how late it wakes: a thread of the campaign, or of
what is tried, would take its own program's business for the machine's.
"""

from __future__ import annotations

import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from typing import Self

from tega.runtime.child_process import end_child, python_command, python_environment

__all__ = ["Standstills", "within_ns"]

_LEAVE_S = 5.0
_STEP_S = 0.02
_LEAST_S = 0.25


def within_ns(found: Sequence[tuple[int, int]], since_ns: int, till_ns: int) -> int:
    """Return how much of the time between two moments lies within those found."""
    return sum(max(0, min(till, till_ns) - max(since, since_ns)) for since, till in found)


class Standstills:
    """The process, and what it has found."""

    def __init__(self) -> None:
        self._found: list[tuple[int, int]] = []
        self._process: subprocess.Popen[str] | None = None
        self._thread = threading.Thread(target=self._receive, daemon=True)

    def __enter__(self) -> Self:
        """Begin to look."""
        self._process = subprocess.Popen(
            python_command("tega_campaigns.standstill"),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=python_environment(),
        )
        self._thread.start()
        return self

    def __exit__(self, *_error: object) -> None:
        """Look no more."""
        if self._process is not None:
            end_child(self._process, _LEAVE_S)
            self._thread.join(_LEAVE_S)
            if self._process.stdout is not None:
                self._process.stdout.close()

    @property
    def total_s(self) -> float:
        """How long it stood still in all, seconds."""
        return sum(till - since for since, till in self._found) / 1e9

    def within_ns(self, since_ns: int, till_ns: int) -> int:
        """Return for how long it stood still between two times of day, all in ns."""
        return within_ns(self._found, since_ns, till_ns)

    def _receive(self) -> None:
        if self._process is not None and self._process.stdout is not None:
            for line in self._process.stdout:
                since, _, till = line.partition(" ")
                self._found.append((int(since), int(till)))


def main() -> None:
    """Look until the standard input ends; print since when and till when the machine stood still, ns of the day."""
    over = threading.Event()

    def listen() -> None:
        sys.stdin.read()
        over.set()

    threading.Thread(target=listen, daemon=True).start()
    last_ns = time.time_ns()
    while not over.wait(_STEP_S):
        now_ns = time.time_ns()
        if now_ns - last_ns > _LEAST_S * 1e9:
            print(last_ns, now_ns, flush=True)  # noqa: T201  # to the program that started it
        last_ns = now_ns


if __name__ == "__main__":
    main()
