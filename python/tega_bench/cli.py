"""Test a device for the first time, and time a vest's motors: ``tega-teleop acceptance`` and ``vest onset``."""

from __future__ import annotations

import sys
from pathlib import Path
from tempfile import TemporaryFile
from typing import TYPE_CHECKING, Any

import click

from tega.ui.cli.options import FILE, PATH, echo_json, json_option, sets_option

if TYPE_CHECKING:
    from tega.config.calibration.records import OnsetRecord

_FOLDER = click.Path(path_type=Path, file_okay=False)
_FAILED = 3


@click.command(epilog="Example: tega-teleop acceptance lab.toml vest")
@click.argument("config", type=FILE, metavar="SETTINGS.toml")
@click.argument("device", metavar="DEVICE")
@sets_option
@click.option(
    "--out", type=_FOLDER, default=Path("acceptance"), show_default=True, help="Folder of the report."
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
    out.mkdir(parents=True, exist_ok=True)
    TemporaryFile(dir=out).close()  # no hour is spent on a report that cannot be written
    report = accept_device(loaded, case, AcceptanceGuide(yes=yes), answered=not yes)
    data, text = write_report(report, out)
    if as_json:
        steps = [{"name": s.name, "status": s.status, "measured": s.measured} for s in report.steps]
        echo_json({"report": str(data), "text": str(text), "passed": report.passed, "steps": steps})
    else:
        click.echo(report_text(report))
        click.echo(f"Wrote {data} and {text}: send both back, they make the table of tried devices.")
    ctx.exit(0 if report.passed else _FAILED)


@click.command(epilog="Example: tega-teleop vest onset lab.toml --motor 0 --motor 21")
@click.argument("config", type=PATH, metavar="[SETTINGS.toml]", required=False)
@click.option(
    "--motor",
    "motors",
    type=click.IntRange(0, 39),
    multiple=True,
    help="Motor to measure; repeatable. Else motor 0.",
)
@click.option(
    "--percent", type=click.IntRange(10, 100), default=60, show_default=True, help="How hard it vibrates."
)
@click.option(
    "--bursts", type=click.IntRange(6, 100), default=15, show_default=True, help="How many bursts are played."
)
@click.option("--microphone", metavar="NAME", help="Number or part of a name; else the system's own choice.")
@click.option("--list", "list_them", is_flag=True, help="List the microphones, and end.")
@click.option(
    "--sync",
    type=click.Choice(["keys", "speaker"]),
    help="Clicks that synchronize recording and commands: the space bar, struck by you, or the loudspeaker. "
    "Default: speaker with a microphone here, else keys.",
)
@click.option(
    "--log",
    "log_file",
    type=FILE,
    help="Record elsewhere, such as with a phone: play the bursts and write the commands to this file.",
)
@click.option("--wav", type=FILE, help="Read that recording, with its --log.")
@click.option("--keep", type=_FOLDER, help="Keep recording and log in this folder.")
@sets_option
@json_option
def onset(
    *,
    config: Path | None,
    motors: tuple[int, ...],
    percent: int,
    bursts: int,
    microphone: str | None,
    list_them: bool,
    sync: str | None,
    log_file: Path | None,
    wav: Path | None,
    keep: Path | None,
    sets: tuple[str, ...],
    as_json: bool,
) -> None:
    """Measure how long a motor takes from its frame to its first vibration, with a microphone taped onto it.

    Bursts of half a second are played and recorded; the room has to be quiet. The result is kept with the
    calibrations, by vest, and every later run adds it to its latency. With a phone: --log FILE plays the bursts, then
    --wav FILE.wav --log FILE reads the phone's recording.

    Exit codes: 0 measured, 1 no result (the message says why), 2 usage, 3 no vest or no microphone.

    With --json: a list of {"file", "record"}; with --log alone {"log"}.
    """
    import msgspec

    from tega.config import load_config
    from tega.config.calibration.folder import CalibrationFolder
    from tega_bench.vest_latency.log import read_log, read_wav, write_log
    from tega_bench.vest_latency.measure import Bursts, measure_motors, play_log, record_of
    from tega_bench.vest_latency.microphone import list_microphones

    if list_them:
        click.echo("\n".join(list_microphones()) or "no microphone")
        return
    if wav is not None and log_file is None:
        raise click.UsageError("--wav needs the --log that was written when the bursts were played")
    if log_file is not None and len(motors) > 1:
        raise click.UsageError("one --log is for one --motor")
    settings = load_config(config, sets=sets).config
    by: Any = sync or ("speaker" if log_file is None else "keys")
    wanted, chosen = Bursts(settings, percent, bursts, by), motors or (0,)
    if log_file is None:
        measured = measure_motors(wanted, chosen, microphone, keep)
    elif wav is not None:
        log = read_log(log_file)
        measured = iter([record_of(*read_wav(wav), log)])
    else:
        near = "keyboard" if by == "keys" else "loudspeaker"
        text = f"Begin the recording now (WAV, or convert it later), the microphone on the motor and near the {near}."
        click.echo(text, err=True)
        write_log(play_log(wanted, chosen[0]), log_file)
        if as_json:
            echo_json({"log": str(log_file)})
        else:
            click.echo(
                f"End the recording. Then: tega-teleop vest onset --wav RECORDING.wav --log {log_file}"
            )
        return
    beside = Path.cwd() if config is None else config.absolute().parent
    home = CalibrationFolder(settings.calibration.folder or beside / "calibrations")
    reported = []
    for record in measured:
        file = home.keep_onset(record)
        reported.append({"file": str(file), "record": msgspec.to_builtins(record)})
        if not as_json:
            click.echo(f"{_text(record)}\n  kept in {file}")
    if as_json:
        echo_json(reported)


def _text(record: OnsetRecord) -> str:
    from tega.setup.calibration.identify import motor_place

    low, high = record.middle_half_ms
    left_out = f"; left out: {', '.join(record.left_out)}" if record.left_out else ""
    return (
        f"motor {record.motor} ({motor_place(record.motor, record.layout)}), {record.percent} %:\n"
        f"  begins {record.onset_ms:.0f} ms after its frame was handed over (half of the bursts {low:.0f} to "
        f"{high:.0f}, worst {record.worst_ms:.0f}), half strength after {record.half_strength_ms:.0f} ms\n"
        f"  the clock of the recording may be off by {record.clock_uncertainty_ms:.0f} ms ({record.clock})\n"
        f"  {record.used} of {record.bursts} bursts count{left_out}; it spins {record.spin_hz:.0f} times a second"
    )
