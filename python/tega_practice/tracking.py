"""Have a calibrated person follow a curve of levels, score it, and keep the EMG to fit a decoder to.

The muscles are read through a run's decoder, without a hand; no force is measured.
"""

from __future__ import annotations

import io
import random
import time
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from tega.config import SessionConfig
from tega.config.calibration.folder import device_name
from tega.config.calibration.records import utc_now
from tega.config.choose import block_s, decoder_choice, muscle_decoder
from tega.config.person import PersonRecords, whose
from tega.devices.base import EmgChunk
from tega.devices.registry import driver_class
from tega.errors import ConfigError, InvalidValueError
from tega.loop.inbox.sources import BlockMeter, SourceReport
from tega.loop.maxima import emg_conditions
from tega.records import Intent
from tega.runtime.files.whole_file import write_whole
from tega.runtime.guide import Bar, Guide
from tega.setup.calibration.steps_emg import drain
from tega_learn.logs import PracticeRecord
from tega_practice.kept import keep_record

_HOLD_S = 3.0
_RAMP_S_PER_LEVEL = 0.75
_LONGEST_DELAY_S = 1.0


class Curve:
    """Ramps and holds between the five levels, in an order of chance; begins and ends at rest.

    No level follows itself, and every five holds visit every level. ``duration_s`` must be at least 10.
    """

    def __init__(self, duration_s: float, *, seed: int) -> None:
        chance = random.Random(seed)
        self.duration_s = duration_s
        times, levels = [0.0, _HOLD_S], [1.0, 1.0]
        order: list[int] = []
        while times[-1] < duration_s:
            if not order:
                order = chance.sample(range(1, 6), 5)
                if order[0] == levels[-1]:
                    order.append(order.pop(0))
            level = order.pop(0)
            ramp_s = _RAMP_S_PER_LEVEL * abs(level - levels[-1])
            times += [times[-1] + ramp_s, times[-1] + ramp_s + _HOLD_S]
            levels += [float(level)] * 2
        self._times, self._levels = np.array(times), np.array(levels)

    def at(self, t_s: float) -> float:
        """Return the level asked for, 1 to 5."""
        return float(np.interp(t_s, self._times, self._levels))


class Score(NamedTuple):
    """Score of a followed curve.

    ``in_target`` is the share of the time on the level asked for (the nearest one, during a ramp).
    ``delay_s`` is the shift at which the level fits the curve best, 0 to 1 s; ``None`` if it never changed.
    """

    in_target: float
    rms_error_levels: float
    delay_s: float | None


def score(t_s: Sequence[float], levels: Sequence[int], curve: Curve) -> Score:
    """Score levels against a curve; there must be a level, and a time for each."""
    if not levels or len(levels) != len(t_s):
        raise InvalidValueError(f"{len(levels)} levels at {len(t_s)} times cannot be scored")
    own = np.array(levels, np.float64)

    def wanted(shift_s: float) -> NDArray[np.float64]:
        return np.array([curve.at(t - shift_s) for t in t_s])

    error = own - wanted(0.0)
    shifts = np.arange(0.0, _LONGEST_DELAY_S + 1e-9, 0.05)
    errors = [float(((own - wanted(float(s))) ** 2).mean()) for s in shifts]
    return Score(
        in_target=float((np.abs(error) <= 0.5).mean()),
        rms_error_levels=float(np.sqrt((error**2).mean())),
        delay_s=float(shifts[int(np.argmin(errors))]) if np.ptp(own) else None,
    )


_TOP_STEPS = 4


def tracked_samples(
    chunks: Sequence[EmgChunk], curve: Curve, *, rate_hz: float, start_ns: int
) -> NDArray[np.float64]:
    """Put the closure that was asked for, 0 to 1, last in each sample's row: ``(n, channels + 1)``.

    Times come from the samples' numbers, as many a second as the source has, from the first chunk's time on:
    a chunk's own time is that of its arrival. What came before the curve began is left out; lost samples
    leave a gap.
    """
    if not chunks:
        return np.empty((0, 1))
    first = chunks[0]
    zero_s = (first.t_ns - start_ns) * 1e-9 - (first.first_index + len(first.samples)) / rate_hz
    parts = []
    for chunk in chunks:
        number = chunk.first_index + 1 + np.arange(len(chunk.samples))
        t_s = zero_s + number / rate_hz
        closure = np.array([(curve.at(max(0.0, t)) - 1) / _TOP_STEPS for t in t_s])
        parts.append(np.column_stack([chunk.samples, closure])[t_s >= 0])
    return np.concatenate(parts)


def keep_tracked(data: NDArray[np.float64], record: Path) -> Path:
    """Write the samples and the closure beside a practice record, as ``.npy``."""
    file = io.BytesIO()
    np.save(file, data, allow_pickle=False)
    path = record.with_suffix(".npy")
    write_whole(path, file.getvalue(), sync=True)
    return path


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
            records = PersonRecords(config, settings=self._settings, now=utc_now())
            personal = records.calibration({}, source, conditions)
            maxima = personal.calibration.emg
            assert maxima is not None
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
    path = keep_record(record, folder)
    keep_tracked(
        tracked_samples(muscles.chunks, curve, rate_hz=muscles.maxima.rate_hz, start_ns=muscles.start_ns),
        path,
    )
    return record, path
