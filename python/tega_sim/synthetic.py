"""Simulate fingertip cameras and EMG amplifiers: presses on a gel and contractions of a forearm, labelled so.

They are drivers like any other, so that the loop, the recorder and every example run with no hardware. Their limits
are in ``docs/evidence/sim-touch.md`` and :mod:`tega_sim.operator`.
"""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING, Annotated, ClassVar

import msgspec

from tega.devices.base import DeviceInfo, EmgChunk, Kind, Options, TactileFrame
from tega.errors import DeviceUnavailableError
from tega.runtime.lifecycle import Opened

if TYPE_CHECKING:
    from tega_sim.gel import Gel
    from tega_sim.operator import ForearmEmg
    from tega_sim.seams import Indenter


Seconds = Annotated[float, msgspec.Meta(gt=0, le=3600)]
Seed = Annotated[int, msgspec.Meta(ge=0, lt=2**32)]

# Hundredths of a second.
_CHUNK_TICKS = 5
# The grasp that both devices follow, as shares of its duration and of full effort: reach, close in steps, hold, let go.
_GRASP = (
    (0.00, 0.02),
    (0.10, 0.02),
    (0.18, 0.35),
    (0.30, 0.40),
    (0.38, 0.62),
    (0.50, 0.66),
    (0.60, 0.97),
    (0.72, 0.92),
    (0.80, 0.45),
    (0.86, 0.04),
    (1.00, 0.02),
)
# The hand and the gel follow the muscles this much later, seconds.
_TOUCH_DELAY_S = 0.35


def effort_at(t_s: float, duration_s: float) -> float:
    """Return the grasp's effort at a time, 0 to 1: a reach, a closing in three steps, a hold, a release.

    Example:
        >>> effort_at(0.0, 10.0) < 0.1 < effort_at(6.0, 10.0)
        True
    """
    share = min(max(t_s / duration_s, 0.0), 1.0)
    for (start, low), (end, high) in itertools.pairwise(_GRASP):
        if share <= end:
            ease = 0.5 - 0.5 * math.cos(math.pi * (share - start) / (end - start))
            return low + (high - low) * ease
    return _GRASP[-1][1]


class SyntheticTouchOptions(Options, frozen=True):
    """Settings of :class:`SyntheticTouch`.

    Attributes:
        seed: Seed of the gel and its noise.
        duration_s: How long the grasp lasts.
        rate_hz: Frames per second.
        force_n: How hard the finger presses at full effort, newtons.
        radius_mm: Radius of the grasped ball: small is sharp, large is broad.
        delay_s: How much later than the others this finger meets the object.
    """

    seed: Seed = 0
    duration_s: Seconds = 12.0
    rate_hz: Annotated[float, msgspec.Meta(gt=0, le=240)] = 60.0
    force_n: Annotated[float, msgspec.Meta(ge=0, le=30)] = 4.0
    radius_mm: Annotated[float, msgspec.Meta(gt=0.5, le=50)] = 4.4
    delay_s: Annotated[float, msgspec.Meta(ge=0, le=60)] = 0.0


