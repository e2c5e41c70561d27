"""What the touch reading is worth, as tables: ``python -m tega_figures.check_touch_live``.

Prints the tables of ``docs/evidence/touch-live.md``: simulated presses with two plain peers on the same frames, what
the memory loses to slow presses, depth and force after three known presses, the demo's three lifts, and recorded touch.
Seeds of simulated units come from the hash of the commit. Recordings are looked for in the folder that ``TEGA_DATA``
names; without them their table is left out.
Needs the extra ``lab``.
"""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import click
import numpy as np
from numpy.typing import NDArray

from tega.tactile.tracker import TouchTracker, sensor_noise, update_fingers
from tega_figures.gel_sequences import SHAPES, press_sequence, ramp
from tega_figures.touch_demo import DemoScore, score_demo
from tega_figures.touch_presses import (
    PEERS,
    FrameReader,
    Image,
    PressScore,
    calibrated_errors,
    score_press,
    unit_seeds,
)
from tega_figures.touch_recordings import GRIPS, RecordedGrip, grip_video, rest, soft_grips

__all__ = ["commit", "felt_of_slow_press"]

# Most recordings begin in contact: background subtraction has nothing to learn from.
_ON_RECORDINGS = {name: make for name, make in PEERS.items() if name != "OpenCV MOG2"}
SLOW_S = (3.0, 10.0, 30.0)
_TABLES = ("simulated", "slow", "calibrated", "demo", "recorded")
_HEAD = {
    "felt_n": "felt from N",
    "peak_rank": "rank: peak, force",
    "area_rank": "rank: EDA, area",
    "steady": "held: sd of EDA",
    "held_jump": "held: largest jump",
    "rising_jump": "rising: largest jump",
    "released_s": "released after s",
    "false_before": "false before",
    "false_after": "false 1 s after",
}


def felt_of_slow_press(name: str, seed: int, rise_s: float, *, rate_hz: float = 30.0) -> float:
    """Return from which force, newtons, a press to 1.5 N over so many seconds is felt to its end; NaN if not."""
    force_n = ramp(peak_n=1.5, wait_s=2.0, rise_s=rise_s, hold_s=1.0, fall_s=0.1)
    tracker, first = None, float("nan")
    for snapshot in press_sequence(
        name, seed=seed, force_n=force_n, duration_s=2.0 + rise_s, rate_hz=rate_hz
    ):
        tracker = tracker or TouchTracker(snapshot.image, rate_hz=rate_hz)
        if not tracker.update(snapshot.image).in_contact:
            first = float("nan")
        elif np.isnan(first):
            first = snapshot.force_n
    return first


def _press_table(units: list[int]) -> list[str]:
    lines = ["| shape | reading | " + " | ".join(_HEAD.values()) + " |", "|---" * (2 + len(_HEAD)) + "|"]
    for name in SHAPES:
        scores: dict[str, list[PressScore]] = {peer: [] for peer in PEERS}
        for seed in units:
            for peer, score in score_press(name, seed, readings=PEERS).items():
                scores[peer].append(score)
        lines += [
            f"| {name} | {peer} | " + " | ".join(_worst(found)) + " |" for peer, found in scores.items()
        ]
    return lines


def _worst(found: list[PressScore]) -> list[str]:
    cells = []
    for of in _HEAD:
        values = [float(getattr(score, of)) for score in found]
        if all(np.isnan(values)):
            cells.append("–")
            continue
        missing = " *" if any(np.isnan(values)) else ""
        worst = np.nanmin(values) if of.endswith("rank") else np.nanmax(values)
        cells.append((f"{worst:.0f}" if of.startswith("false") else f"{worst:.3g}") + missing)
    return cells


def _slow_table(units: list[int]) -> list[str]:
    lines = ["| shape | " + " | ".join(f"{s:.0f} s" for s in SLOW_S) + " |", "|---" * (1 + len(SLOW_S)) + "|"]
    for name in SHAPES:
        found = [[felt_of_slow_press(name, seed, rise_s) for seed in units] for rise_s in SLOW_S]
        cells = [
            f"{max(v):.2f}" if not any(np.isnan(v)) else f"missed in {sum(np.isnan(v))} of {len(v)}"
            for v in found
        ]
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    return lines


def _calibrated_table(units: list[int]) -> list[str]:
    lines = [
        "| shape | depth: within 15 % | worst | force: within 25 % | worst | middle: within 1 mm | worst |",
        "|---" * 7 + "|",
    ]
    found = [calibrated_errors(seed) for seed in units]
    for name in SHAPES:
        errors = np.abs([error for unit in found for error in unit[name]])
        cells = [
            cell
            for values, bar, unit in zip(errors.T, (0.15, 0.25, 1.0), (".1%", ".1%", ".2f"), strict=True)
            for cell in (f"{(values <= bar).sum()} of {len(values)}", f"{values.max():{unit}}")
        ]
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    return lines


def _demo_table(people: int) -> list[str]:
    lines = [
        "| person, finger | " + " | ".join(DemoScore._fields) + " |",
        "|---" * (1 + len(DemoScore._fields)) + "|",
    ]
    for seed in range(1, people + 1):
        scores = score_demo(seed)
        for finger, score in scores.items():
            lines.append(f"| {seed}, {finger} | " + " | ".join(f"{value:.4g}" for value in score) + " |")
        counts = np.sum([score[:-2] for score in scores.values()], axis=0)
        ranks = np.median([score[-2:] for score in scores.values()], axis=0)
        cells = [*(f"{n:.0f}" for n in counts), *(f"{rank:.4g}" for rank in ranks)]
        lines.append(f"| {seed}, all; median rank | " + " | ".join(cells) + " |")
    return lines


