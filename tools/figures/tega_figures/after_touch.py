"""Watch a minute after each release of a touch, over what gels, lights and cameras do: no contact may be reported.

::

    TEGA_DATA=/path/to/recordings python -m tega_figures.after_touch --cases 240 --processes 2
    python -m tega_figures.after_touch --recipe            # the hardest course of a leftover on a clean camera

Every case is drawn from the seed text: a recorded picture of an untouched gel, a shading of another kind than the
simulated gel's (:mod:`tega_figures.other_gels`), a shape, noise, a leftover with one or two time constants, and one
disturbance. It rests for 3 s, is pressed for 4 s, is let go within 0.1 s, and is watched for 60 s; then a light press
of a third of the depth comes at the same place. In a third of the cases a second touch of half the depth comes while
the leftover fades. Exit code 1 if a contact was reported from 0.5 s after the release on, or a touch was not.
"""

from __future__ import annotations

import hashlib
import multiprocessing
import os
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Final, Literal, NamedTuple

import click
import cv2
import numpy as np
from numpy.typing import NDArray

from tega.tactile.tracker import TouchTracker, TrackedContact, sensor_noise
from tega_figures.other_gels import Light, OtherShape, change_of_colour, dent_mm

__all__ = ["Case", "Outcome", "backgrounds", "draw_cases", "judge_case", "recipe"]

Image = NDArray[np.uint8]
Trouble = Literal["none", "mains", "jpeg", "drift", "cast", "burst"]
TROUBLES: Final[tuple[Trouble, ...]] = ("none", "mains", "jpeg", "drift", "cast", "burst")
REST_S, HOLD_S, EDGE_S, WATCH_S, LIGHT_S = 3.0, 4.0, 0.1, 60.0, 1.0
SETTLED_S: Final = 0.5
LIGHT_SHARE: Final = 0.33
# Shares of the depth at which a press's colours are worked out; between them they are a straight line.
_PRESSED: Final = (0.0, LIGHT_SHARE, 0.5, 0.75, 1.0)
# A leftover as it was measured on a clean camera: seconds after the release, share of the dent.
RECIPE_S: Final = ((0.0, 0.16), (0.13, 0.13), (1.0, 0.08), (2.7, 0.06), (10.0, 0.0))


class Case(NamedTuple):
    """One gel, camera and course of a touch."""

    number: int
    background: str
    light: Light
    shape: OtherShape
    depth_mm: float
    noise: float
    """Standard deviation of a pixel, counts."""
    leftover: tuple[tuple[float, float], ...]
    """Share of the dent that is left, and its time constant, seconds; they add."""
    trouble: Trouble
    amount: float
    """Banding: amplitude, share of the light. JPEG: quality. Drift: counts a minute. Cast: share of a colour."""
    measured: bool
    """Whether the tracker is given the camera's measured noise."""
    again_s: float | None
    """When a second touch of half the depth comes, seconds after the release; None for no such touch."""
    rate_hz: float = 30.0
    mains_hz: float = 100.0
    sideways: bool = False
    """Whether the bands of mains light run down the picture."""

    def left(self, t_s: float) -> float:
        """Return the share of the dent that is left so long after the release."""
        if not self.leftover:
            times_s, shares = zip(*RECIPE_S, strict=True)
            return float(np.interp(t_s, times_s, shares))
        return sum(share * float(np.exp(-t_s / tau_s)) for share, tau_s in self.leftover)


class Outcome(NamedTuple):
    """What the tracker reported of a case."""

    case: Case
    noise: tuple[float, float, float] | None
    before: int
    """Contacts reported before the touch, frames."""
    held: float
    """Share of the hold's frames that were reported, from 0.1 s on."""
    released_s: float
    """From the release to the last frame of that contact; NaN where it did not end within the minute."""
    after: int
    """Contacts reported from 0.5 s after the release to the end of the minute, frames; the second touch left out."""
    first_s: float
    """When the first of them came, seconds after the release; NaN for none."""
    again: float
    """Share of the second touch's frames that were reported, from 0.1 s on; NaN for no such touch."""
    light: float
    """The same of the light press after the minute."""
    scatter: float
    """Standard deviation of EDA over its mean in the hold, from 0.5 s on."""
    jump: float
    """Largest change of EDA between two frames in that time, over its mean."""
    area: float
    """Mean of EDA in that time, pixels."""


