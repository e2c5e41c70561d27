"""Stands for the package sounddevice: a microphone at an emulated vest, and a loudspeaker that it records, too.

It has the calls that TEGA makes, with that package's arguments, answers and failures. The sound is made in the
process of the emulated vest; here it is fetched at its own pace, as old as a converter and its buffers make it.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import AbstractContextManager
from importlib.machinery import ModuleSpec
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tega_emulators.hid_port import installed
from tega_emulators.motor_sound import RATE_HZ
from tega_emulators.process import Emulator

__all__ = ["SoundPort"]

_BLOCK_S = 0.02


class PortAudioError(Exception):
    """As sounddevice raises it."""


class SoundPort:
    """A module-like object.

    ``peer`` is the emulated vest, which has to obey ``hear``; ``None`` where there is a loudspeaker only.

    Attributes:
        latency_s: How old sound is when it arrives.
        speaker_ms: What the loudspeaker takes beyond its stamp.
        played: Each block that left the loudspeaker, float32 (n, channels); ``abort`` drops those that wait.
    """

    def __init__(self, peer: Emulator | None = None) -> None:
        self.__spec__ = ModuleSpec("sounddevice", None)
        self.peer = peer
        self.present = True
        self.overflows = False
        self.latency_s, self.speaker_ms = 0.03, 0.0
        self.PortAudioError = PortAudioError
        self.played: list[NDArray[np.float32]] = []

    def query_devices(self, device: Any = None, kind: str | None = None) -> Any:
        """List what is there, or describe one."""
        if not self.present:
            if kind is None:
                return []
            raise PortAudioError("Error querying device -1")
        found = {"name": "emulated microphone", "max_input_channels": 1}
        return [found] if kind is None and device is None else found

    def InputStream(self, **options: Any) -> _SoundStream:  # noqa: N802  # the package's name
        """Return a stream that records."""
        return _SoundStream(self, options | {"samplerate": RATE_HZ}, receives=True)

    def OutputStream(self, **options: Any) -> _SoundStream:  # noqa: N802
        """Return a stream that plays."""
        if not self.present:
            raise PortAudioError("Error querying device -1")
        return _SoundStream(self, options, receives=False)

    def installed(self) -> AbstractContextManager[None]:
        """Stand in the place of the package as long as a block lasts."""
        return installed(self, "sounddevice")


class _SoundStream:
    def __init__(self, port: SoundPort, options: dict[str, Any], *, receives: bool) -> None:
        self._port, self._n_channels = port, options["channels"]
        self._callback: Callable[..., None] = options["callback"]
        self._leave = threading.Event()
        self._aborted_s = 0.0
        self._thread = threading.Thread(target=self._receive if receives else self._play, daemon=True)
        self.samplerate, self.latency = options["samplerate"], port.latency_s

    @property
    def active(self) -> bool:
        return self._thread.is_alive() and self._port.present

    def start(self) -> None:
        self._thread.start()

    def abort(self) -> None:
        self._aborted_s = time.monotonic()
        self._leave.set()

    def close(self) -> None:
        self._leave.set()
        if self._thread.is_alive():
            self._thread.join()

    def _receive(self) -> None:
        port = self._port
        assert port.peer is not None, "there is no microphone"
        first_s = time.monotonic()
        n = round(_BLOCK_S * RATE_HZ)
        k = 0
        while not self._leave.wait(
            max(0.0, first_s + (k + 1) * _BLOCK_S + port.latency_s - time.monotonic())
        ):
            if not port.present:
                return
            from_s = first_s + k * _BLOCK_S
            received = port.peer.say(f"hear {from_s!r} {n}")["samples"]
            data = np.array(received, np.float32)[:, None] / 32768
            self._callback(
                data, n, SimpleNamespace(), SimpleNamespace(input_overflow=port.overflows and k == 20)
            )
            k += 1

    def _play(self) -> None:
        port = self._port
        data = np.zeros((round(_BLOCK_S * self.samplerate), self._n_channels), np.float32)
        waiting: deque[tuple[float, NDArray[np.float32]]] = deque()
        while port.present and not self._leave.wait(_BLOCK_S):
            now_s = time.monotonic()
            leaves_s = now_s + port.latency_s
            stamps = SimpleNamespace(currentTime=now_s - 5.0, outputBufferDacTime=leaves_s - 5.0)
            self._callback(data, len(data), stamps, SimpleNamespace())
            waiting.append((leaves_s, data.copy()))
            while waiting and waiting[0][0] <= now_s:
                port.played.append(waiting.popleft()[1])
            if port.peer is not None and data.any():
                port.peer.say(f"click {leaves_s + port.speaker_ms / 1e3!r}")
        port.played += [block for leaves_s, block in waiting if leaves_s <= self._aborted_s]
