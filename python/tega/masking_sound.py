"""Play pink noise that masks the sound of a vest's motors, so that a person cannot hear what they are to feel."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any, Final, Self

import numpy as np

from tega.errors import DeviceUnavailableError
from tega.sound_card import load_sounddevice

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tega.config_sections import MaskingSection

RATE_HZ: Final = 48_000
"""Samples per second and ear."""

BAND_HZ: Final = (40.0, 16_000.0)
"""The noise has nothing outside; a coin motor's hum and its overtones lie within."""

_LOOP: Final = 2**19  # 10.9 s: nobody hears it come back
_RAMP_S = 0.5


def pink_loop(seed: int = 0) -> NDArray[np.float32]:
    """Make a loop of pink noise: power falls as 1/f within :data:`BAND_HZ`, phases are random, its end fits its start.

    Args:
        seed: Of the phases; a study plays the same sound in all conditions and to everybody.

    Returns:
        float32 (524288,), root mean square 1.
    """
    hz = np.fft.rfftfreq(_LOOP, 1 / RATE_HZ)
    inside = (hz >= BAND_HZ[0]) & (hz <= BAND_HZ[1])
    amplitude = np.where(inside, 1 / np.sqrt(np.maximum(hz, 1.0)), 0.0)
    phase_rad = np.random.default_rng(seed).uniform(0, 2 * np.pi, len(hz))
    loop = np.fft.irfft(amplitude * np.exp(1j * phase_rad), _LOOP)
    made: NDArray[np.float32] = (loop / np.sqrt((loop**2).mean())).astype(np.float32)
    return made


class MaskingSound:
    """Pink noise on the headphones from :meth:`open` to :meth:`close`, the same in both ears.

    Args:
        settings: Level and loudspeaker; a level is set.
    """

    def __init__(self, settings: MaskingSection) -> None:
        if settings.level_dbfs is None:
            raise DeviceUnavailableError("no masking sound: masking.level_dbfs is not set", "for example -30")
        self._level_dbfs = settings.level_dbfs
        self._gain = 10 ** (settings.level_dbfs / 20)
        self._output = int(settings.output) if settings.output.isdecimal() else settings.output or None
        self._loop = pink_loop()
        self._at = 0
        self._n_made = 0
        self._fading = False
        self._silent = False
        self._stream: Any = None

    def __enter__(self) -> Self:
        """Begin to play."""
        self.open()
        return self

    def __exit__(self, *_: object) -> None:
        """Fade out and end."""
        self.close()

    @property
    def words(self) -> str:
        """What is played, for a journal."""
        return f"pink noise at {self._level_dbfs:g} dB of full scale (RMS) on {self._output or 'the system output'}"

    @property
    def playing(self) -> bool:
        """Whether it sounds; False once the loudspeaker has gone."""
        return self._stream is not None and bool(self._stream.active)

    def open(self) -> None:
        """Begin to play.

        Raises:
            MissingExtraError: The package sounddevice is not installed.
            DeviceUnavailableError: There is no such loudspeaker.
        """
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
        until_s = time.monotonic() + 2 * _RAMP_S
        while stream.active and not self._silent and time.monotonic() < until_s:
            time.sleep(0.01)
        stream.abort()
        stream.close()

    def render(self, n: int) -> NDArray[np.float32]:
        """Make the next samples: half a second from silence to the level, and back once it is being closed.

        Args:
            n: How many.

        Returns:
            float32 (n, 2), -1 to 1.
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

    def _give(self, data: Any, n: int, _times: Any, _status: Any) -> None:
        """Fill a block; called by the sound system's own thread."""
        data[:] = self.render(n)
