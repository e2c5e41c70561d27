"""Draw a console as the page on studies shows it.

``python -m tega_figures.study_console docs/images/study-console.svg`` draws it.

A made-up session is under way in a folder that goes away, or with ``--recorded`` trials of it are scored; the console
is driven through textual's pilot.
"""

from __future__ import annotations

import asyncio
import re
import shutil
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import msgspec

from tega.errors import MissingExtraError
from tega.study.lead.status_file import SessionBoard, board_path, write_board
from tega.study.plan import make_plan, read_plan, write_plan
from tega.study.state import resume

if TYPE_CHECKING:
    from tega.study.observe.rater_console import RaterConsole

S = 1_000_000_000
KEYS = (("l", 2.0), ("s", 0.7), ("s", 0.6), ("u", 0.5), ("d", 0.6), ("s", 0.4))
"""What the rater of a session presses, and how many seconds after the key before."""

RECORDED_KEYS = (
    *(("space", 0.1), ("l", 2.1), ("s", 1.3), ("right", 1.2), ("1", 1.0), ("s", 0.8), ("left", 0.3), ("left", 0.1)),
    ("d", 1.6),
)  # fmt: skip
"""Likewise of recordings."""

RECORDED_S = 9.0


@click.command(help=__doc__)
@click.argument("file", type=click.Path(path_type=Path, dir_okay=False))
@click.option("--recorded", is_flag=True, help="The console for recordings.")
def main(file: Path, *, recorded: bool) -> None:
    """Write the picture."""
    try:
        import textual  # noqa: F401
    except ImportError as error:
        raise click.ClickException(
            str(MissingExtraError("textual is not installed", "pip install 'tega[observe]'"))
        ) from error

    with tempfile.TemporaryDirectory() as made:
        folder = Path(made) / "study"
        write_plan(make_plan(participants=2, seed=5, trials=2), folder)
        draw = _of_recordings if recorded else _of_a_session
        file.write_text(draw(folder), encoding="utf-8")


def _of_a_session(folder: Path) -> str:
    """Draw the console beside a session that goes on."""
    from tega.study.observe.console import Console

    now_ns = time.monotonic_ns()
    journal, _ = resume(folder, read_plan(folder), "p01", t_ns=now_ns)
    with journal:
        name = read_plan(folder).of("p01")[0].object
        journal.add("trial_start", t_ns=now_ns, trial=1, source="auto")
        write_board(
            board_path(folder, "p01"),
            SessionBoard(t_ns=now_ns + 60 * S, phase="trial", trial=1, object=name, n_over=0, n_trials=12),
        )

        async def play(pilot: Any) -> None:
            for key, after_s in KEYS:
                await pilot.pause(after_s)
                await pilot.press(key)
            await pilot.pause(0.3)

        return asyncio.run(_driven(Console(folder, "p01", "r1"), play))


def _of_recordings(folder: Path) -> str:
    """Draw the console for recordings; its clock goes on as told."""
    from tega.study.observe.playback_console import PlaybackConsole
    from tega.study.observe.scoring import Scoring

    _record(folder)
    now_ns = 0
    console = PlaybackConsole(
        Scoring(folder, "p01", "r3"),
        "p01",
        show=lambda _moment: None,
        where="http://127.0.0.1:8080",
        now_ns=lambda: now_ns,
        key_ns=lambda _key: now_ns,
    )

    async def play(pilot: Any) -> None:
        nonlocal now_ns
        for key, after_s in RECORDED_KEYS:
            for _ in range(round(after_s * 10)):
                now_ns += S // 10
                console.look()
            await pilot.press(key)

    return asyncio.run(_driven(console, play))


def _record(folder: Path) -> None:
    """Make trials that are over, all with one recording of made-up touch."""
    from tega.config import check_tree
    from tega.study.lead.trial import recording_folder
    from tega.teleop import run_session

    plan, start_ns = read_plan(folder), S // 2
    finger = {"driver": "synthetic-touch", "options": {"duration_s": RECORDED_S}}
    tree = {
        "session": {"pace": "fast"},
        "tactile": {"thumb": finger},
        "recording": {"dir": str(folder / "one")},
    }
    summary = run_session(check_tree(tree, {}, base=folder).config)
    with resume(folder, plan, "p01", t_ns=0)[0] as journal:
        for trial in plan.of("p01"):
            end_ns = round(RECORDED_S * S)
            journal.add("trial_start", t_ns=start_ns, trial=trial.trial, source="auto")
            journal.add(
                "trial_end", t_ns=end_ns, trial=trial.trial, status="done", success=True, source="auto"
            )
            where = recording_folder(folder, trial, 1)
            where.mkdir(parents=True)
            shutil.copy(folder / "one" / summary["recording"]["file"], where)
            facts = {"trial": trial.id, "attempt": 1, "zero_ns": 0, "started_ns": start_ns}
            (where / "trial.json").write_bytes(msgspec.json.encode(facts))


async def _driven(console: RaterConsole, play: Any) -> str:
    """Press the keys and return the screen as SVG."""
    async with console.run_test(size=(100, 26)) as pilot:
        await play(pilot)
        drawn = console.export_screenshot(title="tega-teleop study observe")
    return re.sub(
        r"@font-face \{.*?\}\s*", "", drawn, flags=re.DOTALL
    )  # a font from elsewhere; any fixed one does


if __name__ == "__main__":
    main()
