"""Run a Fitts test on closure with a calibrated person's muscles, through the decoder that a run uses."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from tega.config import SessionConfig
from tega.config.calibration.records import utc_now
from tega.config.choose import decoder_choice
from tega.config.person import whose
from tega.errors import DeviceUnavailableError
from tega.runtime.guide import Bar, Guide
from tega.setup.calibration.tracking import MuscleLoop
from tega_practice.fitts import FittsScore, fitts_score
from tega_practice.fitts_course import FittsCourse, Target, fitts_plan
from tega_practice.kept import FittsRecord, keep_record, movement_row

LEVEL_STEP: Final = 0.25
"""Step of the cursor of a decoder with five levels."""
CLOSURE_STEP: Final = 0.01
"""Step of the cursor of a decoder with a closure: the resolution of the bar and its number."""
_SILENT_S: Final = 3.0
_APART_S: Final = 1e-6


def cursor_of(level: int, closure: float | None) -> tuple[float, float]:
    """Return where a decoder puts the cursor, 0 to 1, and the cursor's step."""
    if closure is None:
        return (level - 1) / 4, LEVEL_STEP
    return min(1.0, max(0.0, closure)), CLOSURE_STEP


def fitts_test(
    config: SessionConfig,
    guide: Guide,
    *,
    movements: int,
    dwell_s: float,
    timeout_s: float,
    seed: int,
    settings: str,
) -> tuple[FittsRecord, FittsScore, Path]:
    """Let a calibrated person hit targets with the closure that the decoder makes of the muscles.

    ``config`` has ``calibration.person``. ``movements`` count, of each distance and width; the cursor has to
    stay in a target for ``dwell_s``, and after ``timeout_s`` the next one comes anyway. ``seed`` is that of
    the order; ``settings`` is how the settings file is named in the commands that are suggested. Returns the
    saved record, its figures, and its path. A person who is not calibrated on this source raises
    :class:`CalibrationError`, a source that went away or sends nothing :class:`DeviceUnavailableError`, a
    test in which no movement counts :class:`InvalidValueError`.
    """
    person, folder = whose(config.calibration)
    course = FittsCourse(fitts_plan(seed, movements=movements), dwell_s=dwell_s, timeout_s=timeout_s)
    step = CLOSURE_STEP
    with MuscleLoop(config, settings=settings, subject="a Fitts test") as muscles:
        guide.part(
            "Fitts test",
            f"Bring the end of the lower bar into the upper one, and keep it there for {dwell_s:g} s: fast and exact.",
        )
        guide.ready("Arm as in use")
        muscles.start()
        closure, last_s, t_s = 0.0, 0.0, 0.0
        while (target := course.target) is not None:
            for block in muscles.blocks():
                closure, step = cursor_of(block.level, block.closure)
                # Blocks that came in one read have one time.
                t_s = max(block.t_ns * 1e-9, t_s + _APART_S)
                course.take(t_s, closure)
                last_s = muscles.gone_s
            if muscles.gone_s - last_s > _SILENT_S:
                raise DeviceUnavailableError(
                    f"{muscles.device}: no EMG block for {_SILENT_S:g} s",
                    "check power and cable, then do the test again",
                )
            guide.show("Hold" if course.inside else "Go", _bars(target, closure), None)
        device, driver = muscles.device, muscles.driver
    score = fitts_score(course.movements, cursor_step=step)
    decoder, options = decoder_choice(config)
    record = FittsRecord(
        person=person,
        device=device,
        driver=driver,
        made=utc_now(),
        preset=config.session.preset,
        decoder=decoder,
        options=options,
        seed=seed,
        dwell_s=dwell_s,
        timeout_s=timeout_s,
        cursor_step=step,
        throughput_bits_s=round(score.throughput_bits_s, 3),
        completion_percent=round(100 * score.completion, 1),
        path_efficiency_percent=None
        if score.path_efficiency is None
        else round(100 * score.path_efficiency, 1),
        overshoots=round(score.overshoots, 2),
        movements=tuple(movement_row(one) for one in course.movements),
    )
    return record, score, keep_record(record, folder)


def _bars(target: Target, closure: float) -> list[Bar]:
    """Show levels, 1 to 5, as practice does; the target from its lower to its upper end."""
    text = f"{1 + 4 * target.centre:.1f} ± {2 * target.width:.2f} level"
    return [
        Bar("target", (1 + 4 * target.high) / 5, text, low=(1 + 4 * target.low) / 5),
        Bar("you", (1 + 4 * closure) / 5, f"{1 + 4 * closure:.2f}"),
    ]
