"""Measure how long a motor of the vest takes to start: ``tega-teleop vest onset``."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import click

from tega.ui.cli.options import echo_json, json_option, progress_bar, sets_option

if TYPE_CHECKING:
    from collections.abc import Callable

    from tega.config import SessionConfig
    from tega.config.calibration.folder import CalibrationFolder
    from tega.config.calibration.records import OnsetRecord
    from tega_bench.vest_latency.log import OnsetLog


_FILE = click.Path(path_type=Path, dir_okay=False)
_FOLDER = click.Path(path_type=Path, file_okay=False)
_CLICKS = 4
_CLICK_APART_S = (0.37, 0.61, 0.83, 0.53)


class _Wanted(NamedTuple):
    settings: SessionConfig
    percent: int
    bursts: int
    sync: Literal["keys", "speaker"]


@click.command(epilog="Example: tega-teleop vest onset lab.toml --motor 0 --motor 21")
@click.argument("config", type=click.Path(path_type=Path), metavar="[SETTINGS.toml]", required=False)
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
    type=_FILE,
    help="Record elsewhere, such as with a phone: play the bursts and write the commands to this file.",
)
@click.option("--wav", type=_FILE, help="Read that recording, with its --log.")
@click.option("--keep", type=_FOLDER, help="Keep recording and log in this folder.")
@click.option(
    "--folder",
    type=_FOLDER,
    help="Where calibrations are kept; else calibration.folder, else 'calibrations' beside SETTINGS.toml.",
)
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
    folder: Path | None,
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
    from tega.config import load_config
    from tega.config.calibration.folder import CalibrationFolder

    if list_them:
        from tega_bench.vest_latency.microphone import list_microphones

        click.echo("\n".join(list_microphones()) or "no microphone")
        return
    if wav is not None and log_file is None:
        raise click.UsageError("--wav needs the --log that was written when the bursts were played")
    if log_file is not None and len(motors) > 1:
        raise click.UsageError("one --log is for one --motor")
    # The bursts count to the day of who wears the vest, which is kept in the same folder.
    where = () if folder is None else (f"calibration.folder={json.dumps(str(folder.absolute()))}",)
    settings = load_config(config, sets=(*sets, *where)).config
    by: Any = sync or ("speaker" if log_file is None else "keys")
    wanted, chosen = _Wanted(settings, percent, bursts, by), motors or (0,)
    if log_file is None:
        measured = _measure(wanted, chosen, microphone, keep)
    elif wav is not None:
        measured = _read(wav, log_file)
    else:
        _play_for_elsewhere(wanted, chosen[0], log_file, as_json=as_json)
        return
    beside = Path.cwd() if config is None else config.absolute().parent
    kept = folder or settings.calibration.folder or beside / "calibrations"
    _keep(measured, CalibrationFolder(kept), as_json=as_json)


def _keep(measured: Iterator[OnsetRecord], home: CalibrationFolder, *, as_json: bool) -> None:
    import msgspec

    reported = []
    for record in measured:
        file = home.keep_onset(record)
        reported.append({"file": str(file), "record": msgspec.to_builtins(record)})
        if not as_json:
            click.echo(f"{_text(record)}\n  kept in {file}")
    if as_json:
        echo_json(reported)


def _read(wav: Path, log_file: Path) -> Iterator[OnsetRecord]:
    from tega_bench.vest_latency.log import read_log, read_wav
    from tega_bench.vest_latency.measure import found_in, record_of

    log = read_log(log_file)
    yield record_of(found_in(*read_wav(wav), log), log)


def _measure(
    wanted: _Wanted, motors: tuple[int, ...], microphone: str | None, keep: Path | None
) -> Iterator[OnsetRecord]:
    from tega.setup.calibration.identify import motor_place
    from tega_bench.vest_latency.log import write_log, write_wav
    from tega_bench.vest_latency.measure import found_in, record_of
    from tega_bench.vest_latency.microphone import Microphone

    for motor in motors:
        if len(motors) > 1 and sys.stdin.isatty():
            text = f"Tape the microphone onto motor {motor} ({motor_place(motor)}), then Enter"
            click.prompt(text, default="", show_default=False, prompt_suffix=" ", err=True)
        with Microphone(microphone) as ear:
            log = _played(wanted, motor)
            samples = ear.received()
        if keep is not None:
            name = f"{log.made:%Y%m%d-%H%M%S}-motor{motor:02}"
            write_wav(keep / f"{name}.wav", samples, ear.rate_hz)
            write_log(log, keep / f"{name}.json")
        yield record_of(found_in(samples, ear.rate_hz, log), log)


def _play_for_elsewhere(wanted: _Wanted, motor: int, file: Path, *, as_json: bool) -> None:
    from tega_bench.vest_latency.log import write_log

    near = "keyboard" if wanted.sync == "keys" else "loudspeaker"
    text = f"Begin the recording now (WAV, or convert it later), the microphone on the motor and near the {near}."
    click.echo(text, err=True)
    write_log(_played(wanted, motor), file)
    if as_json:
        echo_json({"log": str(file)})
    else:
        click.echo(f"End the recording. Then: tega-teleop vest onset --wav RECORDING.wav --log {file}")


def _played(wanted: _Wanted, motor: int) -> OnsetLog:
    from tega.config import DEFAULT_LAYOUT
    from tega.config.calibration.records import utc_now
    from tega.errors import ConfigError
    from tega.loop.worn_vest import dose_file, worn_vest
    from tega.runtime.clock import SystemClock
    from tega.safety.stop import CtrlC
    from tega_bench.vest_latency.measure import log_of, play_bursts, watched_vest

    settings = wanted.settings
    if settings.vest.driver is None:
        raise ConfigError("no vest: vest.driver is not set", "for example --set vest.driver=bhaptics-player")
    layout = settings.vest.layout or DEFAULT_LAYOUT[settings.session.preset]
    made, worn = utc_now(), worn_vest(settings.vest, dose_file(settings.calibration))
    with CtrlC() as stop, _clicker(wanted.sync, stop) as clicks, worn as vest:
        opened: Any = watched_vest(vest)
        clicks_s = clicks()
        with progress_bar() as displayed:
            bursts_s, unsent = play_bursts(
                opened,
                motor,
                layout=layout,
                percent=wanted.percent,
                bursts=wanted.bursts,
                clock=SystemClock(),
                stop=stop,
                reported=lambda done, total: displayed(f"motor {motor}", done, total),
            )
        clicks_s += clicks()
        info = opened.info
    return log_of(
        info,
        bursts_s,
        clicks_s,
        unsent=unsent,
        made=made,
        layout=layout,
        motor=motor,
        percent=wanted.percent,
        clicks=wanted.sync,
    )


@contextmanager
def _clicker(sync: str, stop: Callable[[], bool]) -> Iterator[Callable[[], list[float]]]:
    """Give what makes a few clicks and returns their times, seconds on the monotonic clock."""
    if sync == "speaker":
        from tega_bench.vest_latency.microphone import Speaker

        with Speaker() as speaker:

            def clicked() -> list[float]:
                times = []
                for apart_s in _CLICK_APART_S:
                    times.append(speaker.click())
                    time.sleep(apart_s)
                return times

            yield clicked
        return
    from tega.runtime.keys import Keys

    with Keys() as keys:

        def struck() -> list[float]:
            text = f"Strike the space bar hard {_CLICKS} times, not evenly, beside the microphone: "
            click.echo(text, nl=False, err=True)
            times: list[float] = []
            while len(times) < _CLICKS:
                if stop():
                    raise KeyboardInterrupt
                pressed = keys.read()
                times += [time.monotonic()] * pressed.count(" ")
                click.echo("·" * pressed.count(" "), nl=False, err=True)
                time.sleep(0.001)
            click.echo(" heard", err=True)
            return times

        yield struck


def _text(record: OnsetRecord) -> str:
    from tega.setup.calibration.identify import motor_place

    low, high = record.middle_half_ms
    left_out = f"; left out: {', '.join(record.left_out)}" if record.left_out else ""
    return (
        f"motor {record.motor} ({motor_place(record.motor)}), {record.percent} %:\n"
        f"  begins {record.onset_ms:.0f} ms after its frame was handed over (half of the bursts {low:.0f} to "
        f"{high:.0f}, worst {record.worst_ms:.0f}), half strength after {record.half_strength_ms:.0f} ms\n"
        f"  the clock of the recording may be off by {record.clock_uncertainty_ms:.0f} ms ({record.clock})\n"
        f"  {record.used} of {record.bursts} bursts count{left_out}; it spins {record.spin_hz:.0f} times a second"
    )
