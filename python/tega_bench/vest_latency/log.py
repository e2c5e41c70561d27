"""Keep a sound recording (WAV), beside it the log of commands during it (JSON), and the clock that both lie on.

Sounds of known time, clicks, are found in the recording: the input's latency drops out. What is left is how well the
times of the clicks are known: :data:`CLICKS_MS`.
"""

from __future__ import annotations

import io
import wave
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from typing import Any, Final, Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.errors import InvalidValueError, RecordingError
from tega.runtime.files.foreign_file import parse_json, read_foreign
from tega.runtime.files.whole_file import write_whole
from tega_bench.vest_latency.detect import load_signal

CLICKS_MS: Final = {"keys": 20.0, "speaker": 8.0}
"""Uncertainty of a click's time, ms. A keyboard reports a key up to that long after its sound; a speaker's stamp
lacks its converter's delay, and sound takes 3 ms a metre."""

_CLICK_HZ = 2000.0
_WIDTH_S = 0.002
_APART_S = 0.08
_FITS_S = 0.03
_FEWEST_CLICKS = 3


class ClockMap(msgspec.Struct, frozen=True, kw_only=True):
    """Time of each sample: sample n was recorded at ``began_s + n / rate_hz``, by that clock.

    ``uncertainty_ms`` is how far it may be off; ``how`` is ``clicks``, in logs of before version 0.3 also
    ``stamps`` or ``arrival``.
    """

    began_s: float
    rate_hz: float
    uncertainty_ms: float
    how: str


def _line(index: NDArray[np.float64], at_s: NDArray[np.float64], rate_hz: float) -> tuple[float, float]:
    """Fit time of sample 0 and rate; over a short time the rate is taken as it was asked for."""
    if (index[-1] - index[0]) / rate_hz < 10:
        return float(np.median(at_s - index / rate_hz)), rate_hz
    seconds_each, began_s = np.polyfit(index, at_s, 1)
    # A sound card is right to a thousandth; a fit that says more is a fit of the jitter.
    if abs(seconds_each * rate_hz - 1) > 1e-3:
        return float(np.median(at_s - index / rate_hz)), rate_hz
    return float(began_s), float(1 / seconds_each)


def find_clicks(samples: NDArray[np.float64], rate_hz: float) -> NDArray[np.float64]:
    """Return the times of short, hard sounds in ``samples``, seconds from the first, float64 (n_clicks,).

    A click is a peak of the signal above 2 kHz, ten times the middle level and a fifth of the loudest; its
    time is the rise through half of its peak. ``samples`` is float64 (n,). The rate must be high enough to
    separate a click from a motor.
    """
    signal: Any = load_signal()
    if rate_hz < 3 * _CLICK_HZ:
        raise InvalidValueError(
            f"sound: {rate_hz:g} samples/s are too few to find clicks", "record with 16000 or more"
        )
    sos = signal.butter(4, _CLICK_HZ, "highpass", fs=rate_hz, output="sos")
    width = max(3, round(_WIDTH_S * rate_hz))
    power = np.convolve(signal.sosfiltfilt(sos, samples) ** 2, np.ones(width) / width, "same")
    level = np.sqrt(np.maximum(power, 0.0))
    height = max(10 * float(np.median(level)), 0.2 * float(level.max(initial=0.0)), 1e-6)
    peaks, _ = signal.find_peaks(level, height=height, distance=max(1, round(_APART_S * rate_hz)))
    found = []
    for peak in peaks:
        start = max(0, peak - 5 * width)
        before = np.flatnonzero(level[start:peak] < level[peak] / 2)
        found.append((start + before[-1] + 1 if len(before) else peak) / rate_hz)
    return np.array(found)


def by_clicks(
    samples: NDArray[np.float64], rate_hz: float, clicks_s: Sequence[float], *, source: str
) -> ClockMap:
    """Map by clicks with known times, in a recording that began at any time.

    ``samples`` is float64 (n,), ``rate_hz`` as the recording has it. ``clicks_s`` is when there were clicks:
    three or more, not evenly spaced; ``source`` is what made them: a key of :data:`CLICKS_MS`.
    ``InvalidValueError`` if they are too few, or not found in the recording.
    """
    known = np.sort(np.asarray(clicks_s, np.float64))
    if len(known) < _FEWEST_CLICKS:
        raise InvalidValueError(
            f"{len(known)} clicks are in the log, {_FEWEST_CLICKS} or more are needed", "record again"
        )
    found = find_clicks(samples, rate_hz)
    best = np.empty((0, 2))
    for began_s in np.subtract.outer(known, found).ravel():
        gaps = np.abs(np.subtract.outer(known, found + began_s))
        nearest = gaps.argmin(axis=1)
        fits = gaps[np.arange(len(known)), nearest] < _FITS_S
        if fits.sum() > len(best):
            best = np.stack([known[fits], found[nearest[fits]]], axis=1)
    if len(best) < max(_FEWEST_CLICKS, 0.6 * len(known)):
        raise InvalidValueError(
            f"{len(best)} of the log's {len(known)} clicks are in the recording ({len(found)} sharp sounds in all)",
            "click closer to the microphone; is it the recording of this log?",
        )
    began_s, true_hz = _line(best[:, 1] * rate_hz, best[:, 0], rate_hz)
    off = best[:, 0] - (began_s + best[:, 1] * rate_hz / true_hz)
    uncertainty_ms = CLICKS_MS.get(source, 20.0) + 1e3 * float(np.abs(off).max())
    return ClockMap(began_s=began_s, rate_hz=true_hz, uncertainty_ms=uncertainty_ms, how="clicks")


