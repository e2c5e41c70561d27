"""Starts the program under test, hears what it says, and starts it again."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import threading
import time
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple, Self

from tega.child_process import end_child, python_command, python_environment

__all__ = ["SaidLine", "Supervisor"]

_LEAVE_S = 20.0


class SaidLine(NamedTuple):
    """Something that the program said, with the monotonic time at which it did."""

    at_s: float
    said: dict[str, Any]


class Supervisor:
    """One process after another.

    Args:
        settings: The session's settings.
        errors: Where its error output goes.
        environment: What it finds in its environment besides this program's.

    Attributes:
        lines: What the present one has said.
        memory: Resident memory of each process in turn, as (time, MiB).
        exits: Exit code of each that has ended, with the time.
    """

    def __init__(self, settings: Path, errors: Path, environment: Mapping[str, str]) -> None:
        self._settings, self._environment = settings, environment
        self._errors = errors.open("ab")
        self._process: subprocess.Popen[str] | None = None
        self._reader: threading.Thread | None = None
        self.lines: list[SaidLine] = []
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
    def newest(self) -> SaidLine:
        """The newest line that tells the state and the alerts."""
        return next((line for line in reversed(self.lines) if "alerts" in line.said), SaidLine(0.0, {}))

    @property
    def leads(self) -> bool:
        """Whether the arm follows, as it told last."""
        return bool(self.newest.said.get("arm", "").startswith("following"))

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
            env=python_environment({**os.environ, **self._environment}),
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

    def arm_process(self) -> int | None:
        """Return the number of the process that it has started for the arm; ``None`` if there is none."""
        if self._process is None:
            return None
        for folder in Path("/proc").glob("[0-9]*"):
            try:
                words = (folder / "cmdline").read_bytes().split(b"\0")
                parent = int((folder / "stat").read_text("ascii").rpartition(")")[2].split()[1])
            except (OSError, ValueError):  # it has ended meanwhile
                continue
            if parent == self._process.pid and b"tega.arm.robot.process" in words:
                return int(folder.name)
        return None

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
    def _hear(
        process: subprocess.Popen[str], lines: list[SaidLine], memory: list[tuple[float, float]]
    ) -> None:
        if process.stdout is None:
            return
        for text in process.stdout:
            try:
                said = json.loads(text)
            except ValueError:  # the last line of a process that was killed
                continue
            lines.append(SaidLine(said["at_s"], said))
            if "rss_mib" in said:
                memory.append((said["at_s"], said["rss_mib"]))
