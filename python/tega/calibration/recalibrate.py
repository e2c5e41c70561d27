"""Recalibrate muscles in ten seconds: five at rest, five with the hand closed, for the maxima or a learned model."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from typing import TYPE_CHECKING, Final, NamedTuple, cast

import numpy as np

from tega.calibration.refresh import kept_record, to_todays_scale
from tega.calibration.steps_emg import take_rest, take_squeezes
from tega.decoders.learned import LearnedDecoder
from tega.decoders.stage import LearnedOptions
from tega.devices.registry import driver_class
from tega.errors import CalibrationError, ConfigError
from tega.stages.choose import chosen_stage

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from tega.calibration.folder import CalibrationFolder
    from tega.calibration.guide import Guide
    from tega.calibration.times import Times
    from tega.config import SessionConfig
    from tega.devices.base import EmgChunk, EmgSource

HALF_S: Final = 5.0
"""Rest takes so long, and so does effort."""
# The rise of an effort is not yet the closure that was asked for.
_RISE_S = 0.5


class Recalibrated(NamedTuple):
    """Files that a recalibration wrote.

    Attributes:
        record: Of the person's muscles, with today's rest and maxima.
        model: Of the learned decoder, fitted to today; ``None`` where the settings' decoder needs none.
    """

    record: Path
    model: Path | None


class _Heard:
    """Keeps the chunks of a source while a step reads it; all else is the source's own."""

    def __init__(self, source: EmgSource) -> None:
        self._source = source
        self.chunks: list[EmgChunk] = []

    def read(self, timeout_s: float) -> EmgChunk | None:
        chunk = self._source.read(timeout_s)
        if timeout_s == 0 and chunk is None:
            self.chunks = []  # what came before the step was thrown away
        if chunk is not None:
            self.chunks.append(chunk)
        return chunk

    def __getattr__(self, name: str) -> object:
        return getattr(self._source, name)


def recalibrate(
    config: SessionConfig,
    person: str,
    folder: CalibrationFolder,
    guide: Guide,
    *,
    times: Times,
    now: datetime,
    model_out: Path | None = None,
) -> Recalibrated:
    """Put a calibrated person's muscles to today's scale, and a learned model too.

    Args:
        config: The settings; their decoder says whether there is a model.
        person: Whose calibration.
        folder: Where it is kept.
        guide: Shows and asks.
        times: How long things take; rest and squeeze are five seconds of their own scale.
        now: When this is.
        model_out: Where the new model goes; ``None`` for a file beside the old one, with the time in its name.

    Raises:
        ConfigError: The settings have no EMG, or a learned decoder without a model.
        CalibrationError: The person is not calibrated on this source, or rest or effort cannot be used.
        DeviceUnavailableError: The source went away.
    """
    if config.emg is None:
        raise ConfigError(
            "nothing to recalibrate: the settings have no [emg]", "add it; see docs/device-emg.md"
        )
    model = _model_of(config)
    with driver_class(config.emg.driver, "emg")(config.emg.options) as source:
        record, chain = kept_record(config, config.emg, person, folder, source)
        if model is not None:
            path, decoder = model
            decoder.model.check_fits(
                kind=chain.kind, rate_hz=chain.rate_hz, channels=chain.channels, name=path.name, person=""
            )
        heard = _Heard(source)
        read = cast("EmgSource", heard)
        quiet = take_rest(read, chain, guide, times)
        rest = _samples(heard.chunks)
        maxima = take_squeezes(read, chain, quiet, guide, times, n=1)
        effort = _samples(heard.chunks)[round(_RISE_S * chain.rate_hz) :]
    new = to_todays_scale(record, quiet=quiet, maxima=maxima, guide=guide, now=now)
    written = None
    if model is not None:
        path, decoder = model
        target = np.repeat([0.0, 1.0], [len(rest), len(effort)])
        fitted = decoder.recalibrated(np.concatenate([rest, effort]), target)
        written = model_out or path.with_name(f"{path.stem}-{now:%Y%m%d-%H%M%S}{path.suffix}")
        fitted.save(written)
    return Recalibrated(folder.keep(new), written)


def _model_of(config: SessionConfig) -> tuple[Path, LearnedDecoder] | None:
    """Return the model that the settings' decoder uses."""
    options = chosen_stage("decoder", config.stages, config.session.preset).options
    if not isinstance(options, LearnedOptions):
        return None
    if options.model is None:
        raise ConfigError("decoder 'learned' names no model", "set stages.decoder.options.model to its file")
    return options.model, LearnedDecoder.load(options.model)


def _samples(chunks: Sequence[EmgChunk]) -> NDArray[np.float64]:
    if not chunks:
        raise CalibrationError("no EMG sample came", "check power and cable")
    return np.concatenate([chunk.samples for chunk in chunks])
