"""Print tags, calibrate scene cameras, and score lifts from their videos: ``tega-teleop scene``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import click

from tega.ui.cli.guest_group import GuestGroup
from tega.ui.cli.options import FILE, FiniteRange, all_options, answer, echo_json, json_option

if TYPE_CHECKING:
    from collections.abc import Callable

    from tega_scene.outcomes import SceneOutcome


def _size(_ctx: click.Context, _option: click.Parameter, text: str) -> tuple[int, int]:
    """Read a size such as 1920x1080; a usage error where it is none."""
    width, _, height = text.lower().partition("x")
    if not (width.isdecimal() and height.isdecimal() and len(text) < 12):
        raise click.UsageError(f"--size {text}: write it as 1920x1080")
    return int(width), int(height)


_size_option = click.option(
    "--size",
    metavar="WxH",
    default="1920x1080",
    show_default=True,
    callback=_size,
    help="Width and height of the pictures.",
)


@click.group(
    cls=GuestGroup, epilog="Example: tega-teleop scene score lift.mp4 --lens cam.json --layout tags.toml"
)
def scene() -> None:
    """Score lifts by cameras that see printed tags on table, hand and object."""


def _mark(_ctx: click.Context, _option: click.Parameter, text: str | None) -> tuple[float, float] | None:
    """Read a mark such as 50,-87, millimetres, into metres; a usage error where it is none."""
    from tega_scene.courses import checked_mark

    if text is None:
        return None
    try:
        x_mm, y_mm = map(float, text.split(","))
    except ValueError:
        raise click.UsageError(f"--mark {text}: write it as 50,-87, in millimetres") from None
    return checked_mark((x_mm / 1000, y_mm / 1000))


def optics_options(*, required: bool) -> Callable[[Any], Any]:
    """Return the options of a lens, a layout, the second mark and deformation."""
    return all_options(
        click.option(
            "--lens",
            "lens_file",
            type=FILE,
            required=required,
            metavar="CAM.json",
            help="The camera's intrinsics.",
        ),
        click.option(
            "--layout",
            "layout_file",
            type=FILE,
            required=required,
            metavar="TAGS.toml",
            help="File that says where the tags are.",
        ),
        click.option(
            "--harm-mm",
            type=FiniteRange(0.1, 100),
            default=6.0,
            show_default=True,
            help="How far the object must narrow to count as deformed, mm.",
        ),
        click.option(
            "--mark",
            metavar="X,Y",
            callback=_mark,
            help="Second mark, on which the object is to be put down: mm from the first one, along the table's axes.",
        ),
    )


@scene.command(epilog="Example: tega-teleop scene tags tags.pdf --layout tags.toml")
@click.argument("out", type=FILE, metavar="OUT.pdf")
@click.option(
    "--layout",
    "layout_file",
    type=FILE,
    metavar="TAGS.toml",
    help="Print this layout's tags; where the file is missing, write the example's into it.",
)
@json_option
def tags(*, out: Path, layout_file: Path | None, as_json: bool) -> None:
    """Write tags and the calibration board to scale, as PDF or SVG on A4.

    Print at 100 % and measure the line of 100 mm. With --json: {"files": [...], "layout": file, "tags": n}.
    """
    from tega_scene.layout import example_layout, load_layout, save_layout
    from tega_scene.sheets import board_page, tag_pages, write_pages

    if layout_file is not None and layout_file.exists():
        layout = load_layout(layout_file)
    else:
        layout = example_layout()
        if layout_file is not None:
            save_layout(layout_file, layout)
    files = write_pages(out, [*tag_pages(layout), board_page()])
    n_tags = sum(len(body.all_tags()) for body in layout.bodies().values())
    lines = [f"{', '.join(map(str, files))}: {n_tags} tags and the calibration board"]
    if layout_file is not None:
        lines.append(
            f"{layout_file}: where they are; measure heights and distances on your object, and change them"
        )
    found = {"files": [str(file) for file in files], "layout": str(layout_file or ""), "tags": n_tags}
    answer(found, lines, as_json=as_json)


@scene.command(epilog="Example: tega-teleop scene calibrate 0 cam.json")
@click.argument("source")
@click.argument("out", type=FILE, metavar="CAM.json")
@_size_option
@json_option
def calibrate(*, source: str, out: Path, size: tuple[int, int], as_json: bool) -> None:
    """Calibrate a camera's lens with the printed board: number, /dev/video0, rtsp://, a video or a folder of pictures.

    The command says where to hold the board next and takes the pictures itself. With --json: the intrinsics: width,
    height, fx, fy, cx, cy, distortion, rms_px, n_views.
    """
    import msgspec

    from tega_scene.lens import save_lens
    from tega_scene.sources import calibrate_from

    lens = calibrate_from(source, size, notify=lambda line: click.echo(line, err=True))
    save_lens(out, lens)
    line = f"{out}: {lens.n_views} views fit to {lens.rms_px:.3f} px; focal length {lens.fx:.0f} px"
    answer(msgspec.to_builtins(lens), [line], as_json=as_json)


@scene.command(epilog="Example: tega-teleop scene score lift.mp4 --lens cam.json --layout tags.toml")
@click.argument("video", type=FILE)
@optics_options(required=True)
@click.option(
    "--begin-s",
    type=FiniteRange(),
    help="Start of the trial on the video's clock; its first picture unless given.",
)
@click.option(
    "--end-s",
    type=FiniteRange(),
    help="End of the trial on the video's clock; the last picture unless given.",
)
@json_option
def score(
    *,
    video: Path,
    lens_file: Path,
    layout_file: Path,
    harm_mm: float,
    mark: tuple[float, float] | None,
    begin_s: float | None,
    end_s: float | None,
    as_json: bool,
) -> None:
    """Score one lift from a video: lift-off, 0.2 m, stable, slips, deformations, drop, put down, placed, with errors.

    With --json: {"events": [{"kind", "t_s", "t_error_s", "size_m", "size_error_m"}], "success", "slid_m",
    "slid_error_m", "narrowing_m", "narrowing_error_m", "height_m", "along_mm", "across_mm", "seen", "placed",
    "hand_seen", "longest_gap_s", "notes", "rest": {"at_mm", "error_mm", "lean_deg", "since_s", "error_s", "stood_s",
    "let_go"}, "off_mark_m", "off_mark_error_m", "on_mark"}.
    """
    import math

    import msgspec

    from tega_scene.layout import load_layout
    from tega_scene.lens import load_lens
    from tega_scene.outcomes import score_scene
    from tega_scene.pictures import read_pictures
    from tega_scene.track import track_scene

    lens, layout = load_lens(lens_file), load_layout(layout_file)
    within = {
        "begin_s": -math.inf if begin_s is None else begin_s,
        "end_s": math.inf if end_s is None else end_s,
    }
    track = track_scene(read_pictures(video, **within), lens, layout)
    outcome = score_scene(track, layout, begin_s=begin_s, end_s=end_s, harm_m=harm_mm / 1000, mark_m=mark)
    if as_json:
        echo_json(msgspec.to_builtins(outcome))
        return
    print_outcome(outcome)


def print_outcome(outcome: SceneOutcome, indent: str = "") -> None:
    """Print the events and the outcome of a lift."""
    for event in outcome.events:
        size = f", {1000 * event.size_m:.2f} ± {1000 * event.size_error_m:.2f} mm" if event.size_m else ""
        click.echo(
            f"{indent}{event.t_s:7.3f} s ± {1000 * event.t_error_s:.0f} ms  {event.kind.replace('_', '-')}{size}"
        )
    narrow = ""
    if outcome.narrowing_m is not None and outcome.narrowing_error_m is not None:
        narrow = f", narrowed {1000 * outcome.narrowing_m:.2f} ± {1000 * outcome.narrowing_error_m:.2f} mm"
    click.echo(
        f"{indent}{'lifted and held' if outcome.success else 'not lifted and held'}; "
        f"slid {1000 * outcome.slid_m:.2f} ± {1000 * outcome.slid_error_m:.2f} mm{narrow}; one picture places the "
        f"object to {outcome.along_mm:.2f} mm along the view, {outcome.across_mm:.2f} mm across"
    )
    if outcome.on_mark is not None:
        click.echo(f"{indent}{'placed' if outcome.on_mark else 'not placed'} on the second mark")
    if outcome.rest is not None:
        click.echo(f"{indent}{outcome.rest.said()}")
    for note in outcome.notes:
        click.echo(f"{indent}look: {note}")


@scene.command(
    epilog="Example: tega-teleop scene record session.mcap --camera front=0 --camera side=/dev/video2"
)
@click.argument("out", type=FILE, metavar="OUT.mcap")
@click.option(
    "--camera",
    "cameras",
    multiple=True,
    required=True,
    metavar="NAME=SOURCE",
    help="Name and address of a camera; repeatable.",
)
@_size_option
@click.option(
    "--rate-hz", type=FiniteRange(1, 240), default=30.0, show_default=True, help="Pictures a second."
)
@click.option(
    "--video",
    type=click.Choice(["h264", "av1"]),
    default="h264",
    show_default=True,
    help="Format of the video.",
)
@click.option("--seconds", type=FiniteRange(0.1), help="Seconds to record; else Ctrl-C stops it.")
@json_option
def record(
    *,
    out: Path,
    cameras: tuple[str, ...],
    size: tuple[int, int],
    rate_hz: float,
    video: Literal["h264", "av1"],
    seconds: float | None,
    as_json: bool,
) -> None:
    """Record cameras (number, /dev/video0, rtsp://, a video file) on the clock that sessions of this machine keep.

    With --json: {"cameras": {name: {"pictures", "seen", "dropped", "missed", "longest_gap_s", "lost", "trouble"}}}.
    """
    import time
    from functools import cache

    import msgspec

    from tega.safety.stop import CtrlC
    from tega_scene.record import record_cameras

    named = dict(text.partition("=")[::2] for text in cameras)
    if len(named) < len(cameras) or not all(named.values()):
        raise click.UsageError("--camera: write each as front=0, with a name of its own")
    # Asked for the first time once every camera films: opening them may take seconds.
    begin_s = cache(time.monotonic)
    with CtrlC() as stop:
        found = record_cameras(
            out,
            named,
            size=size,
            rate_hz=rate_hz,
            stop=lambda: stop() or (seconds is not None and time.monotonic() >= begin_s() + seconds),
            video=video,
        )
    lines = (
        f"{name}: {tally.pictures} pictures, {tally.dropped} dropped, {tally.missed} missed, longest gap "
        f"{1000 * tally.longest_gap_s:.0f} ms{'; ' + tally.trouble if tally.trouble else ''}"
        for name, tally in found.items()
    )
    answer({"cameras": msgspec.to_builtins(found)}, lines, as_json=as_json)


@scene.command(epilog="Example: tega-teleop scene export session.mcap front front.mp4")
@click.argument("recording", type=FILE)
@click.argument("name")
@click.argument("out", type=FILE, metavar="OUT.mp4")
@json_option
def export(*, recording: Path, name: str, out: Path, as_json: bool) -> None:
    """Write a recorded camera as MP4 with a time code beside it (OUT.times.csv); nothing is re-encoded.

    With --json: {"pictures": n, "file": ..., "times": ...}.
    """
    from tega_scene.pictures import times_path
    from tega_scene.record import export_camera

    n = export_camera(recording, name, out)
    line = f"{out}: {n} pictures; {times_path(out)}: when each was taken, on the session's clock"
    answer({"pictures": n, "file": str(out), "times": str(times_path(out))}, [line], as_json=as_json)


@scene.command(epilog="Example: tega-teleop scene flash flashes.csv")
@click.argument("out", type=FILE, metavar="FLASHES.csv")
def flash(*, out: Path) -> None:
    """Make this terminal white and black by turns, fewer than two times a second, and write down when.

    Hold it before the cameras while scene record runs; then scene offset says how late each camera is.
    """
    from tega_scene.offset import flash_light

    def write(text: str) -> None:
        click.echo(text, nl=False, color=True)

    flash_light(out, write)
    click.echo(f"{out}: when the light was switched; tega-teleop scene offset SCENE.mcap NAME {out}")


@scene.command(epilog="Example: tega-teleop scene offset session.mcap front flashes.csv")
@click.argument("recording", type=FILE)
@click.argument("name")
@click.argument("flashes", type=FILE, metavar="FLASHES.csv")
@json_option
def offset(*, recording: Path, name: str, flashes: Path, as_json: bool) -> None:
    """Estimate how late a recorded camera is by the light of scene flash, and keep that beside the recording.

    Export, play and clips take it off. With --json: {"late_s", "error_s", "n_edges", "file"}.
    """
    import msgspec

    from tega_scene.offset import measure_offset
    from tega_scene.pictures import keep_offset, offsets_path

    found = measure_offset(recording, name, flashes)
    keep_offset(recording, name, found)
    kept = str(offsets_path(recording))
    line = (
        f"{name}: {1000 * found.late_s:.1f} ± {1000 * found.error_s:.1f} ms late, by {found.n_edges} switchings; "
        f"{kept}: taken off by export, play and clips"
    )
    answer({**msgspec.to_builtins(found), "file": kept}, [line], as_json=as_json)
