"""Run the loop on recordings: ``tega-teleop replay``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from tega.ui.cli.emg import column_options, kind_option
from tega.ui.cli.options import (
    PATH,
    FiniteRange,
    json_option,
    picture_option,
    preset_option,
    progress_bar,
    sets_option,
)
from tega.ui.cli.page import run_viewed, view_options


class _Named(click.ParamType[tuple[str, str]]):
    """FINGER=/TOPIC or emg=/TOPIC, or FINGER=PATH."""

    def __init__(self, value: str) -> None:
        self.name = f"finger={value}"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[str, str]:
        name, _, text = str(value).partition("=")
        if not name or not text:
            self.fail(f"{value!r} is not {self.name.upper()}", param, ctx)
        return name, text


@click.command(
    epilog="Example: tega-teleop replay --tactile thumb=press.avi --emg squeeze.csv --emg-rate-hz 1000 "
    "--emg-kind raw --emg-channels 1,2,3 --preset live --out pressed"
)
@click.argument("session", type=PATH, required=False, metavar="")
@click.option(
    "--tactile",
    type=_Named("path"),
    multiple=True,
    help="Recording of a finger: a folder of pictures, a video, an .npy or .npz stack, or a ROS 2 bag.",
)
@click.option(
    "--tactile-rate-hz",
    type=FiniteRange(0, 100_000, min_open=True),
    help="Pictures per second of folders and stacks [default: times in their names or files, else 60].",
)
@click.option(
    "--topic",
    "topics",
    type=_Named("/topic"),
    multiple=True,
    help="Topic of a finger's pictures, or of EMG (emg=/TOPIC), in a ROS 2 bag; by default the only one that fits.",
)
@click.option(
    "--baseline",
    type=_Named("path"),
    multiple=True,
    help="Picture of a finger's untouched gel; else estimated.",
)
@click.option("--allow-truncated", is_flag=True, help="Use a video of another length than its header says.")
@click.option("--emg", type=PATH, help="EMG samples: text, .npy, .mat, EDF, XDF, a ROS 2 bag and others.")
@kind_option("--emg-kind")
@column_options("emg-")
@preset_option
@click.option(
    "--calibration", type=PATH, help="File with the maxima; else they are taken from the recording itself."
)
@click.option(
    "--out",
    type=PATH,
    help="Folder for the tables: new, empty, or an earlier run's, whose results are then kept below it.",
)
@sets_option
@picture_option
@view_options
@json_option
def replay(
    *,
    session: Path | None,
    sets: tuple[str, ...],
    view: bool,
    view_port: int,
    as_json: bool,
    **flags: Any,
) -> None:
    """Run the loop on pictures and EMG from files as fast as possible, and write tables.

    With --view the loop runs in real time, on a page that can pause. To re-run a recorded session, use verify.

    The folder --out gets contacts.csv, events.csv, levels.csv, vest.csv, can.csv, summary.json, calibration.toml and
    picture.png. A summary of each finger, the level and the vest is printed. The same input gives the same bytes.
    With --json: the summary, with a table "measured" of wall_s and real_time_factor.
    """
    import time

    from tega.config import check_tree, override_tree
    from tega.loop import run_session
    from tega.loop.controls import Controls
    from tega.records.bus import Bus
    from tega.records.display import Notice
    from tega.safety.stop import CtrlC
    from tega.ui.cli.report import Findings, echo_summary

    if session is not None:
        raise click.UsageError(f"replay {session} is now: tega-teleop verify {session}")
    if flags["out"] is None:
        raise click.UsageError(
            "Missing option '--out'. To re-run a recorded session, use 'tega-teleop verify'."
        )
    tree = _tree(flags)
    if view:
        tree["session"]["pace"] = "real"
    settings = check_tree(tree, override_tree(tree, sets), base=Path.cwd()).config
    bus, picture = Bus(), flags["picture"]
    findings = Findings(bus, picture or flags["out"] / "picture.png", required=picture is not None)
    started = time.perf_counter()
    bus.subscribe(Notice, lambda notice: click.echo(notice.text, err=True), name="notices")
    with CtrlC() as stop, progress_bar(enabled=not as_json) as progress:
        how: dict[str, Any] = {"progress": progress, "bus": bus}
        if view:
            how |= {"title": "TEGA · replay", "port": view_port, "can_pause": True}
            summary = run_viewed(settings, stop=stop, **how)
        else:
            summary = run_session(settings, controls=Controls(stop=stop), **how)
    wall_s = time.perf_counter() - started
    findings.notify(
        f"TEGA replay, preset {flags['preset']}", pose_base=settings.session.pose_base, words=not as_json
    )
    echo_summary(summary, wall_s=wall_s, as_json=as_json)


def _tree(flags: dict[str, Any]) -> dict[str, Any]:
    baselines = _by_finger("--baseline", flags["baseline"])
    recordings = _by_finger("--tactile", flags["tactile"])
    for finger in baselines:
        if finger not in recordings:
            raise click.UsageError(f"--baseline {finger}: there is no --tactile {finger}")
    if not recordings and flags["emg"] is None:
        raise click.UsageError("nothing to replay: give --tactile, --emg or both")
    topics = dict(flags["topics"])
    if unused := topics.keys() - recordings.keys() - ({"emg"} if flags["emg"] is not None else set()):
        raise click.UsageError(f"--topic {min(unused)}: there is no recording of that")
    tactile: dict[str, Any] = {}
    for finger, path in recordings.items():
        tactile[finger] = _finger_table(path, flags, topics.get(finger, ""), list(baselines.values()))
        if finger in baselines:
            tactile[finger]["baseline"] = baselines[finger]
    tree: dict[str, Any] = {
        "session": {"preset": flags["preset"], "pace": "fast", "out_dir": flags["out"].absolute()},
        "tactile": tactile,
    }
    if flags["calibration"] is not None:
        tree["calibration"] = {"file": flags["calibration"].absolute()}
    if flags["emg"] is not None:
        tree["emg"] = _emg_table(flags["emg"].absolute(), flags, topics.get("emg", ""))
    return tree


def _is_bag(path: Path) -> bool:
    """Return whether a path is a ROS 2 bag: an MCAP file, or a folder with some or with a bag's metadata."""
    return path.suffix == ".mcap" or (path / "metadata.yaml").exists() or any(path.glob("*.mcap"))


