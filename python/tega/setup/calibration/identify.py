"""Light one motor of a vest at a time, so that its wearer can say where it is."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from tega.devices.base import VestSink
from tega.errors import DeviceUnavailableError, InvalidValueError
from tega.haptics import Layout, MotorLevels, vest_frame
from tega.runtime.clock import Clock

_PERIOD_NS = 50_000_000  # well within a vest's watchdog


def motor_place(motor: int) -> str:
    """Say where a motor, 0 to 39, is felt.

    Example:
        >>> motor_place(23)
        "back, row 1 of 5 from the top, column 4 of 4 from the wearer's left"
    """
    panel, place = divmod(motor, 20)
    row, column = divmod(place, 4)
    side = ("front", "back")[panel]
    return f"{side}, row {row + 1} of 5 from the top, column {column + 1} of 4 from the wearer's left"


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
    Raises ``InvalidValueError`` if the layout has no such motor, or ``percent`` is 0.
    """
    silent = vest_frame([0] * 4, [0] * 4, layout=layout)
    lit = np.where(silent.motors == motor, np.uint8(percent), np.uint8(0)).astype(np.uint8)
    if not lit.any():
        known = ", ".join(str(m) for m in silent.motors)
        raise InvalidValueError(
            f"motor {motor} is not one of layout {layout!r} (or percent is 0)", f"it has {known}"
        )
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
