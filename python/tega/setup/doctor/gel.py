"""Judge a fingertip's gel: whether it is dark, dirty or worn, and whether its baseline still fits.

Everything is judged in the sensor's own noise, which is measured in the pictures that it sends now.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tega.config.calibration.records import GelRecord, read_record
from tega.errors import CalibrationError, TegaError
from tega.runtime.opencv import read_image
from tega.setup.calibration.gel import compare_gels, dark
from tega.setup.doctor.findings import DriverCase, Finding, failed
from tega.setup.doctor.mains import moving_bands, standing_bands
from tega.tactile.tracker import TouchTracker, sensor_noise

LEAST_PICTURES = 10
"""Fewer pictures say too little about a sensor's noise."""
MOST_BANDING = 0.005
"""Bands of mains light, as a share of the light, from which areas are off by more than 5 % where they hardly move."""
MOST_SLOW_BANDING = 0.002
"""The same, of slow bands: that they are at least so large shows at such speeds that they may be ten times as large."""


def check_gel(case: DriverCase, label: str, pictures: Sequence[NDArray[np.uint8]]) -> list[Finding]:
    """Judge the gel by pictures that were taken while nothing should have touched it.

    They are uint8 (H, W, 3), of one size, in the order they came, and are compared with the case's
    ``baseline``. Fewer than :data:`LEAST_PICTURES` are not judged.
    """
    if case.baseline is None:
        return [*_is_dark(case, label, pictures), *_has_bands(case, label, pictures, None)]
    try:
        baseline = read_image(case.baseline, driver=case.driver)
    except TegaError as error:
        return [failed(case, error, device=label, status="missing")]
    sent = pictures[-1].shape
    if baseline.shape != sent:
        height, width = baseline.shape[:2]
        text = f"the baseline {case.baseline.name} is {width}×{height}, {label} sends {sent[1]}×{sent[0]}"
        why = "size or orientation was another when it was taken"
        return [case.reported(label, "error", text, why=why, todo=("take the baseline again",))]
    return [
        *_is_dark(case, label, pictures),
        *_has_bands(case, label, pictures, baseline),
        *_compared(case, label, pictures, baseline, case.baseline),
    ]


def _is_dark(case: DriverCase, label: str, pictures: Sequence[NDArray[np.uint8]]) -> list[Finding]:
    if len(pictures) < LEAST_PICTURES:
        return []
    noise = max(_noise(pictures))
    text = dark(_mean(pictures), noise)
    if not text:
        return []
    why = "the gel's lights are off, weak or covered: touch moves the colours by less than their noise"
    return [
        case.reported(
            label, "error", f"{case.driver} {label}: {text}", why=why, measured={"noise_counts": noise}
        )
    ]


def _has_bands(
    case: DriverCase, label: str, pictures: Sequence[NDArray[np.uint8]], baseline: NDArray[np.uint8] | None
) -> list[Finding]:
    if len(pictures) < LEAST_PICTURES:
        return []
    bands, words, most = moving_bands(pictures), "move", MOST_BANDING
    why = "a lamp on mains flickers at 100 or 120 Hz; contacts are measured without bands that move so fast"
    if bands.slow:
        words, most = "or more hardly move", MOST_SLOW_BANDING
    if baseline is not None and bands.amplitude < most:
        bands, words, most = (
            standing_bands(pictures, baseline),
            "that its baseline has not stand",
            MOST_BANDING,
        )
    if bands.amplitude < most:
        return []
    if bands.slow:
        why = "a lamp on mains flickers at 100 or 120 Hz; bands that hardly move make areas wrong"
    percent = 100 * bands.amplitude
    return [
        case.reported(
            label,
            "warning",
            f"{case.driver} {label}: bands of {percent:.1f} % of the light {words} over the picture",
            why=why,
            todo=("keep lamps on mains away from the gel, or cover its sides",),
            measured={"banding_percent": round(percent, 2)},
        )
    ]


def _compared(
    case: DriverCase,
    label: str,
    pictures: Sequence[NDArray[np.uint8]],
    baseline: NDArray[np.uint8],
    path: Path,
) -> list[Finding]:
    """Compare the gel with its baseline."""
    if len(pictures) < LEAST_PICTURES:
        return []
    now, noise = _mean(pictures), max(_noise(pictures))
    noise_then, when = noise, f"in {path.name}"
    try:
        record = read_record(path.with_suffix(".toml"), GelRecord)
    except CalibrationError:
        pass  # a picture that somebody took by other means
    else:
        noise_then, when = max(record.noise_counts), f"{record.made:%Y-%m-%d}"
    change = compare_gels(now, baseline, noise_now=noise, noise_then=noise_then, when=when)
    findings = [
        case.reported(
            label,
            "warning",
            f"{case.driver} {label}: {words}",
            why="dirt, wear and aged lights look like touch, or hide it",
            todo=(
                "clean the gel with a lint-free cloth, then take its baseline again: tega-teleop calibrate --refresh",
            ),
            measured={"noise_counts": round(noise, 2), "wear_percent": round(100 * change.wear, 2)},
        )
        for words in change.words
    ]
    tracker = TouchTracker(baseline, noise=sensor_noise(pictures))
    contact = tracker.update(now)
    if contact.difference > contact.threshold:
        findings.append(
            case.reported(
                label,
                "warning",
                f"{case.driver} {label}: the gel differs from its baseline ({contact.difference:.1f} times its "
                f"noise; contact threshold {contact.threshold:.1f})",
                why="something touches the gel, or the baseline is stale: gels and lights drift",
                todo=(
                    "take everything off the fingertip and look again",
                    "take the baseline again if that stays",
                ),
                measured={"difference_noises": round(contact.difference, 2)},
            )
        )
    return findings


def _mean(pictures: Sequence[NDArray[np.uint8]]) -> NDArray[np.uint8]:
    total = np.zeros(pictures[0].shape, np.float64)
    for picture in pictures:
        total += picture
    return np.rint(total / len(pictures)).astype(np.uint8)


def _noise(pictures: Sequence[NDArray[np.uint8]]) -> list[float]:
    """Return the standard deviation of a pixel in time, counts, blue, green, red."""
    squares = np.zeros(3)
    for before, after in pairwise(pictures):
        squares += ((after.astype(np.float32) - before) ** 2).mean(axis=(0, 1))
    # Two neighbours differ by the noise of both.
    noise: list[float] = np.sqrt(squares / (2 * (len(pictures) - 1))).tolist()
    return noise