def _recorded_table(folder: Path) -> list[str]:
    lines = ["| recorded | " + " | ".join(_ON_RECORDINGS) + " |", "|---" * (1 + len(_ON_RECORDINGS)) + "|"]

    def row(subject: str, shares: dict[str, float]) -> None:
        lines.append(f"| {subject} | " + " | ".join(f"{shares[peer]:.1%}" for peer in _ON_RECORDINGS) + " |")

    pictures = soft_grips(folder)
    still = np.median(np.array(pictures["empty"]), axis=0).astype(np.uint8)
    for name, frames in pictures.items():
        # Each picture is shown for a second to readings that are made anew.
        reported = {
            p: [_displayed(make(still, 30.0), frame) for frame in frames]
            for p, make in _ON_RECORDINGS.items()
        }
        row(f"{name}, {len(frames)} pictures", {p: float(np.mean(t)) for p, t in reported.items()})
    baseline, frames, _ = rest(folder)
    row(
        "three minutes at rest",
        {p: _reported(make(baseline, 1 / 5.9), frames) for p, make in _ON_RECORDINGS.items()},
    )
    for name, grip in GRIPS.items():
        fingers = [grip_video(folder, name, camera) for camera in (0, 2)]
        together = _together(fingers, grip)
        for number, (camera, images) in enumerate(zip((0, 2), fingers, strict=True)):
            still = np.median(images[grip.rest[0] : grip.rest[1] + 1], axis=0).astype(np.uint8)
            reported = {}
            for peer, make in _ON_RECORDINGS.items():
                if peer == "live":
                    reported[peer] = [on[number] for on in together]
                    continue
                read = make(still, 25.0)
                reported[peer] = [read(frame).in_contact for frame in images[grip.from_frame :]]
            held = slice(grip.held[0] - grip.from_frame, grip.held[1] + 1 - grip.from_frame)
            row(f"{name}, finger {camera}, held", {p: float(np.mean(t[held])) for p, t in reported.items()})
            if grip.silent_from is not None:
                after = slice(grip.silent_from - grip.from_frame, None)
                row(
                    f"{name}, finger {camera}, 1.5 s after",
                    {p: float(np.mean(t[after])) for p, t in reported.items()},
                )
    return lines


def _together(fingers: list[NDArray[np.uint8]], grip: RecordedGrip) -> list[list[bool]]:
    """Read both fingers of a grip as the loop does: each gets the other's, and knows its sensor's noise."""
    still = [frames[grip.rest[0] : grip.rest[1] + 1] for frames in fingers]
    trackers = [
        TouchTracker(np.median(frames, axis=0).astype(np.uint8), rate_hz=25.0, noise=sensor_noise(frames))
        for frames in still
    ]
    return [
        [contact.in_contact for contact in update_fingers(trackers, [frames[k] for frames in fingers])]
        for k in range(grip.from_frame, min(map(len, fingers)))
    ]


def _displayed(read: FrameReader, frame: Image) -> bool:
    return [read(frame).in_contact for _ in range(32)][-1]


def _reported(read: FrameReader, frames: list[Image]) -> float:
    return float(np.mean([read(frame).in_contact for frame in frames]))


def commit() -> str:
    """Return the hash of the commit that is checked out."""
    requested = subprocess.run(
        ["git", "rev-parse", "HEAD"], cwd=Path(__file__).parent, capture_output=True, text=True, check=False
    )
    if requested.returncode:
        raise click.UsageError("there is no commit here to take seeds from: give --seed-text")
    return requested.stdout.strip()


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--units", type=click.IntRange(1, 100), default=4, show_default=True, help="Simulated units.")
@click.option("--only", type=click.Choice(_TABLES), help="One table alone.")
@click.option(
    "--people", type=click.IntRange(1, 100), default=1, show_default=True, help="Of the demo's lifts."
)
@click.option("--seed-text", help="What the units' seeds are the hash of; without it the commit's own hash.")
def main(units: int, only: str | None, people: int, seed_text: str | None) -> None:
    """Print the tables of docs/evidence/touch-live.md: the worst over the units; a star: a unit has no value.

    Recordings are looked for in the folder that the variable TEGA_DATA names, else in ../shared/data.
    """
    text = seed_text or commit()
    click.echo(f"Seeds of the units: from {text!r}.")
    seeds = unit_seeds(units, text)
    folder = Path(os.environ.get("TEGA_DATA", "../shared/data")) / "digit"
    if only in (None, "simulated"):
        click.echo("\n".join(["", "## simulated presses, worst of the units", "", *_press_table(seeds)]))
    if only in (None, "slow"):
        click.echo("\n".join(["", "## felt from N, pressed to 1.5 N over", "", *_slow_table(seeds)]))
    if only in (None, "calibrated"):
        click.echo("\n".join(["", "## calibrated with three presses", "", *_calibrated_table(seeds)]))
    if only in (None, "demo"):
        click.echo("\n".join(["", "## the demo's three lifts", "", *_demo_table(people)]))
    if only in (None, "recorded"):
        there = folder.is_dir()
        lines = _recorded_table(folder) if there else [f"left out: no recordings at {folder}"]
        click.echo("\n".join(["", "## recorded", "", *lines]))


if __name__ == "__main__":
    main()
