"""A person at the calibration wizard: the command in a process of its own, its prompts answered line by line."""

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

from tega.calibration.wearing import SITES, site_motors
from tega.testing.emulators.vests import EmulatedVest

__all__ = ["Wearer", "Wizard", "presses", "records"]

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
        self.code: int | None = None
        self.out = ""
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
        self.code = code = process.wait(30)
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


def presses(command: Callable[[str], None], firmness: list[float], *, hold_s: float = 0.5) -> None:
    """Press and let go, so many times, on an emulated fingertip, from another thread."""

    def go() -> None:
        for firm in firmness:
            command(f"press {firm}")
            time.sleep(hold_s)
            command("press 0")
            time.sleep(0.35)

    threading.Thread(target=go, daemon=True).start()


def records(folder: Path) -> Iterator[str]:
    """Name every file under a folder."""
    yield from sorted(f.relative_to(folder).as_posix() for f in folder.rglob("*") if f.is_file())


class Wearer:
    """Answers the vest's questions from what the emulated motors really did.

    Args:
        peer: The emulated vest.
        threshold: The lowest percent that is felt, by column.
        step: The smallest increase in percent that is noticed.
        mirrored: Whether the back is felt mirrored.
    """

    def __init__(
        self, peer: EmulatedVest, threshold: dict[str, int], *, step: int = 13, mirrored: bool = False
    ) -> None:
        self._peer = peer
        self._threshold = threshold
        self._step = step
        self._mirrored = mirrored
        self._n_seen = len(peer.report().history)
        self.asked: list[str] = []
        self.loudest = 0

    def __call__(self, prompt: str) -> str | None:
        """Answer one prompt."""
        if prompt.startswith(">"):
            return ""
        bursts = self._bursts()
        self.asked += [site for site, _ in bursts[:1]]
        if "Where" in prompt:
            ((site, _),) = bursts
            return f"b{5 - int(site[1])}" if self._mirrored and site[0] == "b" else site
        if "Felt" in prompt:
            return "y" if bursts and bursts[0][1] >= self._threshold[bursts[0][0]] else "n"
        if "stronger" in prompt:
            (_, first), (_, second) = bursts
            return "s" if abs(first - second) < self._step else "12"[second > first]
        return "q"

    def _bursts(self) -> list[tuple[str, int]]:
        """What vibrated since the last question: column and percent, one each."""
        history = self._peer.report().history
        new, self._n_seen = history[self._n_seen :], len(history)
        bursts: list[tuple[str, int]] = []
        dark = True
        for _, motors in new:
            lit = {k for k, v in enumerate(motors) if v}
            self.loudest = max(self.loudest, *motors)
            if lit and dark:
                (site,) = [s for s in SITES if lit == set(site_motors(s))]
                bursts.append((site, max(motors)))
            dark = not lit
        return bursts
