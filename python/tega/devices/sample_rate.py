"""Refuse sample rates that are too low for the filter, or differ from the stated rate."""

from __future__ import annotations

from tega.errors import SampleRateError

LEAST_RATE_HZ = 125.0
"""Below it the 50 Hz low-pass would lie above 0.4 of the rate, where it filters next to nothing."""

RATE_TOLERANCE = 0.05
"""A rate further off than this is not the one the filter was made and calibrated for."""

LOST_TOLERANCE = 0.2
"""A running source this far off is given up: its levels would come late and from the wrong band."""


def too_slow(who: str, rate_hz: float | None, how: str) -> SampleRateError:
    """Return the error for a source below the minimum rate; ``how``: stated or measured."""
    text = "no rate at all" if rate_hz is None else f"{rate_hz:.4g} samples/s"
    return SampleRateError(
        f"{who} {how} {text}; the 50 Hz filter needs {LEAST_RATE_HZ:g}",
        "make the board send faster: no delay() in its loop, a higher baud rate, fewer characters a line",
    )


def wrong_rate(who: str, measured_hz: float, rate_hz: float) -> SampleRateError:
    """Return the error of a source whose rate is not the stated one."""
    if measured_hz < LEAST_RATE_HZ:
        return too_slow(who, measured_hz, "really sends")
    return SampleRateError(
        f"{who} really sends {measured_hz:.1f} samples/s, {rate_hz:g} were expected",
        f"set the board to {rate_hz:g}, or rate_hz to its real rate and calibrate again",
    )
