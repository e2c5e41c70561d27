"""Keep a learned decoder's model as a file, JSON that is checked and never run, and turn a block into its effort."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path
from typing import Annotated, Final, Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.errors import CalibrationError
from tega.runtime.files.foreign_file import parse_json, read_foreign
from tega_learn.block_features import AR_ORDER, amplitude_values, block_features, n_values

_Finite = Annotated[float, msgspec.Meta(ge=-1e300, le=1e300)]
_Positive = Annotated[float, msgspec.Meta(gt=0, le=1e300)]
_Share = Annotated[float, msgspec.Meta(ge=0, le=1)]
_MOST_MIB = 16
_LEAST_NOVELTY = 1e-3
REJECTED: Final = tuple(percent / 100 for percent in range(21))
"""Shares of the training blocks for which a model stores the novelty."""


class Model(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A learned decoder: its features, its weights, and the facts of its training.

    With f the block's features (amplitudes as ln(v + floor)), s each of them smoothed with every time constant, and
    z = (s - mean) / scale: the effort is weights·z + bias, or for ``kernel`` the sum of
    weight·exp(-gamma |z - support|²) + bias; the closure is the effort through the rising polyline of knots, and 0
    below ``dead_band``.

    Attributes:
        kind: ``raw``, ``rectified`` or ``envelope``.
        rate_hz: Samples per second.
        tau: Samples per block.
        channels: Names of the channels, in order.
        person: Person with these muscles; ``""`` if unknown.
        made: Time of its training.
        model: ``ridge``, ``huber`` or ``kernel``.
        features: Names of the features.
        smoothing_s: Time constants of the causal smoothing, s.
        floor: Amplitude at rest, one for each amplitude value, in the unit of the samples.
        mean: Mean of the smoothed features.
        scale: Their standard deviation.
        lowest: Their smallest in training, in standard deviations.
        highest: Their largest.
        weights: Weights of the features, or of the supports.
        bias: Bias of the effort.
        support: Supports of a kernel, row by row; empty without one.
        gamma: Width parameter of a kernel; 0 without one.
        knots_effort: Efforts of the monotone stage, rising.
        knots_closure: Its closures, not falling.
        dead_band: Below it the closure is 0.
        hold_beyond: Novelty, standard deviations, beyond which the closure is held.
        novelty: Beyond these lay 0, 1, ... 20 % of the training blocks, each compared with the others' range; empty in
            models before 0.2.
        confidence: Share of training blocks, kept back in turn, that came within one level, by fifths of closure.
        channel_full: Mean absolute value of each channel at strong effort, for display.
        lag_s: Delay of the target behind the muscles.
        full: Value of the target that is full closure.
        data_sha256: Hash of the training data.
        duration_s: Length of the training data.
        versions: Versions of the packages that it was made with.
        recalibrated: Time of the last refit to a day; ``None`` for never.
        format: Always ``tega-decoder``.
        version: Version of the file format.
    """

    kind: Literal["raw", "rectified", "envelope"]
    rate_hz: _Positive
    tau: Annotated[int, msgspec.Meta(ge=4, le=10_000_000)]
    channels: tuple[str, ...]
    person: str = ""
    made: datetime
    model: Literal["ridge", "huber", "kernel"]
    features: tuple[Literal["MAV", "WL", "ZC", "SSC", "LOGVAR", "AR"], ...]
    smoothing_s: tuple[_Positive, ...]
    floor: tuple[_Positive, ...]
    mean: tuple[_Finite, ...]
    scale: tuple[_Positive, ...]
    lowest: tuple[_Finite, ...]
    highest: tuple[_Finite, ...]
    weights: tuple[_Finite, ...]
    bias: _Finite
    support: tuple[tuple[_Finite, ...], ...] = ()
    gamma: Annotated[float, msgspec.Meta(ge=0, le=1e300)] = 0.0
    knots_effort: tuple[_Finite, ...]
    knots_closure: tuple[_Share, ...]
    dead_band: _Share
    hold_beyond: _Positive
    novelty: tuple[_Finite, ...] = ()
    confidence: tuple[_Share, _Share, _Share, _Share, _Share]
    channel_full: tuple[_Positive, ...]
    lag_s: _Finite
    full: _Positive
    data_sha256: str
    duration_s: _Positive
    versions: dict[str, str]
    recalibrated: datetime | None = None
    format: Literal["tega-decoder"] = "tega-decoder"
    version: Literal[1] = 1

    def check_whole(self, name: str) -> None:
        """Refuse lists of another length than the features need, and knots that do not rise: ``CalibrationError``."""
        channels = len(self.channels)
        values = n_values(self.features, channels) * len(self.smoothing_s)
        amplitudes = int(amplitude_values(self.features, channels).sum())
        lengths = {
            "floor": (len(self.floor), amplitudes),
            "channel_full": (len(self.channel_full), channels),
            "knots_closure": (len(self.knots_closure), len(self.knots_effort)),
            "novelty": (len(self.novelty) or len(REJECTED), len(REJECTED)),
            "weights": (len(self.weights), len(self.support) if self.model == "kernel" else values),
        }
        lengths |= {f: (len(getattr(self, f)), values) for f in ("mean", "scale", "lowest", "highest")}
        lengths |= {f"support[{i}]": (len(row), values) for i, row in enumerate(self.support)}
        for subject, (found, wanted) in lengths.items():
            if found != wanted or not wanted:
                raise CalibrationError(f"{name}: {subject} has {found} numbers, {wanted} are needed", _AGAIN)
        if (np.diff(self.knots_effort) <= 0).any() or (np.diff(self.knots_closure) < 0).any():
            raise CalibrationError(f"{name}: its monotone stage does not rise", _AGAIN)

    def rejecting(self, share: float, name: str) -> Model:
        """Return the model that holds this share of blocks like those of its training, 0 to 0.2.

        ``CalibrationError`` for a model of before models stored the novelty of their training blocks.
        """
        if not self.novelty:
            raise CalibrationError(f"{name}: does not know which share of blocks it would hold", _AGAIN)
        beyond = float(np.interp(share, REJECTED, self.novelty))
        return msgspec.structs.replace(self, hold_beyond=max(beyond, _LEAST_NOVELTY))

    def check_fits(
        self, *, kind: str, rate_hz: float, channels: tuple[str, ...], name: str, person: str = ""
    ) -> None:
        """Refuse a source or a person that the model was not made for; ``CalibrationError`` says what differs."""
        for subject, made, found in (
            ("kind", self.kind, kind),
            ("channels", ", ".join(self.channels), ", ".join(channels)),
            ("person", self.person or person, person or self.person),
        ):
            if made != found:
                raise CalibrationError(f"{name}: made for {subject} {made!r}, the run has {found!r}", _AGAIN)
        if abs(rate_hz / self.rate_hz - 1) > _RATE_SHARE:
            raise CalibrationError(
                f"{name}: made for {self.rate_hz:g} samples/s, the source gives {rate_hz:g}", _AGAIN
            )


