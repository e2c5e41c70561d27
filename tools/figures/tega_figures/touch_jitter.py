"""Measure how much a steady hold's area, depth and place scatter from frame to frame, from faint dents to firm ones.

::

    TEGA_DATA=/path/to/recordings python -m tega_figures.touch_jitter --seeds 8

A dent of another shading than the simulated gel's (:mod:`tega_figures.other_gels`) is pressed on a recorded picture of
an untouched gel with a DIGIT's noise: 2 s of rest, down within a frame, held for 3 s, let go within a frame, and
watched for half a second. Each row is the worst of the seeds; lights and backgrounds go round with the seed.
"""

from __future__ import annotations

import hashlib
import multiprocessing
import sys
from itertools import product
from typing import Final, NamedTuple, get_args

import click
import cv2
import numpy as np
from numpy.typing import NDArray

from tega.tactile.tracker import GelLight, TouchTracker, nominal_light, sensor_noise
from tega_figures.after_touch import backgrounds
from tega_figures.other_gels import PX_PER_MM, Light, OtherShape, change_of_colour, dent_mm

__all__ = ["Case", "Jitter", "draw_cases", "measure"]

RATE_HZ: Final = 60.0
REST_S, HOLD_S, AFTER_S = 2.0, 3.0, 0.5
SETTLED_S: Final = 0.5
"""A hold counts as steady from so long after the press on."""
DEPTHS_MM: Final = (0.2, 0.3, 0.4, 0.8)
NOISE_COUNTS: Final = (3.17, 1.65, 2.74)
"""Standard deviation of a DIGIT's pixel: blue, green, red."""
MOST_SCATTER, MOST_JUMP, MOST_FRAMES, MOST_RELEASE_S = 0.04, 0.15, 2, 0.1


class Case(NamedTuple):
    """One hold."""

    shape: OtherShape
    depth_mm: float
    light: Light
    background: str
    seed: int
    clumped: bool = True
    """Whether neighbouring pixels share most of their noise, as a DIGIT's do, or each has its own."""
    mains: float = 0.0
    """Amplitude of the lamp in the light, as a share."""
    lamp_hz: float = 100.0
    """How fast it flickers, but for mains that are 0.07 % fast."""


class Jitter(NamedTuple):
    """What the tracker reported of a hold; NaN where it did not report it."""

    case: Case
    strength: float
    """Median of S over its threshold."""
    reported: float
    """Share of the hold's frames from the second on that were reported."""
    area_scatter: float
    """Standard deviation of EDA over its mean while steady, like the next."""
    area_jump: float
    """Largest change between two frames."""
    area_px: float
    depth_scatter: float
    place_mm: float
    """Standard deviation of the middle, the larger of both ways."""
    spread_scatter: float
    settled_s: float
    """From the press to the first of all frames whose area is within a tenth of the steady mean, or its own scatter."""
    begins: int
    """Frame of the hold that was the first reported, 1 on."""
    ends_s: float
    """From the release to the last reported frame."""
    false: int
    """Frames reported before."""


