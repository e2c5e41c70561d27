"""Lead pick and place through the arm's chain, and tell what filter, clip and delay do.

``python -m tega_figures.check_arm`` prints the table of ``docs/evidence/arm.md`` and draws its picture into a folder,
``docs/images`` unless told. Everything it says is simulated. Needs the extras ``sim`` and ``view``; a recorded session
as path needs ``record`` too.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click
import numpy as np

from tega.arm import StampedPose
from tega.arm.frames import ToBase
from tega.devices.tracker.sources import read_poses
from tega.runtime.lifecycle import require
from tega_figures.arm_path import CASES, Followed, HandPath, as_recorded, follow_path, hand_path, tracked

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["arm_figure", "hand_of", "main", "table"]

_DISPLAYED = ("default, not late", "without filter", "200 ms late, `age_ms` and `hold_ms` 300")
_STAYS = 0.01


def hand_of(path: Path) -> list[StampedPose]:
    """Return the forearm's path of a CSV file, or of a session recorded with an arm, in the base's axes.

    Raises:
        RecordingError: It cannot be read, or no forearm was tracked in it.
    """
    if path.suffix == ".csv":
        return read_poses(path)
    from tega.recording.mcap_folder import session_files
    from tega.recording.replay.recompute import forearm

    mapping, poses = forearm(session_files(path)[0])
    to_base = ToBase(mapping)
    return [pose._replace(**to_base(pose)._asdict()) if pose.valid else pose for pose in poses]


def table(found: Sequence[tuple[str, Followed]]) -> list[str]:
    """Return the table, in Markdown."""
    lines = [
        "| | error mm | 95 of 100 mm | lag ms | shape mm | turn mrad | jitter mm | following | the object |"
    ]
    lines.append("|---|---|---|---|---|---|---|---|---|")
    for name, f in found:
        chained = not name.startswith("no chain")
        if chained and f.following < _STAYS:
            lines.append(f"| {name} | – | – | – | – | – | – | 0 %: the arm stays | stays |")
            continue
        became = "–"
        if f.placed is not None:
            how = "placed" if f.placed.placed else "not placed"
            became = f"{how}, {f.placed.off_mm:.0f} mm off"
        numbers = (
            f"{f.error_mm:.1f} | {f.worst_mm:.1f} | {f.lag_ms:.0f} | {f.shape_mm:.1f} | {f.turn_mrad:.0f}"
        )
        share = f"{100 * f.following:.0f} %" if chained else "–"
        lines.append(f"| {name} | {numbers} | {f.jitter_mm:.2f} | {share} | {became} |")
    return lines


def arm_figure(path: HandPath, found: Sequence[tuple[str, Followed]]) -> Figure:
    """Draw the height of hand and palm over time, and the palm's tremor while the hand rests.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    from tega.ui.view.figures import new_figure

    displayed = [(name, f) for name, f in found if name in _DISPLAYED]
    figure = new_figure(figsize=(9, 3.6))
    whole, still = figure.subplots(1, 2, width_ratios=(2, 1))
    times = np.arange(0, path.duration_s, 0.01)
    hand = 100 * np.array([path.at(t).position_m for t in times])
    whole.plot(times, hand[:, 2], "k--", lw=1.2, label="hand")
    for number, (name, f) in enumerate(displayed):
        label = name.split(",")[0] if "late," in name else name
        # The first line is broad, so that it is seen where the others lie on it.
        whole.plot(f.course[:, 0], 100 * f.course[:, 3], lw=1 if number else 2.6, label=label)
    if path.closed_s is not None:
        whole.axvspan(*path.closed_s, color="0.85", label="hand told to grip")
    whole.set(
        xlabel="time, s",
        ylabel="height, cm",
        title="the operator's hand (dashed) and the simulated palm (lines)",
    )
    # On white: a patch of the grey would not be seen on the grey.
    whole.legend(fontsize=7, framealpha=1.0, loc="center", bbox_to_anchor=(0.52, 0.5))
    start_s = 3.0
    for name, f in displayed[:2]:
        t, x, *_ = f.course[(f.course[:, 0] > start_s) & (f.course[:, 0] < start_s + 1)].T
        still.plot(t, 1e3 * (x - x.mean()), lw=1, label=name)
    still.set(xlabel="time, s", ylabel="off its mean along x, mm", title="the palm while the hand rests")
    still.legend(fontsize=7, frameon=False)
    return figure


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.argument(
    "out", type=click.Path(exists=True, file_okay=False, path_type=Path), default=Path("docs/images")
)
@click.option(
    "--path",
    "file",
    type=click.Path(exists=True, path_type=Path),
    help="A recorded hand: CSV, or a session recorded with an arm; else one is made up, and picks and places.",
)
@click.option("--jobs", default=1, show_default=True, help="Cases at a time.")
def main(*, out: Path, file: Path | None, jobs: int) -> None:
    """Lead the simulated arm along a hand's path in eleven ways, print how well, and draw OUT/arm-path.png.

    Four minutes with one job on an idle machine; all of it is simulated.
    """
    joblib = require("joblib", driver="check_arm", extra="sim")
    if file is None:
        path = hand_path()
        poses = tracked(path.at, path.duration_s, seed=1)
    else:
        poses = hand_of(file)
        path = as_recorded(poses)
    done = joblib.Parallel(n_jobs=jobs)(
        joblib.delayed(_case)(number, poses, file) for number in range(len(CASES))
    )
    found = [(case.name, followed) for case, followed in zip(CASES, done, strict=True)]
    click.echo("\n".join(table(found)))
    arm_figure(path, found).savefig(out / "arm-path.png", dpi=96)


def _case(number: int, poses: Sequence[StampedPose], file: Path | None) -> Followed:
    """Run one case; made here from what can be sent to another process."""
    return follow_path(CASES[number], poses, hand_path() if file is None else as_recorded(poses))


if __name__ == "__main__":
    main()
