"""Takes one guard after another out of a copy of the program, and shows that a test then fails.

``make guards`` tries all of them and writes ``guards-seen.md`` beside this file; ``make guards THIRD=today`` tries
the third of this day, as CI does, and ``--only WORD`` those with the word in their name or test. Each time of the
hazard table is made ten times as long as well. A test has to pass with everything in place and to fail without the
guard. One that does not end in time proves nothing; it is asked again alone, with more patience. The working tree is
not touched but for the page.
"""

from __future__ import annotations

import argparse
import contextlib
import datetime as dt
import os
import queue
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Final, Literal, NamedTuple

from hazards.guards import LATE, Guard
from hazards.guards_of_devices import OF_DEVICES
from hazards.guards_of_runs import OF_RUNS
from tega import _native

__all__ = ["EVERY", "GUARDS", "read_page"]

GUARDS: Final = (*OF_DEVICES, *OF_RUNS)
EVERY: Final = (*GUARDS, *LATE)

ROOT: Final = Path(__file__).parents[2]
PAGE: Final = ROOT / "tests/hazards/guards-seen.md"
_LONGEST_S: Final = 120.0
_PATIENCE_S: Final = 15.0
# So much longer for what is asked again alone.
_PATIENT: Final = 4.0
# Where code lies that the tests import.
_PARTS: Final = ("python", "tests", "tools")
_PYTEST: Final = ("-m", "pytest", "-qx", "-pno:cacheprovider", "--tb=line", "-n0", "--force-reruns=0")

# A test that fails with such words has met a busy machine, not the missing guard.
_BUSY: Final = (
    "times a second;",
    "a second come,",
    "did not start",
    "no good picture within",
    "no hand answered",
    "really sends",
)

Outcome = Literal["passes", "fails", "unproven"]


class Tried(NamedTuple):
    """What its test does with everything in place and without the guard, and the last words of what decides."""

    guard: Guard
    where: str
    whole: Outcome
    without: Outcome
    words: str

    @property
    def said(self) -> str:
        """The outcome as the page has it; only ``fails`` is proof."""
        if self.whole != "passes":
            return "unproven: fails with the guard too" if self.whole == "fails" else "unproven"
        return {"fails": "fails", "passes": "**SURVIVES**", "unproven": "unproven"}[self.without]


def place(text: str, package: Path = ROOT / "python") -> Path:
    """Return the one file of the program in which a text stands once.

    Raises:
        LookupError: It stands in none, or more than once.
    """
    found = [
        file for file in sorted(package.rglob("*.py")) for _ in range(file.read_text("utf-8").count(text))
    ]
    if len(found) != 1:
        raise LookupError(f"{len(found)} times in the program: {text!r}; put what does it now into GUARDS")
    return found[0]


class Copy:
    """A copy of the program and its tests, in which a guard may be missing."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        for part in _PARTS:
            if (ROOT / part).is_dir():
                ignored = shutil.ignore_patterns("__pycache__")
                shutil.copytree(ROOT / part, folder / part, ignore=ignored)
        shutil.copy(ROOT / "pyproject.toml", folder)
        # The tree has it only where it is built in place.
        shutil.copy(Path(_native.__file__), folder / "python/tega")

    def run(self, shown_by: str, *, patient: bool) -> tuple[Outcome, str]:
        """Run what shows a guard; return what came of it, and its last words. One that does not end proves nothing."""
        more = _PATIENT if patient else 1.0
        tools = sorted(path for path in (self.folder / "tools").glob("*") if path.is_dir())
        paths = [self.folder / "python", self.folder / "tests", *tools]
        running = subprocess.Popen(
            [sys.executable, *_PYTEST, shown_by],
            cwd=self.folder,
            env={
                **os.environ,
                "PYTHONPATH": os.pathsep.join(map(str, paths)),
                "TEGA_PATIENCE_S": f"{more * _PATIENCE_S:g}",
            },
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        )
        try:
            message, _ = running.communicate(timeout=more * _LONGEST_S)
        except subprocess.TimeoutExpired:
            return "unproven", f"it did not end within {more * _LONGEST_S:g} s"
        finally:
            # A test that fails may leave programs behind; they are all of its session.
            with contextlib.suppress(ProcessLookupError):
                os.killpg(running.pid, signal.SIGKILL)
            running.wait()
        lines = [line.strip() for line in message.splitlines() if line.strip()]
        wrong = [line for line in lines if line.startswith("E  ") or "Error: " in line]
        # 1 is a test that failed; anything else is pytest that found none, or was told nonsense.
        outcomes: dict[int, Outcome] = {0: "passes", 1: "fails"}
        outcome, words = outcomes.get(running.returncode, "unproven"), (wrong or lines or [""])[0]
        # A run that went active had all that it needed: its rates are what the fault made of them.
        was_busy = "state='active'" not in words and any(busy in words for busy in _BUSY)
        if outcome == "fails" and was_busy:
            outcome = "unproven"
        return outcome, words[:160]

    def try_guard(self, guard: Guard, whole: tuple[Outcome, str], *, patient: bool) -> Tried:
        """Take a guard out, run its test, and put it back."""
        file = place(guard.old, self.folder / "python")
        where = str(file.relative_to(self.folder / "python"))
        if whole[0] != "passes":
            return Tried(guard, where, whole[0], "unproven", whole[1])
        text = file.read_text(encoding="utf-8")
        file.write_text(text.replace(guard.old, guard.without), encoding="utf-8")
        try:
            outcome, words = self.run(guard.shown_by, patient=patient)
        finally:
            file.write_text(text, encoding="utf-8")
        return Tried(guard, where, "passes", outcome, words)


def try_all(
    guards: Sequence[Guard], *, jobs: int, patient: bool = False, done: Callable[[Tried], None]
) -> dict[Guard, Tried]:
    """Try guards, several at once on copies of their own, and tell each; those that one test shows, in turn."""
    telling = threading.Lock()
    copies: queue.SimpleQueue[Copy] = queue.SimpleQueue()
    groups: dict[str, list[Guard]] = {}
    for guard in guards:
        groups.setdefault(guard.shown_by, []).append(guard)

    def try_group(shown_by: str) -> list[Tried]:
        copy, found = copies.get(), []
        whole = copy.run(shown_by, patient=patient)
        for guard in groups[shown_by]:
            found.append(tried := copy.try_guard(guard, whole, patient=patient))
            with telling:
                _say(f"{tried.said} | {guard.what} | {shown_by} | {tried.words}")
                done(tried)
        copies.put(copy)
        return found

    with tempfile.TemporaryDirectory(prefix="tega-without-") as name:
        for k in range(jobs):
            copies.put(Copy(Path(name, str(k))))
        with ThreadPoolExecutor(jobs) as pool:
            return {one.guard: one for found in pool.map(try_group, groups) for one in found}


def _say(line: str) -> None:
    print(line, flush=True)  # noqa: T201  # this is a program


def _commit() -> str:
    """Return the commit of the working tree, and whether the program or a test was changed since."""

    def git(*words: str) -> str:
        done = subprocess.run(["git", *words], cwd=ROOT, text=True, capture_output=True, check=True)
        return done.stdout.strip()

    changed = git("status", "--porcelain", "--", "python", "tests", "crates")
    return git("rev-parse", "--short=10", "HEAD") + (" and changes" if changed else "")


_HEAD: Final = """# Guards taken out

