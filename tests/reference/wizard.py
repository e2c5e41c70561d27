"""A person at the calibration wizard: the command in a process of its own, its prompts answered line by line."""

from __future__ import annotations

import fcntl
import json
import os
import re
import signal
import struct
import subprocess
import sys
import termios
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO, Any, Self

import pytest

from reference.processes import in_terminal
from tega.ui.cli.main import main
from tega_emulators.process import Emulator

RESTING = 0.04
"""Effort of an emulated arm that lies still."""

Answer = Callable[[str], str | None]


class Wizard:
    """``tega-teleop …`` with pipes for a terminal.

    ``answer`` is given each prompt (``> …`` or ``? …``) and returns what to type, or ``None`` to go away; ``received``
    is given every line, to act on it.
    """

    def __init__(
        self, words: list[str], answer: Answer, received: Callable[[str], None] = lambda _line: None
    ) -> None:
        self.lines: list[str] = []
        self.out = ""
        self._answer, self._received = answer, received
        command, pipe = [sys.executable, "-m", "tega.ui.cli", *words], subprocess.PIPE
        self._process = subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=pipe, text=True, bufsize=1)

    def run(self, code: int = 0) -> Self:
        """Talk until it ends with this exit code."""
        with self._process as process:
            assert process.stdin is not None
            assert process.stdout is not None
            assert process.stderr is not None
            try:
                for line in process.stderr:
                    self._receive(line.rstrip("\n"), process.stdin)
                self.out = process.stdout.read()  # JSON, which a pipe holds until then
                assert process.wait(30) == code, self.said
            finally:  # a person who leaves in the middle takes the command along
                process.kill()
        return self

    def _receive(self, line: str, typed: IO[str]) -> None:
        self.lines.append(line)
        self._received(line)
        if line.startswith((">", "?")):
            message = self._answer(line)
            if message is None:
                typed.close()
            else:
                typed.write(message + "\n")
                typed.flush()

    @property
    def said(self) -> str:
        return "\n".join(self.lines)

    @property
    def reported(self) -> Any:
        return json.loads(self.out)

    def interrupt(self) -> None:
        self._process.send_signal(signal.SIGINT)

    def terminate(self) -> None:
        self._process.terminate()


class OnScreen:
    """``tega-teleop …`` on a pseudo-terminal: reads what is drawn, types what a person would.

    A single key is pressed once for each question that appears, as soon as it stands on the screen. ``answer`` is
    given each prompt as :class:`Wizard` has them.
    """

    def __init__(self, words: list[str], answer: Answer) -> None:
        self._words, self._answer = words, answer
        self._text = self.screen = ""
        self._requested = False
        self.n_keys = 0

    def run(self, limit_s: float) -> int:
        """Sit there until it ends; return its exit code, or -1 where there was nothing to do for so long."""
        with in_terminal(*self._words) as (process, keys, drawn):
            fcntl.ioctl(keys, termios.TIOCSWINSZ, struct.pack("4H", 40, 88, 0, 0))
            until_s, n_seen = time.monotonic() + limit_s, 0
            while time.monotonic() < until_s:
                code, n_keys, displayed = process.poll(), self.n_keys, drawn()
                self._check(displayed[n_seen:].decode("utf-8", "replace"), keys)
                if code is not None:
                    return code
                n_seen = len(displayed)
                if self.n_keys > n_keys:
                    until_s = time.monotonic() + limit_s
            return -1

    def _check(self, drawn: str, ours: int) -> None:
        self._text += drawn
        self.screen += drawn
        # What is drawn comes in panels, and one question that takes a line of its own.
        while found := re.search(r"╭.*?╯|Where\?.*?again", self._text, re.DOTALL):
            text = re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", found[0])
            self._text = self._text[found.end() :]
            typed = self._typed(" ".join(re.sub(r"[╭╮╰╯│─]", " ", text).split()))
            self.n_keys += len(typed)
            os.write(ours, typed.encode())

    def _typed(self, text: str) -> str:
        is_question, before = "again" in text, self._requested
        self._requested = is_question and "Where" not in text
        if "press Enter when ready" in text:
            return "\n"
        if not is_question or (self._requested and before):
            return ""
        message = self._answer(f"? {text}") or ""
        return message if self._requested else f"{message}\n"


def presses(command: Callable[[str], object], firmness: list[float], *, hold_s: float = 0.5) -> None:
    """Press and let go, so many times, on an emulated fingertip, from another thread."""

    def go() -> None:
        for firm in firmness:
            command(f"press {firm}")
            time.sleep(hold_s)
            command("press 0")
            time.sleep(0.35)

    threading.Thread(target=go, daemon=True).start()


class Mover:
    """Does with muscles what the wizard asks for, a fist as strong as said; channel k really sits on ``wired[k]``.

    ``kept`` answers what to do about a problem.
    """

    def __init__(
        self, board: Emulator, wired: tuple[int, ...] = (1, 2, 3), *, full: float = 1.0, kept: str = "q"
    ) -> None:
        self._board, self._wired, self._kept = board, wired, kept
        self.full = full

    def __call__(self, prompt: str) -> str:
        self._board.say(f"effort {self.full if 'fist' in prompt else RESTING}")
        for k, channel in enumerate(self._wired):
            if f"ch{k + 1} sits on" in prompt:
                self._board.say(f"effort 0.5 {channel}")
        return self._kept if prompt.startswith("?") else ""


def records(folder: Path) -> Iterator[str]:
    yield from sorted(f.relative_to(folder).as_posix() for f in folder.rglob("*") if f.is_file())


def lab(path: Path, *parts: str) -> Path:
    file = path / "lab.toml"
    file.write_text("\n".join(parts))
    return file


def teleop(*words: str) -> int:
    with pytest.raises(SystemExit) as done:
        main(list(words))
    code: int = done.value.code  # type: ignore[assignment]
    return code


def calibrate(file: Path, answer: Answer, *more: str, code: int = 0) -> Wizard:
    how = "--person", "p01", "--json", "--time-scale", "0.2", "--pause-s", "0"
    return Wizard(["calibrate", str(file), *how, *more], answer).run(code)
