"""Ask the person at a device, and print its acceptance: ``tega-teleop acceptance SETTINGS.toml DEVICE``."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from tega.ui.cli.options import echo_json, json_option, sets_option

_FAILED = 3


@click.command(epilog="Example: tega-teleop acceptance lab.toml vest")
@click.argument("config", type=click.Path(path_type=Path, dir_okay=False), metavar="SETTINGS.toml")
@click.argument("device", metavar="DEVICE")
@sets_option
@click.option(
    "--out",
    type=click.Path(file_okay=False, path_type=Path),
    default=Path("acceptance"),
    show_default=True,
    help="Folder of the report.",
)
@click.option("--yes", is_flag=True, help="Ask nothing, and make the pulse or motion. For emulated devices.")
@json_option
@click.pass_context
def acceptance(
    ctx: click.Context,
    *,
    config: Path,
    device: str,
    sets: tuple[str, ...],
    out: Path,
    yes: bool,
    as_json: bool,
) -> None:
    """Test one device of the settings for the first time: vest, hand, emg, a fingertip, a tracker or the arm.

    The test checks identity, rate, latency, limits, one pulse or motion at the least strength, after a yes, and the
    stop. Measurements and answers are written as JSON and as text.

    Exit codes: 0 passed, 1 the settings are faulty, 2 usage, 3 failed.

    With --json: {"report", "text", "passed", "steps"}.
    """
    from tega.config import load_config
    from tega_bench.acceptance.report import AcceptanceGuide, report_text, write_report
    from tega_bench.acceptance.run import accept_device, acceptance_case

    if not yes and not sys.stdin.isatty():
        raise click.UsageError(
            "an acceptance test asks a person: run it in a terminal, or with --yes on emulated devices"
        )
    loaded = load_config(config, sets=sets).config
    case = acceptance_case(loaded, device)
    report = accept_device(loaded, case, AcceptanceGuide(yes=yes), answered=not yes)
    data, text = write_report(report, out)
    if as_json:
        steps = [{"name": s.name, "status": s.status, "measured": s.measured} for s in report.steps]
        echo_json({"report": str(data), "text": str(text), "passed": report.passed, "steps": steps})
    else:
        click.echo(report_text(report))
        click.echo(f"Wrote {data} and {text}: send both back, they make the table of tried devices.")
    ctx.exit(0 if report.passed else _FAILED)
