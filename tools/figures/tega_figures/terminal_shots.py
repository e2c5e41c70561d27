"""Picture what verbs print in a terminal, as SVG: ``python -m tega_figures.terminal_shots docs/images``.

The commands run in a folder of their own: settings of the examples, and emulated devices for `doctor` and `inspect`.
"""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Final

from rich.console import Console
from rich.text import Text

__all__ = ["drawn", "main", "picture"]

PROJECT: Final = Path(__file__).resolve().parents[3]
TEGA: Final = (sys.executable, "-m", "tega.ui.cli")
WAIT_S: Final = 180
_LEAST_COLUMNS = 90


def picture(words: list[str], message: str, path: Path, *, most_lines: int = 34) -> None:
    """Write a command, as a reader types it, and what it printed, with its colours, as an SVG file.

    At most ``most_lines`` of it are shown.
    """
    lines = message.rstrip().splitlines()
    displayed = [*lines[:most_lines], *(["…"] if len(lines) > most_lines else [])]
    widest = max(len(Text.from_ansi(line).plain) for line in [*displayed, "$ " + " ".join(words)])
    # An empty line at the end, since the last one is drawn cut; wide enough that no browser blows letters up.
    svg = drawn(words, [*displayed, ""], width=min(118, max(_LEAST_COLUMNS, widest + 2)), name=path.stem)
    path.write_text(svg, encoding="utf-8")


def drawn(words: list[str], lines: list[str], *, width: int, name: str, n_lines: int = 0) -> str:
    """Return a terminal as SVG: a command, as a reader types it, and the lines below it, with their colours.

    ``width`` is of the terminal, characters; ids begin with ``name``; ``n_lines`` is the height below the
    command, where the lines are fewer.
    """
    with Path(os.devnull).open("w", encoding="utf-8") as nowhere:
        console = Console(record=True, width=width, file=nowhere, force_terminal=True)
        console.print(Text("$ " + " ".join(words), style="bold"))
        for line in [*lines, *[""] * (n_lines - len(lines))]:
            console.print(Text.from_ansi(line), no_wrap=True, overflow="ellipsis")
        svg = console.export_svg(title="terminal", unique_id=name)
    return re.sub(r"\s*@font-face \{.*?\}", "", svg, flags=re.DOTALL)


def _run(words: list[str], folder: Path) -> str:
    environment = {**os.environ, "FORCE_COLOR": "1", "COLUMNS": "116"}
    done = subprocess.run(
        [*TEGA, *words[1:]],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
        timeout=WAIT_S,
    )
    if done.returncode:
        raise SystemExit(f"{' '.join(words)}: {done.stderr}")
    here = str(folder) + os.sep
    return re.sub(re.escape(here) + r"(\S+)", lambda match: match[1] + " " * len(here), done.stdout)


def _settings(folder: Path, images: Path) -> None:
    shutil.copy(PROJECT / "examples/simulated.toml", folder)
    words = ["tega-teleop", "config", "show", "simulated.toml", "--set", "session.preset=paper"]
    picture(words, _run(words, folder), images / "config-show.svg", most_lines=26)


def _bench(folder: Path, images: Path) -> None:
    up = subprocess.Popen(
        [*TEGA, "init", "--emulated", "--out", "lab.toml"], cwd=folder, stdout=subprocess.DEVNULL
    )
    try:
        deadline_s = time.monotonic() + WAIT_S
        while not (folder / "lab.toml").is_file() and time.monotonic() < deadline_s:
            time.sleep(0.2)
        words = ["tega-teleop", "doctor", "lab.toml"]
        picture(words, _run(words, folder), images / "doctor-emulated.svg")
        _run(
            ["tega-teleop", "run", "lab.toml", "--set", "session.duration_s=5", "--record", "monday"], folder
        )
        words = ["tega-teleop", "recording", "inspect", "monday"]
        picture(words, _run(words, folder), images / "inspect.svg")
    finally:
        up.send_signal(signal.SIGINT)
        up.wait(timeout=60)


def main(images: Path) -> None:
    """Write every picture into a folder."""
    with tempfile.TemporaryDirectory() as made:
        _settings(Path(made), images)
        _bench(Path(made), images)


if __name__ == "__main__":
    main(Path(sys.argv[1]).resolve())
