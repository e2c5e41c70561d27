"""List the verbs of ``tega-teleop``, call one, and report every failure."""

from __future__ import annotations

import errno
import importlib
import os
import sys
import traceback
from collections.abc import Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import click

from tega.errors import DeviceUnavailableError, MissingToolError, TegaError
from tega.runtime.features import Verb, author_of, show_warnings
from tega.runtime.lifecycle import needs_tools
from tega.runtime.words import printable
from tega.ui.cli.guest_group import GuestGroup, guest_verbs

EXIT_FAILED, EXIT_USAGE, EXIT_DEVICE, EXIT_STOPPED = 1, 2, 3, 130


# The summaries stand here so that `--help` imports no verb.
_BY_GROUP = {
    "Start": {
        "run": (".run:run", "Run a session on the devices of a settings file."),
        "replay": (".replay:replay", "Run the loop on pictures and EMG from files; write tables."),
        "verify": (".verify:verify", "Re-run a recording and check that the output is identical."),
        "play": (".play:play", "Play a recording on the vest and the hand."),
    },
    "Prepare": {
        "init": (".init:init", "Write a settings file for the devices that are plugged in."),
        "doctor": (".doctor:doctor", "Check the devices; print each problem with its fix."),
        "calibrate": (".calibrate:calibrate", "Calibrate fingertips, muscles and vest for a person."),
        "stages": (".lists:stages", "List metrics, decoders, mappings and layouts."),
        "devices": (".lists:devices", "List the drivers, and the devices that they see."),
    },
    "Examine": {
        "audit": (
            "tega_figures.audit.command:audit",
            "Compare readings of the contact equations on a recording.",
        ),
        "bench": ("tega_figures.bench.command:bench", "Measure the run time and error of each kernel."),
        "soak": (
            "tega_campaigns.soak.command:soak",
            "Run all emulated devices for long, with random faults.",
        ),
    },
    "Groups": {
        "recording": (".recording:recording", "Inspect, export, trim and merge recordings."),
        "emg": (".emg:emg", "Fit a decoder to a person; compare and score decoders."),
        "vest": (".vest:vest", "Switch motors on one at a time; measure how long they take to start."),
        "hand": (".hand:hand", "Check the robot hand, teach its closure poses, time its loop."),
        "config": (".config:config", "Show or check a settings file."),
    },
}
_VERBS = {
    name: Verb(target, summary, group)
    for group, verbs in _BY_GROUP.items()
    for name, (target, summary) in verbs.items()
}
# What a verb was called before: it runs, and says what it is called now.
_EARLIER = {
    "inspect": "recording inspect",
    "export": "recording export",
    "trim": "recording trim",
    "merge": "recording merge",
    "sim-trials": "sim trials",
    "identify": "vest identify",
}
_GROUPS = ("Start", "Prepare", "Examine", "Two machines", "Groups")


class _Help(click.HelpFormatter):
    def write_text(self, text: str) -> None:
        if text.startswith("Example: "):  # one line whatever the width: of several, each would be a command
            self.write(f"{'':{self.current_indent}}{text}\n")
        else:
            super().write_text(text)


click.Context.formatter_class = _Help


class _Verbs(GuestGroup):
    """Verbs of TEGA and of its features by name, imported when called, listed by the life cycle of a session."""

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002  # click's signature
        return [*_VERBS, *guest_verbs()]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if (verb := _VERBS.get(cmd_name)) is None:
            return super().get_command(ctx, cmd_name)
        with needs_tools(f"tega-teleop {cmd_name}"):
            module, _, function = verb.target.partition(":")
            command: click.Command = getattr(importlib.import_module(module, "tega.ui.cli"), function)
        return command

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        if nul := next((word for word in args if "\0" in word), None):
            raise click.UsageError(f"{nul!r}: a NUL character stands in no name and no value", ctx)
        return super().parse_args(ctx, args)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        try:
            return super().resolve_command(ctx, args)
        except click.UsageError as error:
            near = get_close_matches(args[0], self.list_commands(ctx), n=2)
            if not near:
                raise
            raise click.UsageError(
                f"{error.format_message()} Did you mean {' or '.join(near)}?", ctx
            ) from error

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:  # noqa: ARG002
        verbs = _VERBS | {name: verb for name, (_, verb) in guest_verbs().items()}
        for group in dict.fromkeys((*_GROUPS, *(verb.group for verb in verbs.values()))):
            if found := [(name, verb.summary) for name, verb in verbs.items() if verb.group == group]:
                with formatter.section(group):
                    formatter.write_dl(found)


