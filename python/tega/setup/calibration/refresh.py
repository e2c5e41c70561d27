"""Put a calibration to today's scale in twenty seconds: baselines, muscles and a learned model."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

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

_BASELINE_S = 1.0
# The rise of an effort is not yet the closure that was asked for.
_RISE_S = 0.5
# Electrodes that moved give other amplitudes: of 54 shifts simulated on recordings none left this range, and a third
# left one of 0.5 to 2 (docs/evidence/emg-decoders.md). Beyond it a channel is loose, or not on a muscle that closes.
_LIMITS = (0.25, 4.0)


def refresh(sitting: Sitting, parts: Sequence[str]) -> list[Path]:
    """Take new baselines, put EMG rest and maxima and a learned model to today's scale; return the files.

    Raises ``ConfigError`` if no part can be refreshed or a learned decoder names no model, ``CalibrationError`` if
    there is no calibration, it has changed too much, or the model is of other muscles or a kernel.
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
    # A model is fitted to as much effort as rest.
    times = times._replace(baseline_s=min(times.baseline_s, _BASELINE_S), squeeze_s=times.rest_s)
    quick = sitting._replace(times=times)
    for part in parts:
        if part.startswith("tactile."):
            finger = part.removeprefix("tactile.")
            section = config.tactile[finger]
            with driver_class(section.driver, "tactile")(section.options) as source:
                if folder.record(person, TouchRecord, device_name(source.info)) is None:
                    raise _nothing(person, f"finger {finger!r}", device_name(source.info))
                files.append(take_baseline(finger, source, quick, is_free=True).file)
        elif part == "emg" and config.emg is not None:
            files += _muscles(quick, config.emg)
    return files


def _muscles(sitting: Sitting, section: EmgConfig) -> list[Path]:
    """Put muscles and the model of a learned decoder to today's scale; write nothing unless all fits.

    The new model is a file beside the old one, with the time in its name.
    """
    config, person, folder, guide, times, now = sitting
    chosen = chosen_stage("decoder", config.stages, config.session.preset)
    model: DayModel | None = chosen.kind.day_model(chosen.options)
    with driver_class(section.driver, "emg")(section.options) as source:
        record, chain = _kept_record(sitting, section, source)
        if model is not None:
            model.check_fits(kind=chain.kind, rate_hz=chain.rate_hz, channels=chain.channels, person=person)
        steps = MuscleSteps(source, chain, guide, times)
        quiet = steps.rest()
        rested = steps.received
        maxima = steps.squeezes(quiet, n=1)
    new = _to_todays_scale(record, quiet, maxima, sitting)
    if model is None:
        return [folder.keep(new)]
    effort = joined(steps.received)[round(_RISE_S * chain.rate_hz) :]
    fitted, file = model.fitted(joined(rested), effort), model.file
    written = file.with_name(f"{file.stem}-{now():%Y%m%d-%H%M%S}{file.suffix}")
    fitted.save(written)
    guide.say(f"The new model: set stages.decoder.options.model = {json.dumps(str(written))}", tone="good")
    return [folder.keep(new), written]


def _kept_record(sitting: Sitting, section: EmgConfig, source: EmgSource) -> tuple[EmgRecord, EmgMaxima]:
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


def _to_todays_scale(record: EmgRecord, quiet: Quiet, maxima: Maxima, sitting: Sitting) -> EmgRecord:
    """Return a calibration of muscles with today's rest, and its maxima scaled by one squeeze of today.

    Raises ``CalibrationError`` if a channel has changed too much. The sitting's guide shows the scale.
    """
    ratios = np.array(maxima.live) / np.array(record.live_max)
    for name, ratio in zip(record.channels, ratios, strict=True):
        if not _LIMITS[0] <= ratio <= _LIMITS[1]:
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
