"""Draw variants by what they cost and by what they miss, and make their table."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import product
from typing import TYPE_CHECKING

import msgspec

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["Choice", "PricedVariant", "drawn", "front", "name_points", "table"]

OURS, OTHERS, LINE = "#c8202f", "#1f5fbf", "#9aa0a6"


class PricedVariant(msgspec.Struct, frozen=True, kw_only=True):
    """One way to set a choice, named as a person would write it.

    ``cost`` and ``error``, what it misses, are in the units of the subject; ``beside`` is what else was
    measured, by the heading of its column; ``default``: TEGA does this unless set otherwise.
    """

    name: str
    cost: float
    error: float
    beside: dict[str, float] = {}
    default: bool = False


class Choice(msgspec.Struct, frozen=True, kw_only=True):
    """A subject: what is chosen among, and what was measured.

    Attributes:
        setting: Where it is set.
        cost: Heading of the cost, with its unit.
        error: Heading of the error, with its unit.
        how: What was measured, and on what; whole sentences.
        why: Why the default is the default.
    """

    title: str
    setting: str
    cost: str
    error: str
    how: str
    why: str
    variants: list[PricedVariant]


def front(variants: Sequence[PricedVariant]) -> list[PricedVariant]:
    """Return the variants that no other one beats in cost and error at once, cheapest first."""

    def beaten(one: PricedVariant) -> bool:
        others = [v for v in variants if v.cost <= one.cost and v.error <= one.error]
        return any((v.cost, v.error) != (one.cost, one.error) for v in others)

    return sorted((v for v in variants if not beaten(v)), key=lambda v: (v.cost, v.error))


def drawn(choice: Choice) -> Figure:
    """Draw one subject: cost to the right, error upwards, the default a star, a line through the front."""
    import matplotlib as mpl

    mpl.rcParams |= {"svg.hashsalt": "tega", "svg.fonttype": "none"}  # letters, not outlines of each
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.5, 4.6), layout="constrained")
    panel = figure.subplots()
    panel.set_xscale("log")
    panel.xaxis.set_major_formatter("{x:g}")
    panel.xaxis.set_minor_formatter("{x:g}")
    if min(v.error for v in choice.variants) > 0:
        panel.set_yscale("log")
        panel.yaxis.set_major_formatter("{x:g}")
        panel.yaxis.set_minor_formatter("{x:g}")
    best = front(choice.variants)
    panel.step([v.cost for v in best], [v.error for v in best], where="post", color=LINE, lw=1, zorder=1)
    for v in choice.variants:
        panel.plot(
            v.cost,
            v.error,
            "*" if v.default else "o",
            color=OURS if v.default else OTHERS,
            markersize=14 if v.default else 6,
            zorder=3,
        )
    panel.margins(0.18)
    panel.set_xlabel(f"{choice.cost} (left is better)")
    panel.set_ylabel(f"{choice.error} (down is better)")
    panel.set_title(f"{choice.title}. Star: the default", fontsize=10)
    panel.grid(visible=True, which="major", color="#e6e6e6", lw=0.6)
    figure.draw_without_rendering()  # Labels are placed once the panel has its size.
    figure.set_layout_engine("none")
    name_points(panel, [(v.cost, v.error, v.name) for v in choice.variants])
    return figure


def name_points(panel: Axes, points: Sequence[tuple[float, float, str]]) -> None:
    """Write a name beside each point, at the nearest of many places that is free of points and of other names."""
    from matplotlib.transforms import Bbox

    at = panel.transData.transform([(x, y) for x, y, _ in points])
    px = panel.figure.dpi / 72
    taken = [Bbox.from_bounds(x - 6 * px, y - 6 * px, 12 * px, 12 * px) for x, y in at]
    for x, y, name in points:
        text = panel.annotate(name, (x, y), (0, 0), fontsize=8, textcoords="offset points", va="center")
        for far, turn in product(range(8, 60, 4), range(0, 360, 30)):
            across, up = far * math.cos(math.radians(turn)), far * math.sin(math.radians(turn))
            text.xyann = across, up
            text.set_horizontalalignment("left" if across > 1 else "right" if across < -1 else "center")
            box = text.get_window_extent()
            inside = panel.bbox.containsx(box.x0) and panel.bbox.containsx(box.x1)
            if inside and panel.bbox.containsy(box.y0) and not any(box.overlaps(other) for other in taken):
                break
        taken.append(box)


def table(choice: Choice) -> str:
    """Make the table of one subject, in the order measured; the default in bold, ``front`` where nothing beats it."""
    best = front(choice.variants)
    beside = list(dict.fromkeys(key for v in choice.variants for key in v.beside))
    lines = [["", choice.cost, choice.error, *beside, "on the front"]]
    lines.append(["---"] * len(lines[0]))
    for v in choice.variants:
        name = f"**{v.name}** (default)" if v.default else v.name
        numbers = [v.cost, v.error, *(v.beside.get(key, math.nan) for key in beside)]
        lines.append([name, *map(_digits, numbers), "yes" if v in best else ""])
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def _digits(value: float) -> str:
    return "–" if math.isnan(value) else f"{value:.3g}"
