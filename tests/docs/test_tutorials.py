"""Each tutorial runs as written."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from reference.page_blocks import blocks_of

PROJECT = Path(__file__).resolve().parents[2]

pytestmark = pytest.mark.skipif(not (PROJECT / "mkdocs.yml").is_file(), reason="not a checkout")

RUN = sorted([*(PROJECT / "docs/tutorials").glob("*.md"), PROJECT / "docs/start/without-hardware.md"])
MARKS = {"", "install", "background", "hardware"}
WAIT_S = 300


def start(text: str, folder: Path, environment: dict[str, str]) -> subprocess.Popen[str]:
    """Start what stays up, and wait for the settings file that it writes."""
    (words,) = [line.split() for line in text.splitlines() if line.strip()]
    written = folder / words[words.index("--out") + 1]
    stays = subprocess.Popen(words, cwd=folder, env=environment, text=True)
    for _ in range(10 * WAIT_S):
        assert stays.poll() is None, f"{text} ended with {stays.returncode}"
        if written.is_file():
            return stays
        time.sleep(0.1)
    raise AssertionError(f"{text} wrote no {written.name}")


@pytest.mark.slow
@pytest.mark.timeout(1200)
@pytest.mark.parametrize("page", RUN, ids=lambda p: p.stem)
def test_a_tutorial_runs_as_written(page: Path, tmp_path: Path) -> None:
    (tmp_path / "examples").symlink_to(PROJECT / "examples")
    environment = {**os.environ, "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}
    ups: list[subprocess.Popen[str]] = []
    n_ran = 0
    try:
        for block in blocks_of(page):
            assert block.mark in MARKS
            if block.title:
                (tmp_path / block.title).write_text(block.text, encoding="utf-8")
            elif block.language == "python":
                subprocess.run([sys.executable, "-c", block.text], cwd=tmp_path, check=True, timeout=WAIT_S)
            elif block.language == "sh" and block.mark == "background":
                ups.append(start(block.text, tmp_path, environment))
            elif block.language == "sh" and not block.mark:
                for line in filter(None, block.text.splitlines()):
                    done = subprocess.run(
                        line,
                        shell=True,
                        cwd=tmp_path,
                        env=environment,
                        capture_output=True,
                        text=True,
                        check=False,
                        timeout=WAIT_S,
                        stdin=subprocess.DEVNULL,
                    )
                    assert done.returncode == 0, f"{line}\n{done.stdout}\n{done.stderr}"
                    assert "Traceback" not in done.stderr
                    n_ran += 1
    finally:
        for up in ups:
            up.send_signal(signal.SIGINT)
        for up in ups:
            up.wait(timeout=60)
    assert n_ran > 0
