"""Fit one kind of model with scikit-learn, turn its effort into closure, judge it, and refit one to a day."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from datetime import UTC, datetime
from typing import Final, NamedTuple

import msgspec
import numpy as np
from numpy.typing import ArrayLike, NDArray

from tega.errors import CalibrationError, ShapeError
from tega_learn.block_features import Blocks
from tega_learn.model import BlockScorer, Model

RIDGE: Final = 2e-3
"""Strength of the ridge for each training block, on features in standard deviations."""
RIDGE_OF_TWO: Final = 0.5
"""The same where the target has two values alone, such as open and closed."""
TARGET_POWER: Final = 0.65
"""The linear part is fitted to closure^0.65: amplitude grows faster than force; the monotone stage takes it back."""
SUPPORTS: Final = 300
LEAST_NOVELTY: Final = 3.0
"""Standard deviations beyond the training data that are always let pass: another day, a stronger squeeze."""
LEAST_NOVELTY_OF_TWO: Final = 6.0
"""The same where the target has two values: a muscle under an electrode that saw none before."""
_FOLDS = 5


class EffortModel(NamedTuple):
    """Weights of a fitted model, one for each feature or support, and the efforts that they give.

    ``support`` are the rows that a kernel compares with, ``(supports, features)``, ``gamma`` is its width
    parameter; without a kernel they are empty and 0.
    """

    weights: NDArray[np.float64]
    bias: float
    support: NDArray[np.float64] = np.empty(0)
    gamma: float = 0.0

    def efforts(self, z: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the effort of each row of standardised features, ``(n, features)``."""
        if self.gamma:
            apart = ((z[:, np.newaxis] - self.support) ** 2).sum(axis=2)
            z = np.exp(-self.gamma * apart)
        found: NDArray[np.float64] = z @ self.weights + self.bias
        return found


Learner = Callable[[NDArray[np.float64], NDArray[np.float64]], EffortModel]
"""Fits a model to standardised features ``(n, features)`` and closure ``(n,)``."""


def fit_effort(z: NDArray[np.float64], y: NDArray[np.float64], *, model: str, strength: float) -> EffortModel:
    """Fit a "ridge", "huber" or "kernel"; ``strength`` is that of the first two, for each training block."""
    wanted = y**TARGET_POWER
    if model == "ridge":
        from sklearn.linear_model import Ridge

        line = Ridge(alpha=strength * len(y)).fit(z, wanted)
        return EffortModel(line.coef_, line.intercept_)
    if model == "huber":
        from sklearn.exceptions import ConvergenceWarning
        from sklearn.linear_model import HuberRegressor

        with warnings.catch_warnings():
            # It also warns where its line search cannot make the last digits any better.
            warnings.simplefilter("ignore", ConvergenceWarning)
            line = HuberRegressor(alpha=strength * len(y), max_iter=2000).fit(z, wanted)
        return EffortModel(line.coef_, line.intercept_)
    from sklearn.kernel_ridge import KernelRidge

    rows = np.unique(np.linspace(0, len(z) - 1, min(len(z), SUPPORTS)).round().astype(int))
    gamma = 0.25 / z.shape[1]
    bias = float(wanted.mean())
    kernel = KernelRidge(alpha=0.3, kernel="rbf", gamma=gamma).fit(z[rows], wanted[rows] - bias)
    return EffortModel(kernel.dual_coef_, bias, z[rows], gamma)


