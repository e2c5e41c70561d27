"""Measure run time and error, ours and others', in one run: ``tega-teleop bench``."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import click

from tega.ui.cli.options import FiniteRange, PngPath, json_option, preset_option
from tega_sim.cli.options import objects_option

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
    the same, and at every width from 100 to 720 pixels; the EMG low-pass, with SciPy and Numba; one tick with 0 to
    4 fingers in contact. Packages that are not installed are left out and listed. It takes two minutes, --quick about
    twenty seconds; figures made while the machine does other work are good for ratios at best.

    \b
    --json prints one object (all times in microseconds):
      method, threads, missing    how it was measured, what was held to one thread, what is not installed
      machine   cpu, n_cores, load_per_core, instruction_set, system, versions
      contact   [{reading, variant, size: [height, width], time: {median_us, p99_us, n_calls}, to_floor,
                to_best_peer, error: {centroid_px, spread_relative, eda_pixels, cci_relative} or null}]
      widths    [{size, strided, to_floor: {kernel: ...}, peer_to_ours: {law: ...}}]: over NumPy's or-reduce; OpenCV's
                fastest form over ours
      emg       [{case: block|bulk|one channel, variant, n_rows, time, ns_per_sample, to_best_peer,
                error_of_full_scale}]
      batches   [{reading, n_frames, one_by_one: {median_us, ...}, at_once: {median_us, ...}, to_one_by_one}]
      tick      [{reading, n_in_contact, stages_us: {stage: ...}, total: {median_us, p99_us, n_calls}}]
    to_floor and to_best_peer are times over the time of the reference: below 1 is faster.
    """  # noqa: D301  # click keeps the lines after \b as they are
    if ctx.invoked_subcommand is not None:
        return
    import msgspec

    from tega.ui.cli.options import echo_json, progress_bar
    from tega_figures.bench.report import run_bench
    from tega_figures.bench.tables import print_bench

    with progress_bar() as progress:
        report = run_bench(quick=quick, progress=progress)
    if picture is not None:
        from tega_figures.bench.picture import draw_pareto

        draw_pareto(picture, report)
    if as_json:
        echo_json(msgspec.to_builtins(report))
    else:
        print_bench(report)


@bench.command(epilog="Example: tega-teleop bench sim --repeats 3 --json")
@objects_option
@click.option(
    "--repeats",
    type=click.IntRange(1, 1000),
    default=5,
    show_default=True,
    help="How often each lift is repeated.",
)
@preset_option
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
    from tega_figures.bench.tables import print_simulation

    with progress_bar() as progress:
        report = bench_simulation(objects=objects, repeats=repeats, preset=preset, progress=progress)
    if as_json:
        echo_json(msgspec.to_builtins(report))
    else:
        print_simulation(report)


@bench.command(epilog="Example: tega-teleop bench loop --seconds 20")
@click.option(
    "--seconds",
    type=FiniteRange(3, 3600),
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
    type=FiniteRange(10, 1000),
    help="Greatest rate of the vest's link, such as 50 for Bluetooth; the Player's is 500.",
)
@preset_option
@click.option(
    "--fingers",
    "n_fingers",
    type=click.IntRange(1, 32),
    default=4,
    show_default=True,
    help="Number of DIGITs; the vest's four columns are shared among them.",
)
@json_option
def loop(
    *,
    seconds: float,
    record: bool,
    pace: Literal["by-frame", "steady"],
    most_hz: float | None,
    preset: Literal["paper", "live"],
    n_fingers: int,
    as_json: bool,
) -> None:
    """Run the whole loop in real time on emulated devices and measure how long each stage takes.

    Four DIGITs, or --fingers, at 60 Hz, EMG at 1 kHz, an Allegro Hand at 333 Hz and a vest, each emulated in a process
    of its own on this machine, so the loop has only what they leave of it.

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
      frames_hz, samples_hz, hand_hz, held_ticks, threads
      cpu_cores, run_cores, emulators_cores
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
        n_fingers=n_fingers,
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
        f"{report.emulators_cores:.2f} for the emulated devices"
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


@bench.command(epilog="Example: tega-teleop bench stations --seconds 20 --keys")
@click.option(
    "--seconds",
    type=FiniteRange(2, 3600),
    default=20,
    show_default=True,
    help="How long to measure, seconds.",
)
@click.option("--keys", is_flag=True, help="Encrypt the link, with keys made for this.")
@json_option
def stations(*, seconds: float, keys: bool, as_json: bool) -> None:
    """Run two stations on emulated devices and measure the way between them.

    Four DIGITs at 60 Hz and an Allegro Hand at the robot's station, EMG at 1 kHz and a vest at the operator's; both
    stations and every device are programs of their own on this machine, so there is no network between them.

    \b
    --json prints one object:
      machine, seconds, keys
      touch_ms    {stage: {n, p50, p95, p99, worst}}: camera to the vest's bytes; "whole" is all of it
      intent_ms   the same, EMG sample to the hand's torques
      command_ms, feature_ms   {n, p50, p95, p99, worst}: the way over the link alone
      clock, refused, commands, features, images
    """  # noqa: D301  # click keeps the lines after \b as they are
    import msgspec

    from tega.ui.cli.options import echo_json
    from tega_figures.bench.stations import bench_stations
    from tega_figures.bench.tables import print_stations

    report = bench_stations(seconds=seconds, keys=keys)
    if as_json:
        echo_json(msgspec.to_builtins(report))
        return
    print_stations(report)
