"""Check a Franka robot, its server, the library and this machine: ``tega-teleop arm``."""

from __future__ import annotations

import click

from tega.cli.options import debug_option, json_option

__all__ = ["arm"]


@click.command(epilog="Example: tega-teleop arm 172.16.0.2")
@click.argument("host")
@json_option
@debug_option
def arm(*, host: str, as_json: bool) -> None:
    """Check the Franka robot at HOST: print its version, and what has to be installed or set here.

    Nothing moves. The robot takes one program at a time, so no other may be connected. Ends with 1 if something is
    missing. With --json: host, server, library (package, version, libfranka, server) and findings, each with ok, what
    and fix.
    """
    import sys

    from tega.arm.robot.fci import preflight
    from tega.cli.options import echo_json

    server, library, findings = preflight(host)
    if as_json:
        named = [{"ok": ok, "what": what, "fix": "" if ok else said} for ok, what, said in findings]
        about = None if library is None else library._asdict()
        echo_json({"host": host, "server": server, "library": about, "findings": named})
    else:
        for ok, what, said in findings:
            click.echo(f"{'ok ' if ok else 'no '} {what}")
            if not ok:
                click.echo(f"    {said}")
    if not all(ok for ok, _, _ in findings):
        sys.exit(1)