@cache
def backgrounds() -> dict[str, Image]:
    """Return pictures of four DIGITs' untouched gels, BGR, by name."""
    folder = Path(os.environ.get("TEGA_DATA", "")) / "digit"
    if not (folder / "digit_backgrounds").is_dir():
        raise click.ClickException("recordings not found; set TEGA_DATA to their folder")
    presses = sorted((folder / "digit_ball_vocdex_a").glob("*.png"))
    middle = np.median([cv2.imread(str(file)) for file in presses], axis=0).astype(np.uint8)
    found = {
        "D20641": cv2.imread(str(folder / "digit_ball_D20641" / "background.png")),
        "D20479": np.load(folder / "digit_backgrounds" / "ncf_bg_D20479.npy"),
        "tacto": cv2.imread(str(folder / "digit_backgrounds" / "tacto_bg_digit_240_320.jpg")),
        "vocdex": middle,
    }
    return {name: np.ascontiguousarray(image, np.uint8) for name, image in found.items()}


def draw_cases(n: int, text: str) -> Iterator[Case]:
    """Draw cases; noise, trouble and background go round, so that each comes equally often.

    The seed is the hash of ``text``.
    """
    rng = np.random.default_rng(int.from_bytes(hashlib.sha256(text.encode()).digest()[:8], "big"))
    names = ("D20641", "D20479", "tacto", "vocdex")
    shapes: tuple[OtherShape, ...] = ("small ball", "large ball", "bar", "edge", "face")
    for number in range(n):
        trouble = TROUBLES[number % len(TROUBLES)]
        total = float(rng.choice((0.05, 0.1, 0.15, 0.2)))
        taus = np.exp(rng.uniform(np.log(0.3), np.log(20.0), size=int(rng.integers(1, 3))))
        shares = (total,) if len(taus) == 1 else (0.5 * total, 0.5 * total)
        amount = {
            "none": 0.0,
            "mains": float(rng.choice((0.005, 0.01, 0.02))),
            "jpeg": float(rng.choice((40, 55, 70, 85, 95))),
            "drift": float(rng.uniform(1.0, 5.0)),
            "cast": float(rng.uniform(0.02, 0.1)),
            "burst": 0.1,
        }[trouble]
        yield Case(
            number,
            names[(number // len(TROUBLES)) % 4],
            "lamps" if rng.random() < 0.5 else "slopes",
            shapes[int(rng.integers(5))],
            float(rng.choice((0.3, 0.6, 1.0))),
            float(rng.choice((0.1, 0.3, 1.0, 2.0, 3.0))),
            tuple((share, float(tau)) for share, tau in zip(shares, taus, strict=True)),
            trouble,
            amount,
            bool(rng.random() < 0.7),
            float(rng.choice((2.0, 6.0, 15.0))) if rng.random() < 1 / 3 else None,
            mains_hz=float(rng.choice((100.0, 120.0))),
            sideways=bool(rng.random() < 0.5),
        )


def recipe(noise: float = 0.3, background: str = "D20641", *, shape: OtherShape = "large ball") -> Case:
    """Return the touch of a clean camera whose leftover fades over ten seconds, at 60 Hz."""
    return Case(
        0, background, "slopes", shape, 1.2, noise, (), "none", 0.0, measured=True, again_s=None, rate_hz=60.0
    )


class _Camera:
    """Pictures of a case, one after the other."""

    def __init__(self, case: Case) -> None:
        self.case = case
        self.rng = np.random.default_rng(case.number)
        still = backgrounds()[case.background]
        self.still = still.astype(np.float32)
        place = (float(self.rng.uniform(0.35, 0.65)), float(self.rng.uniform(0.35, 0.65)))

        changes = [
            change_of_colour(
                case.light, still, dent_mm(case.shape, share * case.depth_mm, still.shape[:2], place)
            )
            for share in _PRESSED
        ]
        by = 1.0 if case.leftover else 130.0 / float(np.abs(changes[-1]).max())
        self.pressed = [by * change for change in changes]
        shape = (8, *still.shape)
        self.noises = (case.noise * self.rng.standard_normal(shape, dtype=np.float32)).astype(np.float32)
        down = np.linspace(0.0, 1.0, still.shape[1 if case.sideways else 0], dtype=np.float32)
        self.down = down[None, :, None] if case.sideways else down[:, None, None]
        self.tilt = np.linspace(-1.0, 1.0, still.shape[1], dtype=np.float32)[None, :, None]

    def picture(self, t_s: float, pressed: float = 0.0, left: float = 0.0) -> Image:
        """Take a picture at a time while a share of the depth is pressed, or a share of the dent's colours is left."""
        # A gel keeps a fainter copy of the dent, not the narrower dent of a lighter press.
        change = self._at(pressed) if pressed else np.float32(left) * self.pressed[-1]
        picture = self.still + change
        case = self.case
        if case.trouble == "mains":
            # Rows are read one after the other over nine tenths of the time from picture to picture.
            phase = 2 * np.pi * case.mains_hz * (t_s * 1.0007 + 0.9 / case.rate_hz * self.down)
            picture *= 1.0 + case.amount * np.sin(phase)
        elif case.trouble == "drift":
            minutes = t_s / 60.0
            picture += case.amount * minutes * (np.array([1.0, -0.5, 0.7], np.float32) + 0.5 * self.tilt)
        elif case.trouble == "cast":
            picture *= 1.0 + case.amount * min(t_s / 30.0, 1.0) * np.array([1.0, -0.3, -0.6], np.float32)
        elif case.trouble == "burst" and 0.0 <= (t_s + 1.0) % 20.0 < case.amount:
            picture *= 0.15
        noise = self.noises[self.rng.integers(len(self.noises))]
        rolled = np.roll(noise.reshape(-1), int(self.rng.integers(noise.size))).reshape(noise.shape)
        taken = np.clip(np.rint(picture + rolled), 0, 255).astype(np.uint8)
        if case.trouble == "jpeg":
            _, packed = cv2.imencode(".jpg", taken, [cv2.IMWRITE_JPEG_QUALITY, int(case.amount)])
            taken = np.asarray(cv2.imdecode(packed, cv2.IMREAD_COLOR), np.uint8)
        picture_taken: Image = taken
        return picture_taken

    def _at(self, share: float) -> NDArray[np.float32]:
        k = min(max(int(np.searchsorted(_PRESSED, share)), 1), len(_PRESSED) - 1)
        part = float((share - _PRESSED[k - 1]) / (_PRESSED[k] - _PRESSED[k - 1]))
        between = self.pressed[k - 1] + part * (self.pressed[k] - self.pressed[k - 1])
        return np.asarray(between, np.float32)


def _course(case: Case, t_s: float) -> tuple[float, float]:
    """Return the share of the depth that is pressed at a time since the first frame, and the share of the dent left."""
    released_s = t_s - (REST_S + HOLD_S)
    if released_s < EDGE_S:
        pressed = (
            np.interp(t_s, (REST_S, REST_S + EDGE_S), (0.0, 1.0))
            if released_s < 0
            else 1.0 - released_s / EDGE_S
        )
        if pressed > case.left(0.0) or released_s < 0:
            return float(pressed), 0.0
    if case.again_s is not None and case.again_s <= released_s < case.again_s + 1.5:
        return 0.5, 0.0
    if released_s >= WATCH_S:
        return LIGHT_SHARE, 0.0
    return 0.0, case.left(released_s)


def _times(case: Case) -> NDArray[np.float64]:
    """Return when pictures are taken; from 20 s after the release on, where nothing is quick, only one of three."""
    times = np.arange(round((REST_S + HOLD_S + WATCH_S + LIGHT_S) * case.rate_hz)) / case.rate_hz
    since_s = times - (REST_S + HOLD_S)
    slow = (since_s > 20.0) & (since_s < WATCH_S - 2.0) & (case.trouble != "mains")
    taken: NDArray[np.float64] = times[~slow | (np.arange(len(times)) % 3 == 0)]
    return taken


def judge_case(case: Case) -> Outcome:
    """Run a case and judge what was reported."""
    camera, rate_hz = _Camera(case), case.rate_hz
    still = [camera.picture(-2.0 + k / rate_hz) for k in range(round(rate_hz))]
    noise = sensor_noise(still) if case.measured else None
    tracker = TouchTracker(np.rint(np.mean(still, axis=0)).astype(np.uint8), rate_hz=rate_hz, noise=noise)
    times = _times(case)
    steps = np.diff(times, prepend=-1.0 / rate_hz)
    contacts = [
        tracker.update(camera.picture(t, *_course(case, t)), dt_s=float(step))
        for t, step in zip(times, steps, strict=True)
    ]
    return _judged(case, noise, times - (REST_S + HOLD_S), contacts)


def _judged(
    case: Case,
    noise: tuple[float, float, float] | None,
    since_s: NDArray[np.float64],
    contacts: list[TrackedContact],
) -> Outcome:
    on = np.array([contact.in_contact for contact in contacts])
    eda = np.array([contact.eda for contact in contacts], np.float64)
    held = (since_s >= EDGE_S + 0.1 - HOLD_S) & (since_s < 0)
    steady = eda[(since_s >= EDGE_S + 0.5 - HOLD_S) & (since_s < 0)]
    again = np.zeros(len(on), bool)
    reported = again.copy()
    if case.again_s is not None:
        reported = (since_s >= case.again_s + 0.1) & (since_s < case.again_s + 1.5)
        # Its own release may take as long as the first one's.
        again = (since_s >= case.again_s) & (since_s < case.again_s + 1.5 + SETTLED_S)
    watched = (since_s >= SETTLED_S) & (since_s < WATCH_S) & ~again
    off = np.flatnonzero(~on & (since_s >= 0))
    phantom = np.flatnonzero(on & watched)
    mean = float(steady.mean()) if steady.size else 0.0
    return Outcome(
        case,
        noise,
        int(on[since_s < -HOLD_S].sum()),
        float(on[held].mean()),
        float(since_s[off[0]]) if off.size and since_s[off[0]] < WATCH_S else float("nan"),
        int(phantom.size),
        float(since_s[phantom[0]]) if phantom.size else float("nan"),
        float(on[reported].mean()) if reported.any() else float("nan"),
        float(on[since_s >= WATCH_S + 0.1].mean()),
        float(steady.std() / mean) if mean else float("nan"),
        float(np.abs(np.diff(steady)).max() / mean) if mean else float("nan"),
        mean,
    )


def _failed(outcome: Outcome) -> bool:
    felt = (outcome.held, outcome.light, 1.0 if np.isnan(outcome.again) else outcome.again)
    return bool(outcome.before or outcome.after or min(felt) < 1.0)


def _table(outcomes: list[Outcome]) -> list[str]:
    """Return a row for each trouble and for each noise."""
    lines = [
        "| | cases | with a contact before | with a contact after | frames of it | hold reported | touch again | "
        "light press | scatter of EDA, median and worst | largest jump |",
        "|---" * 10 + "|",
    ]
    groups: list[tuple[str, list[Outcome]]] = [
        (t, [o for o in outcomes if o.case.trouble == t]) for t in TROUBLES
    ]
    noises = sorted({o.case.noise for o in outcomes})
    groups += [(f"noise {n:g}", [o for o in outcomes if o.case.noise == n]) for n in noises]
    groups += [("all", outcomes)]
    for name, found in groups:
        if not found:
            continue
        again = [o.again for o in found if not np.isnan(o.again)]
        scatters = [o.scatter for o in found if not np.isnan(o.scatter)] or [float("nan")]
        lines.append(
            f"| {name} | {len(found)} | {sum(o.before > 0 for o in found)} | {sum(o.after > 0 for o in found)} | "
            f"{sum(o.after for o in found)} | {_percent([o.held for o in found])} | {_percent(again)} | "
            f"{_percent([o.light for o in found])} | {100 * np.median(scatters):.1f} %, {100 * max(scatters):.1f} % | "
            f"{100 * max((o.jump for o in found if not np.isnan(o.jump)), default=float('nan')):.1f} % |"
        )
    return lines


def _percent(shares: list[float]) -> str:
    return f"{100 * float(np.mean(shares)):.1f} %" if shares else "–"


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--cases", type=click.IntRange(1, 100_000), default=240, show_default=True)
@click.option(
    "--seed-text", default="a minute after", show_default=True, help="What the seed is the hash of."
)
@click.option("--processes", type=click.IntRange(1, 64), default=2, show_default=True)
@click.option(
    "--recipe", "only_recipe", is_flag=True, help="Only the clean camera's leftover of ten seconds."
)
@click.option("--each", is_flag=True, help="Print every case that failed.")
def main(cases: int, seed_text: str, processes: int, only_recipe: bool, each: bool) -> None:  # noqa: FBT001
    """Print how many cases had a contact that was not there, and what was felt."""
    drawn = (
        [recipe(noise, name) for noise in (0.1, 0.3, 1.0) for name in backgrounds()]
        if only_recipe
        else list(draw_cases(cases, seed_text))
    )
    with multiprocessing.get_context("spawn").Pool(processes) as pool:
        outcomes = list(pool.imap_unordered(judge_case, drawn, 1))
    outcomes.sort(key=lambda outcome: outcome.case.number)
    for outcome in filter(_failed, outcomes):
        if each:
            click.echo(repr(outcome))
    click.echo("\n".join(_table(outcomes)))
    if any(map(_failed, outcomes)):
        sys.exit(1)


if __name__ == "__main__":
    main()
