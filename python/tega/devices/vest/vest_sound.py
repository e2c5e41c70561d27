"""Play the vest as sound, one tone for each column, for use without a vest.

A column sounds in the ear on its side, from the wearer's left to the right. The front's four tones are two octaves
above the back's: a sharp contact (CCI, front) is high, a broad one (EDA, back) low. A tone's amplitude is
proportional to the intensity of its column's strongest motor.

=======  =======  =======  =======  =======
face     thumb    index    middle   ring
=======  =======  =======  =======  =======
front    880      1108.7   1318.5   1661.2   Hz (A5, C♯6, E6, G♯6)
back     220      277.2    329.6    415.3    Hz (A3, C♯4, E4, G♯4)
=======  =======  =======  =======  =======
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Final

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.devices.base import Options
from tega.devices.vest.vest_link import VestLink
from tega.devices.vest.vest_stream import HOLD_MS, StreamedVest, VestOptions
from tega.errors import DeviceUnavailableError
from tega.runtime.lifecycle import end_sound, load_sounddevice

RATE_HZ: Final = 48_000
"""Samples per second and ear."""

COLUMN_HZ: Final = (
    (880.0, 1108.731, 1318.510, 1661.219),
    (220.0, 277.183, 329.628, 415.305),
)
"""Frequency of each column, Hz: front, then back, from the wearer's left."""

# Eight tones at full drive stay below full scale in either ear.
_LOUDEST = 1 / 8
# From silence to full drive in so long: at once to the ear, without a click.
_RAMP_S = 0.005
# Closing waits so long at most for the tones to fade.
_FADE_S = 0.5


class SoundVestOptions(VestOptions, frozen=True):
    """Settings of :class:`SoundVest`.

    Attributes:
        volume: How loud full drive is, percent of the sound card's full scale.
        output: Number or part of the name of the loudspeaker; empty for the system's own.
    """

    volume: Annotated[float, msgspec.Meta(gt=0, le=100)] = 50.0
    output: str = ""


class ColumnTones:
    """Makes the sound of 40 motors; it starts silent. ``volume`` is percent of full scale."""

    def __init__(self, volume: float) -> None:
        self._volume = volume / 100
        hz = np.array(COLUMN_HZ, np.float64).reshape(8)
        self._step_rad = 2 * np.pi * hz / RATE_HZ
        self._phase_rad = np.zeros(8)
        # Equal power at every place between the ears.
        side_rad = np.tile(np.linspace(0.0, np.pi / 2, 4), 2)
        self._ears = np.stack([np.cos(side_rad), np.sin(side_rad)], axis=1)
        self._amplitude = np.zeros(8)
        # The latest command, and how many samples were made since: one tuple, since two threads share it.
        self._reported: tuple[NDArray[np.float64], int] = (np.zeros(8), 0)
        self._rendered = self._reported
        self._n_made = 0

    def notify(self, intensities: NDArray[np.uint8]) -> None:
        """Play the motors' intensities, uint8 (40,), percent.

        Rows are from the top and columns from the wearer's left, front then back.
        """
        columns = intensities.reshape(2, 5, 4).max(axis=1).reshape(8)
        self._reported = columns / 100 * self._volume * _LOUDEST, self._n_made

    @property
    def silent(self) -> bool:
        """Whether nothing sounds, and nothing is about to; a block that is being made may be of an older frame."""
        rendered = self._rendered
        return rendered is self._reported and not (self._amplitude.any() or rendered[0].any())

    def render(self, n: int) -> NDArray[np.float32]:
        """Make samples, float32 (n, 2), left and right, -1 to 1; 200 ms without a frame fade to silence."""
        wanted, reported_at = reported = self._reported
        if self._n_made - reported_at > HOLD_MS / 1000 * RATE_HZ:
            wanted = np.zeros(8)
        most = np.arange(1, n + 1)[:, None] * (self._volume * _LOUDEST / (_RAMP_S * RATE_HZ))
        missing = wanted - self._amplitude
        # Where the ramp has arrived the amplitude is exactly what is wanted: silence is zeros.
        amplitude = np.where(np.abs(missing) <= most, wanted, self._amplitude + np.sign(missing) * most)
        phase_rad = self._phase_rad + np.arange(n)[:, None] * self._step_rad
        made = (amplitude * np.sin(phase_rad)) @ self._ears
        if n:
            self._amplitude = amplitude[-1]
        self._phase_rad = (self._phase_rad + n * self._step_rad) % (2 * np.pi)
        self._n_made += n
        self._rendered = reported
        sound: NDArray[np.float32] = made.astype(np.float32)
        return sound


class SoundVest(StreamedVest):
    """Sounds one tone a column through the loudspeaker or headphones."""

    name: ClassVar[str] = "sound-vest"
    summary: ClassVar[str] = "an audible vest: one tone for each column"
    extra: ClassVar[str] = "sound"
    requires: ClassVar[tuple[str, ...]] = ("sounddevice",)
    options_type: ClassVar[type[Options]] = SoundVestOptions
    in_steps: ClassVar[bool] = False
    _options: SoundVestOptions

    def __init__(self, options: SoundVestOptions) -> None:
        super().__init__(options, options.output or "the system's loudspeaker")

    def _new_link(self) -> VestLink:
        return _Loudspeaker(self._options)


class _Loudspeaker(VestLink):
    def __init__(self, options: SoundVestOptions) -> None:
        self._output = int(options.output) if options.output.isdecimal() else options.output or None
        self._tones = ColumnTones(options.volume)
        self._stream: Any = None

    @property
    def present(self) -> bool:
        return self._stream is not None and bool(self._stream.active)

    def connect(self) -> None:
        sd = load_sounddevice()
        try:
            self._stream = sd.OutputStream(
                device=self._output, channels=2, samplerate=RATE_HZ, dtype="float32", latency="low",
                callback=self._give,
            )  # fmt: skip
            self._stream.start()
        except (sd.PortAudioError, ValueError) as error:
            raise DeviceUnavailableError(
                f"sound-vest: the loudspeaker {self._output or 'of the system'} does not open: {error}",
                "python -m sounddevice lists what there is: set vest.options.output",
            ) from error

    def _give(self, data: Any, n: int, _times: Any, _status: Any) -> None:
        """Fill a block; called by the sound system's own thread."""
        data[:] = self._tones.render(n)

    def ready(self, timeout_s: float) -> bool:  # noqa: ARG002  # the newest frame takes the place of the one before
        if not self.present:
            raise DeviceUnavailableError("sound-vest: the loudspeaker went away", "plug it in again")
        return True

    def send(self, intensities: NDArray[np.uint8]) -> None:
        self._tones.notify(intensities)

    def close(self) -> None:
        stream, self._stream = self._stream, None
        if stream is None:
            return
        self._tones.notify(np.zeros(40, np.uint8))
        end_sound(stream, lambda: self._tones.silent, _FADE_S)