# Twenty minutes of two channels at 48 kHz, floats of 32 bits.
_MOST_MIB: Final = 512
# Of full scale; files of floats may go a little over 1.
_LOUDEST: Final = 1e6


class OnsetLog(msgspec.Struct, frozen=True, kw_only=True, tag_field="format", tag="tega-onset-log"):
    """The bursts of one motor; times in seconds from any moment, all from the same.

    Attributes:
        made: When, UTC.
        layout: Which motors it has.
        percent: How hard.
        on_s: How long each burst lasted.
        bursts_s: When each burst's first frame was handed to the transport; ``unsent`` were not.
        clicks_s: When there was a click to go by.
        clicks: What made it; ``""`` for none.
        clock: In logs of before version 0.3 that have no clicks: how the recording lies in time.
        notes: Of the vest's driver.
    """

    version: Literal[1] = 1
    made: datetime
    driver: str
    device: str
    layout: str
    motor: int
    percent: int
    on_s: float
    bursts_s: tuple[float, ...]
    unsent: int = 0
    clicks_s: tuple[float, ...] = ()
    clicks: Literal["", "keys", "speaker"] = ""
    clock: ClockMap | None = None
    notes: tuple[str, ...] = ()


def write_log(log: OnsetLog, path: Path) -> None:
    """Write a log, whole or not at all."""
    write_whole(path, msgspec.json.format(msgspec.json.encode(log)) + b"\n", sync=True)


def read_log(path: Path) -> OnsetLog:
    """Read a log; ``RecordingError`` if it is missing, or is no such log."""
    try:
        return parse_json(read_foreign(path, most_mib=64), OnsetLog)
    except OSError as error:
        raise RecordingError(f"{path.name}: cannot be read: {error.strerror or error}") from error
    except msgspec.DecodeError as error:
        raise RecordingError(
            f"{path.name}: is no log of a motor's bursts: {error}",
            "give the file that 'tega-teleop vest onset --log' wrote",
        ) from error


def read_wav(path: Path) -> tuple[NDArray[np.float64], float]:
    """Read a recording, float64 (n,), -1 to 1, and its samples per second; of several channels, the loudest.

    ``RecordingError`` if it is missing, or no WAV file.
    """
    load_signal()  # says how to install SciPy
    from scipy.io import wavfile

    try:
        content = read_foreign(path, most_mib=_MOST_MIB)
    except OSError as error:
        raise RecordingError(f"{path.name}: cannot be read: {error.strerror or error}") from error
    try:
        rate_hz, data = wavfile.read(io.BytesIO(content))
    except Exception as error:  # whatever a damaged header leads to
        raise RecordingError(
            f"{path.name}: is no WAV file: {error}", f"convert it: ffmpeg -i {path.name} recording.wav"
        ) from error
    if data.dtype == np.uint8:
        samples = (data.astype(np.float64) - 128) / 128
    elif np.issubdtype(data.dtype, np.integer):
        samples = data / float(np.iinfo(data.dtype).max)
    else:
        samples = data.astype(np.float64)
    if not len(samples) or not rate_hz or not (np.abs(samples) < _LOUDEST).all():
        raise RecordingError(f"{path.name}: holds nothing, or no numbers, or has no rate", "record again")
    if samples.ndim > 1:
        samples = samples[:, int(samples.std(axis=0).argmax())]
    return samples, float(rate_hz)


def write_wav(path: Path, samples: NDArray[np.float64], rate_hz: float) -> None:
    """Write a recording, 16 bits, mono; samples are float64 (n,), -1 to 1, and clipped there."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with wave.open(str(path), "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(round(rate_hz))
        file.writeframes((np.clip(samples, -1, 1) * 32767).round().astype("<i2").tobytes())
