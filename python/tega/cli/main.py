"""List the verbs of ``tega-teleop``, call one, and report every failure."""

from __future__ import annotations

import importlib
import os
import sys
import traceback
from collections.abc import Sequence
from typing import Any, NamedTuple

import click

from tega.checkout_tools import needs_tools
from tega.errors import DeviceUnavailableError, MissingToolError, TegaError

__all__ = ["main"]

EXIT_FAILED, EXIT_USAGE, EXIT_DEVICE, EXIT_STOPPED = 1, 2, 3, 130


class _Verb(NamedTuple):
    group: str
    module: str
    function: str
    summary: str


# The summaries stand here so that `--help` imports no verb.
_VERBS = {
    "demo": _Verb(
        "Run", "tega.cli.demo", "demo", "Watch a simulated person lift three objects; no hardware."
    ),
    "run": _Verb("Run", "tega.cli.run", "run", "Run a session on the devices of a settings file."),
    "operator": _Verb(
        "Run", "tega.cli.station", "operator", "Run the operator's half of a session on two machines."
    ),
    "robot": _Verb("Run", "tega.cli.station", "robot", "Run the robot's half of a session on two machines."),
    "replay": _Verb(
        "Run", "tega.cli.replay", "replay", "Compute a recording again, or the loop's output for your files."
    ),
    "play": _Verb("Run", "tega.cli.play", "play", "Feel a recorded session again on a vest and a hand."),
    "inspect": _Verb(
        "Run", "tega.cli.inspect", "inspect", "Print what a recording holds: streams, rates, gaps, losses."
    ),
    "export": _Verb(
        "Run",
        "tega.cli.export",
        "export",
        "Write a recording as tables and pictures, or as a LeRobot dataset.",
    ),
    "trim": _Verb("Run", "tega.cli.trim", "trim", "Cut a part out of a recording."),
    "merge": _Verb("Run", "tega.cli.trim", "merge", "Join the recordings of several sessions."),
    "study": _Verb("Study", "tega.cli.study", "study", "Plan, lead, score and report a user study."),
    "sim-trials": _Verb(
        "Study", "tega.cli.sim_trials", "sim_trials", "Run many simulated trials and compare conditions."
    ),
    "calibrate": _Verb(
        "Hardware", "tega.cli.calibrate", "calibrate", "Calibrate fingertips, muscles and vest for a person."
    ),
    "practice": _Verb(
        "Hardware", "tega.cli.practice", "practice", "Practise: follow a level with the muscles, get a score."
    ),
    "doctor": _Verb(
        "Hardware", "tega.cli.doctor", "doctor", "Check the devices; say what is wrong and what to do."
    ),
    "init": _Verb(
        "Hardware", "tega.cli.init", "init", "Write a settings file for the devices that are plugged in."
    ),
    "devices": _Verb(
        "Hardware", "tega.cli.devices", "devices", "List the drivers, and the devices that they see."
    ),
    "hand": _Verb(
        "Hardware", "tega.cli.hand", "hand", "Check the robot hand, teach its closure poses, time its loop."
    ),
    "arm": _Verb("Hardware", "tega.cli.arm", "arm", "Check whether a Franka robot can be steered from here."),
    "forward": _Verb(
        "Hardware", "tega.cli.forward", "forward", "Align the forearm's tracker with the operator."
    ),
    "net": _Verb("Hardware", "tega.cli.net", "net", "Make the keys that two stations share."),
    "identify": _Verb(
        "Hardware", "tega.cli.identify", "identify", "Switch on the vest's motors one at a time."
    ),
    "vest": _Verb(
        "Hardware", "tega.cli.vest", "vest", "Measure how long a motor of the vest takes to start."
    ),
    "audit": _Verb(
        "Tooling",
        "tega.cli.audit",
        "audit",
        "Compare readings of the contact equations on a recording.",
    ),
    "emg": _Verb("Hardware", "tega.cli.emg", "emg", "Fit a decoder to a person, and compare decoders."),
    "emg-score": _Verb(
        "Tooling", "tega.cli.emg_score", "emg_score", "Score the closure levels against a measured force."
    ),
    "bench": _Verb(
        "Tooling", "tega_figures.bench.command", "bench", "Measure the run time and error of each kernel."
    ),
    "soak": _Verb(
        "Tooling",
        "tega_campaigns.soak.command",
        "soak",
        "Run all emulated devices for long, with random faults.",
    ),
    "stress": _Verb(
        "Tooling", "tega_campaigns.stress.command", "stress", "Test each kernel at its numerical extremes."
    ),
    "stages": _Verb("Tooling", "tega.cli.stages", "stages", "List metrics, decoders, mappings and layouts."),
    "config": _Verb("Tooling", "tega.cli.config", "config", "Show or check a settings file."),
}


