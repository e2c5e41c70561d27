"""Judge the force that the tracker tells on recorded presses, calibrated by three presses and not."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega.tactile.tracker import KnownPress, TrackedContact, calibrate_light, nominal_light
from tega_figures.touch_peers.readings import tracker
from tega_figures.touch_peers.sets import PressClip, disc_presses, wedge_presses

__all__ = ["ForceError", "force_errors"]

_LEAST_N = 0.6
_DRAWS = 2000


class ForceError(NamedTuple):
    """How far the told force is off, on frames of 0.6 N and more that are felt."""

    set: str
    calibrated: str
    n_clips: int
    n_frames: int
    read_over_true: float
    """Median of told over measured force."""
    error: float
    """Median over frames of the relative error, each clip counting alike."""
    interval: tuple[float, float]
    """95 % interval of that, by 2,000 draws with replacement of clips, or of frames where there is one clip."""
    within_quarter: float
    """Share of frames within 25 %."""


class FeltFrames(NamedTuple):
    """Frames of one clip that are felt at 0.6 N and more."""

    name: str
    told_n: NDArray[np.float64]
    force_n: NDArray[np.float64]
    contacts: list[TrackedContact]


def _felt(press: PressClip, first: int) -> FeltFrames:
    read = tracker(press.unit)
    seen = [
        (read(frame).contact, force) for frame, force in zip(press.frames[1:], press.force_n[1:], strict=True)
    ]
    kept = [(c, n) for c, n in seen[first:] if c is not None and c.in_contact and n >= _LEAST_N]
    return FeltFrames(
        press.name,
        np.array([c.force_n for c, _ in kept]),
        np.array([n for _, n in kept]),
        [c for c, _ in kept],
    )


def _stiffer(known: list[KnownPress]) -> float:
    """Return what three presses of known force make of the gel's stiffness, and with it of every told force."""
    return calibrate_light(known).stiffness_n_mm3 / nominal_light().stiffness_n_mm3


def _firmest(clip: FeltFrames) -> KnownPress:
    k = int(np.argmax(clip.force_n))
    return KnownPress(clip.contacts[k], float(clip.force_n[k]))


def _summary(
    of: str, how: str, errors: list[NDArray[np.float64]], ratios: list[NDArray[np.float64]]
) -> ForceError:
    rng = np.random.default_rng(15)
    weighed = float(np.mean([np.median(e) for e in errors]))
    if len(errors) > 1:
        medians = np.array([np.median(e) for e in errors])
        drawn = [float(np.mean(rng.choice(medians, len(medians)))) for _ in range(_DRAWS)]
    else:
        drawn = [float(np.median(rng.choice(errors[0], len(errors[0])))) for _ in range(_DRAWS)]
    low, high = np.quantile(drawn, (0.025, 0.975))
    every = np.concatenate(errors)
    return ForceError(
        of, how, len(errors), len(every), float(np.median(np.concatenate(ratios))), weighed, (float(low), float(high)),
        float(np.mean(every <= 0.25)),
    )  # fmt: skip


def _wedge_errors(folder: Path) -> list[ForceError]:
    clips = [_felt(press, 0) for press in wedge_presses(folder)]
    plain = [c.told_n / c.force_n for c in clips]
    found = [_summary("wedge_force", "no", [np.abs(r - 1) for r in plain], plain)]
    # Every choice of three clips for the presses; the others are judged, none by itself.
    ratios: dict[str, list[NDArray[np.float64]]] = {c.name: [] for c in clips}
    by_peak: dict[str, list[NDArray[np.float64]]] = {c.name: [] for c in clips}
    for chosen in combinations(range(len(clips)), 3):
        known = [_firmest(clips[k]) for k in chosen]
        gain = _stiffer(known)
        n_per_count = float(np.exp(np.mean([np.log(press.force_n / press.contact.peak) for press in known])))
        for k, clip in enumerate(clips):
            if k not in chosen:
                ratios[clip.name].append(gain * clip.told_n / clip.force_n)
                peak = np.array([contact.peak for contact in clip.contacts])
                by_peak[clip.name].append(n_per_count * peak / clip.force_n)
    for how, of in (
        ("three presses of other clips", ratios),
        ("the same three, force = gain x `peak`", by_peak),
    ):
        each = [np.concatenate(r) for r in of.values()]
        found.append(
            _summary("wedge_force", how, [np.abs(r - 1) for r in each], each)
            ._replace(n_frames=sum(len(c.force_n) for c in clips))
        )  # fmt: skip
    own = [_own(c) for c in clips]
    return [
        *found,
        _summary("wedge_force", "three frames of the same clip", [np.abs(r - 1) for r in own], own),
    ]


def _own(clip: FeltFrames) -> NDArray[np.float64]:
    """Return told over measured force of a clip whose own three frames calibrate it; the others are judged."""
    plain = clip.told_n / clip.force_n
    used = np.round(np.quantile(np.arange(len(plain)), (0.15, 0.5, 0.85))).astype(int)
    gain = _stiffer([KnownPress(clip.contacts[k], float(clip.force_n[k])) for k in used])
    return np.delete(plain, used) * gain


def _disc_errors(folder: Path) -> list[ForceError]:
    clip = _felt(disc_presses(folder), 2)
    plain, own = clip.told_n / clip.force_n, _own(clip)
    return [
        _summary("digit_disc_force", "no", [np.abs(plain - 1)], [plain]),
        _summary("digit_disc_force", "three frames of the same closing", [np.abs(own - 1)], [own]),
    ]


def force_errors(folder: Path) -> list[ForceError]:
    """Return the errors on disc and wedge."""
    return _disc_errors(folder) + _wedge_errors(folder)
