"""Walk a newcomer's first hour: every command as the docs print it, timed, with pictures.

``python -m tega_figures.strangers_path walk FOLDER OUT`` walks in a fresh clone, or in a folder with the wheels of
``make wheels`` and the examples, and keeps times and pictures in a folder. ``… page CLONE WHEEL docs`` writes both
into ``docs/evidence/index.md``. TEGA_DATA names the real recordings; Chromium has to be there.
"""

from __future__ import annotations

import io
import json
import os
import platform
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, Final, NamedTuple

from PIL import Image

from reference.page_blocks import blocks_of
from tega_figures.chromium import launched, opened
from tega_figures.terminal_shots import picture

__all__ = ["PARTS", "SHOTS", "WHEEL_SHOTS", "Part", "PathStep", "Walk", "commands", "main", "page"]

PROJECT: Final = Path(__file__).resolve().parents[3]
LIMIT_S: Final = 3600.0


class Part(NamedTuple):
    """One thing that a newcomer does: a page, and which of its commands (a pattern)."""

    title: str
    page: str
    lines: str


PARTS: Final = (
    Part("The demo", "README.md", r"pip install '\.\[sim,view\]'"),
    Part("Ten steps without hardware", "docs/start/without-hardware.md", ""),
    Part("The page in the browser", "docs/view.md", r"demo --view"),
    Part("Replay of real recordings", "docs/replay.md", r"replay --tactile"),
    Part("Calibration and a study of two people", "docs/tutorials/rehearse-a-study.md", ""),
    Part("Add a device", "docs/own-device.md", r"my_device$|devices$|own-emg own-vest$"),
)
REAL: Final = {
    "presses": "digit/digit_ball_D20641",
    "squeezes.mat": "emg/my_thesis/recording_force_v1.mat",
    "grip_0.avi": "digit/gsmini_seq/wooden_statue_1_camera_0.avi",
    "grip_2.avi": "digit/gsmini_seq/wooden_statue_1_camera_2.avi",
}
"""Real recordings by the names that the page on replay gives to the reader's own."""

SHOTS: Final = {
    "stranger-demo.svg": "tega-teleop demo$",
    "stranger-calibrate.svg": "calibrate bench.toml --person p01",
    "stranger-status.svg": "study status",
    "stranger-device.svg": "tega.setup.contract own-emg own-vest$",
}
"""Terminals that are kept, by a pattern of the command; the page, replay and report are pictures of their own."""

_PAGE_SHOT, _REPLAY_SHOT, _REPORT_SHOT = "stranger-page.webp", "stranger-replay.webp", "stranger-report.webp"
WHEEL_SHOTS: Final = {
    "stranger-demo.svg": "stranger-wheel-demo.svg",
    _PAGE_SHOT: "stranger-wheel-page.webp",
    _REPORT_SHOT: "stranger-wheel-report.webp",
}
"""What a picture of the walk from the wheels is called, where it is kept."""

_BEGIN, _END = "<!-- walk: begin -->", "<!-- walk: end -->"


class PathStep(NamedTuple):
    """One command that was typed."""

    part: str
    command: str
    seconds: float
    code: int


def commands(part: Part, root: Path) -> list[tuple[bool, str]]:
    """Return the commands of a part as its page prints them, each with whether it stays up beside the others."""
    found = []
    for block in blocks_of(root / part.page):
        if block.language != "sh" or block.mark == "hardware":
            continue
        for line in re.sub(r"\s*\\\n\s*", " ", block.text).splitlines():
            typed = re.sub(r"\s+#.*$", "", line).strip()
            if typed and re.search(part.lines, typed):
                found += [(block.mark == "background", command) for command in typed.split(" && ")]
    return found


