"""Compare readings of touch, EMG and vest on recordings: ``tega-teleop audit``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tega.ui.cli.options import CHANNELS, FiniteRange, PngPath, json_option

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tega_figures.audit import Audited, AuditReport, AuditRequest, EmgColumns


_FILE = click.Path(exists=True, dir_okay=False, path_type=Path)


@click.command(
    epilog="Example: tega-teleop audit presses/ --baseline presses/background.png --marks presses/annotate.csv "
    "--set stages.metric.name=reading --sweep stages.metric.options.factor=0.5:2.5:0.25 --picture factor.png"
)
@click.argument("recording", type=click.Path(exists=True, path_type=Path))
@click.option(
    "--of", "of", multiple=True, type=click.Choice(["touch", "emg", "vest"]),
    help="Part whose readings are compared; else all that the recording holds, or that of the sweep. Repeatable.",
)  # fmt: skip
@click.option(
    "--reading", "names", multiple=True, metavar="NAME", help="Only this named reading; repeatable."
)
@click.option(
    "--sweep", metavar="KEY=FROM:TO:STEP",
    help="One setting over a range, or KEY=VALUE,VALUE,..., instead of the named readings; keys as for --set.",
)  # fmt: skip
@click.option(
    "--set", "sets", multiple=True, metavar="KEY=VALUE",
    help="A setting of all readings: stages.*, vest.*; repeatable.",
)  # fmt: skip
@click.option(
    "--preset", type=click.Choice(["paper", "live"]), help="Preset to use instead of the recording's own."
)
@click.option("--baseline", type=_FILE, help="Picture of the untouched gel, for loose pictures.")
@click.option(
    "--separate",
    is_flag=True,
    help="Each picture is of a press of its own: nothing is remembered from one to the next.",
)
@click.option(
    "--marks",
    type=_FILE,
    help="Marked contact circles: img_name,center_x,center_y,radius in pixels. Pictures without one are left out.",
)
@click.option(
    "--masks",
    type=click.Path(exists=True, file_okay=False, path_type=Path),
    help="Folder of masks, white where touched: named as the pictures, or with mask in the place of frame. Pictures "
    "without one are left out.",
)
@click.option(
    "--forces",
    type=_FILE,
    help="Forces: img_name,force_n in newtons, 0 where nothing touches; a video's frame,force_n by number from 0; or "
    "t_s,force_n over time.",
)
@click.option(
    "--least-force-n", type=FiniteRange(0, 1000), default=0.0, show_default=True,
    help="Force, in newtons, below which the sensor's value counts as 0.",
)  # fmt: skip
@click.option(
    "--emg-rate-hz",
    type=FiniteRange(0, 10_000_000, min_open=True),
    help="Samples per second of a file of EMG.",
)
@click.option(
    "--emg-kind",
    type=click.Choice(["raw", "rectified", "envelope"]),
    help="What the samples of a file of EMG are.",
)
@click.option(
    "--emg-channels", type=CHANNELS, help="Columns of a file of EMG to use, counted from 1; else all."
)
@click.option("--emg-variable", default="emg", show_default=True, help="Name of the array in a .mat file.")
@click.option("--picture", type=PngPath(), help="Draw the comparison, or the sweep, into this PNG.")
@json_option
def audit(*, recording: Path, picture: Path | None, as_json: bool, **flags: Any) -> None:
    """Compare readings of touch, EMG and vest on RECORDING, with the stages that a run uses.

    RECORDING is a folder of pictures or a video of one finger, a file of EMG samples (.csv, .txt, .npy, .mat), a
    recording made with run --record, or a session's folder. Pictures go through every reading in time order.

    Without --baseline it is estimated from the quietest pictures. With --marks each reading's area is compared with the
    marked circles, and a picture without contact is composed from what lies far from them; --masks does so with drawn
    areas. With --forces it says how the reading goes with the force, and counts contacts where the force is 0.

    With --json: a list of objects, one a recording, {"recording", "sweep", "n_left_out", "touch", "emg", "vest"};
    each of the last three is a list, one a reading (of touch: a reading and finger), with the fields of
    tega_figures.audit.TouchScore, EmgScore and VestScore, of a sweep with its "value".
    """
    import msgspec

    from tega.ui.cli.options import echo_json, progress_bar
    from tega_figures.audit import audit_recording
    from tega_figures.audit.tables import print_report

    with progress_bar(enabled=not as_json) as progress:
        found = audit_recording(
            recording, _requested(flags), baseline=flags["baseline"], emg=_emg(flags), progress=progress
        )
    if picture is not None:
        _draw(found, picture)
    if as_json:
        echo_json(msgspec.to_builtins([one.report for one in found]))
        return
    for one in found:
        print_report(one.report)


def _requested(flags: dict[str, Any]) -> AuditRequest:
    from tega_figures.audit import AuditRequest, parse_sweep, read_forces, read_marks

    if flags["names"] and flags["sweep"]:
        raise click.UsageError("--reading is for named readings: leave it out of a --sweep")
    return AuditRequest(
        of=flags["of"],
        names=flags["names"],
        sweep=None if flags["sweep"] is None else parse_sweep(flags["sweep"]),
        sets=flags["sets"],
        preset=flags["preset"],
        marks=None if flags["marks"] is None else read_marks(flags["marks"]),
        masks=flags["masks"],
        forces=None
        if flags["forces"] is None
        else read_forces(flags["forces"], least_n=flags["least_force_n"]),
        separate=flags["separate"],
    )


def _emg(flags: dict[str, Any]) -> EmgColumns | None:
    from tega_figures.audit import EmgColumns

    if flags["emg_rate_hz"] is None or flags["emg_kind"] is None:
        return None
    return EmgColumns(
        flags["emg_rate_hz"], flags["emg_kind"], tuple(flags["emg_channels"] or ()), flags["emg_variable"]
    )


def _draw(found: Sequence[Audited], picture: Path) -> None:
    """Draw each recording; of several, and of several fingers, the name goes into the file's."""
    from tega_figures.audit.pictures import draw_audit, draw_courses, draw_sweep

    for one in found:
        report: AuditReport = one.report
        name = "" if len(found) == 1 else Path(report.recording).stem
        if report.sweep:
            draw_sweep(_named(picture, name), report)
        elif not report.touch:
            draw_courses(_named(picture, name), report)
        else:
            for finger, seen in one.fingers.items():
                own = [score for score in report.touch if score.finger == finger]
                part = name if len(one.fingers) == 1 else f"{name}-{finger}".strip("-")
                draw_audit(_named(picture, part), seen, own)


def _named(path: Path, part: str) -> Path:
    return path.with_name(f"{path.stem}-{part}{path.suffix}") if part else path