def _emg_table(path: Path, flags: dict[str, Any], topic: str) -> dict[str, Any]:
    bag = _is_bag(path)
    if flags["emg_kind"] is None:
        raise click.UsageError("--emg needs --emg-kind")
    options = {"file": path, "channels": flags["emg_channels"] or []}
    if flags["emg_rate_hz"] is not None:  # else as the file states it
        options["rate_hz"] = flags["emg_rate_hz"]
    options |= {"topic": topic} if bag else {"variable": flags["emg_variable"]}
    return {"driver": "ros2-emg" if bag else "emg-file", "kind": flags["emg_kind"], "options": options}


def _finger_table(path: Path, flags: dict[str, Any], topic: str, exclude: list[Path]) -> dict[str, Any]:
    options: dict[str, Any] = {"file": path}
    if _is_bag(path):
        return {"driver": "ros2-pictures", "options": options | {"topic": topic}}
    driver, rate_hz = "video", flags["tactile_rate_hz"]
    if path.is_dir() or not path.suffix:
        driver, options = "images", {"folder": path, "exclude": exclude}
    elif path.suffix.lower() in {".npy", ".npz"}:
        driver = "picture-stack"
    else:
        options["allow_truncated"] = flags["allow_truncated"]
    if driver != "video" and rate_hz is not None:
        options["rate_hz"] = rate_hz
    return {"driver": driver, "options": options}


def _by_finger(flag: str, pairs: tuple[tuple[str, str], ...]) -> dict[str, Path]:
    named: dict[str, Path] = {}
    for finger, path in pairs:
        if finger in named:
            raise click.UsageError(f"{flag} {finger} is given twice")
        named[finger] = Path(path).absolute()
    return named