def draw_cases(seeds: int, text: str, depths_mm: tuple[float, ...] = DEPTHS_MM) -> list[Case]:
    """Draw holds, ``seeds`` of each shape and depth; the seeds are hashes of ``text``."""
    names = tuple(backgrounds())
    lights: tuple[Light, ...] = get_args(Light)
    cases = []
    for number, (shape, depth_mm, k) in enumerate(product(get_args(OtherShape), depths_mm, range(seeds))):
        seed = int.from_bytes(hashlib.sha256(f"{text} {number}".encode()).digest()[:8], "big")
        cases.append(Case(shape, depth_mm, lights[k % 2], names[k // 2 % len(names)], seed))
    return cases


def _noise(rng: np.random.Generator, shape: tuple[int, ...], *, clumped: bool) -> NDArray[np.float32]:
    noise = rng.standard_normal(shape, dtype=np.float32)
    if clumped:
        # What four by four pixels share, and the rest.
        noise = 0.964 * 4.0 * cv2.blur(noise, (4, 4)) + 0.265 * noise
    return np.asarray(np.array(NOISE_COUNTS, np.float32) * noise, np.float32)


def measure(case: Case) -> Jitter:
    """Run a hold."""
    rng = np.random.default_rng(case.seed)
    still = backgrounds()[case.background]
    place = (float(rng.uniform(0.35, 0.65)), float(rng.uniform(0.35, 0.65)))
    dent = change_of_colour(case.light, still, dent_mm(case.shape, case.depth_mm, still.shape[:2], place))
    noises = [_noise(rng, still.shape, clumped=case.clumped).reshape(-1) for _ in range(8)]
    down = np.linspace(0.0, 1.0, still.shape[0], dtype=np.float32)[:, None, None]
    times = np.arange(round((REST_S + HOLD_S + AFTER_S) * RATE_HZ)) / RATE_HZ

    def picture(t_s: float, *, pressed: bool) -> NDArray[np.uint8]:
        light = still + dent if pressed else still.astype(np.float32)
        if case.mains:
            phase = 2 * np.pi * case.lamp_hz * (t_s * 1.0007 + 0.9 / RATE_HZ * down)
            light = light * (1.0 + case.mains * np.sin(phase)).astype(np.float32)
        noise = np.roll(noises[rng.integers(len(noises))], int(rng.integers(still.size)))
        taken: NDArray[np.uint8] = np.clip(np.rint(light + noise.reshape(still.shape)), 0, 255).astype(
            np.uint8
        )
        return taken

    first = [picture(-2.0 + k / RATE_HZ, pressed=False) for k in range(round(RATE_HZ))]
    nominal = nominal_light()
    tracker = TouchTracker(
        np.rint(np.mean(first, axis=0)).astype(np.uint8),
        rate_hz=RATE_HZ,
        noise=sensor_noise(first),
        light=GelLight(nominal.terms, nominal.mm_per_px, nominal.stiffness_n_mm3),
    )
    held = (times >= REST_S) & (times < REST_S + HOLD_S)
    contacts = [tracker.update(picture(t, pressed=bool(on))) for t, on in zip(times, held, strict=True)]
    on = np.array([contact.in_contact for contact in contacts])
    steady = held & (times >= REST_S + SETTLED_S) & on
    values = np.array([(c.eda, c.depth_mm, *c.centroid_xy, c.spread) for c in contacts], np.float64)
    area = values[steady, 0]
    nan = float("nan")
    mean, deviation = values[steady].mean(axis=0), values[steady].std(axis=0)
    within = np.abs(values[held, 0] - mean[0]) <= max(0.1 * mean[0], 3 * deviation[0])
    off = np.flatnonzero(~within)
    last = np.flatnonzero(on & (times >= REST_S + HOLD_S))
    reported = np.flatnonzero(on[held])
    return Jitter(
        case,
        float(
            np.median(
                [c.difference / c.threshold for c, h in zip(contacts, held, strict=True) if h][
                    round(SETTLED_S * RATE_HZ) :
                ]
            )
        ),
        float(on[held][1:].mean()),
        float(deviation[0] / mean[0]) if area.size else nan,
        float(np.abs(np.diff(area)).max() / mean[0]) if area.size > 1 else nan,
        float(mean[0]) if area.size else nan,
        float(deviation[1] / mean[1]) if area.size else nan,
        float(deviation[2:4].max() / PX_PER_MM) if area.size else nan,
        float(deviation[4] / mean[4]) if area.size else nan,
        float((off[-1] + 1) / RATE_HZ) if off.size else 0.0,
        int(reported[0]) + 1 if reported.size else 0,
        float(times[last[-1]] + 1 / RATE_HZ - REST_S - HOLD_S) if last.size else 0.0,
        int(on[times < REST_S].sum()),
    )


def _table(found: list[Jitter]) -> list[str]:
    lines = [
        "| shape | mm | reported | S over threshold | scatter of EDA, median and worst | largest jump | "
        "scatter of depth | middle, mm | scatter of spread | first reported frame | released after s | "
        "steady after s |",
        "|---" * 12 + "|",
    ]
    for shape, depth_mm in dict.fromkeys((one.case.shape, one.case.depth_mm) for one in found):
        of = [one for one in found if (one.case.shape, one.case.depth_mm) == (shape, depth_mm)]
        felt = [one for one in of if one.reported > 0.5]
        if not felt:
            lines.append(f"| {shape} | {depth_mm:g} | 0 of {len(of)} |" + " – |" * 9)
            continue
        areas = [one.area_scatter for one in felt]
        lines.append(
            f"| {shape} | {depth_mm:g} | {len(felt)} of {len(of)} | {min(one.strength for one in felt):.1f} to "
            f"{max(one.strength for one in felt):.1f} | {100 * np.median(areas):.1f} %, {100 * max(areas):.1f} % | "
            f"{100 * max(one.area_jump for one in felt):.1f} % | "
            f"{100 * max(one.depth_scatter for one in felt):.1f} % | "
            f"{max(one.place_mm for one in felt):.3f} | {100 * max(one.spread_scatter for one in felt):.1f} % | "
            f"{max(one.begins for one in felt)} | {max(one.ends_s for one in felt):.3f} | "
            f"{max(one.settled_s for one in felt):.3f} |"
        )
    return lines


def _missed(one: Jitter) -> bool:
    return one.reported > 0.5 and (
        one.area_scatter > MOST_SCATTER
        or one.area_jump > MOST_JUMP
        or one.begins > MOST_FRAMES
        or one.ends_s > MOST_RELEASE_S
    )


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--seeds", type=click.IntRange(1, 1000), default=8, show_default=True)
@click.option("--seed-text", default="a steady hold", show_default=True, help="What the seeds are hashes of.")
@click.option(
    "--clumped/--white", default=True, show_default=True, help="Noise of a DIGIT's pixels, or of each alone."
)
@click.option(
    "--mains",
    type=click.FloatRange(0.0, 0.05),
    default=0.0,
    show_default=True,
    help="Banding, a share; each hold is paired with one without.",
)
@click.option(
    "--lamp-hz", type=click.FloatRange(1.0, 1000.0), default=100.0, show_default=True, help="Flicker."
)
@click.option("--processes", type=click.IntRange(1, 64), default=2, show_default=True)
def main(seeds: int, seed_text: str, mains: float, lamp_hz: float, processes: int, *, clumped: bool) -> None:
    """Print how much steady holds scatter; exit code 1 if one is over 4 % or jumps by more than 15 %."""
    cases = [
        case._replace(mains=mains, lamp_hz=lamp_hz, clumped=clumped) for case in draw_cases(seeds, seed_text)
    ]
    still = [case._replace(mains=0.0) for case in cases] if mains else []
    with multiprocessing.get_context("spawn").Pool(processes) as pool:
        found = list(pool.imap(measure, cases, 1))
        without = list(pool.imap(measure, still, 1))
    click.echo("\n".join(_table(found)))
    missed = [one for one in found if _missed(one)]
    click.echo(
        f"\n{len(missed)} of {len(found)} missed; {sum(one.false for one in found)} frames before a press"
    )
    if mains:
        shifts = [abs(a.area_px / b.area_px - 1) for a, b in zip(found, without, strict=True)]
        worst = max(shifts)
        click.echo(
            f"area off by more than 5 % in {sum(s > 0.05 for s in shifts)} of {len(shifts)}, at most {worst:.0%}"
        )
    sys.exit(1 if missed else 0)


if __name__ == "__main__":
    main()
