"""Measure bands that lamps on mains make in a camera's pictures, as slow as they may move.

A lamp flickers at 100 or 120 Hz, and a rolling shutter makes bands of that, along rows or, where the picture is turned,
along columns. A line's sum over its sum in another picture is its gain, and over the lines the gain is a wave: one for
the picture's left, middle and right, which a touch changes each in its own way.

From picture to picture the wave turns. How large it is shows once it has turned far; of a slower one only that it is at
least so large as the fastest wave that fits. One that stands still shows against a picture of another time.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Bands", "moving_bands", "standing_bands"]

# Periods of the wave over the picture, of 100 and 120 Hz at 60 to 25 pictures a second.
_PERIODS: Final = np.arange(1.25, 6.01, 0.25)
# Rows or columns are taken together to so many lines.
_LINES: Final = 40
# Turns in the look: of slow waves a few, of others all that can be told apart.
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


def moving_bands(pictures: Sequence[NDArray[np.uint8]]) -> Bands:
    """Measure bands that move in pictures of an untouched gel; of slow ones at least how large they are.

    The pictures are uint8 (H, W, 3), at least three of one size, in the order they came.
    """
    return max(_moving(_gains(pictures, pictures[0], along)) for along in (0, 1))


def standing_bands(pictures: Sequence[NDArray[np.uint8]], baseline: NDArray[np.uint8]) -> Bands:
    """Measure bands by which the mean of some pictures differs from a baseline, all uint8 (H, W, 3)."""
    return max(_standing(_gains(pictures, baseline, along)) for along in (0, 1))


def _gains(
    pictures: Sequence[NDArray[np.uint8]], reference: NDArray[np.uint8], along: int
) -> NDArray[np.float64]:
    """Return how much lighter than the reference the lines of three thirds are, shares, (3, pictures, lines)."""
    length, across = reference.shape[along], reference.shape[1 - along]
    starts = np.arange(min(_LINES, length)) * length // min(_LINES, length)
    gains = []
    for part in range(3):
        third = slice(part * across // 3, (part + 1) * across // 3)
        cut = (slice(None), third) if along == 0 else (third, slice(None))
        lines = [
            picture[cut].sum(axis=(1 - along, 2), dtype=np.float64) for picture in (reference, *pictures)
        ]
        sums = [np.add.reduceat(one, starts) for one in lines]
        gains.append(np.array(sums[1:]) / np.maximum(sums[0], 1.0) - 1.0)
    return np.array(gains)


def _moving(gains: NDArray[np.float64]) -> Bands:
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
