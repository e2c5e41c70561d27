"""How well shear is simulated and read: closed form, grain and grips of recordings, reading against truth, cost.

::

    python -m tega_figures.shear                               # tables of docs/evidence/sim-touch.md
    python -m tega_figures.shear --recorded ../shared/data/digit   # and those of recordings
    python -m tega_figures.shear --picture docs/images/shear.png

All that is not named recorded is simulated.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from tega.tactile.shear import ShearReader, ShearReading
from tega.tactile.tracker import TouchTracker
from tega_sim.gel import PX_PER_MM, Gel, ball
from tega_sim.seams import Shear

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = [
    "PulledBall",
    "cost",
    "follow",
    "grain_counts",
    "main",
    "picture",
    "recorded_grips",
    "stuck_radius",
]

FRICTION, RADIUS_MM = 0.6, 12.0
_CELL_MM = 8 / PX_PER_MM
# A GelSight Mini's picture of 320 x 240 pixels.
_MINI_MM_PER_PX = 1 / 15.8
# Untouched frames of the recorded grips: the first ones are of the trial before, or dark; one begins in contact.
_UNTOUCHED, _UNTOUCHED_LATE = slice(10, 16), slice(390, 440)


def stuck_radius(load_n: float, share: float, *, places: int = 3) -> tuple[float, float]:
    """Return the stuck radius over the touching one of a ball on a flat gel, and that of the ball pressed with P - Q/μ.

    Root means over places within a cell; the pull rises by fiftieths of the limit.
    """
    gel, stuck, less, all_mm2 = Gel(0, spread=0.0, shape="flat", shear="texture"), 0.0, 0.0, 0.0
    for place in range(places**2):
        shift = np.array(divmod(place, places)) * _CELL_MM * PX_PER_MM / places
        middle = (119.5 + float(shift[0]), 159.5 + float(shift[1]))
        one = ball(force_n=load_n, radius_mm=RADIUS_MM, centre_xy=middle)
        gel.forget()
        for step in range(1, round(50 * share) + 1):
            pull_n = step / 50 * FRICTION * load_n
            touch = gel.press([one._replace(shear_n=(0.8 * pull_n, -0.6 * pull_n), friction=FRICTION)])
        stuck += touch.area_mm2 * (1 - gel.sheared.slid)
        all_mm2 += touch.area_mm2
        less += gel.press([one._replace(force_n=(1 - share) * load_n)]).area_mm2
    return math.sqrt(stuck / all_mm2), math.sqrt(less / all_mm2)


def _closed_form() -> Iterable[str]:
    yield "| force N | Q / μP | stuck over touching radius | Cattaneo and Mindlin | off by | touching under P - Q/μ |"
    yield "|---|---|---|---|---|---|"
    for load_n in (2.0, 4.0, 8.0):
        for share in (0.2, 0.4, 0.6, 0.8):
            found, less = stuck_radius(load_n, share)
            theory = (1 - share) ** (1 / 3)
            off = 100 * (found / theory - 1)
            yield f"| {load_n:g} | {share} | {found:.3f} | {theory:.3f} | {off:+.1f} % | {less:.3f} |"


class PulledBall(NamedTuple):
    """A ball that is pressed, pulled to a share of the limit, and held.

    Attributes:
        share: Pull over the limit of each frame.
        true_mm: Displacement of the contact's middle, millimetres.
        slid: True share that slipped.
        read: What is read.
    """

    share: NDArray[np.float64]
    true_mm: NDArray[np.float64]
    slid: NDArray[np.float64]
    read: list[ShearReading]


def follow(
    kind: Shear, seed: int, *, radius_mm: float = RADIUS_MM, load_n: float = 4.0, top: float = 0.95
) -> PulledBall:
    """Press a ball, pull it within a second, and read every frame."""
    gel = Gel(seed, memory=True, shear=kind)
    baseline = np.rint(np.mean([gel.frame([], n) for n in range(30)], axis=0)).astype(np.uint8)
    tracker, reader = TouchTracker(baseline), ShearReader(baseline, mm_per_px=1 / PX_PER_MM)
    shares, true_mm, slid, read = [], [], [], []
    for n in range(110):
        share, pressed_n = top * min(max(n - 30, 0) / 60, 1.0), load_n * min((n + 1) / 20, 1.0)
        pull_n = share * FRICTION * pressed_n
        one = ball(force_n=pressed_n, radius_mm=radius_mm)._replace(shear_n=(0.0, pull_n), friction=FRICTION)
        image = gel.frame([one], 30 + n)
        tracker.update(image)
        read.append(reader.update(image, tracker))
        shares.append(share)
        true_mm.append(gel.sheared.peak_mm)
        slid.append(gel.sheared.slid)
    return PulledBall(np.array(shares), np.array(true_mm), np.array(slid), read)


def _reading() -> Iterable[str]:
    yield "| gel | truly slid | frames | incipient: median | shear off, mm: median, 95 % | direction off, rad: 95 % |"
    yield "|---|---|---|---|---|---|"
    for kind in ("texture", "dots"):
        courses = [follow(kind, seed, radius_mm=r) for seed in range(10, 16) for r in (8.0, 12.0)]
        slid = np.concatenate([one.slid[20:] for one in courses])
        true_mm = np.concatenate([one.true_mm[20:] for one in courses])
        read = np.array([reading for one in courses for reading in one.read[20:]])
        pulled = np.concatenate([one.share[20:] for one in courses]) > 0
        for low, high in ((0.0, 0.0), (0.0, 0.25), (0.25, 0.5), (0.5, 0.75), (0.75, 1.0)):
            mine = pulled & (slid > low) & (slid <= high) if high else ~pulled
            off_mm = np.abs(read[mine, 0] - true_mm[mine])
            turned = np.abs(read[mine, 1] - math.pi / 2)
            name = f"{low} to {high}" if high else "no pull"
            angle = f"{np.quantile(turned, 0.95):.2f}" if high else "–"
            yield (
                f"| {kind} | {name} | {mine.sum()} | {np.median(read[mine, 2]):.2f} | "
                f"{np.median(off_mm):.3f}, {np.quantile(off_mm, 0.95):.3f} | {angle} |"
            )


def _microseconds(work: Callable[[int], object], n: int = 60) -> float:
    took = []
    for k in range(n):
        began = time.perf_counter()
        work(k)
        took.append(time.perf_counter() - began)
    return float(1e6 * np.quantile(took, 0.2))


def cost(radius_mm: float, load_n: float) -> dict[str, float]:
    """Return what frames and readings take, microseconds: the fifth of the quickest of 60, in one run."""
    out = np.empty((320, 240, 3), np.uint8)

    def press(k: int) -> Any:
        pull_n = (0.4 + 0.2 * math.sin(k / 5)) * FRICTION * load_n
        return ball(force_n=load_n, radius_mm=radius_mm)._replace(shear_n=(0.0, pull_n), friction=FRICTION)

    found: dict[str, float] = {}
    kinds: tuple[Shear, ...] = ("off", "texture", "dots")
    for kind in kinds:
        gel = Gel(1, shear=kind)

        def painted(k: int, gel: Gel = gel) -> object:
            return gel.frame([press(k)], k, out=out)

        found[f"frame, {kind}"] = _microseconds(painted)
    tracker, reader = TouchTracker(gel.still()), ShearReader(gel.still())
    images = [gel.frame([press(k)], k) for k in range(20)]
    found["live"] = _microseconds(lambda k: tracker.update(images[k % 20]))
    found["shear"] = _microseconds(lambda k: reader.update(images[k % 20], tracker))
    found["cells"] = float(np.count_nonzero(reader.flow().any(axis=2)))
    return found


def _costs() -> Iterable[str]:
    presses = {"ball 4.4 mm, 3 N": (4.4, 3.0), "ball 12 mm, 4 N": (12.0, 4.0), "ball 33 mm, 8 N": (33.0, 8.0)}
    for number, (name, press) in enumerate(presses.items()):
        found = cost(*press)
        if not number:
            yield "| µs | " + " | ".join(found) + " |"
            yield "|---|" + "---|" * len(found)
        yield f"| {name} | " + " | ".join(f"{value:.0f}" for value in found.values()) + " |"


def _luma(image: NDArray[Any]) -> NDArray[np.float64]:
    grey: NDArray[np.float64] = image.astype(np.float64) @ np.array([0.114, 0.587, 0.299])
    return grey


def _high(luma: NDArray[np.float64], wide: int = 9) -> NDArray[np.float64]:
    """Return what two means over 9 x 9 pixels, one after the other, leave of a picture; its border is cut off."""
    for _ in range(2):
        windows = np.lib.stride_tricks.sliding_window_view(luma, (wide, wide))
        luma = luma[wide // 2 : -(wide // 2), wide // 2 : -(wide // 2)] - windows.mean(axis=(2, 3))
    return luma


def grain_counts(frames: list[NDArray[np.uint8]]) -> float:
    """Return the deviation of what stays in frames, counts of grey: root of the covariance of two halves' medians."""
    high = np.stack([_high(_luma(frame)) for frame in frames])
    one, two = np.median(high[0::2], axis=0), np.median(high[1::2], axis=0)
    return math.sqrt(max(float((one * two).mean()), 0.0))


