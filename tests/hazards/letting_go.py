"""Signals and lost terminals, to one process of a program and to several at once, and the time until the hand is limp.

``make letting-go`` tries every cell on emulated devices and writes docs/evidence/faults.md. A cell starts the
command itself, waits until the emulated hand pushes, makes the fault, and takes the hand's own stamps of zero torque
and SERVO OFF.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import signal
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Final, Literal, NamedTuple

import pytest

from hazards.programs import SUBJECTS, Started
from tega_campaigns.runner import put_table, table

__all__ = ["CELLS", "Cell", "main", "problem", "try_cell"]

PATIENCE_S: Final = float(os.environ.get("TEGA_PATIENCE_S", "60"))
STOP_S: Final = 3.0
_WATCH_S: Final = 3.0
_BETWEEN_S: Final = 0.02
_SIGNALS: Final = {
    "HUP": (signal.SIGHUP,),
    "INT": (signal.SIGINT,),
    "TERM": (signal.SIGTERM,),
    "TERM, HUP": (signal.SIGTERM, signal.SIGHUP),
    "KILL": (signal.SIGKILL,),
}
_WHOLE: Final = ("closed terminal", "dropped SSH", "end of the scope")
EVENTS: Final = (*_SIGNALS, "STOP 3 s", *_WHOLE)
_ROLES: Final = ("run", "hand process", "guard")
_TARGETS: Final = (
    "run",
    "hand process",
    "guard",
    "run + hand process",
    "run + guard",
    "hand process + guard",
    "all",
)

_PAGE: Final = Path(__file__).parents[2] / "docs/evidence/faults.md"
_NAME: Final = "letting go"
_NAMES: Final = {"main": "the command", "run": "the command", "all": "all three"}

Outcome = Literal["let go", "goes on", "pushes", "opens", "rests"]


class Cell(NamedTuple):
    """One fault of one program: a key of :data:`SUBJECTS`, who gets the fault, and one of :data:`EVENTS`."""

    subject: str
    targets: str
    event: str


class Expected(NamedTuple):
    """Expected outcome of a cell, and the longest time until then.

    ``let go``: zero torque and SERVO OFF; ``goes on``: the hand is steered as before; ``pushes``: no program can do
    anything; ``opens``: the robot station opens the hand; ``rests``: the vest's motors rest.
    """

    outcome: Outcome
    within_s: float = 0.0


class Seen(NamedTuple):
    """Outcome of a cell, as the emulated device stamped it.

    Attributes:
        zero_s: Time from the fault to zero torque (of a vest: to rest; of fingers: until they open).
        off_s: Time to SERVO OFF.
        old_torque: Whether torque came between the end of a standstill and letting go.
    """

    outcome: Outcome
    zero_s: float = 0.0
    off_s: float = 0.0
    old_torque: bool = False
    words: str = ""

    @property
    def took_s(self) -> float:
        return max(self.zero_s, self.off_s)


def _cells() -> list[Cell]:
    cells = [Cell("run", targets, event) for targets in _TARGETS for event in (*_SIGNALS, "STOP 3 s")]
    cells += [Cell("run", "all", event) for event in _WHOLE]
    for name, subject in SUBJECTS.items():
        if name == "run":
            continue
        targets = ("main", "all") if subject.steers else ("main",)
        cells += [Cell(name, target, event) for target in targets for event in (*_SIGNALS, "STOP 3 s")]
        cells += [Cell(name, "all" if subject.steers else "main", event) for event in _WHOLE]
    return cells


CELLS: Final = _cells()


def expected(cell: Cell) -> Expected:
    """Return what has to come of a cell; times are those of the hazard table."""
    subject = SUBJECTS[cell.subject]
    if not subject.steers:
        return Expected(subject.otherwise, subject.within_s)
    main = cell.targets.startswith(("main", "run", "all"))
    hand, guard = (cell.targets == "all" or role in cell.targets for role in ("hand process", "guard"))
    if cell.event not in {"KILL", "STOP 3 s"}:
        return Expected("let go", 0.5) if main else Expected("goes on")
    killed = cell.event == "KILL"
    if not (main or hand):
        return Expected("goes on")
    if main and hand and guard:
        return Expected("pushes") if killed else Expected("let go", STOP_S + 0.1)
    if hand and guard:  # the run starts a guard
        return Expected("let go", 2.0 if killed else 1.0 + 2.0)
    return Expected("let go", 0.1 if killed else 1.0 + 0.1)


def try_cell(cell: Cell, folder: Path) -> Seen:
    """Start a program, make a fault, and return what the emulated device did."""
    subject = SUBJECTS[cell.subject]
    with subject.started(folder, terminal=cell.event in _WHOLE, shell=cell.event == "dropped SSH") as started:
        begun_s = time.monotonic()
        with _fault(cell, started) as goes_on_s:
            seen = _watched(expected(cell).outcome, started, begun_s, goes_on_s)
        return seen._replace(words=started.program.said.strip().rpartition("\n")[2].strip())


@contextmanager
def _fault(cell: Cell, started: Started) -> Iterator[list[float]]:
    """Make the fault; yield the moment at which stopped processes go on, once they do."""
    goes_on_s: list[float] = []
    if cell.event in {"closed terminal", "dropped SSH"}:
        started.program.hang_up()
    elif cell.event == "end of the scope":
        started.program.end_scope()
    else:
        pids = [pid for role in _roles(cell.targets) for pid in started.roles[role]]
        if cell.event == "STOP 3 s":
            _send(pids, signal.SIGSTOP)

            def go_on() -> None:
                goes_on_s.append(time.monotonic())
                _send(pids, signal.SIGCONT)

            timer = threading.Timer(STOP_S, go_on)
            timer.start()
            try:
                yield goes_on_s
            finally:
                timer.join()
            return
        for k, number in enumerate(_SIGNALS[cell.event]):
            time.sleep(_BETWEEN_S * k)
            _send(pids, number)
    yield goes_on_s


def _roles(targets: str) -> list[str]:
    if targets == "all":
        return list(_ROLES)
    return ["run" if target == "main" else target for target in targets.split(" + ")]


def _send(pids: list[int], number: signal.Signals) -> None:
    # Of processes that are killed together none sees another end: they stand still before the first is killed.
    first = [signal.SIGSTOP] if number == signal.SIGKILL else []
    for one in (*first, number):
        for pid in pids:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, one)


def _watched(outcome: Outcome, started: Started, begun_s: float, goes_on_s: list[float]) -> Seen:
    """Watch the device until it is as expected, or for as long as a hand that is not let go is watched."""
    if outcome in {"opens", "rests"}:
        while not (at_s := started.device_at_rest_s(begun_s)):
            if time.monotonic() - begun_s > PATIENCE_S:
                return Seen("pushes")
            time.sleep(0.005)
        return Seen(outcome, at_s - begun_s)
    longest_s = PATIENCE_S if outcome == "let go" else _WATCH_S
    check = started.check()
    while time.monotonic() - begun_s < longest_s:
        check = started.check()
        if check["off_s"] > begun_s and not check["servo_on"]:
            zero_s = max(check["zero_s"], begun_s)  # it may have been at zero before
            old = bool(goes_on_s) and check["pushed_s"] > goes_on_s[0]
            return Seen("let go", zero_s - begun_s, check["off_s"] - begun_s, old)
        time.sleep(0.002)
    steered = check["torques"] > started.torques + 100
    return Seen("goes on" if steered else "pushes")


def problem(cell: Cell, seen: Seen, times: float = 1) -> str:
    """Return in which respect a cell is not as expected, in so many times its time; ``""`` if it is."""
    requested = expected(cell)
    if seen.outcome != requested.outcome:
        return f"{seen.outcome} instead of {requested.outcome}: {seen.words}"
    if seen.old_torque:
        return "torque came after the standstill and before letting go"
    late = seen.took_s > times * requested.within_s and seen.outcome not in {"goes on", "pushes"}
    return f"{seen.took_s:.2f} s is more than {requested.within_s:g} s" if late else ""


def _text(cell: Cell, seen: Seen) -> str:
    if seen.outcome == "pushes":
        return "**switch**" if expected(cell).outcome == "pushes" else "**PUSHES**"
    if seen.outcome == "goes on":
        return "goes on"
    return f"{seen.took_s:.2f} s"


def read_page() -> dict[Cell, str]:
    """Return the text of each cell of the page's table."""
    text = _PAGE.read_text("utf-8").split(f"<!-- {_NAME}: begin -->")[1].split(f"<!-- {_NAME}: end -->")[0]
    rows = [line for line in text.splitlines() if line.startswith("| ")]
    texts = [text.strip() for row in rows[1:] for text in row.strip("|").split("|")[2:]]
    cells = [Cell(*row, event) for row in _rows() for event in EVENTS]
    return dict(zip(cells, texts, strict=True)) if len(cells) == len(texts) else {}


