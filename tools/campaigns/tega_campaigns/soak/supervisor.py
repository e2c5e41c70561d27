"""Starts the program under test, hears what it says, and starts it again."""

from __future__ import annotations

import json
import signal
import subprocess
import threading
import time
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple, Self

from tega.child_process import end_child, python_command, python_environment

__all__ = ["Line", "Supervisor"]

_LEAVE_S = 20.0


class Line(NamedTuple):
    """Something that the program said, with the monotonic time at which it did."""

    at_s: float
    said: dict[str, Any]


class Supervisor:
    """One process after another.

    Args:
        settings: The session's settings.
        errors: Where its error output goes.

    Attributes:
        lines: What the present one has said.
        memory: Resident memory of each process in turn, as (time, MiB).
        exits: Exit code of each that has ended, with the time.
    """

    def __init__(self, settings: Path, errors: Path) -> None:
        self._settings = settings
        self._errors = errors.open("ab")
        self._process: subprocess.Popen[str] | None = None
        self._reader: threading.Thread | None = None
        self.lines: list[Line] = []
        self.memory: list[list[tuple[float, float]]] = []

    def __enter__(self) -> Self:
        """Start nothing yet."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End what still runs."""
        try:
            if self._process is not None:
                self.end()
        finally:
            self._errors.close()

    @property
    def alive(self) -> bool:
        """Whether it runs."""
        return self._process is not None and self._process.poll() is None

    @property
    def newest(self) -> Line:
        """The newest line that tells the state and the alerts."""
        return next((line for line in reversed(self.lines) if "alerts" in line.said), Line(0.0, {}))

    def well(self, since_s: float = 0.0) -> bool:
        """Tell whether it runs, has been heard since then, is active, and nothing but latency is wrong."""
        at_s, said = self.newest
        wrong = [alert for alert in said.get("alerts", ()) if not alert.startswith("latency")]
        return self.alive and at_s > since_s and said.get("state") == "active" and not wrong

    def start(self) -> None:
        """Start it."""
        memory: list[tuple[float, float]] = []
        self.lines = []
        self.memory.append(memory)
        words = python_command("tega_campaigns.soak.system", str(self._settings))
        self._process = subprocess.Popen(
            words,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            text=True,
            env=python_environment(),
        )
        self._reader = threading.Thread(
            target=self._hear, args=(self._process, self.lines, memory), daemon=True
        )
        self._reader.start()

    def tell(self, line: str) -> None:
        """Give it a line of its standard input."""
        if self._process is not None and self._process.stdin is not None:
            self._process.stdin.write(line + "\n")
            self._process.stdin.flush()

    def fill_disk(self, *, full: bool) -> None:
        """Let it write no byte beyond what its files have, as on a full disk; or let it write again."""
        import resource  # which Windows has not

        if self._process is not None:
            hard = resource.prlimit(self._process.pid, resource.RLIMIT_FSIZE)[1]
            resource.prlimit(self._process.pid, resource.RLIMIT_FSIZE, (0 if full else hard, hard))

    def hold_up(self, *, on: bool) -> None:
        """Give it no time at all, or time again."""
        if self._process is not None:
            self._process.send_signal(signal.SIGSTOP if on else signal.SIGCONT)

    def kill(self) -> int:
        """Kill it and return the time of day, ns, just before."""
        at_ns = time.time_ns()
        if self._process is not None:
            self._process.kill()
        self._ended()
        return at_ns

    def end(self) -> int:
        """Ask it to end, wait for that, and return its exit code."""
        return self._ended()

    def _ended(self) -> int:
        process, self._process = self._process, None
        if process is None:
            return 0
        code = end_child(process, _LEAVE_S)
        if self._reader is not None:
            self._reader.join(_LEAVE_S)
        if process.stdout is not None:
            process.stdout.close()
        return code

    @staticmethod
    def _hear(process: subprocess.Popen[str], lines: list[Line], memory: list[tuple[float, float]]) -> None:
        if process.stdout is None:
            return
        for text in process.stdout:
            try:
                said = json.loads(text)
            except ValueError:  # the last line of a process that was killed
                continue
            lines.append(Line(said["at_s"], said))
            if "rss_mib" in said:
                memory.append((said["at_s"], said["rss_mib"]))
