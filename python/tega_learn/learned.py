"""Decode EMG by a learned model, block by block, with NumPy alone."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Final

import msgspec
import numpy as np
from numpy.typing import ArrayLike, NDArray

from tega.records.table import rows_html
from tega_learn.block_features import Blocks, FeatureBlock, as_samples
from tega_learn.learners import refitted
from tega_learn.model import BlockScorer, Model, load_model, save_model

DRIFT_LEVELS: Final = 0.7
"""So far from the level a block's closure counts for neither side; half a level is its border."""
POWER: Final = 1.25
"""Exponent of the distance beyond the level, levels: above 1, a large change is accepted before a small one."""
AREA: Final = 0.13
"""Sum that is required, over time in seconds, if the level has been steady."""
BUSY, BUSY_S = 0.1, 3.0
"""So much more is asked for, for the square of the changes of late; a change is forgotten with that time constant."""
BACK, BACK_S = 6.0, 1.5
"""So many times more is asked for a change back, right after a change; that is forgotten with that time constant."""
AHEAD: Final = 0.5
"""The new level is the nearest to where effort goes: past the newest block by this share of its lead over the smoothed
closure."""


class Latch:
    """Give closures of single blocks a level.

    A block at distance a from the level, in levels, adds (a - drift)^power to the sum of its own way, or takes
    drift - a from it; the sums never fall below 0. The level changes where a sum, over time, reaches
    ``area (1 + busy n²) (1 + back exp(-t / back_s))``: n counts the last changes, each as exp(-its age / busy_s), and
    the last factor is there only for a change the other way than the last one, t ago. After long steadiness two levels
    or more are so changed at the first block, and one level after 0.6 s, if no block is back before.
    Effort that jumps within one block is taken for effort that still rises: its level is one too high for some two
    seconds. Muscles take three blocks.
    """

    def __init__(self, block_s: float) -> None:
        self._block_s = block_s
        self._up = self._down = 0.0
        self._since_s = math.inf
        self._n_of_late = 0.0
        self._last_direction = 0
        self.level = 0

    def take(self, closure: float, smoothed: float) -> None:
        """Take the next block's closure and the smoothed one, 0 to 1; ``level`` is then its level, 1 to 5."""
        goes_to = min(1.0, max(0.0, closure + AHEAD * (closure - smoothed)))
        nearest = min(5, int(1.5 + 4.0 * goes_to))
        if self.level == 0:
            self.level = nearest
        self._since_s += self._block_s
        self._n_of_late *= math.exp(-self._block_s / BUSY_S)
        away = 1.0 + 4.0 * closure - self.level
        self._up = self._added(self._up, away)
        self._down = self._added(self._down, -away)
        route = 1 if self._up >= self._down else -1
        requested = AREA * (1.0 + BUSY * self._n_of_late**2)
        if route == -self._last_direction:
            requested *= 1.0 + BACK * math.exp(-self._since_s / BACK_S)
        if max(self._up, self._down) >= requested and (nearest - self.level) * route > 0:
            self.level, self._last_direction = nearest, route
            self._up = self._down = self._since_s = 0.0
            self._n_of_late += 1.0

    def _added(self, sum_so_far: float, away: float) -> float:
        beyond = away - DRIFT_LEVELS
        counts = beyond**POWER if beyond > 0 else beyond
        return max(0.0, sum_so_far + counts * self._block_s)


class Decoded(msgspec.Struct, frozen=True):
    """Closure, level and confidence of one block.

    Attributes:
        closure: 0 (open) to 1 (closed).
        level: 1 to 5: the closure's, steadied (:mod:`tega_learn.learned`).
        confidence: Chance that the closure is within one level of the one meant, 0 to 1; 0 if a channel is bad.
        held: Whether the closure only repeats the one before it: a channel is bad, or the block is like none that the
            model knows.
        channels: Level of each channel, 1 to 5; all 0 where one is bad, since the model needs all.
        end: Number of the block's last sample among those of the call.
    """

    closure: float
    level: int
    confidence: float
    held: bool
    channels: tuple[int, ...]
    end: int


class BlockDecoder:
    """Base of a decoder that gives a closure a block; ``decoded`` are the blocks of the last call."""

    _blocks: Blocks
    decoded: list[Decoded]

    def process(self, samples: ArrayLike) -> NDArray[np.float64]:
        """Take the next samples, ``(n, channels)``, in the unit of the calibration; NaN where missing.

        Return the closure of each block completed, 0 to 1, ``(k,)``, float64. ``ShapeError`` for another number of
        channels, ``DtypeError`` for what are no real numbers.
        """
        self.decoded = [self._decode(block) for block in self._blocks.take(samples)]
        return np.array([one.closure for one in self.decoded])

    def _decode(self, block: FeatureBlock) -> Decoded:
        raise NotImplementedError

    @property
    def levels(self) -> NDArray[np.int64]:
        """Level of each block of the last call, 1 to 5, ``(k,)``."""
        return np.array([one.level for one in self.decoded], np.int64)

    @property
    def confidence(self) -> NDArray[np.float64]:
        """Confidence of each block of the last call, 0 to 1, ``(k,)``."""
        return np.array([one.confidence for one in self.decoded])

    @property
    def held(self) -> NDArray[np.bool_]:
        """Which blocks of the last call were held, ``(k,)``."""
        return np.array([one.held for one in self.decoded], bool)

    @property
    def held_samples(self) -> NDArray[np.int64]:
        """Samples replaced so far, ``(channels,)``."""
        return self._blocks.held_samples