def _recorded(folder: Path) -> Iterable[str]:
    import cv2

    def pictures(of: str) -> list[NDArray[np.uint8]]:
        return [np.asarray(cv2.imread(str(path))) for path in sorted(folder.glob(of))]

    yield "| grain, counts of grey | |"
    yield "|---|---|"
    for name, of in (
        ("DIGIT D20641, 31 presses", "digit_ball_D20641/frame_*.png"),
        ("another DIGIT, 14 presses", "digit_ball_vocdex_a/*.png"),
        ("GelSight Mini without dots, untouched", "gsmini_rest_drift/1*.png"),
    ):
        yield f"| recorded: {name} | {grain_counts(pictures(of)):.2f} |"
    for kind in ("off", "texture"):
        gel = Gel(1, shear=kind)
        yield f"| simulated, {kind} | {grain_counts([gel.frame([], n) for n in range(32)]):.2f} |"
    yield ""
    yield "| grip | frames in contact | shear, mm: median, 95 % | incipient: median | correlation: median |"
    yield "|---|---|---|---|---|"
    for name, read in recorded_grips(folder):
        yield _grip(f"recorded: {name}", read)
    for seed, top in ((20, 0.3), (21, 0.6), (22, 0.95)):
        yield _grip(f"simulated: dots, pulled to {top} of the limit", follow("dots", seed, top=top).read[30:])


