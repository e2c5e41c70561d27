"""Picture the screens of a Fitts test, terminal and page: ``python -m tega_figures.fitts_shots docs/images``.

An emulated EMG board stands for the muscles: somebody is calibrated on it, and then does the test, with an effort that
follows the target shown.
"""

from __future__ import annotations

import fcntl
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
from pathlib import Path
from typing import Final

from tega_emulators.process import Emulator
from tega_figures.calibrate_shots import DrawnTerminal, recorded
from tega_figures.chromium import launched, opened
from tega_figures.terminal_shots import drawn

__all__ = ["main"]

_SETTINGS: Final = 'emg = { driver = "cyton", kind = "raw", options = { port = "%s" } }\n'
_WORDS: Final = ("emg", "fitts", "lab.toml", "--person", "p01", "--set", "stages.decoder.name=proportional")
_TARGET: Final = re.compile(r"(\d\.\d) ± \d\.\d\d level")
_COLUMNS, _ROWS = 88, 12
_WIDTH_PX, _HEIGHT_PX = 940, 470
_LIMIT_S = 120.0
# Share of full effort at rest's end of the decoder's range, and over it; the board's full effort is 0.9.
_DEAD_BAND, _SPAN, _FULL = 0.1, 0.7, 0.9
_NEARLY = 0.8


def _squeeze(board: Emulator, said: str) -> None:
    """Work nearly as hard as the target that a screen shows asks for: the cursor is seen on its way."""
    if found := _TARGET.search(said):
        closure = (float(found[1]) - 1) / 4
        board.say(f"effort {_FULL * _NEARLY * (_DEAD_BAND + _SPAN * closure):.3f}")


def terminal(folder: Path, board: Emulator, picture: Path) -> None:
    """Do the test on a pseudo-terminal, and write the screen of its fourth target as SVG."""
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("4H", _ROWS, _COLUMNS, 0, 0))
    process = subprocess.Popen(
        [sys.executable, "-m", "tega.ui.cli", *_WORDS, "--yes"],
        cwd=folder,
        stdin=theirs,
        stdout=theirs,
        stderr=theirs,
        env={**os.environ, "TERM": "xterm-256color"},
    )
    os.close(theirs)
    screen, targets, end_s = DrawnTerminal(), list[str](), time.monotonic() + _LIMIT_S
    try:
        while time.monotonic() < end_s:
            if not select.select([ours], [], [], 0.1)[0]:
                continue
            screen.take(os.read(ours, 65536).decode(errors="replace"))
            shown = "\n".join(screen.lines)
            _squeeze(board, shown)
            if (found := _TARGET.search(shown)) and found[0] not in targets[-1:]:
                targets.append(found[0])
                since_s = time.monotonic()
            if len(targets) >= 4 and time.monotonic() - since_s > 1.0:
                lines = [line for line in screen.lines if line.strip()][-_ROWS:]
                svg = drawn(["tega-teleop", *_WORDS], lines, width=_COLUMNS, name="fitts-terminal")
                picture.write_text(svg, encoding="utf-8")
                return
        raise SystemExit("\n".join(["the test showed no fourth target:", *screen.lines]))
    finally:
        process.kill()
        process.wait()
        os.close(ours)


def page(folder: Path, board: Emulator, picture: Path) -> None:
    """Do the test on the page, and write what it shows of its first target as PNG."""
    process = subprocess.Popen(
        [sys.executable, "-m", "tega.ui.cli", *_WORDS, "--view", "--view-port", "0"],
        cwd=folder,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stderr is not None
    try:
        address = next(line for line in process.stderr if line.startswith("http"))
        with (
            launched() as browser,
            opened(browser, address.strip(), width_px=_WIDTH_PX, height_px=_HEIGHT_PX) as shown,
        ):
            shown.get_by_role("button", name="Ready").click()
            target = shown.get_by_text(_TARGET)
            target.wait_for()
            _squeeze(board, target.inner_text())
            time.sleep(1.5)
            shown.screenshot(path=picture)
    finally:
        process.kill()
        process.wait()


def main(folder: Path) -> None:
    """Write both pictures."""
    with tempfile.TemporaryDirectory() as made, Emulator("cyton", "--signal", "emg") as board:
        board.go_ahead()
        Path(made, "lab.toml").write_text(_SETTINGS % board.port, encoding="utf-8")
        recorded(Path(made), board)
        page(Path(made), board, folder / "fitts-page.png")
        terminal(Path(made), board, folder / "fitts-terminal.svg")


if __name__ == "__main__":
    main(Path(sys.argv[1]).resolve())
