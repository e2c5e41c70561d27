"""Run a practice: a person follows a curve of levels through the chain that a run uses."""

from __future__ import annotations

from pathlib import Path

from tega.config import SessionConfig
from tega.config.calibration.records import PracticeRecord, utc_now
from tega.config.choose import decoder_choice
from tega.config.person import whose
from tega.runtime.guide import Bar, Guide
from tega.setup.calibration.muscle_loop import MuscleLoop
from tega.setup.calibration.practice import Curve, score
from tega.setup.calibration.tracked import keep_tracked, tracked_samples

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
