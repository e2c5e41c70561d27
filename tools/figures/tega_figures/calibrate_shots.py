"""Record in a terminal how emulated muscles are calibrated: ``python -m tega_figures.calibrate_shots FILE.webp``.

The command runs on a pseudo-terminal beside an emulated EMG board, whose muscles do what each prompt asks for. Nothing
of it is hurried but the pause between squeezes; the animation goes twice as fast.
"""

from __future__ import annotations

import codecs
import fcntl
import io
import os
import pty
import re
import select
import struct
import subprocess
import sys
import tempfile
import termios
import time
from itertools import pairwise
from pathlib import Path
from typing import Any, Final, NamedTuple

from PIL import Image

from tega_emulators.process import Emulator
from tega_figures.chromium import launched
from tega_figures.terminal_shots import drawn

__all__ = ["DrawnTerminal", "main"]

_COLUMNS, _ROWS = 88, 24
_FRAME_S, _FAST_FORWARD, _LIMIT_S = 0.25, 2, 180.0
# Whoever reads a prompt needs a moment.
_READING_S = 1.0
_WIDTH_PX, _QUALITY, _END_MS = 900, 60, 4000
WORDS: Final = ("calibrate", "lab.toml", "--person", "p01", "--only", "emg", "--pause-s", "2")
_SETTINGS: Final = 'emg = { driver = "cyton", kind = "raw", options = { port = "%s" } }\n'
# What a prompt asks of the muscles, as shares of full effort.
_REST, _STRONG, _HALF = 0.02, 0.9, 0.5
_TOKEN: Final = re.compile(r"\x1b\[([?\d;]*)([A-Za-z])|\n|[^\x1b\n\r]+")
_CUT: Final = re.compile(r"\x1b(?:\[[?\d;]*)?$")
_LET_GO: Final = r"let go|raises its own|rest: ch1"


class DrawnTerminal:
    """Keeps the lines on a terminal, as far as Rich needs one: it erases lines before it writes them.

    ``lines`` are from the top, with their colours.
    """

    def __init__(self) -> None:
        self.lines = [""]
        self._at = 0
        self._cut = ""

    def take(self, text: str) -> None:
        """Carry out what is written to the terminal; an order that is cut off waits for the rest of it."""
        text = self._cut + text
        whole = _CUT.sub("", text)
        text, self._cut = whole, text[len(whole) :]
        for found in _TOKEN.finditer(text):
            count, order = found.groups()
            if found[0] == "\n":
                self._at += 1
                self.lines += [""] * (self._at == len(self.lines))
            elif order == "A":
                self._at = max(0, self._at - int(count or 1))
            elif order == "K":
                self.lines[self._at] = ""
            elif order in {None, "m"}:
                self.lines[self._at] += found[0]


class Shown(NamedTuple):
    """The screen at one moment: seconds since the beginning, and its lines."""

    t_s: float
    lines: tuple[str, ...]


def recorded(folder: Path, board: Emulator) -> list[Shown]:
    """Calibrate on a pseudo-terminal, and return what stood on it, four times a second."""
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("4H", _ROWS, _COLUMNS, 0, 0))
    process = subprocess.Popen(
        [sys.executable, "-m", "tega.ui.cli", *WORDS],
        cwd=folder,
        stdin=theirs,
        stdout=theirs,
        stderr=theirs,
        env={**os.environ, "TERM": "xterm-256color"},
    )
    os.close(theirs)
    screen, kept, began_s, unread = DrawnTerminal(), list[Shown](), time.monotonic(), ""
    decoder = codecs.getincrementaldecoder("utf-8")("replace")
    try:
        while (t_s := time.monotonic() - began_s) < _LIMIT_S:
            if select.select([ours], [], [], _FRAME_S / 4)[0]:
                try:
                    new = decoder.decode(os.read(ours, 65536))
                except OSError:  # the command has ended
                    break
                screen.take(new)
                unread = _answered(unread + new, ours, board)
            if not kept or t_s - kept[-1].t_s >= _FRAME_S:
                kept.append(Shown(t_s, tuple(screen.lines)))
        else:
            raise SystemExit("\n".join(["the calibration did not end:", *screen.lines]))
        if process.wait(30):
            raise SystemExit("\n".join(screen.lines))
    finally:
        process.kill()
        process.wait()
        os.close(ours)
    return [*kept, Shown(time.monotonic() - began_s, tuple(screen.lines))]


def _answered(unread: str, ours: int, board: Emulator) -> str:
    """Move the muscles as the newest prompt asks, press Enter, and return what is still to be read."""
    plain = re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]|[╭╮╰╯│─\s]+", " ", unread)
    if "press Enter when ready" not in plain:
        if not re.search(_LET_GO, plain):
            return unread[-4000:]
        board.say(f"effort {_REST}")
        return ""
    board.say(f"effort {_REST}")
    if re.search(r"Squeeze \d of \d", plain):
        board.say(f"effort {_STRONG}")
    elif found := re.search(r"ch(\d) sits on", plain):
        board.say(f"effort {_HALF} {found[1]}")
    time.sleep(_READING_S)
    os.write(ours, b"\n")
    return ""


def frames(displayed: list[Shown]) -> list[Image.Image]:
    """Draw each moment as a terminal, the newest lines at the bottom."""
    pictures = []
    with launched() as browser:
        page: Any = browser.new_page(viewport={"width": _WIDTH_PX, "height": 100})
        for snapshot in displayed:
            lines = [*snapshot.lines][-_ROWS:]
            svg = drawn(["tega-teleop", *WORDS], lines, width=_COLUMNS, n_lines=_ROWS, name="calibrate")
            page.set_content(f'<body style="margin:0">{svg}')
            taken = page.locator("svg").screenshot()
            pictures.append(Image.open(io.BytesIO(taken)).convert("RGB"))
    return pictures


def main(file: Path) -> None:
    """Write the animation."""
    with tempfile.TemporaryDirectory() as made, Emulator("cyton", "--signal", "emg") as board:
        board.go_ahead()
        Path(made, "lab.toml").write_text(_SETTINGS % board.port, encoding="utf-8")
        displayed = recorded(Path(made), board)
    first, *others = frames(displayed)
    times_s = [snapshot.t_s for snapshot in displayed]
    lasts_ms = [round(1000 * (b - a) / _FAST_FORWARD) for a, b in pairwise(times_s)]
    first.save(
        file,
        save_all=True,
        append_images=others,
        duration=[*lasts_ms, _END_MS],
        loop=0,
        quality=_QUALITY,
        method=3,
    )


if __name__ == "__main__":
    main(Path(sys.argv[1]).resolve())
