"""The calibration's animation shows what stands on a terminal: lines that Rich draws anew replace those before."""

from __future__ import annotations

import io

from rich.console import Console
from rich.live import Live
from rich.text import Text

from tega_figures.calibrate_shots import DrawnTerminal


def plain(screen: DrawnTerminal) -> list[str]:
    return [Text.from_ansi(line).plain.rstrip() for line in screen.lines]


def test_a_screen_holds_the_newest_of_what_is_redrawn_and_all_that_is_printed() -> None:
    out = io.StringIO()
    console = Console(file=out, force_terminal=True, width=30, height=10)
    console.print("[green]ok[/] rest", highlight=False)
    with Live(console=console, auto_refresh=False, transient=True) as live:
        for left in (3, 2, 1):
            live.update(f"SQUEEZE\n████··\n{left} s left", refresh=True)
            displayed = DrawnTerminal()
            displayed.take(out.getvalue())
            assert plain(displayed) == ["ok rest", "SQUEEZE", "████··", f"{left} s left"]
    console.print("let go")
    ended = DrawnTerminal()
    for letter in out.getvalue():  # however it is cut into parts
        ended.take(letter)
    assert [line for line in plain(ended) if line] == ["ok rest", "let go"]
    assert "\x1b[32m" in ended.lines[0]
