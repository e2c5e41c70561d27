"""Scores a touch reading on simulated presses: felt from which force, how steadily, silent when after release.

Each press is one unit of the simulated gel with leftovers and drift on (:mod:`tega_figures.gel_sequences`). Seeds of
units come from
a fixed text, so that nobody chose them. The touch tracker and two plain peers read the same frames.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Iterator
from typing import Any, Final, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from tega.runtime.lifecycle import require
from tega.tactile.tracker import GelLight, KnownPress, TouchTracker, TrackedContact, calibrate_light
from tega_figures.gel_sequences import SHAPES, GelMoment, press_sequence, ramp
from tega_sim.gel import PX_PER_MM

__all__ = [
    "CALIBRATION",
    "PEERS",
    "FrameReader",
    "FrameReading",
    "Held",
    "Image",
    "PressError",
    "PressScore",
    "calibrated_errors",
    "hold_press",
    "jumps",
    "rank_correlation",
    "score_press",
    "three_press_light",
    "unit_seeds",
]

Image = NDArray[np.uint8]
RATE_HZ: Final = 60.0
SEED_TEXT: Final = "tega touch-live units"
# Times of a press, seconds: at rest, up to 1.5 N, up to 5 N, held, released, left alone.
_ENDS_S: Final = (3.0, 6.0, 8.0, 9.5, 9.6, 12.6)
_FORCES_N: Final = (0.0, 1.5, 5.0, 5.0, 0.0, 0.0)


class FrameReading(NamedTuple):
    """What a reading takes from one frame."""

    in_contact: bool
    area_px: float
    peak: float


class FrameReader(Protocol):
    """Reads frame after frame of one sensor."""

    def __call__(self, frame: Image) -> FrameReading:
        """Return what the next frame shows."""


def _tracker(baseline: Image, rate_hz: float) -> FrameReader:
    tracker = TouchTracker(baseline, rate_hz=rate_hz)

    def read(frame: Image) -> FrameReading:
        contact = tracker.update(frame)
        return FrameReading(contact.in_contact, contact.eda, contact.peak)

    return read


def _threshold(baseline: Image, rate_hz: float) -> FrameReader:  # noqa: ARG001
    """Pixels whose largest difference over the colours exceeds 15 counts; a contact is 1 % of the picture."""
    still = baseline.astype(np.int16)

    def read(frame: Image) -> FrameReading:
        difference = np.abs(frame - still).max(axis=2)
        area = int((difference > 15).sum())
        return FrameReading(area > 0.01 * difference.size, area, float(np.percentile(difference, 99.5)))

    return read


def _subtraction(baseline: Image, rate_hz: float) -> FrameReader:
    """OpenCV's background subtraction: learns for a second, then keeps it; a contact is 1 % of the picture."""
    cv2: Any = require("cv2", driver="touch check", extra="lab")
    model = cv2.createBackgroundSubtractorMOG2(detectShadows=False)
    model.apply(baseline)
    left = max(1, round(rate_hz))

    def read(frame: Image) -> FrameReading:
        nonlocal left
        left -= 1
        changed = model.apply(frame, learningRate=0 if left < 0 else -1)
        area = int((changed > 0).sum()) if left < 0 else 0
        return FrameReading(area > 0.01 * frame.shape[0] * frame.shape[1], area, float(area))

    return read


PEERS: Final[dict[str, Callable[[Image, float], FrameReader]]] = {
    "live": _tracker,
    "threshold of 15 counts": _threshold,
    "OpenCV MOG2": _subtraction,
}
"""Readings by name: each takes the baseline and the frame rate in hertz."""


class PressScore(NamedTuple):
    """How one reading follows one press; NaN where there is nothing to compare."""

    felt_n: float
    """Force from which it is felt without a gap, newtons, rising by half a newton a second."""
    peak_rank: float
    """Rank correlation of peak and force while it rises and is felt."""
    area_rank: float
    """Rank correlation of outlined and touching area, likewise; NaN where the touching area hardly changes."""
    steady: float
    """Standard deviation of the area over its mean at a held force."""
    held_jump: float
    """Largest change of the area between two frames at a held force, share of the mean."""
    rising_jump: float
    """The same while the force rises from 1.5 to 5 N, share of the later frame's."""
    released_s: float
    """From the end of the force until it is no longer told, seconds."""
    false_before: int
    """Frames told before the press."""
    false_after: int
    """Frames told from 1 s after release."""


def unit_seeds(n: int, text: str = SEED_TEXT) -> list[int]:
    """Return seeds of simulated units: the first bytes of the hash of a text with a number behind it."""
    return [int.from_bytes(hashlib.sha256(f"{text} {k}".encode()).digest()[:6], "big") for k in range(n)]


def rank_correlation(a: Iterable[float], b: Iterable[float]) -> float:
    """Return Spearman's rank correlation; NaN of fewer than three values, or where one side does not vary."""
    x, y = np.array(list(a), np.float64), np.array(list(b), np.float64)
    if len(x) < 3 or not np.ptp(x) or not np.ptp(y):
        return float("nan")
    stats: Any = require("scipy.stats", driver="touch check", extra="lab")
    return float(stats.spearmanr(x, y).statistic)


