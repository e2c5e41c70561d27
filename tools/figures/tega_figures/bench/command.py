"""Measure run time and error, ours and others', in one run: ``tega-teleop bench``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Literal

import click

from tega.ui.cli.options import NameList, PngPath, json_option

if TYPE_CHECKING:
    from rich.console import Console

    from tega_figures.bench.report import BenchReport, ContactRow
    from tega_figures.bench.simulation import SimReport

__all__ = ["bench"]


@click.group(
    invoke_without_command=True,
    epilog="Example: tega-teleop bench --quick --picture pareto.png; tega-teleop bench sim",
)
@click.option(
    "--picture",
    type=PngPath(),
    help="Draw time against error into this PNG.",
)
@click.option("--quick", is_flag=True, help="A tenth of the rounds, and not the largest pictures.")
@json_option
@click.pass_context
def bench(ctx: click.Context, /, *, picture: Path | None, quick: bool, as_json: bool) -> None:
    """Measure run time and error of the kernels, of other ways to compute the same, and of a whole tick.

    What is compared: each reading of the contact equations at four picture sizes, with OpenCV, NumPy and Numba doing
    the same; the EMG low-pass, with SciPy and Numba; one tick with 0 to 4 fingers in contact. Packages that are not
    installed are left out and listed. It takes one to two minutes, --quick about twenty seconds; figures made
    while the machine does other work are good for ratios at best.

    \b
    --json prints one object (all times in microseconds):
      method, threads, missing    how it was measured, what was held to one thread, what is not installed
      machine   cpu, n_cores, load_per_core, instruction_set, system, versions
      contact   [{reading, variant, size: [height, width], time: {median_us, p99_us, n_calls}, to_floor,
                to_best_peer, error: {centroid_px, spread_relative, eda_pixels, cci_relative} or null}]
      emg       [{case: block|bulk, variant, n_rows, time, ns_per_sample, to_best_peer, error_of_full_scale}]
      batches   [{reading, n_frames, one_by_one: {median_us, ...}, at_once: {median_us, ...}, to_one_by_one}]
      tick      [{reading, n_in_contact, stages_us: {stage: ...}, total: {median_us, p99_us, n_calls},
                saved_us: {skip: ...}}]
    to_floor and to_best_peer are times over the time of the reference: below 1 is faster.
    """  # noqa: D301  # click keeps the lines after \b as they are
    if ctx.invoked_subcommand is not None:
        return
    import msgspec

    from tega.ui.cli.options import echo_json, progress_bar
    from tega_figures.bench.report import run_bench

    with progress_bar() as progress:
        report = run_bench(quick=quick, progress=progress)
    if picture is not None:
        from tega_figures.bench.picture import draw_pareto

        draw_pareto(picture, report)
    if as_json:
        echo_json(msgspec.to_builtins(report))
    else:
        _print(report)


@bench.command(epilog="Example: tega-teleop bench sim --repeats 3 --json")
@click.option(
    "--objects",
    type=NameList(),
    default="bottle,container,bag",
    show_default=True,
    help="Objects that are lifted.",
)
@click.option(
    "--repeats",
    type=click.IntRange(1, 1000),
    default=5,
    show_default=True,
    help="How often each lift is repeated.",
)
@click.option(
    "--preset",
    type=click.Choice(["paper", "live"]),
    default="live",
    show_default=True,
    help="Readings of the equations: paper (as printed) or live (meant for people).",
)
@json_option
def sim(*, objects: list[str], repeats: int, preset: Literal["paper", "live"], as_json: bool) -> None:
    """Measure where the time of simulated lifts goes, and what each skip saves.

    \b
    --json prints one object:
      method, machine, repeats
      rows   [{object, part: whole|grasping, simulated_s, real_time_factor, wall_factor, stages_ms: {stage: ...}}]
      skips  [{object, skip, saved_ms, share}]
    All times are milliseconds of processor time per simulated second.
    """  # noqa: D301  # click keeps the lines after \b as they are
    import msgspec

    from tega.ui.cli.options import echo_json, progress_bar
    from tega_figures.bench.simulation import bench_simulation

    with progress_bar() as progress:
        report = bench_simulation(objects=objects, repeats=repeats, preset=preset, progress=progress)
    if as_json:
        echo_json(msgspec.to_builtins(report))
    else:
        _print_simulation(report)


@bench.command(epilog="Example: tega-teleop bench loop --seconds 20")
@click.option(
    "--seconds",
    type=click.FloatRange(3, 3600),
    default=20,
    show_default=True,
    help="How long to measure, seconds.",
)
@click.option(
    "--record",
    is_flag=True,
    help="Record the run and write its tables as well, into a folder that is removed.",
)
@click.option(
    "--pace",
    type=click.Choice(["by-frame", "steady"]),
    default="by-frame",
    show_default=True,
    help="When vest frames are made: as pictures come, or 30 times a second.",
)
@click.option(
    "--most-hz",
    type=click.FloatRange(10, 1000),
    help="Greatest rate of the vest's link, such as 50 for Bluetooth; the Player's is 500.",
)
@click.option(
    "--preset",
    type=click.Choice(["paper", "live"]),
    default="live",
    show_default=True,
    help="Preset of the session. With paper, all versions measure touch alike, so that the rest can be compared.",
)
@click.option(
    "--realtime/--no-realtime",
    default=True,
    show_default=True,
    help="Whether the run and the bare clock beside it ask for real-time priority.",
)
@click.option("--page", is_flag=True, help="Have a Chromium without a window show the run's page meanwhile.")
@click.option(
    "--busy",
    type=click.IntRange(0, 64),
    default=0,
    show_default=True,
    help="Programs that keep a core busy each, at ordinary priority.",
)
@json_option
def loop(
    *,
    seconds: float,
    record: bool,
    pace: Literal["by-frame", "steady"],
    most_hz: float | None,
    preset: Literal["paper", "live"],
    realtime: bool,
    page: bool,
    busy: int,
    as_json: bool,
) -> None:
    """Run the whole loop in real time on emulated devices and measure how long each stage takes.

    Four DIGITs at 60 Hz, EMG at 1 kHz, an Allegro Hand at 333 Hz and a vest, each emulated in a process of its own on
    this machine, so the loop has only what they leave of it.

    \b
    --json prints one object:
      machine, preset, seconds
      latency_ms  {touch|intent: {stage: {n, p50, p95, p99, worst}}}; "in-hand" is all from a picture in our hands to
                  the vest's bytes handed over, "own" the same without what is waited for
      pacing      {ticks, overruns, skipped, worst_late_ms, late}
      late_ticks, hand_ticks, witness_ticks  {ticks, late, over_1_ms, worst_ms}: of the loop; of the hand's own process,
                  by how long after its positions the emulated hand had its torques; and of a bare native clock of
                  3 ms in a process beside them; "late" counts ticks by the bins whose upper bounds are late_edges_ms
      vest        {frames, sent, skipped, ...}
      frames_hz, samples_hz, hand_hz, held_ticks, threads, page, busy
      cpu_cores, run_cores, emulators_cores, browser_cores
    """  # noqa: D301  # click keeps the lines after \b as they are
    import msgspec

    from tega.runtime.threads import spare_threads
    from tega.ui.cli.options import echo_json
    from tega.ui.cli.report import latency_tables

    spare_threads()  # as the command run does, before what is imported here
    from tega_figures.bench.live_loop import bench_loop

    report = bench_loop(
        seconds=seconds,
        record=record,
        pace=pace,
        most_hz=most_hz,
        preset=preset,
        realtime=realtime,
        page=page,
        busy=busy,
    )
    if as_json:
        echo_json(msgspec.to_builtins(report))
        return
    from rich.console import Console

    out = Console(highlight=False, width=100)
    for table in latency_tables(report.latency_ms):
        out.print(table)
    pacing = report.pacing
    out.print(
        f"{report.frames_hz:.0f} pictures, {report.samples_hz:.0f} EMG samples and {report.hand_hz:.0f} ticks "
        f"of the hand a second; {report.threads} threads"
    )
    out.print(
        f"{report.run_cores:.2f} cores for the run, {report.cpu_cores:.2f} with its hand, guard and recorder; "
        f"{report.emulators_cores:.2f} for the emulated devices, {report.browser_cores:.2f} for the browser"
    )
    vest = report.vest
    out.print(
        f"vest {vest['pace']}: {vest['frames'] / report.seconds:.0f} frames made and "
        f"{vest['sent'] / report.seconds:.0f} handed to its driver a second; "
        f"{vest['replaced']} pictures were replaced by newer ones before its link was free"
    )
    out.print(
        f"{pacing['overruns']} of {pacing['ticks']} ticks late by more than 3 ms "
        f"(worst {pacing['worst_late_ms']:.1f} ms), {pacing['skipped']} left out"
    )
    late, hand, bare = report.late_ticks, report.hand_ticks, report.witness_ticks
    out.print(
        f"late by more than 1 ms: {late.over_1_ms} of these; {hand.over_1_ms} of {hand.ticks} answers to the hand "
        f"(worst {hand.worst_ms:.1f} ms); {bare.over_1_ms} of {bare.ticks} of a bare clock "
        f"(worst {bare.worst_ms:.1f} ms)"
    )


@bench.command(epilog="Example: tega-teleop bench start --repeats 5")
@click.option(
    "--repeats",
    type=click.IntRange(1, 1000),
    default=5,
    show_default=True,
    help="How often the run is started.",
)
@click.option("--record", is_flag=True, help="Record the runs, into a folder that is removed.")
@click.option(
    "--emg-hz",
    type=click.Choice(["250", "1000"]),
    default="1000",
    show_default=True,
    help="Samples a second: 250 for a Cyton, 1000 for a board that blinks for 0.4 s and is measured for 1 s.",
)
@json_option
def start(*, repeats: int, record: bool, emg_hz: str, as_json: bool) -> None:
    """Start the command run on emulated devices, and tell how long until its first tick.

    Each run is a process of its own, and the time counts from its start. The devices are those of bench loop.

    \b
    --json prints one object:
      machine, emg_hz
      first_tick_s  [seconds, one a run]
      stages_s      {stage: [seconds until it was reached, one a run]}
    """  # noqa: D301  # click keeps the lines after \b as they are
    import msgspec

    from tega.ui.cli.options import echo_json
    from tega_figures.bench.start import bench_start

    report = bench_start(repeats=repeats, record=record, emg_hz=1000 if emg_hz == "1000" else 250)
    if as_json:
        echo_json(msgspec.to_builtins(report))
        return
    for stage, reached_s in report.stages_s.items():
        click.echo(f"{stage:22} " + " ".join(f"{s:6.2f}" for s in reached_s) + " s")


@bench.command(epilog="Example: tega-teleop bench stations --seconds 20 --keys")
@click.option(
    "--seconds",
    type=click.FloatRange(2, 3600),
    default=20,
    show_default=True,
    help="How long to measure, seconds.",
)
@click.option("--keys", is_flag=True, help="Encrypt the link, with keys made for this.")
@click.option(
    "--images-hz",
    type=click.FloatRange(0, 60),
    default=10,
    show_default=True,
    help="Pictures a second of each fingertip for display.",
)
@json_option
def stations(*, seconds: float, keys: bool, images_hz: float, as_json: bool) -> None:
    """Run two stations on emulated devices and measure the way between them.

    Four DIGITs at 60 Hz and an Allegro Hand at the robot's station, EMG at 1 kHz and a vest at the operator's; both
    stations and every device are programs of their own on this machine, so there is no network between them.

    \b
    --json prints one object:
      machine, seconds, keys, images_hz
      touch_ms    {stage: {n, p50, p95, p99, worst}}: camera to the vest's bytes; "whole" is all of it
      intent_ms   the same, EMG sample to the hand's torques
      command_ms, feature_ms   {n, p50, p95, p99, worst}: the way over the link alone
      clock, refused, commands, features, images
    """  # noqa: D301  # click keeps the lines after \b as they are
    import msgspec

    from tega.ui.cli.options import echo_json
    from tega_figures.bench.stations import bench_stations

    report = bench_stations(seconds=seconds, keys=keys, images_hz=images_hz)
    if as_json:
        echo_json(msgspec.to_builtins(report))
        return
    from rich.box import SIMPLE
    from rich.console import Console
    from rich.table import Table

    out = Console(highlight=False, width=100)
    table = Table(title="two stations on one machine, ms", title_justify="left", box=SIMPLE)
    table.add_column("way", no_wrap=True)
    for name in ("n", "p50", "p95", "p99", "worst"):
        table.add_column(name, justify="right")
    for name, route in (
        ("a command over the link", report.command_ms),
        ("a picture's touch over the link", report.feature_ms),
        ("muscle to hand, all of it", report.intent_ms["whole"]),
        ("camera to vest, all of it", report.touch_ms["whole"]),
    ):
        table.add_row(name, str(route["n"]), *(f"{route[p]:.2f}" for p in ("p50", "p95", "p99", "worst")))
    out.print(table)
    refused = ", ".join(f"{n} {why}" for why, n in report.refused.items()) or "none"
    clock = report.clock
    out.print(
        f"{report.features / report.seconds:.0f} touches and {report.images / report.seconds:.0f} pictures a second"
    )
    out.print(f"not used: {refused}; link {'encrypted' if report.keys else 'not encrypted'}")
    out.print(f"clock {clock['offset_ms']:+.3f} ms, by a round trip of {clock['round_trip_ms']:.3f} ms")


def _print_simulation(report: SimReport) -> None:
    from rich.box import SIMPLE
    from rich.console import Console
    from rich.table import Table

    out = Console(highlight=False, width=130)
    machine = report.machine
    load = "" if machine.load_per_core is None else f", load {machine.load_per_core:g} a core"
    out.print(f"{machine.cpu}, {machine.n_cores} cores{load}, one thread")
    table = Table(title="ms per simulated second", title_justify="left", box=SIMPLE)
    table.add_column("stage", no_wrap=True)
    for row in report.rows:
        table.add_column(f"{row.object}\n{row.part}", justify="right")
    for stage in dict.fromkeys(stage for row in report.rows for stage in row.stages_ms):
        table.add_row(stage, *(f"{row.stages_ms.get(stage, 0.0):.1f}" for row in report.rows))
    table.add_row("in all", *(f"{1e3 / row.real_time_factor:.1f}" for row in report.rows))
    table.add_row("× real time", *(f"{row.real_time_factor:.1f}" for row in report.rows), style="bold")
    table.add_row("by the wall clock", *(f"{row.wall_factor:.1f}" for row in report.rows))
    out.print(table)
    table = Table(title="what a skip saves", title_justify="left", box=SIMPLE)
    for name in ("object", "skip"):
        table.add_column(name, no_wrap=True)
    for name in ("ms per simulated second", "share"):
        table.add_column(name, justify="right")
    for skip in report.skips:
        table.add_row(skip.object, skip.skip, f"{skip.saved_ms:.1f}", f"{skip.share:.0%}")
    out.print(table)
    out.print(report.method, style="dim")


def _print(report: BenchReport) -> None:
    from rich.console import Console

    out = Console(highlight=False, width=130)
    machine = report.machine
    load = "" if machine.load_per_core is None else f", load {machine.load_per_core:g} a core"
    out.print(
        f"{machine.cpu}, {machine.n_cores} cores{load}, kernels in {machine.instruction_set}, one thread"
    )
    out.print(", ".join(f"{name} {version}" for name, version in machine.versions.items()))
    for reading, size in dict.fromkeys((row.reading, row.size) for row in report.contact):
        rows = [row for row in report.contact if (row.reading, row.size) == (reading, size)]
        _print_contact(out, f"{reading}, {size[0]}×{size[1]}", rows)
    _print_emg(out, report)
    _print_batches(out, report)
    _print_ticks(out, report)
    for name in report.missing:
        out.print(f"note: {name} is not installed, so what needs it was not measured")
    out.print(report.method, style="dim")


def _print_contact(out: Console, title: str, rows: list[ContactRow]) -> None:
    from rich.box import SIMPLE
    from rich.table import Table

    table = Table(title=title, title_justify="left", box=SIMPLE)
    table.add_column("contact metrics", no_wrap=True, min_width=21)
    for name in (
        "median µs",
        "p99 µs",
        "× floor",
        "× best peer",
        "centroid px",
        "σ rel.",
        "EDA px",
        "CCI rel.",
    ):
        table.add_column(name, justify="right", min_width=8)
    for row in rows:
        e = row.error
        errors = (e.centroid_px, e.spread_relative, e.eda_pixels, e.cci_relative) if e is not None else ()
        table.add_row(
            row.variant,
            f"{row.time.median_us:.1f}",
            f"{row.time.p99_us:.1f}",
            f"{row.to_floor:.2f}",
            "–" if row.to_best_peer is None else f"{row.to_best_peer:.2f}",
            *(f"{error:.0e}" if 0 < error < 0.01 else f"{error:.3g}" for error in errors),
        )
    out.print(table)


def _print_emg(out: Console, report: BenchReport) -> None:
    from rich.box import SIMPLE
    from rich.table import Table

    table = Table(title="EMG low-pass, 4th order, 3 channels", title_justify="left", box=SIMPLE)
    table.add_column("rows", justify="right")
    table.add_column("variant", no_wrap=True)
    for name in ("median µs", "p99 µs", "ns/sample", "× best peer", "error/full scale"):
        table.add_column(name, justify="right")
    for row in report.emg:
        table.add_row(
            str(row.n_rows),
            row.variant,
            f"{row.time.median_us:.2f}",
            f"{row.time.p99_us:.2f}",
            f"{row.ns_per_sample:.2f}",
            "–" if row.to_best_peer is None else f"{row.to_best_peer:.2f}",
            f"{row.error_of_full_scale:.0e}",
        )
    out.print(table)


def _print_batches(out: Console, report: BenchReport) -> None:
    from rich.box import SIMPLE
    from rich.table import Table

    table = Table(
        title="many frames, 240×320, all cores: median µs a frame", title_justify="left", box=SIMPLE
    )
    table.add_column("reading", no_wrap=True)
    for name in ("frames", "one by one", "at once", "× one by one"):
        table.add_column(name, justify="right")
    for row in report.batches:
        times = (f"{time.median_us / row.n_frames:.1f}" for time in (row.one_by_one, row.at_once))
        table.add_row(row.reading, str(row.n_frames), *times, f"{row.to_one_by_one:.2f}")
    out.print(table)


def _print_ticks(out: Console, report: BenchReport) -> None:
    from rich.box import SIMPLE
    from rich.table import Table

    title = "one tick: four frames and 10 ms of EMG to a vest packet and CAN bytes, median µs"
    table = Table(title=title, title_justify="left", box=SIMPLE)
    table.add_column("touch", no_wrap=True)
    stages = list(report.tick[0].stages_us)
    for name in ("in contact", *stages, "in all", "p99"):
        table.add_column(name, justify="right")
    for row in report.tick:
        table.add_row(
            row.reading,
            str(row.n_in_contact),
            *(f"{row.stages_us[name]:.1f}" for name in stages),
            f"{row.total.median_us:.0f}",
            f"{row.total.p99_us:.0f}",
        )
    out.print(table)
    skips = list(report.tick[0].saved_us)
    table = Table(title="what a skip saves of such a tick, median µs", title_justify="left", box=SIMPLE)
    table.add_column("touch", no_wrap=True)
    for name in ("in contact", *skips):
        table.add_column(name, justify="right")
    for row in report.tick:
        table.add_row(row.reading, str(row.n_in_contact), *(f"{row.saved_us[name]:.1f}" for name in skips))
    out.print(table)