`make guards` takes one guard after another out of a copy of the program, or makes its time ten times as long, and runs
the test that shows it. The test has to pass with the guard and to fail without it. A test that does not end
is no proof. That command writes this file: each line has the commit that it was seen at. The
[hazard table](../../docs/evidence/safety.md#what-can-go-wrong) says what each guard is for.

"""
_COLUMNS: Final = "| without it | guard in | what then fails | seen | commit |\n|---|---|---|---|---|\n"


def read_page() -> dict[tuple[str, str], list[str]]:
    """Return the cells of each line of the page, by what is so without the guard and what shows it."""
    if not PAGE.is_file():
        return {}
    rows = [line for line in PAGE.read_text(encoding="utf-8").splitlines() if line.startswith("| ")]
    cells = [[cell.strip() for cell in row.strip("|").split("|")] for row in rows[1:]]
    return {(row[0], row[2].strip("`")): row for row in cells}


def write_page(tried: Sequence[Tried], commit: str) -> None:
    """Write the page anew: what was tried now, and of the others what the page said before."""
    rows = read_page()
    for one in tried:
        guard = one.guard
        key = (guard.what, guard.shown_by)
        rows[key] = [guard.what, f"`{one.where}`", f"`{guard.shown_by}`", one.said, commit]
    absent = ["", "", "", "not tried", ""]
    kept = [rows.get((g.what, g.shown_by), [g.what, "", f"`{g.shown_by}`", *absent[3:]]) for g in EVERY]
    proven = sum(row[3] == "fails" for row in kept)
    survive = sum("SURVIVES" in row[3] for row in kept)
    commits = sorted({row[4] for row in kept if row[4]})
    summary = (
        f"**{proven} of {len(kept)} are missed** ({len(GUARDS)} taken out, {len(LATE)} ten times too slow), "
        f"{survive} are not, {len(kept) - proven - survive} are unproven. Commits: {', '.join(commits)}.\n\n"
    )
    table = "".join(f"| {' | '.join(row)} |\n" for row in kept)
    PAGE.write_text(_HEAD + summary + _COLUMNS + table, encoding="utf-8")


def main() -> int:
    """Take out what is asked for; return 0 if each was missed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", default="", help="a word of the name or the test")
    parser.add_argument("--third", metavar="K", help="every third only, from the K-th on; today: the day's")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="so many at once")
    parser.add_argument("--page", action="store_true", help="write tests/hazards/guards-seen.md")
    requested = parser.parse_args()
    # A job in the background is deaf to Ctrl-C, and so are its children.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    chosen = [guard for guard in EVERY if requested.only in f"{guard.what} {guard.shown_by}"]
    if requested.third:
        third = dt.datetime.now(tz=dt.UTC).toordinal() if requested.third == "today" else int(requested.third)
        chosen = chosen[third % 3 :: 3]
    commit = _commit()

    def done(one: Tried) -> None:
        if requested.page:  # line by line: who ends it early keeps what was seen
            write_page([one], commit)

    tried = try_all(chosen, jobs=requested.jobs, done=done)
    # Where several run at once a device may be late; what proves nothing is asked again alone.
    if again := [guard for guard, one in tried.items() if one.said.startswith("unproven")]:
        _say(f"{len(again)} are asked again, each alone")
        tried |= try_all(again, jobs=1, patient=True, done=done)
    kept = [one for one in tried.values() if one.said != "fails"]
    _say(
        f"commit {commit}: {len(tried) - len(kept)} of {len(tried)} guards are missed when they are taken out"
    )
    for one in kept:
        _say(f"{one.said} | {one.guard.what} | {one.guard.shown_by} | {one.words}")
    return 1 if kept else 0


if __name__ == "__main__":
    sys.exit(main())
