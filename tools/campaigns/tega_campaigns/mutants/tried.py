"""Try a change: run the tests that run the changed lines, the quickest first, until one fails."""

from __future__ import annotations

import ast
import json
import os
import re
import subprocess
import sys
import sysconfig
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple

import msgspec

from tega.runtime.child_process import python_environment
from tega_campaigns.mutants.drawn import Mutant

if TYPE_CHECKING:
    from coverage import CoverageData

_BUDGETS_S: Final = (4.0, 30.0)
"""A change is tried on tests of so many seconds; if it survives, on those of so many."""
_SLACK: Final = 10.0
"""A test that takes so many times as long as without the change has failed: an endless loop."""
_LEAST_S: Final = 30.0
_TESTS: Final = ("--lib", "--tests")


class Trial(msgspec.Struct, frozen=True):
    """Result of a change.

    Attributes:
        outcome: ``killed``, ``survived``, ``untested`` where no test runs its line, or ``unviable`` where it
            does not compile.
        by: The test that failed, with its error; ``""`` where none did.
        n_tests: Number of tests that run the line.
    """

    name: str
    outcome: str
    by: str = ""
    n_tests: int = 0
    took_s: float = 0.0


class Covered(NamedTuple):
    """Measured lines with the tests that run them, and the time of each test in seconds."""

    data: CoverageData
    took_s: dict[str, float]

    @classmethod
    def read(cls, folder: Path) -> Covered:
        """Read what ``cover`` has written into a folder."""
        from coverage import CoverageData

        data = CoverageData(str(folder / "covered"))
        data.read()
        if not data.measured_files():
            raise FileNotFoundError(f"{folder}: no lines were measured; run the step cover first")
        took_s: dict[str, float] = {}
        for file in sorted(folder.glob("took-*.json")):
            took_s |= json.loads(file.read_text())
        return cls(data, took_s)

    def tests(self, file: Path, line: int) -> list[str]:
        """Return the tests that run a line, the quickest first; those that run its module where that runs alone."""
        by_line = self.data.contexts_by_lineno(str(file))
        first, last = _statement(file, line)
        near = self._named(context for n in range(first, last + 1) for context in by_line.get(n, ()))
        found = near or self._named(context for contexts in by_line.values() for context in contexts)
        return sorted(found, key=lambda name: self.took_s[name])

    def _named(self, contexts: object) -> set[str]:
        names = set()
        for context in contexts:  # type: ignore[attr-defined]
            for part in context.split("|"):
                names.add(re.sub(r" \((setup|call|teardown)\)$", "", part))
        return names & self.took_s.keys()


def _statement(file: Path, line: int) -> tuple[int, int]:
    """Return the first and last line of the innermost statement at a line, or of its head where it has a body."""
    best = (line, line)
    width = 10**9
    for node in ast.walk(ast.parse(file.read_text())):
        if not isinstance(node, ast.stmt):
            continue
        body = getattr(node, "body", None)
        first = min([node.lineno, *(one.lineno for one in getattr(node, "decorator_list", []))])
        last = max(first, body[0].lineno - 1) if body else node.end_lineno or first
        if first <= line <= last and last - first < width:
            best, width = (first, last), last - first
    return best


def try_python(mutant: Mutant, tree: Path, covered: Covered, measured: Path) -> Trial:
    """Try a change of Python on the tests that run its line.

    It is made in ``tree``, a copy of the project; ``measured`` is the project's folder in which the tests
    were measured.
    """
    began_s, by, n_tried = time.monotonic(), "", 0
    tests = covered.tests(measured / mutant.file, mutant.line)
    with _changed(tree / mutant.file, mutant.code):
        for budget_s in _BUDGETS_S:
            chosen = _within(tests[n_tried:], covered.took_s, budget_s)
            by = first_failure(tree, chosen, {name: covered.took_s[name] for name in chosen})
            n_tried += len(chosen)
            if by or n_tried >= len(tests):
                break
    outcome = "killed" if by else "survived" if tests else "untested"
    return Trial(mutant.name, outcome, by, len(tests), round(time.monotonic() - began_s, 1))


@contextmanager
def _changed(file: Path, code: str) -> Iterator[None]:
    before = file.read_text()
    file.write_text(code)
    try:
        yield
    finally:
        file.write_text(before)


def _within(tests: Sequence[str], took_s: dict[str, float], budget_s: float) -> list[str]:
    chosen: list[str] = []
    for name in tests:
        budget_s -= took_s[name]
        if chosen and budget_s < 0:
            break
        chosen.append(name)
    return chosen


