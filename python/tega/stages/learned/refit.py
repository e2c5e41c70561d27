"""Fit a learned decoder to the day by ten seconds of rest and effort, after the electrodes were put on again."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Final

import msgspec
import numpy as np
from numpy.typing import ArrayLike, NDArray

from tega.errors import CalibrationError, ShapeError
from tega.stages.learned.features import Blocks
from tega.stages.learned.model import BlockScorer, Model

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
    old_mean, old_scale = np.array(model.mean), np.array(model.scale)
    weights = np.array(model.weights)
    z = (smoothed - old_mean) / old_scale
    column = np.concatenate([z, np.ones((len(z), 1))], axis=1)
    strength = STRENGTH * len(z) * np.eye(column.shape[1])
    strength[-1, -1] = 1e-6 * len(z)
    prior = np.append(weights, model.bias)
    moved = np.linalg.solve(column.T @ column + strength, column.T @ (wanted - column @ prior))
    new = prior + moved
    return msgspec.structs.replace(
        model,
        weights=tuple(float(w) for w in new[:-1]),
        bias=float(new[-1]),
        lowest=tuple(float(v) for v in np.minimum(model.lowest, z.min(axis=0))),
        highest=tuple(float(v) for v in np.maximum(model.highest, z.max(axis=0))),
        recalibrated=datetime.now(UTC).replace(microsecond=0),
    )


def _effort_of(model: Model, closure: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the effort at which the monotone stage gives a closure: the middle of those that do."""
    efforts, closures = np.array(model.knots_effort), np.array(model.knots_closure)
    low = efforts[np.searchsorted(closures, closure, side="left").clip(0, len(efforts) - 1)]
    high = efforts[(np.searchsorted(closures, closure, side="right") - 1).clip(0, len(efforts) - 1)]
    middle: NDArray[np.float64] = (low + high) / 2.0
    return middle
