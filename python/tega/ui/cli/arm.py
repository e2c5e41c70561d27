"""Check a Franka robot, and align the forearm's tracker: ``tega-teleop arm check``, ``arm forward``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from tega.ui.cli.guest_group import GuestGroup
from tega.ui.cli.options import FiniteRange, echo_json, json_option

if TYPE_CHECKING:
    from tega.arm.heading import ForearmSweep
    from tega.config import SessionConfig
    from tega.devices.base import Tracker


_BAR = 20
_WIDTH = 79


@click.command(epilog="Example: tega-teleop arm forward lab.toml")
@click.argument("config", type=click.Path(exists=True, dir_okay=False, path_type=Path), metavar="CONFIG.toml")
@click.option(
    "--seconds",
    default=30.0,
    show_default=True,
    type=FiniteRange(1, 600),
    help="Seconds to wait for a movement.",
)
@json_option
def forward(*, config: Path, seconds: float, as_json: bool) -> None:
    """Align the forearm's tracker of CONFIG.toml with the operator, and check it.

    The operator moves the forearm straight forward by 20 cm and stops, twice: the first movement sets
    arm.mapping.yaw_rad, the second checks it. No robot is opened and no arm moves. The exit code is 1 if the check
    fails. With --json: yaw_rad, ok, off_rad and words, without waiting for a key.
    """
    import math
    import sys

    from tega.arm.heading import check_forward, kept_yaw, yaw_from_sweep
    from tega.config import load_config

    with _tracker(load_config(config).config) as tracker:
        frame = tracker.frame
        _ask("Hold the forearm still where you work, facing the way you will look.", as_json=as_json)
        found = _watch(tracker, seconds, yaw_rad=None)
        yaw_rad = kept_yaw(yaw_from_sweep(found.places, frame=frame))
        if not as_json:
            click.echo(f"forward is {math.degrees(yaw_rad):+.0f}° off the tracker's own")
        _ask("Go back and hold still; now the check.", as_json=as_json)
        again = _watch(tracker, seconds, yaw_rad=None if as_json else yaw_rad)
        judged = check_forward(again.places, frame=frame, yaw_rad=yaw_rad)
    if as_json:
        echo_json(
            {"yaw_rad": yaw_rad, "ok": judged.ok, "off_rad": round(judged.off_rad, 4), "words": judged.words}
        )
    else:
        click.echo(judged.words)
        if judged.ok:
            click.echo("Put this into the settings, in the robot's file where there are two machines:")
            click.echo(f"  [arm.mapping]\n  yaw_rad = {yaw_rad}")
            click.echo(
                "base_yaw_rad beside it says which way the robot's base points as you see it: 0 away from you, 1.5708 "
                "to your left, 3.1415 towards you."
            )
            click.echo("tega-teleop calibrate keeps both for a person instead, as one of its steps.")
    if not judged.ok:
        sys.exit(1)


def _tracker(config: SessionConfig) -> Tracker:
    from tega.devices.registry import driver_class
    from tega.errors import ConfigError

    set_here = (getattr(part, "tracker", None) for part in (config.arm, *config.guests.values()))
    section = next((one for one in set_here if one is not None), None)
    if section is None:
        raise ConfigError(
            "no tracker is set, so there is no forward to find",
            "set [arm.tracker]; a SpaceMouse needs none of this but arm.mapping.base_yaw_rad, where the base does not "
            "point away from the operator",
        )
    tracker: Tracker = driver_class(section.driver, "tracker")(section.options)
    return tracker


def _ask(words: str, *, as_json: bool) -> None:
    if not as_json:
        click.echo(words)
        click.pause("Press any key, then move it straight forward by 20 cm and stop.")


def _watch(tracker: Tracker, seconds: float, *, yaw_rad: float | None) -> ForearmSweep:
    """Wait for a movement; with a yaw show how it looks from the robot while it lasts."""
    from tega.setup.calibration.steps_arm import watch_sweep

    text = ""

    def displayed(sweep: ForearmSweep, _left_s: float) -> None:
        nonlocal text
        if yaw_rad is not None and (line := _seen(sweep)) != text:
            text = line
            click.echo(f"\r{line}", nl=False)

    try:
        return watch_sweep(tracker, seconds, yaw_rad=yaw_rad, displayed=displayed)
    finally:
        if yaw_rad is not None:
            click.echo()


def _seen(sweep: ForearmSweep) -> str:
    ahead, left, up = (round(100 * float(x)) for x in sweep.gone_m)
    bar = "#" * max(0, min(_BAR, ahead))
    side = f"{abs(left)} cm to the {'left' if left > 0 else 'right'}" if left else "straight"
    return f"forward [{bar:<{_BAR}}] {ahead:+4d} cm, {side}, {up:+d} cm up".ljust(_WIDTH)


class _Arm(GuestGroup):
    """The arm's verbs; ``arm HOST``, as it was called before, is ``arm check HOST``."""

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        if not args[0].startswith("-") and args[0] not in self.commands and "." in args[0]:
            click.echo(f"note: arm {args[0]} is now: tega-teleop arm check {args[0]}", err=True)
            args = ["check", *args]
        return super().resolve_command(ctx, args)


@click.group(cls=_Arm, epilog="Example: tega-teleop arm check 172.16.0.2")
def arm() -> None:
    """Check a Franka robot, and align the forearm's tracker with the operator."""


arm.add_command(forward)


@arm.command(epilog="Example: tega-teleop arm check 172.16.0.2")
@click.argument("host")
@json_option
def check(*, host: str, as_json: bool) -> None:
    """Check the Franka robot at HOST: print its version, and the changes needed on this machine.

    Nothing moves. The robot accepts one program at a time, so disconnect all others first. The exit code is 1 if
    something is missing. With --json: host, server, library (package, version, libfranka, server) and findings, each
    with ok, what and fix.
    """
    import sys

    from tega.devices.arm.robot.fci import preflight

    server, library, findings = preflight(host)
    if as_json:
        named = [{"ok": ok, "what": subject, "fix": "" if ok else text} for ok, subject, text in findings]
        about = None if library is None else library._asdict()
        echo_json({"host": host, "server": server, "library": about, "findings": named})
    else:
        for ok, subject, text in findings:
            click.echo(f"{'ok ' if ok else 'no '} {subject}")
            if not ok:
                click.echo(f"    {text}")
    if not all(ok for ok, _, _ in findings):
        sys.exit(1)