def rising_polyline(
    efforts: NDArray[np.float64], y: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the rising polyline from effort to closure: isotonic regression, its steps joined.

    Raises ``CalibrationError`` if effort does not rise with the target.
    """
    from sklearn.isotonic import IsotonicRegression

    found = IsotonicRegression(y_min=0.0, y_max=1.0, out_of_bounds="clip").fit(efforts, y)
    corners, values = found.X_thresholds_, np.clip(found.y_thresholds_, 0.0, 1.0)
    steps = [np.flatnonzero(values == value) for value in np.unique(values)]
    knots: list[tuple[float, float]] = []
    for number, step in enumerate(steps):
        low, high, value = float(corners[step[0]]), float(corners[step[-1]]), float(values[step[0]])
        if number == 0:
            knots += [(low, value), (high, value)]
        elif number == len(steps) - 1:
            knots.append((low, value))
        else:
            # A step of a cue says what its middle means, not that nothing lies between two steps.
            knots.append(((low + high) / 2.0, value))
    effort, first = np.unique([knot[0] for knot in knots], return_index=True)
    closure = np.array([knot[1] for knot in knots])[first]
    if len(effort) < 2 or closure[-1] == closure[0]:
        raise CalibrationError(
            "the decoder's effort does not rise with the target",
            "record again; see docs/evidence/emg-decoders.md",
        )
    return effort, closure


def judge_kept_back(
    learner: Learner, z: NDArray[np.float64], y: NDArray[np.float64]
) -> tuple[tuple[float, float, float, float, float], NDArray[np.float64]]:
    """Judge blocks in time by models that have not seen them: how often they are right, how far they lie outside."""
    closures, novelty = np.empty_like(y), np.empty_like(y)
    for part in np.array_split(np.arange(len(y)), _FOLDS):
        rest = np.setdiff1d(np.arange(len(y)), part)
        novelty[part] = np.maximum(z[rest].min(axis=0) - z[part], z[part] - z[rest].max(axis=0)).max(axis=1)
        if np.ptp(y[rest]) == 0:
            closures[part] = y[rest].mean()
            continue
        parts = learner(z[rest], y[rest])
        effort, closure = rising_polyline(parts.efforts(z[rest]), y[rest])
        closures[part] = np.interp(parts.efforts(z[part]), effort, closure)
    right = np.abs(closures - y) <= 0.25
    fifth = np.minimum((5 * closures).astype(int), 4)
    overall = float(right.mean())
    # Ten blocks' worth of the overall share steady a fifth that has few.
    a, b, c, d, e = (
        float((right[fifth == n].sum() + 10 * overall) / ((fifth == n).sum() + 10)) for n in range(5)
    )
    return (a, b, c, d, e), novelty


LEAST_S: Final = 5.0
STRENGTH: Final = 0.1
"""Ridge towards the old weights, for each block."""


def refitted(model: Model, samples: NDArray[np.float64], target: ArrayLike) -> Model:
    """Return the model moved to new samples, ``(n, channels)``, with a target for each, 0 to 1.

    Weights and bias move from the old ones by a ridge that penalises change. A gain is an offset of a
    logarithm, which goes into the bias. The known range grows by the new samples. The monotone stage is
    unchanged. Raises ``CalibrationError`` if the model is a kernel, or the samples are too short, or lack
    rest or effort.
    """
    goal = np.asarray(target, np.float64)
    if goal.shape != (len(samples),):
        raise ShapeError(
            f"target has shape {goal.shape}, samples {samples.shape}: one target a sample is needed"
        )
    if model.model == "kernel":
        raise CalibrationError("a kernel cannot be refitted in ten seconds", "fit it again with emg fit")
    if len(samples) < LEAST_S * model.rate_hz:
        raise CalibrationError(
            f"{len(samples) / model.rate_hz:.1f} s are too short to refit the decoder",
            "give about ten seconds",
        )
    blocks = Blocks(model.rate_hz, model.tau, model.kind, len(model.channels)).take(samples)
    y = np.clip(goal[: len(blocks) * model.tau].reshape(-1, model.tau).mean(axis=1), 0.0, 1.0)
    good = np.array([not block.bad.any() for block in blocks])
    if (y[good] < 0.25).mean() < 0.1 or (y[good] > 0.5).mean() < 0.1:
        raise CalibrationError(
            "rest or effort is missing", "half the time at rest, half with the hand closed"
        )
    scorer = BlockScorer(model)
    smoothed = np.array([scorer.smooth(block.samples) for block, ok in zip(blocks, good, strict=True) if ok])
    wanted = _effort_of(model, y[good])
    z = (smoothed - np.array(model.mean)) / np.array(model.scale)
    column = np.concatenate([z, np.ones((len(z), 1))], axis=1)
    strength = STRENGTH * len(z) * np.eye(column.shape[1])
    strength[-1, -1] = 1e-6 * len(z)
    prior = np.append(model.weights, model.bias)
    moved = np.linalg.solve(column.T @ column + strength, column.T @ (wanted - column @ prior))
    *weights, bias = (prior + moved).tolist()
    return msgspec.structs.replace(
        model,
        weights=tuple(weights),
        bias=bias,
        lowest=tuple(np.minimum(model.lowest, z.min(axis=0)).tolist()),
        highest=tuple(np.maximum(model.highest, z.max(axis=0)).tolist()),
        recalibrated=datetime.now(UTC).replace(microsecond=0),
    )


def _effort_of(model: Model, closure: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the effort at which the monotone stage gives a closure: the middle of those that do."""
    efforts, closures = np.array(model.knots_effort), np.array(model.knots_closure)
    low = efforts[np.searchsorted(closures, closure, side="left").clip(0, len(efforts) - 1)]
    high = efforts[(np.searchsorted(closures, closure, side="right") - 1).clip(0, len(efforts) - 1)]
    middle: NDArray[np.float64] = (low + high) / 2.0
    return middle
