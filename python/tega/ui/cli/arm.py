"""Check a Franka robot, its server, the library and this machine: ``tega-teleop arm check``."""

from __future__ import annotations

import click

from tega.ui.cli.forward import forward
from tega.ui.cli.guest_group import GuestGroup
from tega.ui.cli.options import echo_json, json_option


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
