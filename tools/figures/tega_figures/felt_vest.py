"""What is felt of a vest: by a simulated skin, in batches of trials, and by the forces on the fingertips in lifts.

The skin is that of :mod:`tega_sim.operator.vest_sense` (link, motor's lag, spread, threshold, noise of a look), with
the same numbers of the same simulated people, but with a place for every motor: that one sums a face up by its
strongest column. What it adds is marked [P], a proposal that nobody has measured: how often a place is taken for its
neighbour, and the distance of the rows. :class:`Discriminant` names the stimulus that a percept is most like: no person
names better than the percepts allow; people name worse. :func:`score_lifts` scores what the vest shows of the forces
in simulated lifts: felt where loaded, silent where not.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from tega.config import FINGERS
from tega_figures.touch_demo import DEMO_OBJECTS, LOAD_N, RELEASE_S
from tega_figures.touch_presses import rank_correlation
from tega_sim.operator.vest_sense import POLL_S
from tega_sim.plan import TrialPlan
from tega_sim.streams import Streams
from tega_sim.trial import run_trial

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
        chance = _normal_cdf((log - math.log(p.threshold)) / p.threshold_log_sd)[at]
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


def _normal_cdf(z: Array) -> Array:
    return 0.5 * (1 + _erf(z / math.sqrt(2)))


class Discriminant:
    """Linear discriminant with one covariance, shrunk a little towards its diagonal.

    ``percepts`` is (trials, features), ``stimuli`` the number of each trial's stimulus, int (trials,).
    """

    def __init__(self, percepts: Array, stimuli: NDArray[np.int64]) -> None:
        self.kinds = np.unique(stimuli)
        self.means = np.array([percepts[stimuli == kind].mean(axis=0) for kind in self.kinds])
        rest = percepts - self.means[np.searchsorted(self.kinds, stimuli)]
        covariance = rest.T @ rest / max(len(rest) - len(self.kinds), 1)
        shrunk = 0.95 * covariance + 0.05 * np.diag(np.diag(covariance)) + 1e-6 * np.eye(len(covariance))
        self.inverse = np.linalg.inv(shrunk)

    def named(self, percepts: Array) -> NDArray[np.int64]:
        """Return the stimulus that each percept is most like."""
        weights = self.means @ self.inverse
        scores = percepts @ weights.T - 0.5 * (weights * self.means).sum(axis=1)
        named: NDArray[np.int64] = self.kinds[np.argmax(scores, axis=1)]
        return named

    def along(self, percepts: Array) -> Array:
        """Return how far percepts lie from the first of two stimuli towards the second."""
        far: Array = percepts @ (self.inverse @ (self.means[1] - self.means[0]))
        return far


FELT_PERCENT: Final = 20
"""Intensity that skin feels where a wearer's threshold was not measured."""

# A picture is this old when it is measured; what is shown is compared with the force of then.
_LAG_S: Final = 0.02


class Shown(NamedTuple):
    """Vest frames of one finger in one lift.

    Attributes:
        loaded: Frames before which the finger carried 0.5 N throughout 0.1 s.
        felt: Those of them in which a motor of its columns ran at 20 % or more.
        free: Frames before which nothing touched the finger for 0.2 s.
        false: Those of them in which a motor of its columns ran.
        rank: Rank correlation of force and the mean of its columns, over all frames.
    """

    loaded: int
    felt: int
    free: int
    false: int
    rank: float


def score_lifts(seeds: Iterable[int]) -> list[Shown]:
    """Run lifts of the default person and settings, one a person's seed, and score every finger."""
    found = []
    for seed in seeds:
        for name in DEMO_OBJECTS:
            kept = Streams()
            run_trial(TrialPlan(object=name, seed=seed, rules=3), streams=kept)
            vest = np.array(kept.rows["vest"], np.float64)
            t_s, motors = vest[:, 0], vest[:, 1:].reshape(len(vest), 2, -1, 4)
            at_s = kept.array("truth", "t_s")
            for column, finger in enumerate(FINGERS):
                force_n = kept.array("truth", f"{finger}_force_n")
                found.append(Shown(*_score(t_s, motors[..., column], at_s, force_n)))
    return found


def _score(
    t_s: NDArray[np.float64],
    motors: NDArray[np.float64],
    at_s: NDArray[np.float64],
    force_n: NDArray[np.float64],
) -> tuple[int, int, int, int, float]:
    before = np.searchsorted(at_s, t_s, side="right")
    since = np.searchsorted(at_s, t_s - RELEASE_S), np.searchsorted(at_s, t_s - 2 * RELEASE_S)
    least = np.array([force_n[i:j].min(initial=np.inf) for i, j in zip(since[0], before, strict=True)])
    most = np.array([force_n[i:j].max(initial=0.0) for i, j in zip(since[1], before, strict=True)])
    strongest = motors.max(axis=(1, 2))
    loaded, free = np.isfinite(least) & (least >= LOAD_N), most == 0
    rank = rank_correlation(np.interp(t_s - _LAG_S, at_s, force_n), motors.mean(axis=(1, 2)))
    counts = (loaded, loaded & (strongest >= FELT_PERCENT), free, free & (strongest > 0))
    n_loaded, n_felt, n_free, n_false = (int(some.sum()) for some in counts)
    return n_loaded, n_felt, n_free, n_false, float(rank)