def _rows() -> list[tuple[str, str]]:
    return list(dict.fromkeys((cell.subject, cell.targets) for cell in CELLS))


def page(seen: Mapping[Cell, Seen]) -> str:
    """Return the page's table; a cell that was not tried keeps its text."""
    before, rows = read_page(), list[tuple[str, ...]]()
    for subject, targets in _rows():
        cells = [Cell(subject, targets, event) for event in EVENTS]
        name = _NAMES.get(targets, targets.replace("run", "command"))
        texts = (_text(cell, seen[cell]) if cell in seen else before.get(cell, "–") for cell in cells)
        rows.append((f"`{SUBJECTS[subject].command}`", name, *texts))
    return table(("command", "processes", *EVENTS), rows)


def _try(cell: Cell) -> Seen | None:
    """Try a cell; ``None`` if its program did not come so far."""
    try:
        with tempfile.TemporaryDirectory(prefix="tega-letting-go-") as folder:
            seen = try_cell(cell, Path(folder))
    except (Exception, pytest.fail.Exception) as error:
        _say(f"{' | '.join(cell)} | not tried | {error}")
        return None
    _say(f"{' | '.join(cell)} | {_text(cell, seen)} | {problem(cell, seen)}")
    return seen


def _say(line: str) -> None:
    print(line, flush=True)  # noqa: T201  # this is a program


def main(arguments: Sequence[str] | None = None) -> int:
    """Try the cells that are asked for; return 0 if each is as expected."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", nargs="*", default=[], metavar="WORD", help="cells with all of these words")
    parser.add_argument("--jobs", type=int, default=2, help="cells at once")
    requested = parser.parse_args(arguments)
    chosen = [cell for cell in CELLS if all(word in " | ".join(cell) for word in requested.only)]
    with ThreadPoolExecutor(requested.jobs) as pool:
        tried = zip(chosen, pool.map(_try, chosen), strict=True)
        seen = {cell: outcome for cell, outcome in tried if outcome is not None}
    put_table(_PAGE, page(seen), name=_NAME)
    wrong = [cell for cell in chosen if cell not in seen or problem(cell, seen[cell])]
    _say(f"{len(chosen) - len(wrong)} of {len(chosen)} cells are as expected")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