_AGAIN = "fit one on this source: tega-teleop emg fit"
_RATE_SHARE = 0.01
assert AR_ORDER == 4  # what `version` 1 of the format means


def save_model(model: Model, path: Path) -> None:
    """Write a model as JSON, a key a line."""
    path.write_bytes(msgspec.json.format(msgspec.json.encode(model), indent=1) + b"\n")


def load_model(path: Path) -> Model:
    """Read a model; ``CalibrationError`` if the file is missing, damaged or inconsistent."""
    try:
        data = read_foreign(path, most_mib=_MOST_MIB, error=CalibrationError)
    except OSError as error:
        raise CalibrationError(
            f"{path.name}: cannot be read: {error.strerror or error}", f"looked for {path}"
        ) from error
    try:
        model = parse_json(data, Model)
    except msgspec.DecodeError as error:
        raise CalibrationError(f"{path.name}: no decoder's model: {error}", _AGAIN) from error
    model.check_whole(path.name)
    return model


class Smoother:
    """Smooths the values of blocks causally with every time constant, seconds, from the first block on."""

    def __init__(self, smoothing_s: tuple[float, ...], block_s: float) -> None:
        self._gains = -np.expm1(-block_s / np.array(smoothing_s))[:, np.newaxis]
        self._state: NDArray[np.float64] | None = None

    def take(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the smoothed values of the next block, time constant by time constant."""
        if self._state is None:
            self._state = np.repeat(values[np.newaxis], len(self._gains), axis=0)
        self._state = self._state + self._gains * (values - self._state)
        return self._state.ravel()


class BlockScorer:
    """Turns a block's features into smoothed, scaled values and an effort; keeps the smoothing's state.

    ``newest`` are the last block's features: the smoothed ones' limit if the muscles stayed the same.
    """

    def __init__(self, model: Model) -> None:
        self._amplitude = amplitude_values(model.features, len(model.channels))
        self._floor = np.array(model.floor)
        self._smoother = Smoother(model.smoothing_s, model.tau / model.rate_hz)
        self._n_smoothed = len(model.smoothing_s)
        self.newest: NDArray[np.float64] = np.empty(0)
        self._features, self._bias, self._gamma = model.features, model.bias, model.gamma
        self._mean, self._scale = np.array(model.mean), np.array(model.scale)
        self._weights, self._support = np.array(model.weights), np.array(model.support)

    def smooth(self, samples: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the smoothed features of the next block, as the model was trained on them."""
        values = block_features(samples, self._features)
        if len(self._floor):
            values[self._amplitude] = np.log(values[self._amplitude] + self._floor)
        self.newest = np.tile(values, self._n_smoothed)
        return self._smoother.take(values)

    def scaled(self, smoothed: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return them in standard deviations."""
        z: NDArray[np.float64] = (smoothed - self._mean) / self._scale
        return z

    def effort(self, z: NDArray[np.float64]) -> float:
        """Return the effort. Sums instead of products of matrices: those may differ from machine to machine."""
        if self._gamma:
            apart = self._support - z
            z = np.exp(-self._gamma * np.add.reduce(apart * apart, axis=1))
        return float(np.add.reduce(self._weights * z)) + self._bias
