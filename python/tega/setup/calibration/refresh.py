"""Put a calibration to today's scale: all of it in twenty seconds, muscles and a learned model in ten."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final, NamedTuple

import msgspec
import numpy as np

from tega.config import EmgConfig
from tega.config.calibration import EmgMaxima
from tega.config.calibration.folder import device_name
from tega.config.calibration.records import EmgRecord, TouchRecord
from tega.config.choose import block_s, chosen_stage
from tega.config.person import driver_settings, other_conditions
from tega.devices.base import EmgSource
from tega.devices.registry import driver_class
from tega.errors import CalibrationError, ConfigError
from tega.loop.maxima import emg_conditions
from tega.setup.calibration.effort import Maxima, Quiet, joined
from tega.setup.calibration.sitting import Sitting
from tega.setup.calibration.steps_emg import MuscleSteps
from tega.setup.calibration.steps_touch import take_baseline
from tega.stages.base import DayModel

_BASELINE_S, _REST_S, _SQUEEZE_S = 1.0, 4.0, 3.0
# A channel beyond these is not the same electrode on the same muscle any more.
_SCALE = (0.5, 2.0)


def refresh(sitting: Sitting, parts: Sequence[str]) -> list[Path]:
    """Take new baselines, put EMG rest and maxima to today's scale by one squeeze; return the files.

    Raises ``ConfigError`` if no part can be refreshed, ``CalibrationError`` if there is no calibration or it
    has changed too much.
    """
    config, person, folder, guide, times, _ = sitting
    if not any(part == "emg" or part.startswith("tactile.") for part in parts):
        raise ConfigError(
            "nothing to refresh: only fingertips and muscles change from day to day", "leave out --refresh"
        )
    files = []
    guide.part(
        "Refresh", "Everything off the fingertips, then rest, then one strong squeeze. Twenty seconds."
    )
    if any(part.startswith("tactile.") for part in parts):
        guide.ready("Take everything off all fingertips")
    quick = sitting._replace(
        times=times._replace(
            baseline_s=min(times.baseline_s, _BASELINE_S),
            rest_s=min(times.rest_s, _REST_S),
            squeeze_s=min(times.squeeze_s, _SQUEEZE_S),
        )
    )
    for part in parts:
        if part.startswith("tactile."):
            finger = part.removeprefix("tactile.")
            section = config.tactile[finger]
            with driver_class(section.driver, "tactile")(section.options) as source:
                if folder.record(person, TouchRecord, device_name(source.info)) is None:
                    raise _nothing(person, f"finger {finger!r}", device_name(source.info))
                files.append(take_baseline(finger, source, quick, is_free=True).file)
        elif part == "emg" and config.emg is not None:
            with driver_class(config.emg.driver, "emg")(config.emg.options) as source:
                record, chain = kept_record(quick, config.emg, source)
                steps = MuscleSteps(source, chain, guide, quick.times)
                quiet = steps.rest()
                maxima = steps.squeezes(quiet, n=1)
            files.append(folder.keep(to_todays_scale(record, quiet, maxima, _SCALE, quick)))
    return files


def kept_record(sitting: Sitting, section: EmgConfig, source: EmgSource) -> tuple[EmgRecord, EmgMaxima]:
    """Return the person's calibration on an open source, and the conditions under which it was made.

    Raises ``CalibrationError`` if there is none, or it is of other channels or EMG settings.
    """
    record = sitting.folder.record(sitting.person, EmgRecord, device_name(source.info))
    if record is None:
        raise _nothing(sitting.person, "EMG", device_name(source.info))
    chain = emg_conditions(source, section.kind, block_s=block_s(sitting.config))
    text = other_conditions(
        record,
        channels=chain.channels,
        kind=chain.kind,
        tau_samples=chain.tau,
        settings=driver_settings(section),
    )
    if text:
        raise CalibrationError(text, "set it back, or calibrate again: tega-teleop calibrate")
    return record, chain


def to_todays_scale(
    record: EmgRecord, quiet: Quiet, maxima: Maxima, limits: tuple[float, float], sitting: Sitting
) -> EmgRecord:
    """Return a calibration of muscles with today's rest, and its maxima scaled by one squeeze of today.

    ``limits`` are the smallest and largest permitted ratio of a channel to its old maximum, else
    ``CalibrationError`` is raised. The sitting's guide shows the scale.
    """
    ratios = np.array(maxima.live) / np.array(record.live_max)
    for name, ratio in zip(record.channels, ratios, strict=True):
        if not limits[0] <= ratio <= limits[1]:
            raise CalibrationError(
                f"EMG: {name} gives {ratio:.1f} times its signal at the calibration",
                "check its electrode, then calibrate again: tega-teleop calibrate",
            )
    scale = float(f"{np.exp(np.log(ratios).mean()):.4g}")
    new = msgspec.structs.replace(
        record,
        offset=quiet.offset,
        rest=quiet.rest,
        live_max=_times(record.live_max, ratios),
        paper_max=_times(record.paper_max, ratios),
        refreshed=sitting.now(),
        scale=float(f"{record.scale * scale:.4g}"),
        notes=(*record.notes, *quiet.notes, *maxima.notes),
    )
    sitting.guide.say(f"EMG: today {scale:.2f} times the calibration's scale", tone="good")
    return new


def _times(values: tuple[float, ...], ratios: np.ndarray) -> tuple[float, ...]:
    return tuple(float(f"{v * r:.6g}") for v, r in zip(values, ratios, strict=True))


def _nothing(person: str, subject: str, device: str) -> CalibrationError:
    return CalibrationError(
        f"{subject}: {person} has no calibration on {device} to refresh",
        "calibrate first: tega-teleop calibrate, without --refresh",
    )


HALF_S: Final = 5.0
"""Rest takes so long, and so does effort."""
# The rise of an effort is not yet the closure that was asked for.
_RISE_S = 0.5
# Electrodes that moved give other amplitudes: of 54 shifts simulated on recordings none left this range, and a third
# left that of a refresh (docs/evidence/emg-decoders.md). Beyond it a channel is loose, or not on a muscle that closes.
_LIMITS = (0.25, 4.0)


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
    chosen = chosen_stage("decoder", config.stages, config.session.preset)
    model: DayModel | None = chosen.kind.day_model(chosen.options)
    if model is None and model_out is not None:
        raise ConfigError(
            f"there is no model to write: the settings' decoder {chosen.name!r} has none",
            'leave out --out, or set stages.decoder.name = "learned" and its model',
        )
    with driver_class(config.emg.driver, "emg")(config.emg.options) as source:
        record, chain = kept_record(sitting, config.emg, source)
        if model is not None:
            model.check_fits(kind=chain.kind, rate_hz=chain.rate_hz, channels=chain.channels, person=person)
        guide.part("Recalibrate", "Five seconds of rest, then one fist of five seconds. Ten seconds.")
        steps = MuscleSteps(source, chain, guide, times)
        quiet = steps.rest()
        rested = steps.received
        maxima = steps.squeezes(quiet, n=1)
    new = to_todays_scale(record, quiet, maxima, _LIMITS, sitting)
    if model is None:
        return Recalibrated(folder.keep(new), None)
    effort = joined(steps.received)[round(_RISE_S * chain.rate_hz) :]
    fitted, file = model.fitted(joined(rested), effort), model.file
    written = model_out or file.with_name(f"{file.stem}-{now():%Y%m%d-%H%M%S}{file.suffix}")
    fitted.save(written)
    return Recalibrated(folder.keep(new), written)