def beside_python() -> dict[str, str]:
    """Return this program's environment, with the programs beside this Python found first."""
    return os.environ | {"PATH": os.pathsep.join([sysconfig.get_path("scripts"), os.environ["PATH"]])}


def first_failure(tree: Path, tests: Sequence[str], took_s: dict[str, float]) -> str:
    """Return the first test that fails, with its error; ``""`` if all pass."""
    if not tests:
        return ""
    slowest_s = max(took_s[name] for name in tests)
    total_s = sum(took_s[name] for name in tests)
    command = ["pytest", "-n0", "-x", "-q", "-p", "no:cacheprovider", "-rf", "--tb=no"]
    command += ["--timeout", str(round(max(_LEAST_S, _SLACK * slowest_s))), *tests]
    folders = [tree / "python", *(tree / "tools" / name for name in ("emulators", "campaigns", "figures"))]
    env = beside_python() | {"HYPOTHESIS_PROFILE": "ci", "PYTHONPATH": os.pathsep.join(map(str, folders))}
    try:
        done = subprocess.run(
            command,
            cwd=tree,
            env=python_environment(env),
            capture_output=True,
            text=True,
            timeout=2 * _LEAST_S + _SLACK * total_s,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return f"{tests[0]} and those after it: no end"
    if done.returncode in {0, 5}:
        return ""
    failed = re.search(r"^(?:FAILED|ERROR) (.{,300})", done.stdout, re.MULTILINE)
    return failed[1] if failed else f"{tests[0]} ends with {done.returncode}"


def try_rust(mutant: Mutant, tree: Path, baselines_s: dict[str, float]) -> Trial:
    """Try a change of Rust, in a copy of the project, on its crate's own tests.

    ``baselines_s`` has the time of each crate's tests without a change; a missing one is measured and added.
    """

    def run(*more: str, limit_s: float = 900.0) -> int:
        command = ["cargo", "test", "--quiet", "--locked", "-p", mutant.package, *more]
        # What one change makes a property find must not be what the next is tried by.
        env = os.environ | {"PROPTEST_RNG_SEED": "1", "PROPTEST_DISABLE_FAILURE_PERSISTENCE": "1"}
        try:
            return subprocess.run(
                command, cwd=tree, env=env, capture_output=True, timeout=limit_s, check=False
            ).returncode
        except subprocess.TimeoutExpired:
            return 1

    def patched(*more: str) -> None:
        command = ["patch", "--quiet", *more, mutant.file]
        subprocess.run(command, cwd=tree, input=mutant.diff, text=True, check=True)

    began_s = time.monotonic()
    if mutant.package not in baselines_s:
        run(*_TESTS, "--no-run")
        at_s = time.monotonic()
        if run(*_TESTS) or run("--doc"):
            raise RuntimeError(f"the tests of {mutant.package} fail without a change")
        baselines_s[mutant.package] = time.monotonic() - at_s
    patched()
    try:
        outcome = "unviable"
        if not run(*_TESTS, "--no-run"):
            limit_s = max(_LEAST_S, _SLACK * baselines_s[mutant.package])
            failed = run(*_TESTS, limit_s=limit_s) or run("--doc", limit_s=limit_s)
            outcome = "killed" if failed else "survived"
    finally:
        patched("--reverse")
    return Trial(mutant.name, outcome, mutant.package, took_s=round(time.monotonic() - began_s, 1))


def progress(folder: Path, language: str, wanted: int) -> Callable[[Trial], bool]:
    """Return the function that keeps a result and returns whether enough are tried."""
    file = folder / f"{language}.jsonl"
    n = len([one for one in kept(folder, language) if one.outcome != "unviable"])

    def keep(trial: Trial) -> bool:
        nonlocal n
        with file.open("ab") as out:
            out.write(msgspec.json.encode(trial) + b"\n")
        n += trial.outcome != "unviable"
        sys.stdout.write(f"{n}/{wanted} {trial.outcome} {trial.name} {trial.by} {trial.took_s:g} s\n")
        sys.stdout.flush()
        return n >= wanted

    return keep


def kept(folder: Path, language: str) -> list[Trial]:
    """Return the results that are kept in a folder, in the order of the draw; of a change the newest."""
    file = folder / f"{language}.jsonl"
    lines = file.read_bytes().splitlines() if file.exists() else []
    trials = [msgspec.json.decode(line, type=Trial) for line in lines]
    return list({trial.name: trial for trial in trials}.values())
