"""Write a settings file for the devices that are plugged in: ``tega-teleop init``."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable
from pathlib import Path

import click

from tega.errors import ConfigError, TegaError
from tega.ui.cli.lists import could_not_look
from tega.ui.cli.options import FILE, echo_json, json_option


@click.command(epilog="Example: tega-teleop init --out lab.toml")
@click.option("--out", type=FILE, default=Path("lab.toml"), show_default=True, help="The file to write.")
@click.option("--force", is_flag=True, help="Overwrite the file if it is there.")
@click.option(
    "--emulated",
    is_flag=True,
    help="Start emulated devices, write settings that reach them, and keep them up.",
)
@click.option(
    "--arm",
    metavar="DRIVER",
    help="Switch the arm's table on, with this driver: franky, bench-arm, simulated-arm; else it is a comment. "
    "With --emulated an arm is led too: franky on a robot of franky-sim, bench-arm or simulated-arm.",
)
@click.option(
    "--stations",
    is_flag=True,
    help="With --emulated: settings for two stations, as docs/two-machines.md says.",
)
@click.option(
    "--play",
    type=int,
    metavar="SEED",
    help="With --emulated: squeeze, rest and press by a script of this seed, until a move is typed.",
)
@json_option
def init(
    *,
    out: Path,
    force: bool,
    emulated: bool,
    stations: bool,
    arm: str | None,
    play: int | None,
    as_json: bool,
) -> None:
    """Write a settings file: connected devices are filled in, the others are comments with instructions.

    Opens no device. With --emulated, two cameras, an EMG board, a vest and a hand run as programs until Ctrl-C, with
    a baseline and a calibration made for them. Another terminal can then try `doctor` and `run` on the file. With
    --arm, a headset and a pedal run as well; the emulated operator presses the dead-man switch for 8 s out of every
    10 s.

    With --json: {"file", "found", "could_not"}, found and could_not by driver; with --stations "robot" and "operator"
    as well, with --arm "pythonpath", a folder that `run` needs in PYTHONPATH to find the emulated pedal.
    """
    from tega.config import load_config
    from tega.devices.registry import driver_class
    from tega.setup.doctor import lab_settings, probe_drivers

    if out.exists() and not force:
        raise ConfigError(
            f"{out} is there already; nothing was written", "--force overwrites it, --out names another"
        )
    if not out.parent.is_dir():
        raise ConfigError(
            f"there is no folder {out.parent}", "make it first, or name another file with --out"
        )
    if arm is not None:
        driver_class(arm, "arm")
    if emulated:
        _emulate(out, stations=stations, arm=arm, play=play, as_json=as_json)
        return
    if stations:
        raise click.UsageError(
            "--stations goes with --emulated; docs/two-machines.md shows how to write the files"
        )
    if play is not None:
        raise click.UsageError("--play goes with --emulated: real devices are moved by people")
    looked = probe_drivers()
    out.write_text(lab_settings(looked, name=out.name, arm=arm), encoding="utf-8")
    load_config(out, environ={})  # what is written can be read
    found = {name: [one.label for one in there.found] for name, there in looked.items() if there.found}
    if as_json:
        could_not = {name: there.could_not for name, there in looked.items() if there.could_not}
        echo_json({"file": str(out), "found": found, "could_not": could_not})
        return
    for name, labels in found.items():
        for label in labels:
            click.echo(f"found  {name}: {label}")
    for line in could_not_look(looked):
        click.echo(line)
    if not found:
        click.echo("Nothing is plugged in that could be found; every device stands in the file as a comment.")
    click.echo(f"Wrote {out}. Read it through, then: tega-teleop doctor {out}")


def _emulate(out: Path, *, stations: bool, arm: str | None, play: int | None, as_json: bool) -> None:
    import shlex
    import time
    import tomllib

    from tega.runtime.lifecycle import needs_tools
    from tega.safety.stop import CtrlC

    with needs_tools("tega-teleop init --emulated"):
        from tega_emulators.bench_moves import MOVES
        from tega_emulators.emulated_bench import EmulatedBench
        from tega_emulators.stations import free_port, split, write_trees

    if not as_json:
        click.echo("Starting emulated devices …", err=True)
    with EmulatedBench(arm) as bench, CtrlC() as stop:
        bench.write_settings(out)
        found = {name: [one.label for one in there.found] for name, there in bench.looked.items()}
        files, operator = {}, bench.operator
        hidapi = None if operator is None else operator.hidapi
        # Where the emulated pedal is found.
        ahead = "" if hidapi is None else f"PYTHONPATH={shlex.quote(str(hidapi))} "
        if stations:
            address = f"tcp/127.0.0.1:{free_port()}"
            trees = split(tomllib.loads(out.read_text(encoding="utf-8")), listen=address, connect=address)
            written = map(str, write_trees(out.parent, trees, f"{out.stem}-"))
            files = dict(zip(("robot", "operator"), written, strict=True))
        if as_json:
            also = {} if hidapi is None else {"pythonpath": str(hidapi)}
            echo_json({"file": str(out), **files, **also, "found": found, "could_not": {}})
        elif stations:
            click.echo(
                "The emulated devices run until Ctrl-C; in two other terminals:\n"
                f"  tega-teleop robot {files['robot']}\n  {ahead}tega-teleop operator {files['operator']}"
            )
        else:
            click.echo(
                f"Wrote {out}. The emulated devices run until Ctrl-C; in another terminal:\n"
                f"  {ahead}tega-teleop doctor {out}\n  {ahead}tega-teleop run {out}"
            )
        if play is not None:
            bench.moves.play(play)
        if _may_read():
            if not as_json:
                click.echo(f"Type here what muscles and fingertips do: {MOVES}")
            threading.Thread(
                target=_act_as_typed, args=(bench.moves.act,), name="tega-typed", daemon=True
            ).start()
        begin_s = time.monotonic()
        while not stop():
            if operator is not None:
                operator.act(time.monotonic() - begin_s)
            time.sleep(0.1)


def _act_as_typed(act: Callable[[str], object]) -> None:
    for line in sys.stdin:
        if not line.strip():
            continue
        try:
            act(line.strip())
        except TegaError as error:
            click.echo(f"error: {error}", err=True)


def _may_read() -> bool:
    """Whether reading the standard input is allowed: the system stops a background program that reads its terminal."""
    if sys.platform == "win32" or not sys.stdin.isatty():
        return True
    return os.getpgrp() == os.tcgetpgrp(sys.stdin.fileno())