class SyntheticTouch(Opened):
    """A fingertip camera that sees a ball pressed in and let go, as the grasp goes."""

    kind: ClassVar[Kind] = "tactile"
    summary: ClassVar[str] = "simulated presses on a gel; needs nothing"
    options_type: ClassVar[type[Options]] = SyntheticTouchOptions

    def __init__(self, options: SyntheticTouchOptions) -> None:
        self._options = options
        self._gel: Gel | None = None
        self._next = 0

    @property
    def info(self) -> DeviceInfo:
        """Rate and number of frames."""
        return DeviceInfo(
            driver="synthetic-touch",
            kind="tactile",
            label=f"simulated gel {self._options.seed}",
            live=False,
            rate_hz=self._options.rate_hz,
            n_items=_n_items(self._options),
            notes=("simulated touch",),
        )

    def open(self) -> None:
        """Make the gel; the same seed makes the same pictures again."""
        from tega_sim.gel import Gel

        self._gel, self._next = Gel(self._options.seed), 0

    def close(self) -> None:
        """Forget the gel."""
        self._gel = None

    @property
    def ended(self) -> bool:
        """Whether the grasp is over."""
        return self._next >= _n_items(self._options)

    def press_at(self, t_s: float) -> Indenter:
        """Return what presses the gel at a time."""
        from tega_sim.gel import HEIGHT, WIDTH, ball

        options = self._options
        effort = effort_at(t_s - _TOUCH_DELAY_S - options.delay_s, options.duration_s)
        # Contact begins when the fingers have closed a fifth of the way; the ball rolls a little as it is squeezed.
        squeeze = max(0.0, effort - 0.2) / 0.8
        centre = (WIDTH / 2 + 18 * math.sin(2.2 * squeeze), HEIGHT / 2 - 25 + 30 * squeeze)
        return ball(force_n=options.force_n * squeeze, radius_mm=options.radius_mm, centre_xy=centre)

    def skip(self, n_frames: int) -> None:
        """Pass over the next ``n_frames`` frames."""
        self._next += n_frames

    def read(self, timeout_s: float) -> TactileFrame | None:  # noqa: ARG002  # never keeps one waiting
        """Return the next frame."""
        if self._gel is None:
            raise DeviceUnavailableError("synthetic-touch is not open", "open it first")
        if self.ended:
            return None
        seq = self._next
        self._next += 1
        t_s = seq / self._options.rate_hz
        image = self._gel.frame([self.press_at(t_s)], seq)
        return TactileFrame(round(t_s * 1e9), seq, image, f"frame {seq}")


class SyntheticEmgOptions(Options, frozen=True):
    """Settings of :class:`SyntheticEmg`.

    Attributes:
        seed: Seed of the noise.
        duration_s: How long the grasp lasts.
        rate_hz: Samples per second.
    """

    seed: Seed = 0
    duration_s: Seconds = 12.0
    rate_hz: Annotated[float, msgspec.Meta(ge=200, le=10_000)] = 1000.0


def _n_items(options: SyntheticTouchOptions | SyntheticEmgOptions) -> int:
    return max(1, round(options.duration_s * options.rate_hz))


class SyntheticEmg(Opened):
    """Three channels of raw EMG that follow the effort of the grasp."""

    kind: ClassVar[Kind] = "emg"
    summary: ClassVar[str] = "simulated raw EMG of three muscles; needs nothing"
    options_type: ClassVar[type[Options]] = SyntheticEmgOptions

    def __init__(self, options: SyntheticEmgOptions) -> None:
        self._options = options
        self._forearm: ForearmEmg | None = None
        self._tick = self._next = 0

    @property
    def info(self) -> DeviceInfo:
        """Rate, channels and number of samples."""
        return DeviceInfo(
            driver="synthetic-emg",
            kind="emg",
            label="simulated forearm",
            live=False,
            rate_hz=self._options.rate_hz,
            channels=("ch1", "ch2", "ch3"),
            unit="µV",
            n_items=_n_items(self._options),
            notes=("simulated EMG",),
        )

    def open(self) -> None:
        """Make the signal; the same seed makes the same one again."""
        from tega_sim.operator import ForearmEmg, typical_person

        options = self._options
        self._forearm = ForearmEmg(typical_person(), seed=options.seed, rate_hz=options.rate_hz)
        self._tick = self._next = 0

    def close(self) -> None:
        """Forget the signal."""
        self._forearm = None

    @property
    def ended(self) -> bool:
        """Whether the grasp is over."""
        return self._next >= _n_items(self._options)

    def read(self, timeout_s: float) -> EmgChunk | None:  # noqa: ARG002  # never keeps one waiting
        """Return the next twentieth of a second."""
        if self._forearm is None:
            raise DeviceUnavailableError("synthetic-emg is not open", "open it first")
        if self.ended:
            return None
        first, options = self._next, self._options
        times_s = [(self._tick + n) / 100 for n in range(_CHUNK_TICKS)]
        samples = self._forearm.course([effort_at(t_s, options.duration_s) for t_s in times_s])
        samples = samples[: _n_items(self._options) - first]
        self._tick += _CHUNK_TICKS
        self._next = first + len(samples)
        return EmgChunk(round(self._next * 1_000_000_000 / options.rate_hz), first, samples)
