"""Play a participant's sounds: pink noise that masks a vest's motors (table ``[masking]``), and beeps of a second task.

Audible motors would let the participant identify the cue by ear.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import Annotated, Any, Final

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.errors import DeviceUnavailableError
from tega.runtime.lifecycle import Opened, end_sound, load_sounddevice

RATE_HZ: Final = 48_000
"""Samples per second and ear."""

BAND_HZ: Final = (40.0, 16_000.0)
"""The noise has nothing outside; a coin motor's hum and its overtones lie within."""

_LOOP: Final = 2**19  # 10.9 s: nobody hears it come back
_RAMP_S = 0.5

BEEP_HZ: Final = 1000.0
BEEP_S: Final = 0.1
"""Length of a beep, seconds; it rises and falls for 5 ms, so that it does not click."""
BEEP_DBFS: Final = -30.0
"""Its level (RMS) at its height, or the noise's level where that is higher."""
_BEEP_RAMP_S = 0.005


class MaskingSection(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The sound that masks the vest's motors in a study: pink noise, the same in every condition.

    Attributes:
        level_dbfs: Its level (RMS), decibels below the sound card's full scale; none plays nothing. Begin
            low: how loud that is depends on card and headphones.
        output: Number or part of the name of the loudspeaker; empty for the system's own.
    """

    level_dbfs: Annotated[float, msgspec.Meta(ge=-80, le=-14)] | None = None
    output: str = ""


def pink_loop() -> NDArray[np.float32]:
    """Make a loop of pink noise: power falls as 1/f within :data:`BAND_HZ`, phases are random.

    Its end fits its start. float32 (524288,), root mean square 1.
    """
    hz = np.fft.rfftfreq(_LOOP, 1 / RATE_HZ)
    inside = (hz >= BAND_HZ[0]) & (hz <= BAND_HZ[1])
    amplitude = np.where(inside, 1 / np.sqrt(np.maximum(hz, 1.0)), 0.0)
    phase_rad = np.random.default_rng(0).uniform(0, 2 * np.pi, len(hz))
    loop = np.fft.irfft(amplitude * np.exp(1j * phase_rad), _LOOP)
    made: NDArray[np.float32] = (loop / np.sqrt((loop**2).mean())).astype(np.float32)
    return made


def beep_tone(level_dbfs: float) -> NDArray[np.float32]:
    """Make a beep, float32 (4800,), -1 to 1.

    ``level_dbfs`` is its level at its height, decibels of full scale (RMS).
    """
    at_s = np.arange(round(BEEP_S * RATE_HZ)) / RATE_HZ
    edge = np.clip(np.minimum(at_s, BEEP_S - at_s) / _BEEP_RAMP_S, 0, 1)
    tone: NDArray[np.float32] = (
        10 ** (level_dbfs / 20) * np.sqrt(2) * edge * np.sin(2 * np.pi * BEEP_HZ * at_s)
    ).astype(np.float32)
    return tone


class MaskingSound(Opened):
    """Pink noise on the headphones from :meth:`open` to :meth:`close`, the same in both ears, and beeps.

    The settings state a level, unless there are beeps.
    """

    def __init__(self, settings: MaskingSection, *, beeps: bool = False) -> None:
        if settings.level_dbfs is None and not beeps:
            raise DeviceUnavailableError("no masking sound: masking.level_dbfs is not set", "for example -30")
        self._level_dbfs = settings.level_dbfs
        self._gain = 0.0 if settings.level_dbfs is None else 10 ** (settings.level_dbfs / 20)
        self._tone = beep_tone(max(BEEP_DBFS, settings.level_dbfs or -np.inf))
        self._left = self._tone[:0]  # of the beep that sounds
        self._requested: deque[None] = deque()
        self._sounded_ns: deque[int] = deque()
        self._output = int(settings.output) if settings.output.isdecimal() else settings.output or None
        self._loop = pink_loop()
        self._at = 0
        self._n_made = 0
        self._fading = False
        self._silent = False
        self._stream: Any = None

    @property
    def words(self) -> str:
        """What masks, for a journal."""
        if self._level_dbfs is None:
            return "none"
        return f"pink noise at {self._level_dbfs:g} dB of full scale (RMS) on {self._output or 'the system output'}"

    @property
    def playing(self) -> bool:
        """Whether it sounds; False once the loudspeaker has gone."""
        return self._stream is not None and bool(self._stream.active)

    def open(self) -> None:
        """Begin to play; ``DeviceUnavailableError`` if there is no such loudspeaker."""
        sd = load_sounddevice()
        try:
            self._stream = sd.OutputStream(
                device=self._output, channels=2, samplerate=RATE_HZ, dtype="float32", callback=self._give
            )
            self._stream.start()
        except (sd.PortAudioError, ValueError) as error:
            self._stream = None
            raise DeviceUnavailableError(
                f"masking sound: the loudspeaker {self._output or 'of the system'} does not open: {error}",
                "python -m sounddevice lists what there is: set masking.output",
            ) from error

    def close(self) -> None:
        """Fade out and end; nothing where it was not opened."""
        stream, self._stream = self._stream, None
        if stream is None:
            return
        self._fading = True
        end_sound(stream, lambda: self._silent, 4 * _RAMP_S)

    def render(self, n: int) -> NDArray[np.float32]:
        """Make the next samples, float32 (n, 2), -1 to 1.

        Half a second from silence to the level, and back once it is being closed.
        """
        at = (self._at + np.arange(n)) % len(self._loop)
        self._at = int((self._at + n) % len(self._loop))
        step = 1 / (_RAMP_S * RATE_HZ)
        begin = self._n_made * step
        ramp = np.clip(begin + step * np.arange(1, n + 1) * (-1 if self._fading else 1), 0, 1)
        # Where on the ramp the next block begins, in samples; full level is its end.
        self._n_made = round(float(ramp[-1]) / step) if n else self._n_made
        self._silent = self._fading and self._n_made == 0
        mono = np.clip(self._loop[at] * (self._gain * ramp), -1, 1)
        made: NDArray[np.float32] = np.repeat(mono[:, None], 2, axis=1).astype(np.float32)
        return made

    def beep(self) -> None:
        """Play a beep with the next block; :meth:`sounded_ns` returns when it leaves the loudspeaker."""
        self._requested.append(None)

    def sounded_ns(self) -> list[int]:
        """Return when beeps left the loudspeaker since the last call, on the machine's monotonic clock, nanoseconds.

        The time is reported by the sound card; the additional delay of a wireless headphone is unknown.
        """
        found = []
        while self._sounded_ns:
            found.append(self._sounded_ns.popleft())
        return found

    def _give(self, data: Any, n: int, times: Any, _status: Any) -> None:
        """Fill a block; called by the sound system's own thread."""
        data[:] = self.render(n)
        if self._requested:
            self._requested.popleft()
            self._left = self._tone
            late_s = max(0.0, times.outputBufferDacTime - times.currentTime)
            self._sounded_ns.append(time.monotonic_ns() + round(late_s * 1e9))
        if len(self._left):
            part, self._left = np.split(self._left, [n])
            data[: len(part)] = np.clip(data[: len(part)] + part[:, None], -1, 1)


class Beeps:
    """Beeps of one attempt."""

    def __init__(self, sound: MaskingSound, at_s: Sequence[float], *, key: str) -> None:
        self._sound, self._left_s, self.key = sound, list(at_s), key

    def begin(self) -> None:
        """Forget beeps of a trial before this one."""
        self._sound.sounded_ns()

    def check(self, t_s: float, note: Callable[[int], None]) -> None:
        """Play the beeps that are due ``t_s`` after the trial's start, and report those that have sounded.

        ``note`` is called with the time at which a beep left the loudspeaker, nanoseconds.
        """
        while self._left_s and self._left_s[0] <= t_s:
            self._left_s.pop(0)
            self._sound.beep()
        for sounded_ns in self._sound.sounded_ns():
            note(sounded_ns)