def jumps(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return changes from frame to frame as shares of the later value, or of 1 where that is less."""
    return np.abs(np.diff(values)) / np.maximum(values[1:], 1.0)


def press_of(name: str, seed: int, *, rate_hz: float = RATE_HZ) -> Iterator[GelMoment]:
    """Yield the press that is scored: at rest, up to 1.5 and 5 N, held, released within 0.1 s, at rest again."""
    return press_sequence(
        name,
        seed=seed,
        force_n=lambda t_s: float(np.interp(t_s, _ENDS_S, _FORCES_N)),
        duration_s=_ENDS_S[-1],
        rate_hz=rate_hz,
    )


def score_press(
    name: str, seed: int, *, readings: Iterable[str] = ("live",), rate_hz: float = RATE_HZ
) -> dict[str, PressScore]:
    """Press a shape into a unit of a seed and score readings on the same frames.

    ``name`` is one of :data:`~tega_figures.gel_sequences.SHAPES`, ``readings`` are names in :data:`PEERS`.
    """
    moments = list(press_of(name, seed, rate_hz=rate_hz))
    made = {one: PEERS[one](moments[0].image, rate_hz) for one in readings}
    return {one: _score(moments, [read(m.image) for m in moments]) for one, read in made.items()}


def _score(moments: list[GelMoment], seen: list[FrameReading]) -> PressScore:
    t_s, force, true_area = (
        np.array([getattr(m, of) for m in moments]) for of in ("t_s", "force_n", "area_px")
    )
    on = np.array([s.in_contact for s in seen])
    area, peak = (np.array([getattr(s, of) for s in seen], np.float64) for of in ("area_px", "peak"))
    rest_s, gentle_s, firm_s, held_s, gone_s, _ = _ENDS_S
    rising = (t_s > rest_s) & (t_s <= firm_s)
    missed = np.flatnonzero(rising & ~on)
    first = missed[-1] + 1 if len(missed) else int(np.flatnonzero(rising)[0])
    felt = rising & on & (np.arange(len(on)) >= first)
    held = (t_s > firm_s + 0.3) & (t_s < held_s)
    steep = felt & (t_s > gentle_s)
    off = np.flatnonzero(~on & (t_s >= gone_s - 1e-9))
    mean = max(float(area[held].mean()), 1.0)
    nan = float("nan")
    wide = felt.sum() > 2 and np.ptp(true_area[felt]) > 0.2 * true_area[felt].max()
    return PressScore(
        felt_n=float(force[first]) if felt.any() else nan,
        peak_rank=rank_correlation(force[felt], peak[felt]),
        area_rank=rank_correlation(true_area[felt], area[felt]) if wide else nan,
        steady=float(area[held].std() / mean),
        held_jump=float(np.abs(np.diff(area[held])).max() / mean),
        rising_jump=float(jumps(area[steep]).max()) if steep.sum() > 1 else nan,
        released_s=float(t_s[off[0]] - gone_s) if len(off) else nan,
        false_before=int(on[t_s <= rest_s].sum()),
        false_after=int(on[t_s >= gone_s + 1.0].sum()),
    )


CALIBRATION: Final = (("ball 4 mm", 1.5), ("ball 4 mm", 4.0), ("face", 4.0))
"""The three known presses: shape and newtons."""
JUDGED_N: Final = (1.0, 2.0, 5.0)


class Held(NamedTuple):
    """What a tracker reads at the end of a held press, its depth map, and what is true."""

    contact: TrackedContact
    depth_map: NDArray[np.float32]
    truth: GelMoment


def hold_press(name: str, seed: int, force_n: float, light: GelLight | None = None) -> Held:
    """Press a shape into a unit within a second, hold it for half a second, and read it."""
    curve = ramp(peak_n=force_n, wait_s=1.0, rise_s=1.0, hold_s=1.0, fall_s=0.1)
    moments = list(press_sequence(name, seed=seed, force_n=curve, duration_s=2.5, rate_hz=30.0))
    tracker = TouchTracker(moments[0].image, rate_hz=30.0, light=light)
    contact = [tracker.update(snapshot.image) for snapshot in moments][-1]
    return Held(contact, tracker.depth_map(), moments[-1])


def three_press_light(seed: int) -> GelLight:
    """Return the light of a unit as three known presses calibrate it: depth, force and a ball's map are used."""
    presses = []
    for name, force_n in CALIBRATION:
        held = hold_press(name, seed, force_n)
        presses.append(
            KnownPress(held.contact, force_n, held.truth.depth_mm, held.depth_map, name.startswith("ball"))
        )
    return calibrate_light(presses)


class PressError(NamedTuple):
    """How far a held press is measured off the truth: depth and force relatively, its middle in mm."""

    depth: float
    force: float
    middle_mm: float


def calibrated_errors(seed: int) -> dict[str, list[PressError]]:
    """Return how far presses of each shape at 1, 2 and 5 N are off after three known presses of the same unit."""
    light = three_press_light(seed)
    errors: dict[str, list[PressError]] = {}
    for name in SHAPES:
        for force_n in JUDGED_N:
            contact, _, truth = hold_press(name, seed, force_n, light)
            off_px = float(np.hypot(*np.subtract(contact.centroid_xy, truth.centre_xy)))
            error = contact.depth_mm / truth.depth_mm - 1, contact.force_n / force_n - 1, off_px / PX_PER_MM
            errors.setdefault(name, []).append(PressError(*error))
    return errors
