"""Fit a decoder to EMG and a target closure or a measured force; needs scikit-learn, the extra ``learn``."""

from __future__ import annotations

import hashlib
import platform
from collections.abc import Sequence
from datetime import UTC, datetime
from functools import partial
from importlib.metadata import version
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tega import __version__
from tega.emg import InputKind
from tega.errors import CalibrationError, InvalidValueError, ShapeError
from tega.runtime.lifecycle import require
from tega_learn.block_features import FEATURES, Blocks, amplitude_values, as_samples, block_features
from tega_learn.learned import LearnedDecoder
from tega_learn.learners import (
    LEAST_NOVELTY,
    LEAST_NOVELTY_OF_TWO,
    RIDGE,
    RIDGE_OF_TWO,
    TARGET_POWER,
    fit_effort,
    judge_kept_back,
    rising_polyline,
)
from tega_learn.model import REJECTED, Model, Smoother

DEFAULT_FEATURES: Final = ("MAV", "LOGVAR")
SMOOTHING_S: Final = (0.15, 0.4)
SMOOTHING_OF_TWO_S: Final = (0.05,)
"""Time constants for a target of two values, which lie far apart and need little smoothing."""
FLOOR_PERCENTILE: Final = 12.0
FULL_PERCENTILE: Final = 98.0
DEAD_BAND: Final = 0.03
HELD_SHARE: Final = 0.01
LEAST_S: Final = 10.0
CLIPPED_SHARE: Final = 0.05
LEAST_SHARE: Final = 0.05
LEAST_R2: Final = 0.2
_EARLIEST_S, _LATEST_S = -1.0, 0.5


