"""Draw who holds the interpreter lock: ``python -m tega_figures.lock_profile lock-profile.png a.raw b.raw``.

Each file is what ``py-spy record --gil --threads --rate 200 --duration 10 --format raw --pid N`` wrote of a run: one
stack a line, outermost first, and how many samples found it. Each becomes a panel: threads at the bottom, what they
call above, as wide as the share of the time in which they held the lock.
"""

from __future__ import annotations

import re
import sys
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Final

from tega.ui.view.figures import new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Stacks = Counter[tuple[str, ...]]

_DEEP: Final = 7
# Of an inch of panel, so much a sign of a label needs.
_SIGN: Final = 0.075
_NAMES: Final = {"digit": "cameras", "MainThread": "loop", "bhaptics-player": "vest", "allegro": "hand"}
# What is outside of these is the same in every sample.
_INNER: Final = ("DualLoop.run", "Digit._drain", "HandProcess._hear", "Allegro._run", "Reader._pass_on")
_FRAME: Final = re.compile(r"(?P<name>.+) \((?P<file>[^()]+?)(:\d+)?\)$")
_COLOURS: Final = ("#c8202f", "#1f5fbf", "#38863f", "#985cb6", "#bb5b14", "#0b7285", "#868e96")


def stacks(path: Path) -> Stacks:
    """Return how many samples found each stack: thread first, then TEGA's own functions and what they call."""
    found: Stacks = Counter()
    for line in path.read_text(encoding="utf-8").splitlines():
        text, _, n = line.rpartition(" ")
        thread, *frames = text.split(";")
        name = thread.partition(": ")[2] or "library"
        seen = [match for frame in frames if (match := _FRAME.match(frame))]
        while seen and not seen[0]["file"].startswith("tega/"):
            seen.pop(0)
        calls = [match["name"].rpartition(".<locals>.")[2] for match in seen]
        calls = calls[next((k for k, call in enumerate(calls) if call in _INNER), 0) :]
        found[_NAMES.get(name, name.removeprefix("tega-")), *calls] += int(n)
    return found


def draw(path: Path, files: list[Path], *, n_samples: int = 2000) -> None:
    """Write the picture.

    Args:
        path: The PNG.
        files: One a panel; the name before the suffix is its title.
        n_samples: How many were taken of each, whether anybody held the lock or not.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    figure = new_figure(figsize=(12, 3.4 * len(files)))
    colours: dict[str, str] = {}
    for ax, file in zip(figure.subplots(len(files), 1, squeeze=False)[:, 0], files, strict=True):
        found = stacks(file)
        threads = Counter[str]()
        for stack, n in found.items():
            threads[stack[0]] += n
        left = 0
        for thread, n in threads.most_common():
            colour = colours.setdefault(thread, _COLOURS[min(len(colours), len(_COLOURS) - 1)])
            inside = {stack: m / n_samples for stack, m in found.items() if stack[0] == thread}
            _draw_level(ax, inside, 0, left / n_samples, colour)
            left += n
        ax.set_xlim(0, 0.45)
        ax.set_ylim(0, _DEEP)
        ax.set_yticks([])
        ax.xaxis.set_major_formatter(lambda share, _place: f"{100 * share:.0f} %")
        ax.set_title(
            f"{file.stem.replace('-', ' ')}: the lock is held for {100 * left / n_samples:.0f} % of the time"
        )
    figure.savefig(path, dpi=100)


def _draw_level(
    ax: Axes, found: Mapping[tuple[str, ...], float], depth: int, left: float, colour: str
) -> None:
    """Draw the functions of one depth side by side, and above each what it calls."""
    if depth == _DEEP:
        return
    names: dict[str, float] = {}
    for stack, share in found.items():
        if len(stack) > depth:
            names[stack[depth]] = names.get(stack[depth], 0.0) + share
    for name, width in sorted(names.items(), key=lambda named: -named[1]):
        ax.barh(depth, width, 1, left, align="edge", color=colour, alpha=1 - 0.1 * depth, edgecolor="white")
        n_signs = int(width / 0.45 * 11 / _SIGN)
        if n_signs > 3:
            said = name if len(name) <= n_signs else name[: n_signs - 1] + "…"
            ax.text(left + width / 2, depth + 0.5, said, ha="center", va="center", fontsize=7, color="white")
        above = {s: share for s, share in found.items() if len(s) > depth and s[depth] == name}
        _draw_level(ax, above, depth + 1, left, colour)
        left += width


if __name__ == "__main__":
    draw(Path(sys.argv[1]), [Path(name) for name in sys.argv[2:]])
