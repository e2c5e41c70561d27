"""Judge a touch reading on the recorded sets: found where something touches, told where nothing does, overlap, rank."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega.runtime.opencv import read_image
from tega.tactile.tracker import TouchTracker, update_fingers
from tega_figures.audit import read_marks
from tega_figures.touch_peers.readings import (
    SEES_ALL,
    WITH_MEMORY,
    Image,
    Makes,
    PeerReading,
    Reading,
    Unit,
    tracker,
)
from tega_figures.touch_presses import rank_correlation
from tega_figures.touch_recordings import (
    GRIPS,
    Clip,
    best_lag,
    disc,
    grasps,
    grip_video,
    longest_run,
    rest,
    soft_grips,
    wedge,
)

__all__ = ["SETS", "Figure", "PressClip", "disc_presses", "wedge_presses"]

# A single picture is shown to a reading with a memory for about a second.
_DISPLAYED = 32
_BINS_N: Final = ((0.6, 2.0), (2.0, 4.0), (4.0, 40.0))
_AFTER_S: Final = 1.5


class Figure(NamedTuple):
    """One number of one reading on one set."""

    set: str
    what: str
    value: float
    wanted: str = "high"
    """``high`` or ``low``."""
    n: int = 0
    """Frames, pictures or clips that it is of."""


class PressClip(NamedTuple):
    """One clip with its force, ready to be read."""

    name: str
    kind: str
    unit: Unit
    frames: NDArray[np.uint8]
    force_n: NDArray[np.float64]
    """As the picture shows it: shifted by the lag, and the longest run over 0.3 N alone."""
    silent: tuple[int, int]
    """End of the frames surely before, and first of those from 1.5 s after."""


def displayed(make: Makes, unit: Unit, frame: Image) -> PeerReading:
    """Return what a reading made anew says of a picture that it is shown for a second."""
    read = make(unit)
    return [read(frame) for _ in range(_DISPLAYED if make in WITH_MEMORY else 1)][-1]


@cache
def wedge_presses(folder: Path) -> list[PressClip]:
    """Return the clips of ``wedge_force``; each day's noise is measured where that day's sensor is untouched."""
    clips = wedge(folder)
    first_day = next(clip for clip in clips if clip.kind == "golf").frames[:12]
    return [_pressed(clip, first_day) for clip in clips]


def _pressed(clip: Clip, first_day: NDArray[np.uint8]) -> PressClip:
    # Three clips begin while the object closes in: of those the first frame alone is untouched.
    untouched = "t=" in clip.name
    unit = Unit(clip.frames[: 10 if untouched else 1], 30.0, clip.frames[:30] if untouched else first_day)
    followed = TouchTracker(unit.baseline, rate_hz=30.0, noise=unit.noise)
    difference = np.array([followed.update(frame).difference for frame in clip.frames[1:]])
    first, end = longest_run(clip.force_n)
    places = np.arange(len(clip.force_n))
    run = np.where((places >= first) & (places < end), clip.force_n, 0.0)
    lag = best_lag(run, np.r_[difference[0], difference])
    at = places - lag
    force = np.where((at >= 0) & (at < len(at)), run[np.clip(at, 0, len(at) - 1)], 0.0)
    return PressClip(
        clip.name,
        clip.kind,
        unit,
        clip.frames,
        force,
        (max(first + lag - 4, 0), end + lag + round(_AFTER_S * 30)),
    )


@cache
def disc_presses(folder: Path) -> PressClip:
    """Return ``digit_disc_force``: one closing, the first picture is the baseline at 1.1 N."""
    pressed = disc(folder)
    frames = np.array([frame for _, frame in pressed])
    forces = np.array([force for force, _ in pressed])
    return PressClip("disc", "disc", Unit(frames[:1], 30.0), frames, forces, (0, len(frames)))


def _soft_grips(folder: Path, make: Makes) -> Iterator[Figure]:
    pictures = _pictures(folder)
    unit = Unit(pictures["empty"], 30.0)
    for name, frames in pictures.items():
        reported = float(np.mean([displayed(make, unit, frame).on for frame in frames]))
        yield Figure("gsmini_soft_grips", name, reported, "low" if name == "empty" else "high", len(frames))


_pictures = cache(soft_grips)
_rest = cache(rest)
_grasps = cache(grasps)


def _drift(folder: Path, make: Makes) -> Iterator[Figure]:
    baseline, frames, t_s = _rest(folder)
    read = make(Unit([baseline], 1.0))
    reported = [read(f, dt_s=dt).on for f, dt in zip(frames, [0.0, *np.diff(t_s)], strict=True)]
    yield Figure(
        "gsmini_rest_drift", "three minutes untouched", float(np.mean(reported)), "low", len(reported)
    )


def _wedge(folder: Path, make: Makes) -> Iterator[Figure]:
    felt: dict[tuple[str, float], list[bool]] = {}
    before: list[bool] = []
    after: list[bool] = []
    ranks: list[float] = []
    areas: list[float] = []
    for press in wedge_presses(folder):
        read = make(press.unit)
        seen = [PeerReading(on=False, area_px=0, peak=0.0, mask=np.zeros((0, 0), bool))] + [
            read(f) for f in press.frames[1:]
        ]
        on = np.array([s.on for s in seen])
        for low, high in _BINS_N:
            within = (press.force_n >= low) & (press.force_n < high)
            felt.setdefault((press.kind, low), []).extend(on[within].tolist())
        before += on[: press.silent[0]].tolist()
        after += on[press.silent[1] :].tolist()
        pressed = press.force_n > 0
        for of, into in (("peak", ranks), ("area_px", areas)):
            values = [getattr(s, of) if s.on else 0.0 for s in seen]
            into.append(rank_correlation(press.force_n[pressed], np.array(values)[pressed]))
    for (kind, low), reported in sorted(felt.items()):
        if reported:
            high = dict(_BINS_N)[low]
            subject = f"{kind}, {low:g} to {high:g} N" if high < 40 else f"{kind}, {low:g} N and more"
            yield Figure("wedge_force", subject, float(np.mean(reported)), n=len(reported))
    yield Figure("wedge_force", "before", float(np.mean(before)), "low", len(before))
    yield Figure(
        "wedge_force", "from 1.5 s after", float(np.mean(after)) if after else np.nan, "low", len(after)
    )
    for subject, found in (("peak", ranks), ("area", areas)):
        yield Figure("wedge_force", f"rank of force and {subject}, median clip", float(np.median(np.nan_to_num(found))),
                     n=len(found))  # fmt: skip
        yield Figure("wedge_force", f"rank of force and {subject}, least", float(np.min(np.nan_to_num(found))),
                     n=len(found))  # fmt: skip


def _disc(folder: Path, make: Makes) -> Iterator[Figure]:
    press = disc_presses(folder)
    read = make(press.unit)
    seen = [read(frame) for frame in press.frames][3:]
    yield Figure("digit_disc_force", "found from 1503 on", float(np.mean([s.on for s in seen])), n=len(seen))
    for subject, of in (("peak", "peak"), ("area", "area_px")):
        values = [getattr(s, of) if s.on else 0.0 for s in seen]
        found = np.nan_to_num(rank_correlation(press.force_n[3:], values))
        yield Figure("digit_disc_force", f"rank of force and {subject}", float(found), n=len(seen))


def _both(
    make: Makes, units: Sequence[Unit], fingers: list[NDArray[np.uint8]], first: int
) -> NDArray[np.bool_]:
    """Read two fingers of one grip, together where a reading can."""
    end = min(map(len, fingers))
    on = np.zeros((end, 2), bool)
    if make is tracker:
        followed = [TouchTracker(u.baseline, rate_hz=u.rate_hz, noise=u.noise) for u in units]
        for k in range(first, end):
            on[k] = [c.in_contact for c in update_fingers(followed, [frames[k] for frames in fingers])]
        return on
    for finger, (unit, frames) in enumerate(zip(units, fingers, strict=True)):
        read: Reading = make(unit)
        for k in range(first, end):
            if make in SEES_ALL or _judged(k):
                on[k, finger] = read(frames[k]).on
    return on


def _judged(frame: int) -> bool:
    """Whether a frame of a grip is judged: neighbours show the same, and slow readings are asked for one in five."""
    return frame % 5 == 0


@cache
def _grip(folder: Path, name: str) -> tuple[list[NDArray[np.uint8]], list[Unit]]:
    fingers = [grip_video(folder, name, camera) for camera in (0, 2)]
    first, last = GRIPS[name].rest
    stills = [frames[first : last + 1] for frames in fingers]
    return fingers, [Unit(still, 25.0, still) for still in stills]


def _grips(folder: Path, make: Makes) -> Iterator[Figure]:
    held, after = [], []
    for name, grip in GRIPS.items():
        fingers, units = _grip(folder, name)
        on = _both(make, units, fingers, grip.from_frame)
        judged = np.array([_judged(k) for k in range(len(on))])
        places = np.arange(len(on))
        held += on[judged & (places >= grip.held[0]) & (places <= grip.held[1])].mean(axis=0).tolist()
        if grip.silent_from is not None:
            after += on[judged & (places >= grip.silent_from)].mean(axis=0).tolist()
    yield Figure("gsmini_grips", "held, mean of the fingers", float(np.mean(held)), n=len(held))
    yield Figure("gsmini_grips", "held, worst finger", float(min(held)), n=len(held))
    yield Figure(
        "gsmini_grips", "from 1.5 s after, mean of the fingers", float(np.mean(after)), "low", len(after)
    )
    yield Figure("gsmini_grips", "from 1.5 s after, worst finger", float(max(after)), "low", len(after))


def _overlap(a: NDArray[np.bool_], b: NDArray[np.bool_]) -> float:
    return float((a & b).sum() / max((a | b).sum(), 1))


def _masks(folder: Path, make: Makes) -> Iterator[Figure]:
    baseline, pairs = _grasps(folder)
    unit = Unit([baseline], 30.0)
    seen = [(displayed(make, unit, frame), drawn) for frame, drawn in pairs]
    overlaps = [_overlap(s.mask & s.on, drawn) for s, drawn in seen]
    yield Figure("digit_grasp_masks", "found", float(np.mean([s.on for s, _ in seen])), n=len(seen))
    yield Figure("digit_grasp_masks", "overlap, median", float(np.median(overlaps)), n=len(seen))
    yield Figure("digit_grasp_masks", "overlap, least", min(overlaps), n=len(seen))


@cache
def _balls(folder: Path) -> tuple[Image, list[tuple[Image, NDArray[np.bool_]]]]:
    at = folder / "digit_ball_D20641"
    pictures = [
        (read_image(at / name, driver="touch peers"), mark)
        for name, mark in read_marks(at / "annotate.csv").items()
    ]
    marked = [(image, mark.distance(image.shape[:2]) <= 1) for image, mark in pictures]
    return read_image(at / "background.png", driver="touch peers"), marked


def _ball_presses(folder: Path, make: Makes) -> Iterator[Figure]:
    baseline, marked = _balls(folder)
    unit = Unit([baseline], 30.0)
    seen = [(displayed(make, unit, frame), circle) for frame, circle in marked]
    overlaps = [_overlap(s.mask & s.on, circle) for s, circle in seen]
    areas = [float((s.mask & s.on).sum() / circle.sum()) for s, circle in seen]
    name = "digit_ball_D20641"
    yield Figure(name, "found", float(np.mean([s.on for s, _ in seen])), n=len(seen))
    yield Figure(name, "overlap, median", float(np.median(overlaps)), n=len(seen))
    yield Figure(name, "overlap, worst tenth", float(np.quantile(overlaps, 0.1)), n=len(seen))
    yield Figure(name, "area over the circle's, median", float(np.median(areas)), "", len(seen))


SETS: Final[dict[str, Callable[[Path, Makes], Iterator[Figure]]]] = {
    "gsmini_soft_grips": _soft_grips,
    "gsmini_rest_drift": _drift,
    "wedge_force": _wedge,
    "gsmini_grips": _grips,
    "digit_grasp_masks": _masks,
    "digit_ball_D20641": _ball_presses,
    "digit_disc_force": _disc,
}
"""The sets in the order of the tables."""
