"""Try every cell of the table of letting go, and write docs/evidence/letting-go.md: ``make letting-go``."""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Final

import pytest

from hazards.letting_go import CELLS, EVENTS, STOP_S, Cell, Seen, expected, try_cell
from hazards.programs import SUBJECTS

ROOT: Final = Path(__file__).parents[2]
PAGE: Final = ROOT / "docs/evidence/letting-go.md"
_HEAD: Final = f"""# Signals and lost terminals

`make letting-go` writes this page. Each cell starts the command on emulated devices and waits until the emulated hand
pushes. The fault then goes to the processes named in the row, all at once. The cell is the time from the fault until
the hand had zero torque and SERVO OFF, by the emulated hand's own stamps; n = 1. The same cells are tests
(`tests/hazards/test_letting_go.py`), with the bounds of the [hazard table](../safety.md#what-can-go-wrong).

- **goes on**: the hand is steered as before. A guard that is killed or stopped is replaced; the run holds until then.
- **switch**: the hand still pushes, and no program is left that could let go. Use the hand's emergency switch.
- *TERM, HUP*: the second signal follows 20 ms after the first.
- *STOP {STOP_S:g} s*: the processes are stopped and go on {STOP_S:g} s later. Where all of them are stopped, as in a
  computer that sleeps, the hand is let go when they go on, and no torque comes before that.
- *closed terminal*: the command has the terminal itself. *dropped SSH*: a shell has it, and the command is its job.
- *end of the scope*: SIGTERM and then SIGHUP to every process of the command and its shell, as systemd sends them at a
  log-out, `loginctl terminate-session`, `systemctl stop` or a shutdown. A script sends them: no systemd ran.

The operator's station has no hand: its column is the time until the robot's station opens the fingers (it holds for
2 s first). `calibrate` opens no hand: its column is the time until the vest's motors rest. `hand show` and
`hand teach` leave the motors off.

"""
_NAMES: Final = {"main": "the command", "run": "the command", "all": "all three"}


def _text(cell: Cell, seen: Seen) -> str:
    if seen.outcome == "pushes":
        return "**switch**" if expected(cell).outcome == "pushes" else "**PUSHES**"
    if seen.outcome == "goes on":
        return "goes on"
    return f"{seen.took_s:.2f} s"


def read_page() -> dict[Cell, str]:
    """Return the text of each cell of the page."""
    if not PAGE.is_file():
        return {}
    rows = [line for line in PAGE.read_text(encoding="utf-8").splitlines() if line.startswith("| ")]
    texts = [text.strip() for row in rows[1:] for text in row.strip("|").split("|")[2:]]
    cells = [Cell(*row, event) for row in _rows() for event in EVENTS]
    return dict(zip(cells, texts, strict=True)) if len(cells) == len(texts) else {}


def _rows() -> list[tuple[str, str]]:
    return list(dict.fromkeys((cell.subject, cell.targets) for cell in CELLS))


def page(seen: Mapping[Cell, Seen]) -> str:
    """Return the page's text: of the cells that were not tried, what it was before."""
    before = read_page()
    lines = [f"| command | processes | {' | '.join(EVENTS)} |", "|---" * (2 + len(EVENTS)) + "|"]
    for subject, targets in _rows():
        cells = [Cell(subject, targets, event) for event in EVENTS]
        name = _NAMES.get(targets, targets.replace("run", "command"))
        texts = " | ".join(
            _text(cell, seen[cell]) if cell in seen else before.get(cell, "–") for cell in cells
        )
        lines.append(f"| `{SUBJECTS[subject].command}` | {name} | {texts} |")
    return _HEAD + "\n".join(lines) + "\n"


def problem(cell: Cell, seen: Seen) -> str:
    """Return in which respect a cell is not as expected; ``""`` if it is."""
    asked = expected(cell)
    if seen.outcome != asked.outcome:
        return f"{seen.outcome} instead of {asked.outcome}: {seen.words}"
    if seen.old_torque:
        return "torque came after the standstill and before letting go"
    late = seen.took_s > asked.within_s and seen.outcome not in {"goes on", "pushes"}
    return f"{seen.took_s:.2f} s is more than {asked.within_s:g} s" if late else ""


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
    asked = parser.parse_args(arguments)
    chosen = [cell for cell in CELLS if all(word in " | ".join(cell) for word in asked.only)]
    with ThreadPoolExecutor(asked.jobs) as pool:
        tried = zip(chosen, pool.map(_try, chosen), strict=True)
        seen = {cell: outcome for cell, outcome in tried if outcome is not None}
    PAGE.write_text(page(seen), encoding="utf-8")
    wrong = [cell for cell in chosen if cell not in seen or problem(cell, seen[cell])]
    _say(f"{len(chosen) - len(wrong)} of {len(chosen)} cells are as expected")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
