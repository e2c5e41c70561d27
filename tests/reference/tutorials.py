"""The pages that a reader types along with, and what runs such a page from its first command to its last."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from contextlib import ExitStack
from pathlib import Path
from typing import Final

from reference.installed import program
from reference.page_blocks import blocks_of
from reference.processes import until

PROJECT: Final = Path(__file__).resolve().parents[2]
DOCS: Final = PROJECT / "docs"
TUTORIALS: Final = sorted([*(DOCS / "tutorials").glob("*.md"), DOCS / "start/without-hardware.md"])
REHEARSAL: Final = DOCS / "tutorials/rehearse-a-study.md"
_MARKS: Final = {"", "install", "background", "hardware"}


def _start(text: str, folder: Path, environment: dict[str, str]) -> subprocess.Popen[str]:
    """Start what stays up, and wait for the settings file that it writes."""
    (words,) = [line.split() for line in text.splitlines() if line.strip()]
    written = folder / words[words.index("--out") + 1]
    stays = subprocess.Popen(words, cwd=folder, env=environment, text=True)
    until(lambda: written.is_file() or stays.poll() is not None)
    assert stays.poll() is None, f"{text} ended with {stays.returncode}"
    return stays


def _end(stays: subprocess.Popen[str]) -> None:
    stays.send_signal(signal.SIGINT)
    stays.wait(timeout=60)


def run_tutorial(page: Path, folder: Path) -> None:
    """Run a page's commands and Python in a folder, but for those that install something or need a device."""
    (folder / "examples").symlink_to(PROJECT / "examples")
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    environment, n_ran = os.environ | {"PATH": path}, 0
    with ExitStack() as stack:
        for block in blocks_of(page):
            assert block.mark in _MARKS
            if block.title:
                (folder / block.title).write_text(block.text, encoding="utf-8")
            elif block.language == "python":
                program(sys.executable, "-c", block.text, folder=folder)
            elif block.language == "sh" and block.mark == "background":
                stack.callback(_end, _start(block.text, folder, environment))
            elif block.language == "sh" and not block.mark:
                for line in filter(None, block.text.splitlines()):
                    done = program("sh", "-c", line, folder=folder, env=environment)
                    assert "Traceback" not in done.stderr
                    n_ran += 1
    assert n_ran > 0
