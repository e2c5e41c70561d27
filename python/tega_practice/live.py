"""Run a Fitts test on closure with a calibrated person's muscles, and note each movement of the cursor."""

from __future__ import annotations

import random
from collections.abc import Sequence
from pathlib import Path
from typing import Final, NamedTuple

from tega.config import SessionConfig
from tega.config.calibration.records import utc_now
from tega.config.choose import decoder_choice
from tega.config.person import whose
from tega.errors import DeviceUnavailableError, InvalidValueError
from tega.runtime.guide import Bar, Guide
from tega_practice.fitts import CONDITIONS, FittsScore, Movement, fitts_score
from tega_practice.kept import FittsRecord, keep_record, movement_row
from tega_practice.tracking import MuscleLoop

_ROUNDING: Final = 1e-9


class Target(NamedTuple):
    """Stretch of closure to be hit: its middle, 0 to 1, and its width from end to end."""

    centre: float
    width: float

    @property
    def low(self) -> float:
        """Lower end."""
        return self.centre - self.width / 2

    @property
    def high(self) -> float:
        """Upper end."""
        return self.centre + self.width / 2

    def holds(self, closure: float) -> bool:
        """Whether a closure is in it."""
        return self.low - _ROUNDING <= closure <= self.high + _ROUNDING


class FittsMovement(NamedTuple):
    """One movement as it is asked for.

    ``distance`` is from the last target's centre, closure. ``counts`` is whether it is scored; the first of a
    condition only leads to where that begins.
    """

    target: Target
    distance: float
    counts: bool


def fitts_plan(seed: int, *, movements: int) -> list[FittsMovement]:
    """Return the movements of a test: each condition to and fro, the conditions in an order of chance."""
    return [
        FittsMovement(Target(high if n % 2 else low, width), high - low, counts=n > 0)
        for low, high, width in random.Random(seed).sample(list(CONDITIONS), len(CONDITIONS))
        for n in range(movements + 1)
    ]


class FittsCourse:
    """A test that goes on; ``movements`` are those that were made so far and count, oldest first."""

    def __init__(self, requested: Sequence[FittsMovement], *, dwell_s: float, timeout_s: float) -> None:
        if not 0 < dwell_s < timeout_s:
            raise InvalidValueError(
                f"dwell_s = {dwell_s:g} s has to be above 0 and under timeout_s = {timeout_s:g} s"
            )
        self._requested, self._dwell_s, self._timeout_s = list(requested), dwell_s, timeout_s
        self._n = 0
        self.movements: list[Movement] = []
        self._last: tuple[float, float] | None = None
        self._began = (0.0, 0.0)
        self._path = 0.0
        self._overshoots = 0
        # Time, closure and path at the entry into the target in which the cursor is.
        self._entry: tuple[float, float, float] | None = None

    @property
    def target(self) -> Target | None:
        """Target that is asked for now; ``None`` at the end."""
        return self._requested[self._n].target if self._n < len(self._requested) else None

    @property
    def inside(self) -> bool:
        """Whether the cursor is in it."""
        return self._entry is not None

    def take(self, t_s: float, closure: float) -> None:
        """Take the cursor's next place; its time must be after the last one's, the closure 0 to 1."""
        if self.target is None:
            return
        if self._last is None:
            self._began = (t_s, closure)
        else:
            self._path += abs(closure - self._last[1])
        self._last = (t_s, closure)
        if self.target.holds(closure):
            if self._entry is None:
                self._entry = (t_s, closure, self._path)
            if t_s - self._entry[0] >= self._dwell_s - _ROUNDING:
                self._end(self._entry, closure)
                return
        elif self._entry is not None:
            self._entry = None
            self._overshoots += 1
        if t_s - self._began[0] >= self._timeout_s - _ROUNDING:
            self._end((self._began[0] + self._timeout_s, closure, self._path), None)

    def _end(self, entry: tuple[float, float, float], endpoint: float | None) -> None:
        """Note the movement, if it counts; the next one begins where the cursor is."""
        requested, (began_s, start) = self._requested[self._n], self._began
        if requested.counts:
            self.movements.append(
                Movement(
                    distance=requested.distance,
                    width=requested.target.width,
                    centre=requested.target.centre,
                    start=start,
                    entry=entry[1],
                    endpoint=endpoint,
                    time_s=entry[0] - began_s,
                    path=entry[2],
                    overshoots=self._overshoots,
                    inside_at_start=requested.target.holds(start),
                )
            )
        self._n += 1
        self._began, self._path, self._overshoots, self._entry = self._last or self._began, 0.0, 0, None


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
    efficiency = score.path_efficiency
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
        path_efficiency_percent=None if efficiency is None else round(100 * efficiency, 1),
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