def recorded_grips(folder: Path) -> Iterable[tuple[str, list[ShearReading]]]:
    """Read the recorded grips of GelSight Minis: the name of each, and what was read while something touched."""
    import cv2

    for path in sorted([*folder.glob("gsmini_seq/*.avi"), *folder.glob("gsmini_grips/*.avi")]):
        film = cv2.VideoCapture(str(path))
        frames = []
        while (got := film.read())[0]:
            frames.append(np.asarray(got[1], np.uint8))
        late = path.name.startswith("avocado")
        untouched = frames[_UNTOUCHED_LATE if late else _UNTOUCHED]
        baseline = np.rint(np.mean(untouched, axis=0)).astype(np.uint8)
        tracker = TouchTracker(baseline, rate_hz=25.0)
        reader = ShearReader(baseline, mm_per_px=_MINI_MM_PER_PX)
        read = []
        for frame in frames if late else frames[10:]:
            touches = tracker.update(frame).in_contact
            one = reader.update(frame, tracker, dt_s=0.04)
            if touches:
                read.append(one)
        yield path.stem, read


def _grip(name: str, read: list[ShearReading]) -> str:
    if not read:
        return f"| {name} | 0 | – | – | – |"
    values = np.array(read)
    top = np.quantile(values[:, 0], 0.95)
    middle = np.median(values, axis=0)
    return f"| {name} | {len(read)} | {middle[0]:.2f}, {top:.2f} | {middle[2]:.2f} | {middle[4]:.2f} |"


