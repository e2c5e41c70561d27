"""Record a microphone, and click a loudspeaker, through the package sounddevice (PortAudio)."""

from __future__ import annotations

import threading
import time
from typing import Any, Final, Self

import numpy as np
from numpy.typing import NDArray

from tega.errors import DeviceUnavailableError
from tega.runtime.lifecycle import load_sounddevice

RATE_HZ: Final = 48_000
_FIRST_S: Final = 3.0
_CLICK_S: Final = 0.003
_CLICK_HZ: Final = 3500.0


def list_microphones() -> list[str]:
    """Return number and name of everything that sound can come from."""
    devices = load_sounddevice().query_devices()
    return [f"{n}: {d['name']}" for n, d in enumerate(devices) if d["max_input_channels"] > 0]


class _Sound:
    """A stream of the sound system, for as long as the ``with`` block lasts."""

    _stream: Any = None

    def __exit__(self, *_error: object) -> None:
        """Close it."""
        stream, self._stream = self._stream, None
        if stream is not None:
            stream.close()


class Microphone(_Sound):
    """Records one channel while open; ``device`` is a number or part of a name, ``None`` the system's own."""

    def __init__(self, device: str | None = None) -> None:
        self._device = int(device) if device is not None and device.isdigit() else device
        self._lock = threading.Lock()
        self._parts: list[NDArray[np.float64]] = []
        self._came_s = 0.0
        self._lost = 0
        self.rate_hz = float(RATE_HZ)
        self.name = ""

    def __enter__(self) -> Self:
        """Begin to record, and wait for the first block; ``DeviceUnavailableError`` if none comes."""
        sd = load_sounddevice()
        try:
            self.name = str(sd.query_devices(self._device, "input")["name"])
            self._stream = sd.InputStream(
                device=self._device, channels=1, samplerate=RATE_HZ, dtype="float32", callback=self._take
            )
            self._stream.start()
        except (sd.PortAudioError, ValueError) as error:
            self.__exit__(None, None, None)
            raise DeviceUnavailableError(
                f"no microphone: {error}", "plug one in; 'tega-teleop vest onset --list' shows what there is"
            ) from error
        self.rate_hz = float(self._stream.samplerate)
        until_s = time.monotonic() + _FIRST_S
        while not self._parts:
            if time.monotonic() > until_s:
                self.__exit__(None, None, None)
                raise DeviceUnavailableError(
                    f"the microphone {self.name!r} gives no sound",
                    "another program may hold it; unplug and plug",
                )
            time.sleep(0.01)
        return self

    def received(self) -> NDArray[np.float64]:
        """Return the recorded sound, float64 (n,), -1 to 1.

        ``DeviceUnavailableError`` if the microphone was unplugged meanwhile, or the system has lost samples.
        """
        with self._lock:
            parts, came_s, lost = list(self._parts), self._came_s, self._lost
        if self._stream is not None and (not self._stream.active or time.monotonic() - came_s > 0.5):
            raise DeviceUnavailableError(
                f"the microphone {self.name!r} went away while it recorded", "plug it in and measure again"
            )
        if lost:
            raise DeviceUnavailableError(
                f"the sound system lost samples {lost} times, so the times are not known",
                "close other programs and measure again",
            )
        return np.concatenate(parts)

    def _take(self, data: Any, _n: int, _times: Any, status: Any) -> None:
        """Keep a block; called by the sound system's own thread."""
        with self._lock:
            self._lost += bool(status.input_overflow)
            self._parts.append(np.array(data[:, 0], np.float64))
            self._came_s = time.monotonic()


class Speaker(_Sound):
    """Clicks with known times from the system's loudspeaker."""

    def __init__(self) -> None:
        self._wanted = threading.Event()
        self._done = threading.Event()
        self._at_s = 0.0
        self._latency_s = 0.0

    def __enter__(self) -> Self:
        """Open it; ``DeviceUnavailableError`` if there is none."""
        sd = load_sounddevice()
        try:
            self._stream = sd.OutputStream(
                channels=1, samplerate=RATE_HZ, dtype="float32", callback=self._give
            )
            self._stream.start()
        except (sd.PortAudioError, ValueError) as error:
            self.__exit__(None, None, None)
            raise DeviceUnavailableError(f"no loudspeaker: {error}", "use --sync keys") from error
        self._latency_s = float(self._stream.latency)
        return self

    def click(self) -> float:
        """Click once and return when it leaves the converter, seconds on the monotonic clock.

        ``DeviceUnavailableError`` if the loudspeaker takes nothing any more.
        """
        self._done.clear()
        self._wanted.set()
        if not self._done.wait(_FIRST_S):
            raise DeviceUnavailableError("the loudspeaker takes no sound", "use --sync keys")
        return self._at_s

    def _give(self, data: Any, n: int, times: Any, _status: Any) -> None:
        data.fill(0)
        if not self._wanted.is_set():
            return
        self._wanted.clear()
        stamped = times.outputBufferDacTime > times.currentTime > 0
        ahead_s = times.outputBufferDacTime - times.currentTime if stamped else self._latency_s
        self._at_s = time.monotonic() + ahead_s
        t = np.arange(min(n, round(_CLICK_S * RATE_HZ))) / RATE_HZ
        data[: len(t), 0] = 0.8 * np.exp(-t / 0.001) * np.sin(2 * np.pi * _CLICK_HZ * t + 1)
        self._done.set()
