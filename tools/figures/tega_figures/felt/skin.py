"""Simulate what many looks at a vest show one person, motor by motor, in batches of trials.

It is the skin of :mod:`tega_sim.operator.vest_sense` (link, motor's lag, spread, threshold, noise of a look), with
the same numbers of the same simulated people, but with a place for every motor: that one sums a face up by its
strongest column. What it adds is marked [P], a proposal that nobody has measured: how often a place is taken for its
neighbour, and the distance of the rows.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

from tega_sim.operator.vest_sense import POLL_S

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from tega_sim.operator.sections import VestSection

    Array = NDArray[np.float64]

ROWS: Final = 5
REFRESH_S: Final = 1 / 30
"""Time between two frames."""

COLUMN_TAKEN_FOR_NEXT: Final = 0.03
"""Share of trials in which all is felt one column aside [P]; 0 to 0.1."""

ROW_TAKEN_FOR_NEXT: Final = 0.15
"""Share of trials in which all is felt one row up or down [P]: acuity along the spine is half of that across it."""

_ROW_SPREAD = math.exp(-6.0 / 4.0)  # rows 6 cm apart [P]; the columns' spread is exp(-9.5 cm / 4 cm)
# A window in which less than half of the looks felt something counts as unfelt: so far below the threshold, ln.
_BELOW = 0.5
# Nobody knows to a look when a presentation began: so many looks early or late [P].
_LATE_LOOKS = 2
_WINDOW_S = 0.25
_TWO_GLANCES = 0.954


class BatchSkin:
    """One person's skin for many trials of the same stimulus."""

    def __init__(self, vest: VestSection) -> None:
        self._p = vest
        self._look_sd = math.log1p(vest.weber) / _TWO_GLANCES

    def moved(self, levels: NDArray[np.uint8]) -> Array:
        """Return the motors' amplitudes at each look, float64 (looks, 2, 5, 4), 0 to 1.

        ``levels`` are the steps that reach the motors, 0 to 15, uint8 (frames, 40), a frame every
        ``REFRESH_S``.
        """
        p = self._p
        drive = np.where(levels < p.start_level, 0.0, (levels / 15.0) ** p.exponent).reshape(-1, 2, ROWS, 4)
        late_s = (p.link_ms + p.dead_ms) / 1e3
        n_checks = round(len(levels) * REFRESH_S / POLL_S)
        sub = 5
        dt_ms = POLL_S * 1e3 / sub
        up, down = (math.exp(-dt_ms / lag) for lag in (p.lag_up_ms, p.lag_down_ms))
        at, looks = np.zeros((2, ROWS, 4)), []
        for step in range(n_checks * sub):
            frame = math.floor((step * POLL_S / sub - late_s) / REFRESH_S + 1e-9)
            wanted = drive[frame] if frame >= 0 else np.zeros_like(at)
            gap = wanted - at
            at = wanted - gap * np.where(gap > 0, up, down)
            if step % sub == sub - 1:
                looks.append(at)
        return np.array(looks)

    def felt(self, moved: Array) -> Array:
        """Return intensities on the skin at each look, (looks, 2, 5, 4): spread to the neighbours."""
        column, row = self._p.spread * moved, _ROW_SPREAD * moved
        out = moved.copy()
        out[..., 1:] = np.maximum(out[..., 1:], column[..., :-1])
        out[..., :-1] = np.maximum(out[..., :-1], column[..., 1:])
        out[..., 1:, :] = np.maximum(out[..., 1:, :], row[..., :-1, :])
        out[..., :-1, :] = np.maximum(out[..., :-1, :], row[..., 1:, :])
        return out

    def percepts(self, levels: NDArray[np.uint8], n_trials: int, rng: np.random.Generator) -> Array:
        """Return what trials of one stimulus leave in mind, float64 (trials, features).

        For each face and each quarter of a second: the mean log intensity of its strongest place, and the column and
        the row of the middle of what was felt. Of the noise of a look half stays however many are averaged.
        """
        p = self._p
        whole = np.pad(self.felt(self.moved(levels)), [(_LATE_LOOKS, _LATE_LOOKS), (0, 0), (0, 0), (0, 0)])
        n = len(whole) - 2 * _LATE_LOOKS
        late = rng.integers(0, 2 * _LATE_LOOKS + 1, n_trials)
        at = late[:, None] + np.arange(n)
        log = np.log(np.maximum(whole, 1e-6))
        z = (log - math.log(p.threshold)) / p.threshold_log_sd
        chance = 0.5 * (1 + _erf(z / math.sqrt(2)))[at]
        intensity, log = whole[at], log[at]
        missed = rng.random((n_trials, n, 2, 1, 1))
        shape = (n_trials, n, 2, 1, 1)
        lasting = rng.standard_normal((n_trials, 1, 2, 1, 1))
        error = self._look_sd * math.sqrt(0.5) * (lasting + rng.standard_normal(shape))
        is_felt = missed < (1 - p.lapse) * chance
        weight = np.where(is_felt, intensity, 0.0)
        strongest = np.where(is_felt, log, -np.inf).max(axis=(3, 4))
        seen = np.where(np.isfinite(strongest), strongest + error[..., 0, 0], 0.0)
        total = weight.sum(axis=(3, 4))
        columns = (weight * np.arange(4.0)).sum(axis=(3, 4))
        rows = (weight * np.arange(float(ROWS))[:, None]).sum(axis=(3, 4))
        some = total > 0
        aside = _aside(rng, n_trials, COLUMN_TAKEN_FOR_NEXT), _aside(rng, n_trials, ROW_TAKEN_FOR_NEXT)
        middle = [
            np.where(some, snapshot / np.where(some, total, 1) + by[:, None, None], 0.0)
            for snapshot, by in zip((columns, rows), aside, strict=True)
        ]
        per = round(_WINDOW_S / POLL_S)

        def windows(looks: Array) -> Array:
            added: Array = looks[:, : n // per * per].reshape(n_trials, n // per, per, 2).sum(axis=2)
            return added

        counts = windows(some.astype(np.float64))
        enough = counts >= per / 2
        nothing = (math.log(p.threshold) - _BELOW, -1.0, -1.0)
        features = np.stack(
            [
                np.where(enough, windows(of) / np.maximum(counts, 1), without)
                for of, without in zip((seen, *middle), nothing, strict=True)
            ],
            axis=-1,
        )
        swapped = rng.random(n_trials) < p.panel_swap
        features[swapped] = features[swapped][:, :, ::-1]
        return features.reshape(n_trials, -1)


def _aside(rng: np.random.Generator, n: int, chance: float) -> Array:
    """Return how far each trial is felt aside: 0, or one place to either side."""
    return np.where(rng.random(n) < chance, rng.choice([-1.0, 1.0], n), 0.0)


_erf: Callable[[Array], Array] = np.vectorize(math.erf, otypes=[np.float64])
