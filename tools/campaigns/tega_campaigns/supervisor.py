"""Starts the program under test, reads what it prints, holds it up, kills it, and starts it again."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager
from itertools import takewhile
from pathlib import Path
from typing import Any, NamedTuple

from tega.runtime.child_process import end_child, python_command, python_environment

__all__ = ["SaidLine", "Supervisor"]

_LEAVE_S = 20.0
# Lines of the processes before that stay when the next one is started.
_KEPT_LINES = 2000


class SaidLine(NamedTuple):
    """A line that the program printed, with the monotonic time at which it did."""

    at_s: float
    said: dict[str, Any]


class Supervisor(AbstractContextManager["Supervisor"]):
    """One process of :mod:`tega_campaigns.program` after another.

    ``words`` go on its command line, ``environment`` beside this program's own; ``errors`` is the file that
    its error output is added to, ``None`` for this program's own.

    Attributes:
        lines: Output of the present one and those before it, oldest first.
        started_s: When the present one was started.
        memory: Resident memory of each process in turn, as (time, MiB).
    """

    def __init__(
        self,
        settings: Path,
        *words: str,
        errors: Path | None = None,
        environment: Mapping[str, str] | None = None,
    ) -> None:
        self._command = python_command("tega_campaigns.program", str(settings), *words)
        self._environment = python_environment({**os.environ, **(environment or {})})
        self._errors = None if errors is None else errors.open("ab")
        self._process: subprocess.Popen[str] | None = None
        self._reader: threading.Thread | None = None
        self.started_s = 0.0
        self.lines: list[SaidLine] = []
        self.memory: list[list[tuple[float, float]]] = []

    def __exit__(self, *_error: object) -> None:
        """End what still runs."""
        try:
            self.end()
        finally:
            if self._errors is not None:
                self._errors.close()

    @property
    def alive(self) -> bool:
        """Whether it runs."""
        return self._process is not None and self._process.poll() is None

    @property
    def newest(self) -> SaidLine:
        """The present process's newest line with the state and the alerts."""
        reported = (line for line in self.backwards(self.started_s) if "alerts" in line.said)
        return next(reported, SaidLine(0.0, {}))

    @property
    def now(self) -> dict[str, Any]:
        """What it does, by its latest report."""
        return self.newest.said

    @property
    def leads(self) -> bool:
        """Whether the arm follows, by the latest report."""
        return bool(self.now.get("arm", "").startswith("following"))

    def well(self, since_s: float = 0.0) -> bool:
        """Whether it runs, has reported since then, is active, and nothing but latency is wrong."""
        at_s, message = self.newest
        wrong = [alert for alert in message.get("alerts", ()) if not alert.startswith("latency")]
        return self.alive and at_s > since_s and message.get("state") == "active" and not wrong

    def backwards(self, since_s: float) -> Iterator[SaidLine]:
        """Return the lines since a moment, newest first."""
        return takewhile(lambda line: line.at_s >= since_s, reversed(self.lines))

    def since(self, at_s: float, key: str) -> list[tuple[float, Any]]:
        """Return what one thing became after a time, and when; what it was before stands first, at that time."""
        changes: list[tuple[float, Any]] = []
        for line in list(self.lines):
            if key not in line.said:
                continue
            if line.at_s <= at_s:
                changes = [(at_s, line.said[key])]
            elif not changes or changes[-1][1] != line.said[key]:
                changes.append((line.at_s, line.said[key]))
        return changes

    def has_said(self, words: str) -> float | None:
        """Return when it has printed something for a person, or ended with it; ``None`` if it has not."""
        return next(
            (
                line.at_s
                for line in list(self.lines)
                if any(words in str(line.said.get(key, "")) for key in ("said", "ended"))
            ),
            None,
        )

    def start(self) -> None:
        """Start it."""
        memory: list[tuple[float, float]] = []
        self.lines = self.lines[-_KEPT_LINES:]
        self.memory.append(memory)
        self.started_s = time.monotonic()
        self._process = subprocess.Popen(
            self._command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            text=True,
            env=self._environment,
        )
        self._reader = threading.Thread(
            target=self._receive, args=(self._process, self.lines, memory), daemon=True
        )
        self._reader.start()

    def notify(self, line: str) -> None:
        """Give it a line of its standard input."""
        if self._process is not None and self._process.stdin is not None:
            self._process.stdin.write(line + "\n")
            self._process.stdin.flush()

    def fill_disk(self, *, full: bool) -> None:
        """Let it and its recorder write no byte beyond what their files have, as on a full disk; or write again."""
        import resource  # which Windows has not

        if self._process is not None:
            for pid in filter(None, (self._process.pid, self.recorder_process())):
                hard = resource.prlimit(pid, resource.RLIMIT_FSIZE)[1]
                resource.prlimit(pid, resource.RLIMIT_FSIZE, (0 if full else hard, hard))

    def arm_process(self) -> int | None:
        """Return the number of the process that it has started for the arm; ``None`` if there is none."""
        return self._child("tega.devices.arm.robot.process")

    def recorder_process(self) -> int | None:
        """Return the number of the process that records for it; ``None`` if there is none."""
        return self._child("tega.recording.recorder_program")

    def _child(self, module: str) -> int | None:
        """Return the number of the process that it has started of a module; ``None`` if there is none."""
        if self._process is None:
            return None
        for folder in Path("/proc").glob("[0-9]*"):
            try:
                words = (folder / "cmdline").read_bytes().split(b"\0")
                parent = int((folder / "stat").read_text("ascii").rpartition(")")[2].split()[1])
            except (OSError, ValueError):  # it has ended meanwhile
                continue
            if parent == self._process.pid and module.encode() in words:
                return int(folder.name)
        return None

    def hold_up(self, *, on: bool) -> None:
        """Give it no time at all, as a machine that hangs, or time again."""
        if self._process is not None:
            self._process.send_signal(signal.SIGSTOP if on else signal.SIGCONT)

    def kill(self) -> int:
        """Kill it without a word and return the time of day, ns, just before."""
        at_ns = time.time_ns()
        if self._process is not None:
            self._process.kill()
        self.end()
        return at_ns

    def end(self) -> int:
        """Ask it to end, wait for that, and return its exit code; 0 where there is none."""
        process, self._process = self._process, None
        if process is None:
            return 0
        if process.poll() is None and os.name == "posix":
            process.send_signal(signal.SIGCONT)  # what is held up cannot end
        code = end_child(process, _LEAVE_S)
        if self._reader is not None:
            self._reader.join(_LEAVE_S)
        if process.stdout is not None:
            process.stdout.close()
        return code

    @staticmethod
    def _receive(
        process: subprocess.Popen[str], lines: list[SaidLine], memory: list[tuple[float, float]]
    ) -> None:
        if process.stdout is None:
            return
        for text in process.stdout:
            try:
                message = json.loads(text)
            except ValueError:  # the last line of a process that was killed
                continue
            lines.append(SaidLine(message["at_s"], message))
            if "rss_mib" in message:
                memory.append((message["at_s"], message["rss_mib"]))
