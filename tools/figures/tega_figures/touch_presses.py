"""Scores the touch tracker on simulated presses: felt from which force, how steadily, silent when after release.

Each press is one unit of the simulated gel with leftovers and drift on (:mod:`tega_figures.gel_sequences`). Seeds of
units come from a fixed text, so that nobody chose them.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega.tactile.tracker import GelLight, KnownPress, TouchTracker, TrackedContact, calibrate_light
from tega_figures.gel_sequences import SHAPES, GelMoment, press_sequence, ramp
from tega_learn.score import rank_correlation
from tega_sim.gel import CAMERA_HZ, PX_PER_MM, Gel

__all__ = [
    "CALIBRATION",
    "Held",
    "PressError",
    "PressScore",
    "calibrated_errors",
    "felt_of_slow_press",
    "hold_press",
    "score_press",
    "three_press_light",
    "unit_seeds",
    "untouched_contacts",
]

SEED_TEXT: Final = "tega touch-live units"
# Times of a press, seconds: at rest, up to 1.5 N, up to 5 N, held, released, left alone.
_ENDS_S: Final = (3.0, 6.0, 8.0, 9.5, 9.6, 12.6)
_FORCES_N: Final = (0.0, 1.5, 5.0, 5.0, 0.0, 0.0)


class PressScore(NamedTuple):
    """How the tracker follows one press; NaN where there is nothing to compare."""

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
    """From the end of the force until it is no longer reported, seconds."""
    false_before: int
    """Frames reported as touched before the press."""
    false_after: int
    """Frames reported as touched from 1 s after release."""


def unit_seeds(n: int, text: str = SEED_TEXT) -> list[int]:
    """Return seeds of simulated units: the first bytes of the hash of a text with a number behind it."""
    return [int.from_bytes(hashlib.sha256(f"{text} {k}".encode()).digest()[:6], "big") for k in range(n)]


def score_press(name: str, seed: int) -> PressScore:
    """Press a shape into a unit of a seed and score the tracker.

    At rest, up to 1.5 and 5 N, held, released within 0.1 s, at rest again; ``name`` is one of
    :data:`~tega_figures.gel_sequences.SHAPES`.
    """
    moments = list(
        press_sequence(
            name,
            seed=seed,
            force_n=lambda t_s: float(np.interp(t_s, _ENDS_S, _FORCES_N)),
            duration_s=_ENDS_S[-1],
        )
    )
    tracker = TouchTracker(moments[0].image)
    seen = [tracker.update(m.image) for m in moments]
    t_s, force, true_area = (
        np.array([getattr(m, of) for m in moments]) for of in ("t_s", "force_n", "area_px")
    )
    on = np.array([s.in_contact for s in seen])
    area, peak = (np.array([getattr(s, of) for s in seen], np.float64) for of in ("eda", "peak"))
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
        rising_jump=float((np.abs(np.diff(area[steep])) / np.maximum(area[steep][1:], 1.0)).max())
        if steep.sum() > 1
        else nan,
        released_s=float(t_s[off[0]] - gone_s) if len(off) else nan,
        false_before=int(on[t_s <= rest_s].sum()),
        false_after=int(on[t_s >= gone_s + 1.0].sum()),
    )


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


def untouched_contacts(seed: int, minutes: float, *, rate_hz: float = CAMERA_HZ) -> Iterator[int]:
    """Yield how many frames of an untouched unit are reported as contact, for one minute after the other.

    Leftovers, creep and drift are on. ``rate_hz`` is a whole part of the camera's 60.
    """
    gel = Gel(seed, memory=True)
    tracker = TouchTracker(gel.frame([], 0), rate_hz=rate_hz)
    step, begin = round(CAMERA_HZ / rate_hz), 0
    while begin < minutes * 60 * CAMERA_HZ:
        end = min(begin + round(60 * CAMERA_HZ), round(minutes * 60 * CAMERA_HZ))
        numbers = range(begin + step, end + step, step)
        yield sum(tracker.update(gel.frame([], number)).in_contact for number in numbers)
        begin = end


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