class Walk:
    """Types the commands of the pages in a folder, as one person in one terminal.

    Args:
        folder: A clone, or a folder with wheels.
        out: Where pictures go.
    """

    def __init__(self, folder: Path, out: Path) -> None:
        self.steps: list[PathStep] = []
        self._folder, self._out = folder, out
        self._before: list[str] = []
        self._is_clone = (folder / "pyproject.toml").is_file()
        environment = {k: v for k, v in os.environ.items() if k not in {"PYTHONPATH", "VIRTUAL_ENV"}}
        self._environment = {**environment, "COLUMNS": "116"}

    def walk(self, part: Part) -> None:
        """Type what a page says, and end afterwards what it left running."""
        source = self._folder if self._is_clone else PROJECT
        with ExitStack() as running:
            for stays_up, typed in commands(part, source):
                if stays_up:
                    running.enter_context(self._beside(part, typed))
                elif "--view" in typed:
                    with self._beside(part, typed) as up:
                        self._look(up)
                else:
                    self._type(part, typed)

    def _line(self, command: str) -> str:
        """Return a command with what was switched on before it; from wheels, with their names for the checkout's."""
        if not self._is_clone:
            names = (f"tega-*{platform.machine()}.whl", "tega_emulators-*.whl")
            wheel, emulators = (next(self._folder.glob(name)).name for name in names)
            command = re.sub(r"'\.\[", f"'./{wheel}[", command).replace("./tools/emulators", f"./{emulators}")
        return "; ".join([*self._before, command])

    def _type(self, part: Part, command: str) -> None:
        if command.startswith(". "):
            self._before.append(command)
        began_s = time.monotonic()
        done = subprocess.run(
            ["bash", "-c", self._line(command)],
            cwd=self._folder,
            env=self._environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            check=False,
            timeout=LIMIT_S,
        )
        self._keep(PathStep(part.title, command, time.monotonic() - began_s, done.returncode), done.stdout)

    def _keep(self, step: PathStep, said: str) -> None:
        self.steps.append(step)
        (self._out / f"{len(self.steps):02}.txt").write_text(f"$ {step.command}\n{said}", encoding="utf-8")
        print(f"{step.seconds:7.1f} s, code {step.code}: {step.command}", flush=True)
        said = said.replace(str(self._folder) + os.sep, "").replace(str(self._folder), ".")
        for name, pattern in SHOTS.items():
            if re.search(pattern, step.command):
                picture(step.command.removeprefix(".venv/bin/").split(), said, self._out / name)

    @contextmanager
    def _beside(self, part: Part, command: str) -> Iterator[subprocess.Popen[str]]:
        """Start what stays up, wait until it says or writes what the next command needs, and end it by Ctrl-C."""
        words, began_s, began_at_s = command.split(), time.monotonic(), time.time()
        written = self._folder / words[words.index("--out") + 1] if "--out" in words else None
        up = subprocess.Popen(
            ["bash", "-c", self._line(f"exec {command}")],
            cwd=self._folder,
            env=self._environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE if written is None else subprocess.DEVNULL,
            text=True,
            start_new_session=True,
        )
        try:
            while written is not None and up.poll() is None:
                if written.is_file() and written.stat().st_mtime >= began_at_s:
                    break
                time.sleep(0.1)
            self._keep(PathStep(part.title, command, time.monotonic() - began_s, up.poll() or 0), "")
            yield up
        finally:
            if up.poll() is None:
                os.killpg(up.pid, signal.SIGINT)
            up.wait(60)

    def _look(self, up: subprocess.Popen[str]) -> None:
        """Take a picture of the page while an object is held up; say so where there is none to take."""
        from playwright.sync_api import Error

        assert up.stderr is not None
        url = next((found[0] for line in up.stderr if (found := re.search(r"http://\S+", line))), "")
        try:
            with launched() as browser, opened(browser, url) as shown:
                shown.get_by_text("hold", exact=True).first.wait_for()
                shown.wait_for_timeout(2_000)
                _shrunk(shown.screenshot(), self._out / _PAGE_SHOT)
        except Error as error:
            print(f"no picture of the page: {error}", flush=True)

    def look_back(self) -> None:
        """Keep the picture that replay left, and the top of the study's report."""
        _shrunk((self._folder / "pressed/picture.png").read_bytes(), self._out / _REPLAY_SHOT)
        with launched() as browser:
            shown: Any = browser.new_page(viewport={"width": 892, "height": 1000})
            shown.goto((self._folder / "two-people/report.html").resolve().as_uri())
            _shrunk(shown.screenshot(), self._out / _REPORT_SHOT)


def _shrunk(image: bytes, path: Path) -> None:
    Image.open(io.BytesIO(image)).convert("RGB").save(path, quality=85, method=6)


def walk(folder: Path, out: Path) -> None:
    """Walk every part in a folder; keep times, what was printed, and pictures in another."""
    out.mkdir(parents=True, exist_ok=True)
    for name, source in REAL.items():
        (folder / name).unlink(missing_ok=True)
        (folder / name).symlink_to(Path(os.environ["TEGA_DATA"]) / source)
    walked = Walk(folder.resolve(), out)
    try:
        for part in PARTS:
            walked.walk(part)
        walked.look_back()
    finally:
        (out / "walk.json").write_text(json.dumps([s._asdict() for s in walked.steps], indent=1))


def table(steps: list[PathStep]) -> list[str]:
    """Return a row for each part: its page, how many commands, how long, and what did not end with 0."""
    rows = ["| what | page | commands | minutes | longest | failed |", "|---|---|---|---|---|---|"]
    for part in PARTS:
        own = [step for step in steps if step.part == part.title]
        if not own:
            continue
        longest = max(own, key=lambda step: step.seconds)
        failed = ", ".join(f"`{s.command}` ({s.code})" for s in own if s.code) or "none"
        rows.append(
            f"| {part.title} | `{part.page}` | {len(own)} | {sum(s.seconds for s in own) / 60:.1f} "
            f"| `{longest.command}`: {longest.seconds:.0f} s | {failed} |"
        )
    minutes, n_failed = sum(step.seconds for step in steps) / 60, sum(step.code != 0 for step in steps)
    rows.append(f"| together | | {len(steps)} | {minutes:.1f} | | {n_failed} |")
    return rows


def page(clone: Path, wheel: Path, docs: Path) -> None:
    """Write both walks into the page, and their pictures beside it."""
    told = []
    for title, out in (("From a clone", clone), ("From the wheel", wheel)):
        steps = [PathStep(**step) for step in json.loads((out / "walk.json").read_text(encoding="utf-8"))]
        told += [f"### {title}", "", *table(steps), ""]
    file = docs / "evidence/index.md"
    text = file.read_text(encoding="utf-8")
    before, after = text[: text.index(_BEGIN)], text[text.index(_END) + len(_END) :]
    file.write_text(before + "\n".join([_BEGIN, "", *told, _END]) + after, encoding="utf-8")
    kept = {clone / name: name for name in (*SHOTS, _PAGE_SHOT, _REPLAY_SHOT, _REPORT_SHOT)}
    kept |= {wheel / name: kept_as for name, kept_as in WHEEL_SHOTS.items()}
    for taken, name in kept.items():
        if taken.is_file():
            shutil.copy(taken, docs / "images" / name)


def main(words: list[str]) -> None:
    """Walk, or write the page."""
    # Who is started in the background ignores Ctrl-C, and so would all that is started here.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    verb, *folders = words
    (walk if verb == "walk" else page)(*(Path(folder).resolve() for folder in folders))


if __name__ == "__main__":
    main(sys.argv[1:])
