"""Run the whole system on emulated devices, with faults at random: ``tega-teleop soak``."""

from __future__ import annotations

from pathlib import Path

import click

from tega.ui.cli.options import FiniteRange, json_option

__all__ = ["soak"]


@click.command(epilog="Example: tega-teleop soak --seconds 60 --seed 1")
@click.option(
    "--seconds",
    type=FiniteRange(min=10.0),
    default=60.0,
    show_default=True,
    help="How long to measure, seconds.",
)
@click.option("--seed", type=int, default=1, show_default=True, help="Seed of the faults and their order.")
@click.option(
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    metavar="DIR",
    help="Keep report.json, errors.log, faults.png and the recordings here.",
)
@click.option(
    "--stations",
    is_flag=True,
    help="Two stations, robot and operator, and a link between them that breaks too.",
)
@click.option(
    "--patient",
    is_flag=True,
    help="For a machine that does other work: loosen the hand's limits of silence and rate.",
)
@json_option
def soak(
    *, seconds: float, seed: int, out: Path | None, stations: bool, patient: bool, as_json: bool
) -> None:
    """Run everything on emulated devices, make faults at random, and see that nothing bad comes of them.

    Four fingertip cameras, an EMG board, a hand, a vest, a headset and a pedal, each a program of its own, and a
    recorded run that leads a simulated arm; with --stations the same shared among two stations. They are unplugged,
    frozen, slowed down, fed with noise and wrong data; the clock is set, the disk is full, the run is killed. It
    passes if every fault is reported and over afterwards, no command beyond a limit reaches hand, vest or arm, no
    recording loses more than half a second, and memory does not grow; and if enough took place: at least 95 % of the
    faults could be judged, each kind once, and there were commands and recordings. Guards are set as they come, or as
    --patient says, which the report then states. Exit code 1 if it does not pass.
    """
    import sys
    import tempfile
    from contextlib import ExitStack

    import msgspec

    from tega.ui.cli.options import echo_json, progress_bar
    from tega_campaigns.soak.report import draw, print_report
    from tega_campaigns.soak.trial import soak as run_soak

    with ExitStack() as stack:
        folder = out
        if folder is None:
            folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="tega-soak-")))
        folder.mkdir(parents=True, exist_ok=True)
        with progress_bar(enabled=not as_json) as progress:
            report = run_soak(
                folder,
                seconds=seconds,
                seed=seed,
                stations=stations,
                keep=out is not None,
                patient=patient,
                progress=progress,
            )
    if out is not None:
        (out / "report.json").write_bytes(msgspec.json.format(msgspec.json.encode(report)) + b"\n")
        draw(report, out / "faults.png")
    if as_json:
        echo_json(msgspec.to_builtins(report))
    else:
        from rich.console import Console

        print_report(report, Console())
    if not report.passed:
        sys.exit(1)