def picture(path: Path) -> None:
    """Draw stuck radius against theory, a field of displacements, and what is read of what is true."""
    from tega.ui.view.figures import new_figure

    figure = new_figure(figsize=(10, 3.4))
    radii, field, reading = figure.subplots(1, 3)
    shares = np.linspace(0.1, 0.9, 9)
    for load_n, marker in ((2.0, "o"), (4.0, "s")):
        radii.plot(
            shares,
            [stuck_radius(load_n, float(s))[0] for s in shares],
            marker,
            ms=4,
            label=f"simulated, {load_n:g} N",
        )
    fine = np.linspace(0, 1, 100)
    radii.plot(fine, (1 - fine) ** (1 / 3), color="0.4", label="Cattaneo and Mindlin")
    radii.set(
        xlabel="pull over the limit of friction, Q / μP", ylabel="stuck over touching radius", ylim=(0, 1.05)
    )
    radii.legend(fontsize=7, frameon=False)
    gel = Gel(1, shear="dots")
    for step in range(1, 36):
        pull_n = step / 50 * FRICTION * 4.0
        one = ball(force_n=4.0, radius_mm=RADIUS_MM)._replace(
            shear_n=(0.6 * pull_n, 0.8 * pull_n), friction=FRICTION
        )
        image = gel.frame([one], step)
    moved = gel.shear_mm()[1::2, 1::2] * PX_PER_MM
    rows, columns = np.mgrid[1:40:2, 1:30:2] * 8 + 3.5
    field.imshow(image[..., ::-1])
    field.quiver(
        columns,
        rows,
        moved[..., 0],
        moved[..., 1],
        color="w",
        angles="xy",
        scale_units="xy",
        scale=0.6,
        width=0.006,
    )
    field.contour(gel.contact_mask(), [0.5], colors="#ffd23f", linewidths=1)
    field.set_title("pulled to 0.7 of the limit; outline: touching", fontsize=8)
    field.set_axis_off()
    shown: dict[Shear, str] = {"texture": "#1f77b4", "dots": "#d62728"}
    for kind, color in shown.items():
        course = follow(kind, 10)
        reading.plot(
            course.true_mm[20:],
            [one.shear_mm for one in course.read[20:]],
            ".",
            ms=3,
            color=color,
            label=kind,
        )
    reading.plot([0, 1.2], [0, 1.2], color="0.6", lw=1, ls=":")
    reading.set(xlabel="true displacement of the middle, mm", ylabel="shear read, mm")
    reading.legend(fontsize=7, frameon=False)
    figure.savefig(path, dpi=100)


def main() -> None:
    """Print the tables, or draw the picture."""
    parser = argparse.ArgumentParser(
        description="Shear, simulated and read, against theory, truth and recordings."
    )
    parser.add_argument("--recorded", type=Path, help="folder of the shared recordings of fingertips")
    parser.add_argument("--grips", action="store_true", help="only the tables of the recordings")
    parser.add_argument("--picture", type=Path, help="draw the picture there instead")
    asked = parser.parse_args()
    if asked.picture is not None:
        picture(asked.picture)
        return
    tables = [] if asked.grips else [_closed_form(), _reading(), _costs()]
    if asked.recorded is not None:
        tables.append(_recorded(asked.recorded))
    for table in tables:
        sys.stdout.writelines(line + "\n" for line in table)
        sys.stdout.write("\n")


if __name__ == "__main__":
    main()
