"""``tega-teleop arm``: is the robot there, and do its server, the library and this machine fit together?"""

from __future__ import annotations

import click

from tega.cli.options import debug_option, json_option

__all__ = ["arm"]


@click.command(epilog="Example: tega-teleop arm 172.16.0.2")
@click.argument("host")
@json_option
@debug_option
def arm(*, host: str, as_json: bool) -> None:
    """Ask the Franka robot at HOST for its version, and say what has to be installed or set here.

    Nothing moves. The robot takes one program at a time, so no other may be connected. Ends with 1 if something is
    missing. With --json: host, server, library (package, version, libfranka, server) and findings, each with ok, what
    and fix.
    """
    import sys

    from tega.arm.robot.fci import installed_library, machine_findings, server_version, the_fix
    from tega.cli.options import echo_json

    server, library = server_version(host), installed_library()
    fix = the_fix(server, library)
    has = "no franky-control" if library is None else f"{library.package} {library.version}"
    if library is not None:
        has += f", libfranka {library.libfranka or '?'} for robot server {library.server or '?'}"
    findings = [
        (True, f"robot server {server} ({'Panda' if server <= 5 else 'FR3'}) at {host}", ""),
        (not fix, has, fix),
        *machine_findings(),
    ]
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