class LearnedDecoder(BlockDecoder):
    """Turn EMG samples into a closure a block, by a model of :func:`tega_learn.fit`.

    Causal; a recording gives bit-identical results however it is cut into chunks. Samples that are missing are NaN:
    with a channel bad the closure is held, with confidence 0. A block far beyond the training data is held too.

    Example:
        >>> import numpy as np
        >>> from tega_learn.decoders import fit
        >>> rng = np.random.default_rng(1)
        >>> closure = np.repeat([0.0, 1.0, 0.0, 0.5, 0.0, 1.0] * 2, 400)
        >>> emg = rng.normal(size=(len(closure), 3)) * (5 + 100 * closure[:, None])
        >>> decoder = fit(emg, closure, rate_hz=200, tau=20)
        >>> closures = decoder.process(emg)
        >>> bool(np.corrcoef(closures, closure[19::20])[0, 1] > 0.9)
        True
        >>> decoder.levels[:3]
        array([1, 1, 1])
    """

    def __init__(self, model: Model) -> None:
        model.check_whole("model")
        self.model = model
        self.restart()

    @classmethod
    def load(cls, path: Path) -> LearnedDecoder:
        """Read a model's file; ``CalibrationError`` if it is missing, damaged, or no model."""
        return cls(load_model(path))

    def save(self, path: Path) -> None:
        """Write the model to a file."""
        save_model(self.model, path)

    def __repr__(self) -> str:
        """Model, channels, rate and training time."""
        m = self.model
        return (
            f"<LearnedDecoder: {m.model} on {', '.join(m.channels)}, {m.kind}, {m.rate_hz:g} Hz, "
            f"learned from {m.duration_s:.0f} s>"
        )

    def _repr_html_(self) -> str:
        m = self.model
        rows = [("model", m.model, ""), ("channels", ", ".join(m.channels), ""), ("samples", m.kind, "")]
        rows += [("rate", f"{m.rate_hz:g}", "Hz"), ("block", f"{1000 * m.tau / m.rate_hz:g}", "ms")]
        rows += [("participant", m.person or "not named", ""), ("learned from", f"{m.duration_s:.0f}", "s")]
        return rows_html("LearnedDecoder", rows)

    def restart(self) -> None:
        """Forget all samples."""
        m = self.model
        self._blocks = Blocks(m.rate_hz, m.tau, m.kind, len(m.channels))
        self._scorer = BlockScorer(m)
        self._latch = Latch(m.tau / m.rate_hz)
        self._knots = np.array(m.knots_effort), np.array(m.knots_closure)
        self._lowest, self._highest = np.array(m.lowest), np.array(m.highest)
        self._full = np.array(m.channel_full)
        self._last = 0.0
        self.decoded = []

    def _decode(self, block: FeatureBlock) -> Decoded:
        n = len(self._full)
        if block.bad.any():
            return Decoded(
                self._last, max(1, self._latch.level), 0.0, held=True, channels=(0,) * n, end=block.end
            )
        z = self._scorer.scaled(self._scorer.smooth(block.samples))
        effort = self._scorer.effort(z)
        novelty = float(np.maximum(self._lowest - z, z - self._highest).max())
        shares = np.add.reduce(np.abs(block.samples)) / len(block.samples) / self._full
        channels = tuple((1 + np.minimum(4 * shares, 4).astype(int)).tolist())
        wanted = self.closure_of(effort)
        confidence = self.model.confidence[min(4, int(5 * wanted))]
        if novelty > 0:
            confidence *= 0.5 ** (novelty / self.model.hold_beyond)
        held = novelty > self.model.hold_beyond
        if not held:
            self._last = wanted
            newest = self._scorer.effort(self._scorer.scaled(self._scorer.newest))
            self._latch.take(self.closure_of(newest), wanted)
        level = max(1, self._latch.level)
        return Decoded(self._last, level, confidence, held, channels, block.end)

    def closure_of(self, effort: float) -> float:
        """Return the closure that an effort asks for; it never falls as the effort rises."""
        closure = float(np.interp(effort, *self._knots))
        return closure if closure >= self.model.dead_band else 0.0

    def recalibrated(self, emg: ArrayLike, target: ArrayLike) -> LearnedDecoder:
        """Return a decoder that fits the day, from about ten seconds ``(n, channels)`` of rest and effort.

        ``target`` is the closure meant at each sample, 0 to 1. See :func:`tega_learn.learners.refitted`.
        """
        return LearnedDecoder(refitted(self.model, as_samples(emg, len(self.model.channels)), target))

    @property
    def channels(self) -> int:
        """Number of channels."""
        return len(self.model.channels)
