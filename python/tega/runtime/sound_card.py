"""Load PortAudio, through which microphones and loudspeakers are used, by its package sounddevice."""

from __future__ import annotations

from typing import Any

from tega.errors import DeviceUnavailableError, MissingExtraError


def load_sounddevice() -> Any:
    """Import the package sounddevice.

    Raises:
        MissingExtraError: It is not installed.
        DeviceUnavailableError: PortAudio, which it needs, is not.
    """
    try:
        import sounddevice as found
    except ImportError as error:
        raise MissingExtraError(
            "the package 'sounddevice' is not installed", "pip install 'tega[sound]'"
        ) from error
    except OSError as error:
        raise DeviceUnavailableError(
            f"the package 'sounddevice' does not find PortAudio: {error}",
            "sudo apt install libportaudio2; elsewhere it comes with the package",
        ) from error
    return found