def fit(
    emg: ArrayLike,
    target: ArrayLike,
    *,
    rate_hz: float,
    tau: int,
    kind: InputKind = "raw",
    features: Sequence[str] = DEFAULT_FEATURES,
    model: Literal["ridge", "huber", "kernel"] = "ridge",
    full: float | None = None,
    channels: Sequence[str] = (),
    person: str = "",
) -> LearnedDecoder:
    """Fit a decoder of closure.

    The target may come before the muscles (a cue that is followed late) or after them (a force): the shift at which
    the block's features explain it best is found first, -1 to 0.5 s, and taken out.

    A target of two values alone, such as open and closed, teaches no levels, and often comes of one place of the
    electrodes. Such a model is smoothed less, and held near the mean difference of both by a strong ridge on one
    scale for all channels, so that it bears other gains, places and noise than it has seen.

    A run holds blocks that lie farther outside than a hundredth of the training's, each compared with the others'
    range, but none within three standard deviations of the training data, six of two values.

    Args:
        emg: Samples ``(n, channels)``, any unit, finite.
        target: Closure or force at each sample, ``(n,)``; 0 is open.
        rate_hz: Samples per second.
        tau: Samples per block.
        kind: "raw", "rectified" or "envelope".
        features: Names out of :data:`tega.decoders.FEATURES`.
        model: "ridge", "huber" (unmoved by bursts in the target), or "kernel" (ridge with radial functions).
        full: Target that is full closure; ``None``: its 98th percentile.
        channels: Their names; ``ch1``, ``ch2`` … where left out.
        person: Code of the person with these muscles.

    Returns:
        The decoder, at its start.

    Raises:
        CalibrationError: The data has one class, is clipped, too short, not finite, or does not go with the target.
        ShapeError: There is not a target for every sample.
        InvalidValueError: An option cannot be used.
        MissingExtraError: scikit-learn is not installed.
    """
    samples = as_samples(emg, None)
    goal = np.asarray(target, np.float64)
    names = tuple(channels) or tuple(f"ch{n + 1}" for n in range(samples.shape[1]))
    wanted = tuple(dict.fromkeys(features))
    _check_options(rate_hz, tau, kind, wanted, names, samples.shape[1], model)
    closure, scale = _checked_target(samples, goal, rate_hz, full)
    two_classes = len(np.unique(closure)) == 2
    require("sklearn", driver="emg fit", extra="learn")
    learner = partial(fit_effort, model=model, strength=RIDGE_OF_TWO if two_classes else RIDGE)
    block_s = tau / rate_hz
    blocks = Blocks(rate_hz, tau, kind, samples.shape[1]).take(samples)
    if any(block.bad.any() for block in blocks):
        _refuse_still(blocks, names)
    values = np.array([block_features(block.samples, wanted) for block in blocks])
    loud = amplitude_values(wanted, samples.shape[1])
    floors = np.percentile(values[:, loud], FLOOR_PERCENTILE, axis=0)
    floors = np.maximum(floors, np.maximum(values[:, loud].max(axis=0) * 1e-6, 1e-300))
    values[:, loud] = np.log(values[:, loud] + floors)
    y = closure[: len(blocks) * tau].reshape(-1, tau).mean(axis=1)
    lag = _lag(values, y**TARGET_POWER, block_s)
    smoothing_s = SMOOTHING_OF_TWO_S if two_classes else SMOOTHING_S
    smoother = Smoother(smoothing_s, block_s)
    x, y = _shifted(np.array([smoother.take(row) for row in values]), y, lag)
    mean, sd = x.mean(axis=0), x.std(axis=0)
    sd = np.where(sd > 0, sd, 1.0)
    if two_classes:
        # One for all channels of an amplitude: a quiet channel is not made loud.
        of_each = sd[np.tile(loud, len(smoothing_s))].reshape(-1, samples.shape[1])
        sd[np.tile(loud, len(smoothing_s))] = np.sqrt((of_each**2).mean(axis=1)).repeat(samples.shape[1])
    z = (x - mean) / sd
    parts = learner(z, y)
    efforts = parts.efforts(z)
    knots_effort, knots_closure = rising_polyline(efforts, y)
    confidence, novelty = judge_kept_back(learner, z, y)
    least = LEAST_NOVELTY_OF_TWO if two_classes else LEAST_NOVELTY
    hold_beyond = max(least, float(np.quantile(novelty, 1.0 - HELD_SHARE)))
    mav = np.array([np.abs(block.samples).mean(axis=0) for block in blocks])
    found = Model(
        kind=kind,
        rate_hz=float(rate_hz),
        tau=tau,
        channels=names,
        person=person,
        made=datetime.now(UTC).replace(microsecond=0),
        model=model,
        features=wanted,  # type: ignore[arg-type]  # checked above
        smoothing_s=smoothing_s,
        floor=_tuple(floors),
        mean=_tuple(mean),
        scale=_tuple(sd),
        lowest=_tuple(z.min(axis=0)),
        highest=_tuple(z.max(axis=0)),
        weights=_tuple(parts.weights),
        bias=float(parts.bias),
        support=tuple(_tuple(row) for row in parts.support),
        gamma=parts.gamma,
        knots_effort=_tuple(knots_effort),
        knots_closure=_tuple(knots_closure),
        dead_band=DEAD_BAND,
        hold_beyond=hold_beyond,
        novelty=_tuple(np.quantile(novelty, 1.0 - np.array(REJECTED))),
        confidence=confidence,
        channel_full=_tuple(np.maximum(np.percentile(mav, 98, axis=0), 1e-12)),
        lag_s=lag * block_s,
        full=scale,
        data_sha256=hashlib.sha256(samples.tobytes() + goal.tobytes()).hexdigest(),
        duration_s=len(samples) / rate_hz,
        versions={
            "tega": __version__,
            "scikit-learn": version("scikit-learn"),
            "numpy": np.__version__,
            "python": platform.python_version(),
        },
    )
    return LearnedDecoder(found)


def _check_options(  # noqa: PLR0917  # in the order of fit
    rate_hz: float,
    tau: int,
    kind: str,
    features: tuple[str, ...],
    names: tuple[str, ...],
    n_channels: int,
    model: str,
) -> None:
    if not features or not set(FEATURES).issuperset(features):
        raise InvalidValueError(f"features = {features!r}", f"choose among {', '.join(FEATURES)}")
    if model not in {"ridge", "huber", "kernel"}:
        raise InvalidValueError(f"model = {model!r} is not known", "choose ridge, huber or kernel")
    if not (np.isfinite(rate_hz) and rate_hz > 0) or tau < 4:
        raise InvalidValueError(
            f"rate_hz = {rate_hz!r}, tau = {tau!r}", "give samples per second, and at least 4 samples a block"
        )
    if kind == "raw" and rate_hz <= 100:
        raise InvalidValueError(
            f"rate_hz = {rate_hz:g} is too low for raw EMG", "use 200 samples/s or more, or an envelope"
        )
    if len(names) != n_channels or len(set(names)) != n_channels:
        raise ShapeError(
            f"channels = {names!r} for {n_channels} columns", "give each column a name of its own"
        )


