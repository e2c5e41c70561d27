"""Judge a fingertip's gel: whether it is dark, dirty, worn or lit by mains, and whether its baseline still fits.

Everything is judged in the sensor's own noise, which is measured in the pictures that it sends now. A lamp on mains
flickers at 100 or 120 Hz, and a rolling shutter makes bands of that, along rows or, where the picture is turned, along
columns. A line's sum over its sum in another picture is its gain, and over the lines the gain is a wave: one for the
picture's left, middle and right, which a touch changes each in its own way.

From picture to picture the wave turns. How large it is shows once it has turned far; of a slower one only that it is at
least so large as the fastest wave that fits. One that stands still shows against a picture of another time.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega.config.calibration.records import GelRecord, read_record
from tega.errors import CalibrationError, TegaError
from tega.runtime.opencv import read_image
from tega.setup.calibration.gel import compare_gels, dark, mean_and_noise
from tega.setup.doctor.findings import DriverCase, Finding, failed
from tega.tactile.tracker import TouchTracker, sensor_noise

# Periods of the wave over the picture, of 100 and 120 Hz at 60 to 25 pictures a second.
_PERIODS: Final = np.arange(1.25, 6.01, 0.25)
# Rows or columns are taken together to so many lines.
_LINES: Final = 40
# Turns in the look: of slow waves a few, of others all that can be distinguished.
_SLOW_TURNS: Final = np.geomspace(0.03, 0.5, 9)
_TURNS: Final = 0.25
_FITS: Final = 10.0
"""Waves fit alike whose squares differ by no more than this share over the number of pictures."""
_LEAST_EXPLAINED: Final = 0.6
"""A wave against another picture explains this share of what differs between lines, or is none."""
_SLOW: Final = 0.039
"""Turns from picture to picture under which bands hardly move for ``live``: MOVES in tega-tactile's mains.rs."""


class Bands(NamedTuple):
    """A wave of gains over the lines of a picture; ``amplitude`` is a share of the light.

    ``turns`` are those from picture to picture, at least 0.
    """

    amplitude: float
    turns: float = 0.0

    @property
    def slow(self) -> bool:
        """Whether the bands hardly move, so that contacts are measured with them."""
        return self.turns < _SLOW


def _bands(
    pictures: Sequence[NDArray[np.uint8]],
    reference: NDArray[np.uint8],
    fit: Callable[[NDArray[np.float64]], Bands],
) -> Bands:
    """Return the larger bands of pictures, uint8 (H, W, 3), along rows or columns, fitted to gains over another."""
    lights, light = [_light(picture) for picture in pictures], _light(reference)
    return max(fit(_gains(lights, light, along)) for along in (0, 1))


def _light(picture: NDArray[np.uint8]) -> NDArray[np.int32]:
    """Return the sum of each pixel's colours, (H, W); ``sum`` over an axis of three is ten times as slow."""
    return picture[..., 0].astype(np.int32) + picture[..., 1] + picture[..., 2]


