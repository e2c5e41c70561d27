"""Light motors of a vest for a while: one, so that its wearer can say where it is, or those of a site."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np

from tega.config.calibration.wearing import column_sites, site_motors, site_place
from tega.devices.base import VestSink
from tega.errors import DeviceUnavailableError, InvalidValueError
from tega.haptics import Layout, MotorLevels, vest_frame
from tega.haptics.motor_layout import find_layout
from tega.runtime.clock import Clock, SystemClock
from tega.setup.calibration.sitting import Times
from tega.setup.calibration.staircase import LEVEL_PERCENT

_PERIOD_NS = 50_000_000  # well within a vest's watchdog


def motor_place(motor: int, layout: Layout) -> str:
    """Say where a motor, by its number, is felt; ``InvalidValueError`` if the layout has no such motor.

    Example:
        >>> motor_place(31, "x16")
        "back, row 2 of 2 from the top, column 4 of 4 from the wearer's left"
    """
    table = find_layout(layout)
    for face, row, column, number, _ in table.motors:
        if number == motor:
            place = f"row {row + 1} of {table.rows(face)} from the top, column {column + 1}"
            return f"{face}, {place} of {table.columns(face)} from the wearer's left"
    known = ", ".join(map(str, table.numbers))
    raise InvalidValueError(f"motor {motor} is not one of layout {layout!r}", f"it has {known}")


def light_motor(
    vest: VestSink,
    motor: int,
    *,
    layout: Layout,
    percent: int,
    duration_s: float,
    clock: Clock,
    stop: Callable[[], bool] = lambda: False,
    reported: Callable[[MotorLevels], None] = lambda _sent: None,
) -> None:
    """Drive one motor of an open vest for a while, then none.

    ``motor`` is an index as in :attr:`tega.haptics.MotorLevels.motors`; the rest is as in :func:`show_frame`.
    Raises ``InvalidValueError`` if the layout has no such motor.
    """
    motor_place(motor, layout)
    lit = np.where(find_layout(layout).numbers == motor, np.uint8(percent), np.uint8(0))
    show_frame(
        vest,
        MotorLevels(layout, lit),
        duration_s=duration_s,
        clock=clock,
        stop=stop,
        reported=reported,
        subject=f"motor {motor}",
    )


def show_frame(
    vest: VestSink,
    frame: MotorLevels,
    *,
    duration_s: float,
    clock: Clock,
    subject: str,
    stop: Callable[[], bool] = lambda: False,
    reported: Callable[[MotorLevels], None] = lambda _sent: None,
) -> None:
    """Show a frame on an open vest for a while, then none, also when it is interrupted.

    ``subject`` names it in errors. ``stop`` is asked all the time whether to end early. ``reported`` is
    called with each frame that the vest reports as sent, except the silence at the end. Raises
    ``DeviceUnavailableError`` if the vest did not show it all the time.
    """
    silent = MotorLevels(frame.layout, np.zeros_like(frame.intensities))
    start_ns = clock.now_ns()
    displayed = True
    try:
        for k in range(round(duration_s * 1e9) // _PERIOD_NS + 1):
            clock.sleep_until(start_ns + k * _PERIOD_NS)
            if stop():
                break
            sent = vest.write(k * _PERIOD_NS, frame)
            reported(sent)
            displayed = bool(sent.intensities.any() or not frame.intensities.any()) and displayed
    finally:
        vest.write(clock.now_ns() - start_ns, silent)
    if not displayed:
        notes = "; ".join(vest.info.notes) or "its link was down"
        raise DeviceUnavailableError(f"the vest did not show {subject} all the time: {notes}")


class Pulses:
    """Vibrations at sites of a vest, never above a ceiling, 1 to 15."""

    def __init__(self, vest: VestSink, *, layout: Layout, ceiling: int, times: Times) -> None:
        self._vest = vest
        self.layout: Layout = layout
        self._silent = vest_frame([0] * 4, [0] * 4, layout=layout)
        self.ceiling = ceiling
        self._times = times
        self._clock = SystemClock()

    def sites(self, *, each_motor: bool) -> tuple[str, ...]:
        """Return the columns, or the motors, that this vest has."""
        if each_motor:
            return tuple(f"m{m}" for m in self._silent.motors.tolist())
        return column_sites(self.layout)

    def one(self, site: str, level: int) -> None:
        """Vibrate once; level 0 takes as long and does nothing."""
        percent = LEVEL_PERCENT[min(level, self.ceiling)]
        lit = np.isin(self._silent.motors, site_motors(site, self.layout))
        frame = MotorLevels(self.layout, np.where(lit, np.uint8(percent), np.uint8(0)).astype(np.uint8))
        subject = site_place(site, self.layout)
        show_frame(self._vest, frame, duration_s=self._times.pulse_s, clock=self._clock, subject=subject)

    def pair(self, site: str, first: int, second: int) -> None:
        """Vibrate twice, with a gap."""
        self.one(site, first)
        self._clock.sleep_until(self._clock.now_ns() + round(self._times.gap_s * 1e9))
        self.one(site, second)

    def all(self, frame: MotorLevels, subject: str) -> None:
        """Show a frame as long as a vibration, nothing of it above the ceiling."""
        limited = np.minimum(frame.intensities, np.uint8(LEVEL_PERCENT[self.ceiling]))
        frame = MotorLevels(frame.layout, limited)
        show_frame(self._vest, frame, duration_s=self._times.pulse_s, clock=self._clock, subject=subject)
        self._clock.sleep_until(self._clock.now_ns() + round(self._times.gap_s * 1e9))

    @contextmanager
    def silence(self) -> Iterator[None]:
        """Leave the vest at zero, however the block is left."""
        try:
            yield
        finally:
            self._vest.write(self._clock.now_ns(), self._silent)
