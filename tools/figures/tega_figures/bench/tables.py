"""Print the tables of the benches on the terminal."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table

if TYPE_CHECKING:
    from tega_figures.bench.machine import Machine
    from tega_figures.bench.report import BenchReport, ContactRow
    from tega_figures.bench.simulation import SimReport
    from tega_figures.bench.stations import StationsBench

__all__ = ["print_bench", "print_simulation", "print_stations"]


def _print_table(
    out: Console, title: str, columns: Sequence[str], rows: Iterable[Sequence[str]], *, n_names: int = 1
) -> None:
    """Print a table whose first columns are names and whose others are numbers."""
    table = Table(title=title, title_justify="left", box=SIMPLE)
    for number, name in enumerate(columns):
        if number < n_names:
            table.add_column(name, no_wrap=True)
        else:
            table.add_column(name, justify="right")
    for row in rows:
        table.add_row(*row)
    out.print(table)


def _print_machine(out: Console, machine: Machine, rest: str) -> None:
    load = "" if machine.load_per_core is None else f", load {machine.load_per_core:g} a core"
    out.print(f"{machine.cpu}, {machine.n_cores} cores{load}, {rest}")


def _to_peer(ratio: float | None) -> str:
    return "–" if ratio is None else f"{ratio:.2f}"


def print_bench(report: BenchReport) -> None:
    """Print times and errors of the kernels, batches and ticks."""
    out = Console(highlight=False, width=130)
    _print_machine(out, report.machine, f"kernels in {report.machine.instruction_set}, one thread")
    out.print(", ".join(f"{name} {version}" for name, version in report.machine.versions.items()))
    for reading, size in dict.fromkeys((row.reading, row.size) for row in report.contact):
        rows = [row for row in report.contact if (row.reading, row.size) == (reading, size)]
        _print_contact(out, f"{reading}, {size[0]}×{size[1]}", rows)
    _print_table(
        out,
        "every width: times over NumPy's or-reduce of both images, and how often ours fits into OpenCV's fastest form",
        (
            "height × width",
            "rows",
            *report.widths[0].to_floor,
            *(f"{law} in OpenCV's" for law in report.widths[0].peer_to_ours),
        ),
        (
            (
                f"{row.size[0]}×{row.size[1]}",
                "apart" if row.strided else "together",
                *(f"{ratio:.2f}" for ratio in row.to_floor.values()),
                *(f"{ratio:.1f}" for ratio in row.peer_to_ours.values()),
            )
            for row in report.widths
        ),
        n_names=2,
    )
    _print_table(
        out,
        "EMG low-pass, 4th order, 3 channels",
        ("variant", "case", "rows", "median µs", "p99 µs", "ns/sample", "× best peer", "error/full scale"),
        (
            (
                row.variant,
                row.case,
                str(row.n_rows),
                f"{row.time.median_us:.2f}",
                f"{row.time.p99_us:.2f}",
                f"{row.ns_per_sample:.2f}",
                _to_peer(row.to_best_peer),
                f"{row.error_of_full_scale:.0e}",
            )
            for row in report.emg
        ),
    )
    _print_table(
        out,
        "many frames, 320×240, all cores: median µs a frame",
        ("reading", "frames", "one by one", "at once", "× one by one"),
        (
            (
                row.reading,
                str(row.n_frames),
                *(f"{time.median_us / row.n_frames:.1f}" for time in (row.one_by_one, row.at_once)),
                f"{row.to_one_by_one:.2f}",
            )
            for row in report.batches
        ),
    )
    _print_ticks(out, report)
    for name in report.missing:
        out.print(f"note: {name} is not installed, so what needs it was not measured")
    out.print(report.method, style="dim")


def _print_contact(out: Console, title: str, rows: Sequence[ContactRow]) -> None:
    lines = []
    for row in rows:
        e = row.error
        errors = (e.centroid_px, e.spread_relative, e.eda_pixels, e.cci_relative) if e is not None else ()
        times = f"{row.time.median_us:.1f}", f"{row.time.p99_us:.1f}", f"{row.to_floor:.2f}"
        displayed = [f"{error:.0e}" if 0 < error < 0.01 else f"{error:.3g}" for error in errors]
        lines.append((row.variant, *times, _to_peer(row.to_best_peer), *displayed))
    errors_of = "centroid px", "σ rel.", "EDA px", "CCI rel."
    columns = "contact metrics", "median µs", "p99 µs", "× floor", "× best peer", *errors_of
    _print_table(out, title, columns, lines)


def _print_ticks(out: Console, report: BenchReport) -> None:
    stages = list(report.tick[0].stages_us)
    _print_table(
        out,
        "one tick: four frames and 10 ms of EMG to a vest packet and CAN bytes, median µs",
        ("touch", "in contact", *stages, "in all", "p99"),
        (
            (
                row.reading,
                str(row.n_in_contact),
                *(f"{row.stages_us[name]:.1f}" for name in stages),
                f"{row.total.median_us:.0f}",
                f"{row.total.p99_us:.0f}",
            )
            for row in report.tick
        ),
    )


def print_simulation(report: SimReport) -> None:
    """Print where the time of simulated lifts goes."""
    out = Console(highlight=False, width=130)
    _print_machine(out, report.machine, "one thread")
    stages = dict.fromkeys(stage for row in report.rows for stage in row.stages_ms)
    lines = [
        *((stage, *(f"{row.stages_ms.get(stage, 0.0):.1f}" for row in report.rows)) for stage in stages),
        ("in all", *(f"{1e3 / row.real_time_factor:.1f}" for row in report.rows)),
        ("× real time", *(f"{row.real_time_factor:.1f}" for row in report.rows)),
        ("by the wall clock", *(f"{row.wall_factor:.1f}" for row in report.rows)),
    ]
    columns = "stage", *(f"{row.object}\n{row.part}" for row in report.rows)
    _print_table(out, "ms per simulated second", columns, lines)
    _print_table(
        out,
        "what a skip saves",
        ("object", "skip", "ms per simulated second", "share"),
        ((skip.object, skip.skip, f"{skip.saved_ms:.1f}", f"{skip.share:.0%}") for skip in report.skips),
        n_names=2,
    )
    out.print(report.method, style="dim")


def print_stations(report: StationsBench) -> None:
    """Print the time between two stations."""
    out = Console(highlight=False, width=100)
    ways = (
        ("a command over the link", report.command_ms),
        ("a picture's touch over the link", report.feature_ms),
        ("muscle to hand, all of it", report.intent_ms["whole"]),
        ("camera to vest, all of it", report.touch_ms["whole"]),
    )
    percentiles = "p50", "p95", "p99", "worst"
    _print_table(
        out,
        "two stations on one machine, ms",
        ("way", "n", *percentiles),
        ((name, str(route["n"]), *(f"{route[p]:.2f}" for p in percentiles)) for name, route in ways),
    )
    refused = ", ".join(f"{n} {why}" for why, n in report.refused.items()) or "none"
    clock, seconds = report.clock, report.seconds
    out.print(f"{report.features / seconds:.0f} touches and {report.images / seconds:.0f} pictures a second")
    out.print(f"not used: {refused}; link {'encrypted' if report.keys else 'not encrypted'}")
    out.print(f"clock {clock['offset_ms']:+.3f} ms, by a round trip of {clock['round_trip_ms']:.3f} ms")
