"""Load PortAudio, through which microphones and loudspeakers are used, by its package sounddevice."""

from __future__ import annotations

from typing import Any

from tega.errors import DeviceUnavailableError
from tega.runtime.lifecycle import require


def load_sounddevice() -> Any:
    """Import sounddevice; ``DeviceUnavailableError`` where PortAudio, which it needs, is not installed."""
    try:
        return require("sounddevice", driver="sound", extra="sound")
    except OSError as error:
        raise DeviceUnavailableError(
            f"the package 'sounddevice' does not find PortAudio: {error}",
            "sudo apt install libportaudio2; elsewhere it comes with the package",
        ) from error