def _gains(
    lights: Sequence[NDArray[np.int32]], reference: NDArray[np.int32], along: int
) -> NDArray[np.float64]:
    """Return how much lighter than the reference the lines of three thirds are, shares, (3, pictures, lines)."""
    length, across = reference.shape[along], reference.shape[1 - along]
    starts = np.arange(min(_LINES, length)) * length // min(_LINES, length)
    gains = []
    for part in range(3):
        third = slice(part * across // 3, (part + 1) * across // 3)
        cut = (slice(None), third) if along == 0 else (third, slice(None))
        lines = [light[cut].sum(axis=1 - along) for light in (reference, *lights)]
        sums = [np.add.reduceat(one, starts) for one in lines]
        gains.append(np.array(sums[1:]) / np.maximum(sums[0], 1.0) - 1.0)
    return np.array(gains)


def _moving(gains: NDArray[np.float64]) -> Bands:
    """Return bands that move from picture to picture, three or more; of slow ones at least how large they are."""
    waves, _ = _waves(gains - gains.mean(axis=1, keepdims=True))
    n = gains.shape[1]
    speeds = np.concatenate([_SLOW_TURNS, np.arange(_SLOW_TURNS[-1], n / 2, _TURNS)[1:]]) / n
    found = []
    for turns in (*speeds, *-speeds):
        part, left = _turning(waves[:, None], turns)
        found.append((left, float(np.abs(part[0])), turns))
    most = min(left for left, *_ in found) * (1.0 + _FITS / n)
    amplitude, turns = min((amplitude, turns) for left, amplitude, turns in found if left <= most)
    turning = np.array([_turning(third, turns)[0] for third in gains])
    _, explained = _waves(turning[:, None])
    return Bands(amplitude if explained >= _LEAST_EXPLAINED else 0.0, abs(float(turns)))


def _turning(values: NDArray[np.inexact], turns: float) -> tuple[NDArray[np.complex128], float]:
    """Return the part of (pictures, n) that turns so fast, beside what stands, (n,), and the square that is left."""
    basis = np.array([np.ones(len(values)), np.exp(2j * np.pi * turns * np.arange(len(values)))]).T
    parts = np.linalg.pinv(basis) @ values
    return parts[1], float((np.abs(values - basis @ parts) ** 2).sum())


def _standing(gains: NDArray[np.float64]) -> Bands:
    waves, explained = _waves(gains.mean(axis=1, keepdims=True))
    return Bands(float(np.abs(waves[0])) if explained >= _LEAST_EXPLAINED else 0.0)


def _waves(gains: NDArray[np.inexact]) -> tuple[NDArray[np.complex128], float]:
    """Fit the waves of one length, beside a slow change over the lines, that explain most of all thirds.

    Return each picture's amplitude and phase, (pictures,), and what they explain of the gains' square.
    """
    at = np.linspace(-1.0, 1.0, gains.shape[-1])
    plain = np.array([np.ones_like(at), at, at**2])
    gains = gains - gains @ np.linalg.pinv(plain) @ plain
    whole = float((np.abs(gains) ** 2).sum())
    least, best = whole, np.zeros(gains.shape[1], np.complex128)
    for periods in _PERIODS:
        basis = np.array([*plain, np.cos(np.pi * periods * at), np.sin(np.pi * periods * at)])
        parts = gains.mean(axis=0) @ np.linalg.pinv(basis)
        left = float((np.abs(gains - parts @ basis) ** 2).sum())
        if left < least:
            least, best = left, parts[:, 3] + 1j * parts[:, 4]
    return best, 1.0 - least / whole if whole else 0.0


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
    baseline: NDArray[np.uint8] | None = None
    if case.baseline is not None:
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
    if len(pictures) < LEAST_PICTURES:
        return []
    mean, noises = mean_and_noise(pictures)
    noise, findings = float(noises.max()), []
    if text := dark(mean, noise):
        why = "the gel's lights are off, weak or covered: touch moves the colours by less than their noise"
        text = f"{case.driver} {label}: {text}"
        findings.append(case.reported(label, "error", text, why=why, measured={"noise_counts": noise}))
    findings += _has_bands(case, label, pictures, baseline)
    if baseline is not None and case.baseline is not None:
        findings += _compared(case, label, pictures, baseline, case.baseline)
    return findings


def _has_bands(
    case: DriverCase, label: str, pictures: Sequence[NDArray[np.uint8]], baseline: NDArray[np.uint8] | None
) -> list[Finding]:
    bands, words, most = _bands(pictures, pictures[0], _moving), "move", MOST_BANDING
    why = "a lamp on mains flickers at 100 or 120 Hz; contacts are measured without bands that move so fast"
    if bands.slow:
        words, most = "or more hardly move", MOST_SLOW_BANDING
    if baseline is not None and bands.amplitude < most:
        bands, most = _bands(pictures, baseline, _standing), MOST_BANDING
        words = "that its baseline has not stand"
    if bands.amplitude < most:
        return []
    if bands.slow:
        why = "a lamp on mains flickers at 100 or 120 Hz; bands that hardly move make areas wrong"
    percent = 100 * bands.amplitude
    text = f"{case.driver} {label}: bands of {percent:.1f} % of the light {words} over the picture"
    todo = ("keep lamps on mains away from the gel, or cover its sides",)
    measured = {"banding_percent": round(percent, 2)}
    return [case.reported(label, "warning", text, why=why, todo=todo, measured=measured)]


def _compared(
    case: DriverCase,
    label: str,
    pictures: Sequence[NDArray[np.uint8]],
    baseline: NDArray[np.uint8],
    path: Path,
) -> list[Finding]:
    now, noises = mean_and_noise(pictures)
    noise = float(noises.max())
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
        text = (
            f"{case.driver} {label}: the gel differs from its baseline ({contact.difference:.1f} times its "
            f"noise; contact threshold {contact.threshold:.1f})"
        )
        why = "something touches the gel, or the baseline is stale: gels and lights drift"
        todo = ("take everything off the fingertip and look again", "take the baseline again if that stays")
        measured = {"difference_noises": round(contact.difference, 2)}
        findings.append(case.reported(label, "warning", text, why=why, todo=todo, measured=measured))
    return findings