class _Verbs(click.Group):
    """Verbs by name, imported when called, listed by the life cycle of a session."""

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002  # click's signature
        return list(_VERBS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:  # noqa: ARG002
        verb = _VERBS.get(cmd_name)
        if verb is None:
            return None
        with needs_tools(f"tega-teleop {cmd_name}"):
            command: click.Command = getattr(importlib.import_module(verb.module), verb.function)
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:  # noqa: ARG002
        for group in dict.fromkeys(verb.group for verb in _VERBS.values()):
            with formatter.section(group):
                formatter.write_dl([(n, v.summary) for n, v in _VERBS.items() if v.group == group])


def _version(ctx: click.Context, _param: click.Parameter, value: bool) -> None:  # noqa: FBT001  # click's signature
    if value:
        from tega import __version__

        click.echo(f"tega {__version__}")
        ctx.exit()


_GREETING = """\
TEGA lets a person steer a robot hand with the muscles of the forearm, and feel on a vest what its fingertips touch.

Type one of these first:
  tega-teleop demo             watch a simulated person lift three objects: no hardware, under a minute
  tega-teleop init             write lab.toml for the devices that are plugged in
  tega-teleop doctor           look for devices, say what is missing
  tega-teleop run lab.toml     start a session
  tega-teleop --help           list all verbs; tega-teleop VERB --help explains one"""


@click.group(
    cls=_Verbs,
    invoke_without_command=True,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
    epilog="Example: tega-teleop replay --tactile thumb=press.avi --out results",
)
@click.option("--debug", is_flag=True, help="Show where in the program an error arose.")
@click.option(
    "--version", is_flag=True, callback=_version, expose_value=False, is_eager=True, help="Show the version."
)
@click.pass_context
def cli(ctx: click.Context, debug: bool) -> None:  # noqa: FBT001  # click's signature
    """Steer a robot hand with muscle signals (EMG), and feel its fingertips on a vibrating vest."""
    ctx.obj = {"debug": debug}
    if ctx.invoked_subcommand is None:
        click.echo(_GREETING)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run a command line and exit.

    Exit codes: 0 ok, 1 failed, 2 usage, 3 device missing, 130 stopped.

    Args:
        arguments: The words after the program's name; those of this process when ``None``.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    debug = "--debug" in words
    try:
        result: Any = cli.main(args=words, prog_name="tega-teleop", standalone_mode=False)
    except click.UsageError as error:
        _usage(error)
        sys.exit(EXIT_USAGE)
    except click.ClickException as error:
        _tell(error.format_message(), "", debug=debug)
        sys.exit(EXIT_FAILED)
    except (KeyboardInterrupt, click.Abort):
        click.echo("stopped", err=True)
        sys.exit(EXIT_STOPPED)
    except MissingToolError as error:
        _tell(error.message, error.hint, debug=debug)
        sys.exit(EXIT_USAGE)
    except DeviceUnavailableError as error:
        _tell(error.message, error.hint, debug=debug)
        sys.exit(EXIT_DEVICE)
    except TegaError as error:
        _tell(error.message, error.hint, debug=debug)
        sys.exit(EXIT_FAILED)
    except BrokenPipeError:
        # The reader of our output went away; nothing of ours is wrong, and nothing can be told to it.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(EXIT_FAILED)
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        _tell(f"{where}{error.strerror or error}", "", debug=debug)
        sys.exit(EXIT_FAILED)
    except Exception as error:  # the last resort: no traceback unless asked for
        _tell(
            f"unexpected {type(error).__name__}: {error}", "run again with --debug and report it", debug=debug
        )
        sys.exit(EXIT_FAILED)
    sys.exit(result if isinstance(result, int) else 0)


def _usage(error: click.UsageError) -> None:
    click.echo(f"error: {error.format_message()}", err=True)
    path = error.ctx.command_path if error.ctx is not None else "tega-teleop"
    click.echo(f"hint: {path} --help", err=True)


def _tell(message: str, hint: str, *, debug: bool) -> None:
    if debug:
        traceback.print_exc()
    click.echo(f"error: {message}", err=True)
    if hint:
        from tega.cli.install_line import with_origin

        click.echo(f"hint: {with_origin(hint)}", err=True)
