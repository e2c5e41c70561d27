"""``tega-teleop audit``: the readings of the contact equations on recorded touch."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tega.cli.options import debug_option, json_option

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from tega.audit import ReadingScore
    from tega.devices.base import TactileSource

__all__ = ["audit"]


@click.command(
    epilog="Example: tega-teleop audit presses/ --baseline presses/background.png --marks presses/annotate.csv"
)
@click.argument("recording", type=click.Path(exists=True, path_type=Path))
@click.option(
    "--baseline",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    help="Picture of the untouched gel.",
)
@click.option(
    "--marks",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    help="Marked contact circles: img_name,center_x,center_y,radius in pixels. Pictures without one are left out.",
)
@click.option(
    "--masks",
    type=click.Path(exists=True, file_okay=False, path_type=Path),
    help="Folder of masks, named as the pictures: white where touched. Pictures without one are left out.",
)
@click.option(
    "--forces",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    help="Forces: img_name,force_n in newtons, 0 where nothing touches; a video's frames by number from 0.",
)
@click.option(
    "--picture", type=click.Path(dir_okay=False, path_type=Path), help="Draw the comparison into this PNG."
)
@click.option(
    "--curves",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Draw EDA and CCI of the presets over the frames into this PNG; no recorded picture is in it.",
)
@json_option
@debug_option
def audit(
    *,
    recording: Path,
    baseline: Path | None,
    marks: Path | None,
    masks: Path | None,
    forces: Path | None,
    picture: Path | None,
    curves: Path | None,
    as_json: bool,
) -> None:
    """Apply every reading of the contact equations to RECORDING, a folder of pictures or a video.

    Without --baseline it is estimated from the quietest frames. With --marks each reading's area is compared with
    the marked circles, and a frame without contact is composed from what lies far from them; --masks does so with drawn
    areas. With --forces it says how EDA goes with force, and counts contacts where the force is 0. With --json a
    list of
    objects is printed, one a reading, with the fields of tega.audit.ReadingScore.
    """
    import msgspec

    from tega.audit import audit_frames, far_field, read_forces, read_marks
    from tega.cli.options import echo_json
    from tega.errors import RecordingError
    from tega.teleop.baseline import find_baseline

    circles = read_marks(marks) if marks is not None else None
    newtons = read_forces(forces) if forces is not None else None
    with _source(recording, [p for p in (baseline,) if p is not None]) as source:
        still, _ = find_baseline(source, baseline, finger="thumb")
        frames, force_of = [], []
        while (frame := source.read(0.0)) is not None:
            force = newtons.get(frame.name, newtons.get(str(frame.seq))) if newtons is not None else None
            known = (circles is None or frame.name in circles) and (newtons is None or force is not None)
            if known and (masks is None or (masks / frame.name).is_file()):
                frames.append(frame)
                force_of.append(force)
    if not frames:
        raise RecordingError(
            f"{recording.name}: no picture has what --marks, --masks or --forces tell",
            "name them as the pictures are",
        )
    images = [frame.image for frame in frames]
    placed = [circles[frame.name] for frame in frames] if circles is not None else []
    at_rest = far_field(images, placed, still) if placed else None
    drawn = [_mask(masks / frame.name, still.shape[:2]) for frame in frames] if masks is not None else []
    scores = audit_frames(images, still, marks=placed, masks=drawn, forces_n=force_of, at_rest=at_rest)
    if picture is not None:
        from tega.view.audit import draw_audit

        draw_audit(picture, images, still, scores, marks=placed)
    if curves is not None:
        from tega.view.audit import draw_curves

        draw_curves(curves, images, still, scores, title=recording.stem)
    if as_json:
        echo_json(msgspec.to_builtins(scores))
    else:
        _print(scores, n_pixels=still.shape[0] * still.shape[1])


def _mask(path: Path, shape: tuple[int, ...]) -> NDArray[np.bool_]:
    from tega.errors import RecordingError
    from tega.opencv import read_image

    white: NDArray[np.bool_] = read_image(path, driver="audit").max(axis=2) > 127
    if white.shape != shape:
        raise RecordingError(
            f"{path.name}: a mask of {white.shape[0]} x {white.shape[1]} pixels, the pictures have "
            f"{shape[0]} x {shape[1]}",
            "give masks of the pictures' size",
        )
    return white


def _source(recording: Path, exclude: list[Path]) -> TactileSource:
    from tega.devices.registry import driver_class

    name = "images" if recording.is_dir() else "video"
    driver: Any = driver_class(name, "tactile")
    options = {"folder": recording, "exclude": tuple(exclude)} if recording.is_dir() else {"file": recording}
    source: TactileSource = driver(driver.options_type(**options))
    return source


def _print(scores: list[ReadingScore], *, n_pixels: int) -> None:
    from rich.box import SIMPLE
    from rich.console import Console
    from rich.table import Table

    first = scores[0]
    table = Table(title=f"{first.n_frames} frames of {n_pixels} pixels", title_justify="left", box=SIMPLE)
    table.add_column("reading", no_wrap=True)
    columns = ["found", "EDA least", "median", "most"]
    columns += ["at rest"] if first.eda_at_rest is not None else []
    columns += ["area / mark", "overlap", "worst tenth", "r with mark"] if first.iou is not None else []
    columns += ["felt"] if first.n_touched is not None else []
    columns += ["false"] if first.n_false is not None else []
    columns += ["r with N"] if any(s.force_rank is not None for s in scores) else []
    for name in columns:
        table.add_column(name, justify="right")
    for s in scores:
        areas = sorted(s.eda)
        row = [f"{s.n_found}", *(str(areas[i]) for i in (0, len(areas) // 2, -1))]
        row += [str(s.eda_at_rest)] if s.eda_at_rest is not None else []
        if s.iou is not None:
            row += [_number(v) for v in (s.area_ratio, s.iou, s.iou_low, s.area_correlation)]
        row += [f"{s.n_felt} of {s.n_touched}"] if s.n_touched is not None else []
        row += [str(s.n_false)] if s.n_false is not None else []
        row += [_number(s.force_rank)] if "r with N" in columns else []
        table.add_row(s.reading, *row)
    Console(highlight=False, width=130).print(table)


def _number(value: float | None) -> str:
    return "–" if value is None else f"{value:.2f}"
