"""Draw the observer's console as the page on studies shows it.

``python -m tega_figures.study_console docs/images/study-console.svg`` draws it.

A made-up session is under way in a folder that goes away; the console is driven through textual's pilot.
"""

from __future__ import annotations

import asyncio
import re
import tempfile
import time
from pathlib import Path

import click

from tega.runtime.lifecycle import require
from tega_study.lead.tell import SessionBoard, board_path, write_board
from tega_study.plan import make_plan, read_plan, write_plan
from tega_study.state import resume

S = 1_000_000_000
KEYS = (("l", 2.0), ("s", 0.7), ("s", 0.6), ("u", 0.5), ("d", 0.6), ("s", 0.4))
"""What the rater presses, and how many seconds after the key before."""


@click.command(help=__doc__)
@click.argument("file", type=click.Path(path_type=Path, dir_okay=False))
def main(file: Path) -> None:
    """Write the picture."""
    require("textual", driver="the console", extra="observe")
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made) / "study"
        write_plan(make_plan(participants=2, seed=5, trials=2), folder)
        now_ns = time.monotonic_ns()
        journal, _ = resume(folder, read_plan(folder), "p01", t_ns=now_ns)
        with journal:
            name = read_plan(folder).of("p01")[0].object
            journal.add("trial_start", t_ns=now_ns, trial=1, source="auto")
            write_board(
                board_path(folder, "p01"),
                SessionBoard(
                    t_ns=now_ns + 60 * S, phase="trial", trial=1, object=name, n_over=0, n_trials=12
                ),
            )
            file.write_text(asyncio.run(_driven(folder)), encoding="utf-8")


async def _driven(folder: Path) -> str:
    """Press the keys and return the screen as SVG."""
    from tega_study.observe.console import Console

    console = Console(folder, "p01", "r1")
    async with console.run_test(size=(100, 26)) as pilot:
        for key, after_s in KEYS:
            await pilot.pause(after_s)
            await pilot.press(key)
        await pilot.pause(0.3)
        drawn = console.export_screenshot(title="tega-teleop study observe")
    return re.sub(
        r"@font-face \{.*?\}\s*", "", drawn, flags=re.DOTALL
    )  # a font from elsewhere; any fixed one does


if __name__ == "__main__":
    main()
