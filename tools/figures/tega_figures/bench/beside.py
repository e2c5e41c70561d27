"""Run other programs beside a bench, and tell the processor time of each apart."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

from tega.errors import DeviceUnavailableError
from tega.runtime.child_process import end_child, python_command, python_environment

__all__ = ["Viewer", "busy_cores", "processor_s"]

_PATIENCE_S = 10.0


def processor_s(pids: Sequence[int]) -> float:
    """Return the processor time of some processes and of all that they have started, seconds; 0 but on Linux."""
    if sys.platform != "linux":
        return 0.0
    begun_by, used = dict[int, int](), dict[int, int]()
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            pid, fields = int(stat.parent.name), stat.read_text().rpartition(")")[2].split()
        except OSError:  # it has ended meanwhile
            continue
        begun_by[pid], used[pid] = int(fields[1]), sum(map(int, fields[11:15]))

    def belongs(pid: int) -> bool:
        while pid > 1:
            if pid in pids:
                return True
            pid = begun_by.get(pid, 0)
        return False

    return sum(ticks for pid, ticks in used.items() if belongs(pid)) / os.sysconf("SC_CLK_TCK")


class Viewer:
    """A browser, in a process of its own, that shows a page from :meth:`open` until the block ends."""

    def __init__(self) -> None:
        self._stack = ExitStack()
        self.pids: list[int] = []

    def __enter__(self) -> Viewer:
        """Do nothing yet."""
        return self

    def __exit__(self, *_how: object) -> None:
        """End the browser."""
        self._stack.close()

    def open(self, url: str) -> None:
        """Show a page; returns when the browser has drawn it.

        Raises:
            DeviceUnavailableError: It does not.
        """
        process = self._stack.enter_context(_program("tega_figures.watch_page", url))
        assert process.stdout is not None
        if process.stdout.readline().strip() != b"shown":
            raise DeviceUnavailableError("the browser does not show the page", "is Chromium installed?")
        self.pids.append(process.pid)


@contextmanager
def busy_cores(n_programs: int) -> Iterator[None]:
    """Have so many programs compute for as long as the block lasts."""
    with ExitStack() as stack:
        for _ in range(n_programs):
            stack.enter_context(_program("tega_figures.busy_program"))
        yield


@contextmanager
def _program(module: str, *words: str) -> Iterator[subprocess.Popen[bytes]]:
    with subprocess.Popen(
        python_command(module, *words),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        env=python_environment(),
    ) as process:
        try:
            yield process
        finally:
            end_child(process, _PATIENCE_S)
