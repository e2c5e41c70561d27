"""Measure a study's filmed lifts, and confirm them: ``tega-teleop scene measure`` and ``confirm``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from tega.ui.cli.options import FILE, answer, echo_json, json_option
from tega_scene.cli import optics_options, print_outcome
from tega_study.cli.options import folder_argument, participant_argument


@click.command(
    epilog="Example: tega-teleop scene measure my-study p01 cam.mp4 --lens cam.json --layout tags.toml"
)
@folder_argument
@participant_argument
@click.argument("video", type=FILE, required=False)
@click.option(
    "--camera", metavar="NAME", help="Which camera of the settings, where several filmed the trials."
)
@optics_options(required=False)
@json_option
def measure(
    *,
    video: Path | None,
    lens_file: Path | None,
    layout_file: Path | None,
    harm_mm: float,
    mark: tuple[float, float] | None,
    as_json: bool,
    **requested: Any,
) -> None:
    """Score the trials of a study's session by a camera; study score compares them with the raters.

    Without a video: from the frames that a camera of the settings recorded in each trial. Writes
    sessions/ID/measured.jsonl. With --json: {"trials": [{"participant", "trial", "attempt", "object", "outcome",
    "problem"}]}, an outcome in the format of scene score.
    """
    import msgspec

    from tega_scene.layout import load_layout
    from tega_scene.lens import load_lens
    from tega_study.measuring import measure_session

    if video is not None and requested["camera"] is not None:
        raise click.UsageError("a video is of one camera: leave out --camera or the file")
    if video is not None and (lens_file is None or layout_file is None):
        raise click.UsageError("a video needs --lens CAM.json and --layout TAGS.toml")
    lens = None if lens_file is None else load_lens(lens_file)
    layout = None if layout_file is None else load_layout(layout_file)
    size_m: dict[str, Any] = {"harm_m": harm_mm / 1000, "mark_m": mark}
    found = measure_session(video=video, lens=lens, layout=layout, **size_m, **requested)
    if as_json:
        echo_json({"trials": msgspec.to_builtins(found)})
        return
    for one in found:
        again = " again" if one.attempt > 1 else ""
        click.echo(f"{one.participant} trial {one.trial}{again}, {one.object}: {one.problem or 'measured'}")
        if one.outcome is not None:
            print_outcome(one.outcome, "  ")


@click.command(
    epilog="Example: tega-teleop scene confirm my-study p01 7 --rater r1 --strike 12 --add slip=4.2"
)
@folder_argument
@participant_argument
@click.argument("trial", type=click.IntRange(1, 10_000))
@click.option("--rater", required=True, metavar="ID", help="Code of the rater who looked at the video.")
@click.option("--attempt", type=click.IntRange(1, 2), default=1, help="Which attempt of the trial.")
@click.option("--strike", "struck", type=int, multiple=True, metavar="N", help="Event N did not happen.")
@click.option("--add", "added", multiple=True, metavar="KIND=SECONDS", help="The camera missed this.")
@click.option(
    "--list", "only_list", is_flag=True, help="Show the events with their numbers, and write nothing."
)
@json_option
def confirm(
    *,
    folder: Path,
    participant: str,
    trial: int,
    attempt: int,
    added: tuple[str, ...],
    only_list: bool,
    as_json: bool,
    **requested: Any,
) -> None:
    """Confirm or correct the camera's measurement of a trial; the camera's own account stays unchanged.

    With --json: {"events": [{"n", "kind", "t_ns"}]}, those that count now; with --list those that were measured.
    """
    from tega_study.journal import SEEN
    from tega_study.measuring import confirm_trial
    from tega_study.observers import read_measured

    if only_list:
        mine = [e for e in read_measured(folder, participant) if (e.trial, e.attempt) == (trial, attempt)]
        events = [event for event in mine if event.kind in SEEN]
        lines = [f"{event.n}: {event.text}" for event in events]
    else:
        wanted = []
        for text in added:
            kind, _, t_s = text.partition("=")
            try:
                wanted.append((kind, float(t_s)))
            except ValueError:
                raise click.UsageError(f"--add {text}: write it as slip=4.2") from None
        events = confirm_trial(folder, participant, trial, attempt=attempt, added=wanted, **requested)
        reported = ", ".join(one.kind for one in events) or "nothing"
        lines = [f"{participant} trial {trial}, as {requested['rater']} has it: {reported}"]
    shown = [{"n": one.n, "kind": one.kind, "t_ns": one.t_ns} for one in events]
    answer({"events": shown}, lines, as_json=as_json)