_GREETING = """\
TEGA lets a person steer a robot hand with the muscles of the forearm, and feel the touch of its fingertips on a vest.

Type one of these first:
  tega-teleop demo             watch a simulated person lift three objects: no hardware, under a minute
  tega-teleop init             write lab.toml for the devices that are plugged in
  tega-teleop doctor           look for devices, list missing ones and fixes
  tega-teleop run lab.toml     start a session
  tega-teleop --help           list all verbs; tega-teleop VERB --help explains one"""


@click.group(
    "",
    cls=_Verbs,
    invoke_without_command=True,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
    epilog="Example: tega-teleop replay --tactile thumb=press.avi --out pressed",
)
@click.option(
    "--debug",
    is_flag=True,
    expose_value=False,
    help="Show where in the program an error arose; with any verb.",
)
@click.version_option(package_name="tega", message="tega %(version)s", help="Show the version.")
@click.pass_context
def cli(ctx: click.Context) -> None:
    """Steer a robot hand with muscle signals (EMG), and feel its fingertips on a vibrating vest."""
    if ctx.invoked_subcommand is None:
        click.echo(_GREETING)


_STEPS = {
    errno.ENOSPC: "make room; what was written is not whole",
    **dict.fromkeys(
        (errno.EACCES, errno.EPERM, errno.EROFS),
        "your user may not read or write there: name another place, work in another folder, or have it allowed",
    ),
}
"""Hints about an error of the system."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Run a command line and exit.

    Exit codes: 0 ok, 1 failed, 2 usage, 3 device missing, 130 stopped.

    Args:
        arguments: The words after the program's name; those of this process when ``None``.
    """
    _ready_streams()
    words = list(sys.argv[1:] if arguments is None else arguments)
    debug = "--debug" in words
    words = [word for word in words if word != "--debug"]
    if words and (now := _EARLIER.get(words[0])):
        click.echo(f"note: {words[0]} is now: tega-teleop {now}", err=True)
        words[:1] = now.split()
    show_warnings(lambda message, hint: click.echo(printable(f"warning: {message}\nhint: {hint}"), err=True))
    try:
        result: Any = cli.main(args=words, prog_name="tega-teleop", standalone_mode=False)
    except click.UsageError as error:
        click.echo(f"error: {error.format_message()}", err=True)
        path = error.ctx.command_path if error.ctx is not None else "tega-teleop"
        click.echo(f"hint: {path} --help", err=True)
        sys.exit(EXIT_USAGE)
    except click.ClickException as error:
        _notify(error.format_message(), "", debug=debug)
        sys.exit(EXIT_FAILED)
    except (KeyboardInterrupt, click.Abort):
        click.echo("stopped", err=True)
        sys.exit(EXIT_STOPPED)
    except TegaError as error:
        _notify(error.message, error.hint, debug=debug)
        if isinstance(error, MissingToolError):
            sys.exit(EXIT_USAGE)
        sys.exit(EXIT_DEVICE if isinstance(error, DeviceUnavailableError) else EXIT_FAILED)
    except BrokenPipeError:
        # The reader of our output went away; nothing of ours is wrong, and nothing can be printed.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(EXIT_FAILED)
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        _notify(f"{where}{error.strerror or error}", _STEPS.get(error.errno or 0, ""), debug=debug)
        sys.exit(EXIT_FAILED)
    except Exception as error:  # the last resort: no traceback unless asked for
        author = _author(error)
        problem = f"unexpected {type(error).__name__}{f' in {author}' if author else ''}: {error}"
        whom = f" to the authors of {author}" if author else ""
        _notify(problem, f"run again with --debug and report it{whom}", debug=debug)
        sys.exit(EXIT_FAILED)
    sys.exit(result if isinstance(result, int) else 0)


def _ready_streams() -> None:
    """Open closed standard streams as empty, and have an output of another encoding than UTF-8 escape what it lacks."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if (stream := getattr(sys, name)) is None:
            # Else the next file or device that is opened would take its number.
            setattr(sys, name, Path(os.devnull).open(mode, encoding="utf-8"))  # noqa: SIM115  # as long as the program
        elif mode == "w" and stream.errors == "strict":
            stream.reconfigure(errors="backslashreplace")


def _author(error: BaseException) -> str:
    """Return the package of the feature in whose code, or by whose call, an error arose; ``""`` for TEGA's own."""
    modules = [str(frame.f_globals.get("__name__")) for frame, _ in traceback.walk_tb(error.__traceback__)]
    return next((feature.package for one in reversed(modules) if (feature := author_of(one))), "")


def _notify(message: str, hint: str, *, debug: bool) -> None:
    if debug:
        traceback.print_exc()
    click.echo(printable(f"error: {message}"), err=True)
    if hint:
        from tega.ui.cli.options import with_origin

        click.echo(printable(f"hint: {with_origin(hint)}"), err=True)
