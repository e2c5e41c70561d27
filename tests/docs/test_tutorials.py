"""What a page tells its reader to type: every option exists, and each tutorial runs as written."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
import tomllib
from pathlib import Path

import click
import pytest

from reference.page_blocks import blocks_of, commands_of
from tega.ui.cli.main import cli

PROJECT = Path(__file__).resolve().parents[2]

pytestmark = pytest.mark.skipif(not (PROJECT / "mkdocs.yml").is_file(), reason="not a checkout")

RUN = sorted([*(PROJECT / "docs/tutorials").glob("*.md"), PROJECT / "docs/start/without-hardware.md"])
SHOWN = [PROJECT / "README.md", *sorted((PROJECT / "docs").rglob("*.md"))]
MARKS = {"", "install", "background", "hardware"}
WAIT_S = 300


@pytest.mark.parametrize("page", SHOWN, ids=lambda p: p.stem)
def test_every_option_that_a_page_shows_exists(page: Path) -> None:
    for words in commands_of(page):
        command: click.Command = cli
        for word in words:
            if not isinstance(command, click.Group):
                break
            if word.startswith("-"):
                continue
            inner = command.get_command(click.Context(command), word)
            if inner is None:
                assert command is not cli or not re.fullmatch(r"[a-z][a-z-]*", word), f"no verb {word}"
                break
            command = inner
        known = {o for c in (cli, command) for p in c.params for o in (*p.opts, *p.secondary_opts)}
        known |= {"-h", "--help"}
        for word in words:
            if re.fullmatch(r"--[a-z][a-z-]*", word):
                assert word in known, f"{page.name}: {' '.join(words)} has no option {word}"


@pytest.mark.parametrize("page", SHOWN, ids=lambda p: p.stem)
def test_every_extra_that_a_page_installs_exists(page: Path) -> None:
    project = tomllib.loads((PROJECT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    for place, extras in re.findall(
        r"pip install (?:-e )?'([\w.]+)\[([\w,-]+)\]'", page.read_text(encoding="utf-8")
    ):
        assert place == ".", f"{page.name}: there is no package {place} on an index; install '.[{extras}]'"
        assert set(extras.split(",")) <= set(project["optional-dependencies"])


def test_no_two_tutorials_write_the_same_name() -> None:
    """Nothing is written over, so a reader who types a second tutorial in the same folder would be stopped."""
    written: dict[str, set[str]] = {"results": {"what a run writes where nothing else is said"}}
    for page in (*RUN, PROJECT / "docs/replay.md"):
        text = "\n".join(
            b.text for b in blocks_of(page) if b.mark in {"", "background"} and b.language != "python"
        )
        for name in re.findall(r"""(?:--out |--record |out_dir ?= ?"?)([\w.-]+)""", text):
            # The emulated bench keeps what it needs in a folder of the settings' name.
            written.setdefault(name.removesuffix(".toml"), set()).add(page.stem)
    assert {name: pages for name, pages in written.items() if len(pages) > 1} == {}


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
