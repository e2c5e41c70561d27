"""A person at the calibration wizard: the command in a process of its own, its prompts read and answered line by line."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

__all__ = ["Wizard"]

Answer = Callable[[str], str | None]


class Wizard:
    """``tega-teleop …`` with pipes for a terminal.

    Args:
        words: The command's words.
        answer: Given each prompt (``> …`` or ``? …``); returns what to type, or ``None`` to go away.
        heard: Given every line, to act on it.
    """

    def __init__(
        self, words: list[str], answer: Answer, heard: Callable[[str], None] = lambda _line: None
    ) -> None:
        self.lines: list[str] = []
        self._answer = answer
        self._heard = heard
        command = [sys.executable, "-m", "tega.cli", *words]
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            bufsize=1,
        )

    def run(self) -> int:
        """Talk until it ends; return its exit code."""
        process = self._process
        out: list[str] = []
        reader = threading.Thread(target=lambda: out.extend(process.stdout or []))
        reader.start()
        assert process.stderr is not None
        assert process.stdin is not None
        for line in process.stderr:
            text = line.rstrip("\n")
            self.lines.append(text)
            self._heard(text)
            if text.startswith((">", "?")):
                said = self._answer(text)
                if said is None:
                    process.stdin.close()
                else:
                    process.stdin.write(said + "\n")
                    process.stdin.flush()
        code = process.wait(30)
        reader.join()
        if not process.stdin.closed:
            process.stdin.close()
        process.stderr.close()
        if process.stdout is not None:
            process.stdout.close()
        self.out = "".join(out)
        return code

    @property
    def said(self) -> str:
        """Everything it said so far."""
        return "\n".join(self.lines)

    @property
    def told(self) -> Any:
        """What it printed on stdout, as JSON."""
        return json.loads(self.out)

    def interrupt(self) -> None:
        """Press Ctrl-C."""
        self._process.send_signal(signal.SIGINT)

    def terminate(self) -> None:
        """Ask it to end, as a service manager does."""
        self._process.terminate()


def presses(command: Callable[[str], None], firmness: list[float], *, hold_s: float = 0.6) -> None:
    """Press and let go, so many times, on an emulated fingertip, from another thread."""

    def go() -> None:
        for firm in firmness:
            command(f"press {firm}")
            time.sleep(hold_s)
            command("press 0")
            time.sleep(0.5)

    threading.Thread(target=go, daemon=True).start()


def settings(path: Path, **parts: str) -> Path:
    """Write a settings file of some parts and return its path."""
    path.write_text("\n".join(parts.values()))
    return path


def records(folder: Path) -> Iterator[str]:
    """Name every file under a folder."""
    yield from sorted(f.relative_to(folder).as_posix() for f in folder.rglob("*") if f.is_file())
