"""Run a practice: a person follows a curve of levels through the chain that a run uses."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING

from tega.calibration.folder import device_name
from tega.calibration.guide import Bar, Guide
from tega.calibration.maxima import emg_conditions
from tega.calibration.person import person_calibration, whose
from tega.calibration.practice import Curve, score
from tega.calibration.records import PracticeRecord, utc_now
from tega.calibration.tracked import keep_tracked, tracked_samples
from tega.devices.registry import driver_class
from tega.errors import CalibrationError, ConfigError
from tega.inbox.sources import BlockMeter, SourceReport
from tega.stages.choose import block_s, muscle_decoder

if TYPE_CHECKING:
    from tega.config import SessionConfig
    from tega.devices.base import EmgChunk


_READ_S = 0.05
_TOP_LEVEL = 5


def track(
    config: SessionConfig, guide: Guide, *, duration_s: float, seed: int, settings: str
) -> tuple[PracticeRecord, Path]:
    """Let a calibrated person follow a curve.

    Args:
        config: The settings, with ``calibration.person``.
        guide: Shows.
        duration_s: How long.
        seed: Of the curve.
        settings: How the settings file is named in the commands that are suggested.

    Returns:
        The score, and where it is kept; the EMG lies beside it, for ``tega-teleop emg fit``.

    Raises:
        ConfigError: The settings have no EMG.
        CalibrationError: The person is not calibrated on this source.
        DeviceUnavailableError: The source went away.
    """
    if config.emg is None:
        raise ConfigError(
            "practice needs muscles: the settings have no [emg]", "add it; see docs/device-emg.md"
        )
    curve = Curve(duration_s, seed=seed)
    guide.part("Practice", "Follow the upper bar with the lower one: squeeze as far as it is full.")
    with driver_class(config.emg.driver, "emg")(config.emg.options) as source:
        conditions = emg_conditions(source, config.emg.kind, block_s=block_s(config))
        personal = person_calibration(config, {}, source, conditions, settings=settings, now=utc_now())
        maxima = personal.calibration.emg
        if maxima is None:
            raise CalibrationError(f"{personal.name}: has no EMG maxima", "calibrate")
        decoder = muscle_decoder(config.stages, config.session.preset, maxima)
        guide.ready("Arm as in use. The curve begins at rest")
        while source.read(0.0) is not None:
            pass
        start_ns = time.monotonic_ns()
        meter = BlockMeter(decoder, SourceReport(), maxima=maxima, live=True, start_ns=start_ns)
        times: list[float] = []
        levels: list[int] = []
        chunks: list[EmgChunk] = []
        while (gone_s := (time.monotonic_ns() - start_ns) * 1e-9) < duration_s:
            chunk = source.read(_READ_S)
            if chunk is not None:
                chunks.append(chunk)
            for block in [] if chunk is None else meter.take(chunk):
                times.append(block.t_ns * 1e-9)
                levels.append(block.level)
            now, asked = levels[-1] if levels else 1, curve.at(gone_s)
            bars = [
                Bar("target", asked / _TOP_LEVEL, f"{asked:.1f}"),
                Bar("you", now / _TOP_LEVEL, f"{now}"),
            ]
            guide.show("Follow", bars, duration_s - gone_s)
        driver, device = source.info.driver, device_name(source.info)
    found = score(times, levels, curve)
    person, folder = whose(config.calibration)
    record = PracticeRecord(
        person=person,
        device=device,
        driver=driver,
        made=utc_now(),
        preset=config.session.preset,
        seed=seed,
        duration_s=duration_s,
        in_target_percent=round(100 * found.in_target, 1),
        rms_error_levels=round(found.rms_error_levels, 3),
        delay_s=None if found.delay_s is None else round(found.delay_s, 2),
        kind=maxima.kind,
        rate_hz=maxima.rate_hz,
        channels=maxima.channels,
    )
    path = folder.keep_practice(record)
    keep_tracked(tracked_samples(chunks, curve, rate_hz=maxima.rate_hz, start_ns=start_ns), path)
    return record, path
