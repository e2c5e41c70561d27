"""Recalibrate muscles in ten seconds: five of rest, five of a fist, for the maxima and a learned model."""

from __future__ import annotations

from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega.config import SessionConfig
from tega.config.choose import chosen_stage
from tega.devices.base import EmgChunk
from tega.devices.registry import driver_class
from tega.errors import CalibrationError, ConfigError
from tega.setup.calibration.refresh import kept_record, to_todays_scale
from tega.setup.calibration.steps_emg import MuscleSteps
from tega.setup.calibration.times import Sitting
from tega.stages.learned.learned import LearnedDecoder
from tega.stages.learned.stage import LearnedOptions

HALF_S: Final = 5.0
"""Rest takes so long, and so does effort."""
# The rise of an effort is not yet the closure that was asked for.
_RISE_S = 0.5
# Electrodes that moved give other amplitudes: of 54 shifts simulated on recordings none left this range, and a third
# left that of a refresh (docs/evidence/emg-decoders.md). Beyond it a channel is loose, or not on a muscle that closes.
_LIMITS = (0.25, 4.0)
# The least that a recalibrated model has to make of the very samples that it was fitted to.
_REST_MOST, _EFFORT_LEAST = 0.25, 0.5


class Recalibrated(NamedTuple):
    """Files that a recalibration wrote: the record and, with a learned decoder, the model fitted to today."""

    record: Path
    model: Path | None


def recalibrate(sitting: Sitting, model_out: Path | None = None) -> Recalibrated:
    """Put a calibrated person's muscles and a learned model to today's scale; write nothing unless all fits.

    The decoder of the settings decides whether there is a model; the sitting's rest and squeeze last
    :data:`HALF_S` each. Without ``model_out`` the new model is a file beside the old one, with the time in
    its name. Raises ``ConfigError`` if the settings have no EMG, a learned decoder names no model, or there
    is no model to write; ``CalibrationError`` if the person is not calibrated on this source, the model is of
    other muscles or a kernel, or rest or effort cannot be used.
    """
    config, person, folder, guide, times, now = sitting
    if config.emg is None:
        raise ConfigError(
            "nothing to recalibrate: the settings have no [emg]", "add it; see docs/device-emg.md"
        )
    model = _model_of(config)
    if model is None and model_out is not None:
        raise ConfigError(
            "there is no model to write: the settings' decoder is not learned",
            'leave out --out, or set stages.decoder.name = "learned" and its model',
        )
    with driver_class(config.emg.driver, "emg")(config.emg.options) as source:
        record, chain = kept_record(sitting, config.emg, source)
        if model is not None:
            model.decoder.model.check_fits(
                kind=chain.kind,
                rate_hz=chain.rate_hz,
                channels=chain.channels,
                name=model.file.name,
                person=person,
            )
        guide.part("Recalibrate", "Five seconds of rest, then one fist of five seconds. Ten seconds.")
        steps = MuscleSteps(source, chain, guide, times)
        quiet = steps.rest()
        rested = steps.received
        maxima = steps.squeezes(quiet, n=1)
    new = to_todays_scale(record, quiet, maxima, _LIMITS, sitting)
    if model is None:
        return Recalibrated(folder.keep(new), None)
    effort = _samples(steps.received)[round(_RISE_S * chain.rate_hz) :]
    fitted = _fitted(model, _samples(rested), effort)
    written = model_out or model.file.with_name(f"{model.file.stem}-{now():%Y%m%d-%H%M%S}{model.file.suffix}")
    fitted.save(written)
    return Recalibrated(folder.keep(new), written)


class _Named(NamedTuple):
    """A model and its file."""

    file: Path
    decoder: LearnedDecoder


def _model_of(config: SessionConfig) -> _Named | None:
    """Return the model that the settings' decoder uses."""
    options = chosen_stage("decoder", config.stages, config.session.preset).options
    if not isinstance(options, LearnedOptions):
        return None
    if options.model is None:
        raise ConfigError("decoder 'learned' names no model", "set stages.decoder.options.model to its file")
    decoder = LearnedDecoder.load(options.model)
    if decoder.model.model == "kernel":
        raise CalibrationError(
            f"{options.model.name}: a kernel cannot be refitted in ten seconds",
            "practise for a minute, then fit it again: tega-teleop emg fit",
        )
    return _Named(options.model, decoder)


def _fitted(model: _Named, rest: NDArray[np.float64], effort: NDArray[np.float64]) -> LearnedDecoder:
    """Return the model fitted to rest and effort, if it then distinguishes them."""
    target = np.repeat([0.0, 1.0], [len(rest), len(effort)])
    fitted = model.decoder.recalibrated(np.concatenate([rest, effort]), target)
    at_rest, at_work = (float(np.median(LearnedDecoder(fitted.model).process(s))) for s in (rest, effort))
    if at_rest > _REST_MOST or at_work < _EFFORT_LEAST:
        raise CalibrationError(
            f"{model.file.name}: fitted to today it makes closure {at_rest:.2f} of rest and {at_work:.2f} of effort, "
            f"at most {_REST_MOST:g} and at least {_EFFORT_LEAST:g} are needed",
            "practise for a minute, then fit a new one: tega-teleop practice, tega-teleop emg fit",
        )
    return fitted


def _samples(chunks: list[EmgChunk]) -> NDArray[np.float64]:
    return np.concatenate([chunk.samples for chunk in chunks])
