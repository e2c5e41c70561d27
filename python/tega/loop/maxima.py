"""Derive maxima from the whole recording, the fallback of a run without a calibration, which is then not causal."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.config.calibration import EmgMaxima, TouchMaxima
from tega.devices.base import EmgSource
from tega.emg import channel_maxima
from tega.emg.levels import hold_last
from tega.errors import CalibrationError, ConfigError
from tega.loop.inbox.reader import READ_TIMEOUT_S
from tega.records import Contact

SELF_CALIBRATED = "estimated from the whole input, so these results cannot be reproduced live"

TAU_S = 0.1
"""Length of an EMG block where no decoder says otherwise: 100 ms, as the presets have it."""

TOUCH_PERCENTILE = 99.5
"""One spike must not deaden the vest: the maximum is this percentile of the frames in contact."""

HEADROOM = 1.3
"""A hold may dent the gel more widely than a flat board in a guided press does; it shall still be felt to grow."""

LEAST_CONTACT_PX = 30
"""A CCI from fewer pixels than this says nothing about how sharp a press can be."""

EMG_PERCENTILE = {"paper": 100.0, "live": 95.0}
"""Which percentile of the block means counts as the maximum, by preset."""


def touch_maxima(contacts: Sequence[Contact]) -> TouchMaxima:
    """Derive a finger's maxima: 99.5 percentiles over the frames in contact, CCI from those of at least 30 pixels."""
    touching = [contact for contact in contacts if contact.in_contact]
    return TouchMaxima(
        cci_max=_percentile([c.cci for c in touching if c.eda >= LEAST_CONTACT_PX]),
        eda_max=_percentile([float(c.eda) for c in touching]),
    )


def guided_maxima(contacts: Sequence[Contact]) -> TouchMaxima:
    """Derive maxima from guided presses, round and flat: :func:`touch_maxima`, EDA times :data:`HEADROOM`."""
    full = touch_maxima(contacts)
    return full if full.eda_max is None else msgspec.structs.replace(full, eda_max=HEADROOM * full.eda_max)


def _percentile(values: Sequence[float]) -> float | None:
    if not values:
        return None
    maximum = float(np.percentile(values, TOUCH_PERCENTILE))
    return maximum if maximum > 0 else None


def block_length(rate_hz: float, block_s: float = TAU_S) -> int:
    """Return the samples of a block; ``ConfigError`` if the rate is too low for a block to hold one."""
    tau = round(block_s * rate_hz)
    if tau < 1:
        raise ConfigError(
            f"EMG rate_hz = {rate_hz:g}: a block of {block_s * 1000:g} ms holds no sample",
            "give the samples per second of one channel",
        )
    return tau


def emg_conditions(
    source: EmgSource, kind: Literal["raw", "rectified", "envelope"], *, block_s: float = TAU_S
) -> EmgMaxima:
    """Describe an EMG source as far as a calibration depends on it; the maxima are left empty."""
    info = source.info
    if info.rate_hz is None:
        raise ConfigError(f"EMG source {info.label!r} states no rate", "set rate_hz in its options")
    return EmgMaxima(
        kind=kind,
        rate_hz=info.rate_hz,
        tau=block_length(info.rate_hz, block_s),
        channels=info.channels,
        maxima=(),
    )


def emg_maxima(source: EmgSource, conditions: EmgMaxima, *, preset: Literal["paper", "live"]) -> EmgMaxima:
    """Derive the channels' maxima from a whole open recording, which is left at its beginning.

    ``conditions`` (:func:`emg_conditions`) are returned with the maxima. ``CalibrationError`` if a channel never moves,
    or the recording is shorter than one block.
    """
    chunks = []
    while not source.ended:
        if (chunk := source.read(READ_TIMEOUT_S)) is not None:
            chunks.append(chunk.samples)
    samples = held_samples(np.concatenate(chunks or [np.empty((0, len(source.info.channels)))]))
    source.open()
    try:
        maxima = channel_maxima(
            samples,
            conditions.rate_hz,
            tau=conditions.tau,
            kind=conditions.kind,
            percentile=EMG_PERCENTILE[preset],
        )
    except CalibrationError as error:
        text = f"EMG {source.info.label}, channels {', '.join(conditions.channels)}: {error.message}"
        raise CalibrationError(text, error.hint) from error
    return msgspec.structs.replace(conditions, maxima=tuple(float(m) for m in maxima))


def held_samples(samples: NDArray[np.float64]) -> NDArray[np.float64]:
    """Let a sample that is no number keep the value before it, as the running chain does."""
    good = np.isfinite(samples)
    if good.all():
        return samples
    first_good = np.take_along_axis(samples, good.argmax(axis=0)[np.newaxis], axis=0)
    return hold_last(samples, good, first_good[0])[0][1:]
