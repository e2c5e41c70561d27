"""Read a calibrated person's muscles through a run's decoder, without a hand, and have a curve of levels followed."""

from __future__ import annotations

import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Self

from tega.config import SessionConfig
from tega.config.calibration.folder import device_name
from tega.config.calibration.records import PracticeRecord, utc_now
from tega.config.choose import block_s, decoder_choice, muscle_decoder
from tega.config.person import person_calibration, whose
from tega.devices.base import EmgChunk
from tega.devices.registry import driver_class
from tega.errors import CalibrationError, ConfigError
from tega.loop.inbox.sources import BlockMeter, SourceReport
from tega.loop.maxima import emg_conditions
from tega.records import Intent
from tega.runtime.guide import Bar, Guide
from tega.setup.calibration.practice import Curve, keep_tracked, score, tracked_samples
from tega.setup.calibration.steps_emg import drain

_READ_S = 0.05


class MuscleLoop:
    """EMG source and decoder of the settings, for as long as the ``with`` block lasts.

    ``chunks`` are the samples since :meth:`start`, as they came; ``start_ns`` is the time of that call, on
    the monotonic clock. ``device`` is the source's serial number, or a substitute. Raises ``ConfigError`` if
    the settings have no EMG, ``CalibrationError`` if the person is not calibrated on this source.
    """

    def __init__(self, config: SessionConfig, *, settings: str, subject: str) -> None:
        if config.emg is None:
            raise ConfigError(
                f"{subject} needs muscles: the settings have no [emg]", "add it; see docs/device-emg.md"
            )
        self._config = config
        self.chunks: list[EmgChunk] = []
        self._source = driver_class(config.emg.driver, "emg")(config.emg.options)
        self._kind, self._settings = config.emg.kind, settings

    def __enter__(self) -> Self:
        """Open the source and make the decoder."""
        config, source = self._config, self._source
        with ExitStack() as opened:
            opened.enter_context(source)
            conditions = emg_conditions(source, self._kind, block_s=block_s(config))
            personal = person_calibration(
                config, {}, source, conditions, settings=self._settings, now=utc_now()
            )
            maxima = personal.calibration.emg
            if maxima is None:
                raise CalibrationError(f"{personal.name}: has no EMG maxima", "calibrate")
            self.maxima = maxima
            self._decoder = muscle_decoder(config.stages, config.session.preset, maxima)
            self.driver, self.device = source.info.driver, device_name(source.info)
            opened.pop_all()
        return self

    def __exit__(self, *error: Any) -> None:
        """Close the source."""
        self._source.__exit__(*error)

    def start(self) -> None:
        """Begin with the next samples."""
        drain(self._source)
        self.start_ns = time.monotonic_ns()
        self._meter = BlockMeter(
            self._decoder, SourceReport(), maxima=self.maxima, live=True, start_ns=self.start_ns
        )

    @property
    def gone_s(self) -> float:
        """Seconds since :meth:`start`."""
        return (time.monotonic_ns() - self.start_ns) * 1e-9

    def blocks(self) -> list[Intent]:
        """Wait a twentieth of a second at most; return the blocks that were completed, oldest first."""
        chunk = self._source.read(_READ_S)
        if chunk is None:
            return []
        self.chunks.append(chunk)
        return list(self._meter.take(chunk))


_TOP_LEVEL = 5


def track(
    config: SessionConfig, guide: Guide, *, duration_s: float, seed: int, settings: str
) -> tuple[PracticeRecord, Path]:
    """Let a calibrated person follow a curve; return the score, and where it is kept.

    The EMG lies beside it, for ``tega-teleop emg fit``.
    """
    curve = Curve(duration_s, seed=seed)
    with MuscleLoop(config, settings=settings, subject="practice") as muscles:
        guide.part("Practice", "Follow the upper bar with the lower one: squeeze as far as it is full.")
        guide.ready("Arm as in use. The curve begins at rest")
        muscles.start()
        times: list[float] = []
        levels: list[int] = []
        while (gone_s := muscles.gone_s) < duration_s:
            for block in muscles.blocks():
                times.append(block.t_ns * 1e-9)
                levels.append(block.level)
            now, requested = levels[-1] if levels else 1, curve.at(gone_s)
            bars = [
                Bar("target", requested / _TOP_LEVEL, f"{requested:.1f}"),
                Bar("you", now / _TOP_LEVEL, f"{now}"),
            ]
            guide.show("Follow", bars, duration_s - gone_s)
    found = score(times, levels, curve)
    person, folder = whose(config.calibration)
    decoder, options = decoder_choice(config)
    record = PracticeRecord(
        person=person,
        device=muscles.device,
        driver=muscles.driver,
        made=utc_now(),
        preset=config.session.preset,
        seed=seed,
        duration_s=duration_s,
        in_target_percent=round(100 * found.in_target, 1),
        rms_error_levels=round(found.rms_error_levels, 3),
        delay_s=None if found.delay_s is None else round(found.delay_s, 2),
        kind=muscles.maxima.kind,
        rate_hz=muscles.maxima.rate_hz,
        channels=muscles.maxima.channels,
        decoder=decoder,
        options=options,
    )
    path = folder.keep_practice(record)
    keep_tracked(
        tracked_samples(muscles.chunks, curve, rate_hz=muscles.maxima.rate_hz, start_ns=muscles.start_ns),
        path,
    )
    return record, path