def _checked_target(
    samples: NDArray[np.float64], goal: NDArray[np.float64], rate_hz: float, full: float | None
) -> tuple[NDArray[np.float64], float]:
    """Return the target as closure, and its full value; refuse data that cannot be learned from."""
    if goal.ndim != 1 or len(goal) != len(samples):
        raise ShapeError(
            f"target has shape {goal.shape}, samples {samples.shape}: one target a sample is needed",
            "put both on one clock first",
        )
    if len(samples) < LEAST_S * rate_hz:
        raise CalibrationError(
            f"training data of {len(samples) / rate_hz:.1f} s is too short",
            f"record {LEAST_S:g} s at least, with rest and full effort in it; 30 s is good",
        )
    if not (np.isfinite(samples).all() and np.isfinite(goal).all()):
        n = int((~np.isfinite(samples)).sum() + (~np.isfinite(goal)).sum())
        raise CalibrationError(f"training data holds {n} samples that are no numbers", "cut that part out")
    for column in range(samples.shape[1]):
        signal = samples[:, column]
        if np.ptp(signal) == 0:
            raise CalibrationError(
                f"channel {column + 1} never moves", "look at its electrode, or leave it out"
            )
        at_top, at_bottom = (float((signal == end).mean()) for end in (signal.max(), signal.min()))
        clipped = max(at_top, at_bottom)
        rests_there = signal.min() == 0 and at_top <= CLIPPED_SHARE  # as an envelope does, at 0
        if clipped > CLIPPED_SHARE and len(np.unique(signal)) > 2 and not rests_there:
            raise CalibrationError(
                f"channel {column + 1} is clipped in {100 * clipped:.0f} % of its samples",
                "lower the amplifier's gain and record again",
            )
    scale = float(np.percentile(goal, FULL_PERCENTILE)) if full is None else full
    if not scale > 0:
        raise CalibrationError(
            f"target has one class: {FULL_PERCENTILE:g} % of it is {scale:g} or less",
            "record rest and effort; 0 is open",
        )
    closure = np.clip(goal / scale, 0.0, 1.0)
    for subject, share in (("rest", (closure < 0.25).mean()), ("effort", (closure > 0.5).mean())):
        if share < LEAST_SHARE:
            raise CalibrationError(
                f"target has one class: {100 * share:.0f} % of the time is {subject}",
                f"record at least {100 * LEAST_SHARE:.0f} % of the time at {subject}",
            )
    return closure, scale


def _refuse_still(blocks: list[Any], names: tuple[str, ...]) -> None:
    share = np.mean([block.bad for block in blocks], axis=0)
    worst = int(share.argmax())
    if share[worst] > CLIPPED_SHARE:
        raise CalibrationError(
            f"channel {names[worst]} stands still in {100 * share[worst]:.0f} % of the blocks",
            "look at its electrode: it is off, or at the amplifier's limit",
        )


def _shifted(
    x: NDArray[np.float64], y: NDArray[np.float64], lag: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the rows that belong together where the target comes ``lag`` blocks later than the muscles."""
    if lag > 0:
        return x[:-lag], y[lag:]
    return (x[-lag:], y[:lag]) if lag < 0 else (x, y)


def _lag(values: NDArray[np.float64], y: NDArray[np.float64], block_s: float) -> int:
    """Find how many blocks later than the muscles the target comes."""
    from sklearn.linear_model import Ridge

    lags = range(round(_EARLIEST_S / block_s), round(_LATEST_S / block_s) + 1)
    explained = []
    for lag in lags:
        x, wanted = _shifted(values, y, lag)
        sd = x.std(axis=0)
        z = (x - x.mean(axis=0)) / np.where(sd > 0, sd, 1.0)
        line = Ridge(alpha=RIDGE * len(wanted)).fit(z, wanted)
        left = float((wanted - line.predict(z)).var())
        explained.append(1.0 - left / float(wanted.var()) if wanted.var() > 1e-9 else 0.0)
    best = int(np.argmax(explained))
    if explained[best] < LEAST_R2:
        raise CalibrationError(
            f"EMG and target do not go together: {100 * max(explained[best], 0):.0f} % of the target is explained at "
            "the best shift",
            "check that both are on one clock, and which channels are the muscles'",
        )
    return lags[best]


def _tuple(values: NDArray[np.float64]) -> tuple[float, ...]:
    return tuple(values.tolist())
