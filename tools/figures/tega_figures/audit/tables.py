"""Print the tables of an audit on the terminal."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table

if TYPE_CHECKING:
    from tega_figures.audit import AuditReport


_Column = tuple[str, Callable[[Any], str | None]]


def _number(name: str, form: str = ".2f") -> Callable[[Any], str | None]:
    def reported(score: Any) -> str | None:
        value = getattr(score, name)
        return None if value is None else f"{value:{form}}"

    return reported


def _area(place: Callable[[list[int]], int]) -> Callable[[Any], str | None]:
    return lambda score: str(sorted(score.eda)[place(score.eda)]) if score.eda else None


_TOUCH: tuple[_Column, ...] = (
    ("found", lambda s: f"{s.n_found} of {s.n_frames}"),
    ("EDA least", _area(lambda _all: 0)),
    ("median", _area(lambda all_: len(all_) // 2)),
    ("most", _area(lambda _all: -1)),
    ("changes/s", _number("changes_per_s")),
    ("at rest", _number("eda_at_rest", "d")),
    ("area / mark", _number("area_ratio")),
    ("overlap", _number("iou")),
    ("worst tenth", _number("iou_low")),
    ("r with mark", _number("area_correlation")),
    ("felt", lambda s: None if s.n_touched is None else f"{s.n_felt} of {s.n_touched}"),
    ("false", _number("n_false", "d")),
    ("EDA with N", _number("force_rank")),
    ("CCI with N", _number("cci_force_rank")),
)

_EMG: tuple[_Column, ...] = (
    ("blocks", _number("n_blocks", "d")),
    ("share at 1 … 5", lambda s: " ".join(f"{100 * share:.0f}" for share in s.level_shares) + " %"),
    ("changes/s", _number("changes_per_s")),
    ("later ms", lambda s: None if s.later_s is None else f"{1000 * s.later_s:.0f}"),
    ("same level", lambda s: f"{100 * s.agreement:.0f} %"),
    ("muted", _number("n_muted", "d")),
    ("r with N", _number("force_rank")),
    ("maxima of", lambda s: str(s.maxima_of)),
)

_VEST: tuple[_Column, ...] = (
    ("layout", lambda s: str(s.layout)),
    ("frames lit", lambda s: f"{100 * s.lit_share:.0f} %"),
    ("front %", _number("front_mean", ".0f")),
    ("back %", _number("back_mean", ".0f")),
    ("full", lambda s: f"{100 * s.full_share:.0f} %"),
    ("flips/s", _number("flips_per_s")),
    ("steps", _number("n_steps", "d")),
    ("r with N", _number("force_rank")),
    ("maxima of", lambda s: str(s.maxima_of)),
)


def print_report(report: AuditReport) -> None:
    """Print a table for touch, EMG and vest each, where the report has it."""
    console = Console(highlight=False, width=150)
    for subject, scores, columns in (
        ("touch", report.touch, _TOUCH),
        ("EMG", report.emg, _EMG),
        ("vest", report.vest, _VEST),
    ):
        if scores:
            console.print(
                _table(f"{report.recording}: {subject}", report.sweep or "reading", scores, columns)
            )
    if report.n_left_out:
        console.print(f"{report.n_left_out} pictures left out: marks, masks or forces say nothing of them.")


def _table(title: str, first: str, scores: Sequence[Any], columns: Sequence[_Column]) -> Table:
    table = Table(title=title, title_justify="left", box=SIMPLE)
    several = len({getattr(score, "finger", "") for score in scores}) > 1
    table.add_column(first.rpartition("options.")[2], no_wrap=True)
    if several:
        table.add_column("finger")
    displayed = [
        (name, reported) for name, reported in columns if any(reported(score) is not None for score in scores)
    ]
    for name, _ in displayed:
        table.add_column(name, justify="right")
    for score in scores:
        row = [score.reading, *([score.finger] if several else [])]
        table.add_row(*row, *(reported(score) or "–" for _, reported in displayed))
    return table
