"""Define every error that TEGA raises on purpose.

Each message names the thing, the value and its unit; ``hint`` is the next step to take.
"""

from __future__ import annotations

__all__ = [
    "CalibrationError",
    "ConfigError",
    "DeviceUnavailableError",
    "DtypeError",
    "FeatureError",
    "InvalidValueError",
    "MissingExtraError",
    "MissingToolError",
    "RecordingError",
    "SampleRateError",
    "ShapeError",
    "StreamContradictionError",
    "TegaError",
    "UnsafeNameError",
    "WireError",
    "WrongDeviceError",
]


class TegaError(Exception):
    """Base of all errors raised by TEGA.

    Args:
        message: What is wrong: the thing, its value, its unit.
        hint: What to do next; empty where the message already says it.
    """

    def __init__(self, message: str, hint: str = "") -> None:
        super().__init__(message, hint)
        self.message = message
        self.hint = hint

    def __str__(self) -> str:
        """Return the message, followed by the hint where there is one."""
        return f"{self.message}; {self.hint}" if self.hint else self.message


class InvalidValueError(TegaError, ValueError):
    """A number is out of its range or not finite, or a choice is not one of those offered."""


class ShapeError(TegaError, ValueError):
    """An array has the wrong number of dimensions, shape or size."""


class DtypeError(TegaError, TypeError):
    """An array has the wrong element type."""


class CalibrationError(TegaError, ValueError):
    """A maximum, baseline or calibration file cannot be used."""


class ConfigError(TegaError, ValueError):
    """A settings file has an unknown key, a wrong type or a value out of range."""


class RecordingError(TegaError, ValueError):
    """A recording is missing, cut short, or cannot be parsed."""


class UnsafeNameError(InvalidValueError):
    """A name that stands in a file or a message must not become part of a path."""


class WireError(TegaError, ValueError):
    """A packet cannot be encoded from the values given."""


class FeatureError(TegaError, RuntimeError):
    """A function of a feature raises an error, or returns something else than it should."""


class DeviceUnavailableError(TegaError, RuntimeError):
    """A device is not there, or does not answer."""


class WrongDeviceError(DeviceUnavailableError):
    """A device answers, but it is not the one the settings ask for."""


class MissingExtraError(DeviceUnavailableError, ImportError):
    """A device needs a package that is not installed; the hint names the extra that brings it."""


class MissingToolError(MissingExtraError):
    """A verb needs a distribution of the checkout's ``tools/`` that is not installed; the hint is the pip line."""


class StreamContradictionError(DeviceUnavailableError):
    """A stream's counter, banner, stamps, rate or values contradict what its driver assumes of it."""


class SampleRateError(DeviceUnavailableError):
    """A source's true sample rate is too low for the filter, or not the one it is said to have."""
