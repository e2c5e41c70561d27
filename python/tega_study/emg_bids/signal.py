"""Read the muscle signals of a trial's recordings, and write them as EDF+."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, Final, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.errors import RecordingError
from tega.recording.mcap_reader import McapReader
from tega.runtime.files.foreign_file import parse_json
from tega.runtime.lifecycle import require

_RECORD_S: Final = 0.1
# A wrong number of one chunk would ask for memory for all the samples up to it.
_MOST_GAP_S: Final = 3600.0
_MOST_CHANNELS: Final = 256


class _Source(msgspec.Struct):
    """Facts about the amplifier in a recording's head that are used."""

    label: str = ""
    rate_hz: float | None = None
    channels: tuple[str, ...] = ()
    unit: str = ""


class Gap(NamedTuple):
    """Samples that are not measured; the onset is since the first sample.

    ``kind`` is ``lost`` (they never came) or ``padding`` (the file's last record is filled up).
    """

    onset_s: float
    duration_s: float
    kind: str


class Muscles(NamedTuple):
    """Muscle signals of one recording: float64 (samples, channels), 0 where they were lost.

    ``unit`` is ``n/a`` where the amplifier does not state it; ``begin_ns`` is since the start of the session.
    """

    samples: NDArray[np.float64]
    rate_hz: float
    names: tuple[str, ...]
    unit: str
    device: str
    begin_ns: int
    gaps: tuple[Gap, ...]


def read_muscles(path: Path) -> Muscles | None:
    """Return the muscle signals of a recording; ``None`` where it has none.

    An unknown rate, or samples that contradict each other, are a ``RecordingError``.
    """
    reader = McapReader(path)
    chunks = [
        message.value for message in reader.messages(lambda topic: topic == "/emg/samples") if message.value
    ]
    if not chunks:
        return None
    try:
        source = parse_json(reader.metadata.get("sources", {}).get("emg", "{}").encode(), _Source)
    except msgspec.DecodeError as error:
        raise RecordingError(f"{path.name}: the description of its amplifier is damaged: {error}") from error
    rate_hz, n_channels = source.rate_hz or 0.0, int(chunks[0].n_channels)
    if not (0 < rate_hz < 1e6 and 0 < n_channels <= _MOST_CHANNELS):
        raise RecordingError(
            f"{path.name}: EMG of {n_channels} channels at {rate_hz:g} Hz cannot be written",
            "name an amplifier that states its rate",
        )
    blocks: list[NDArray[np.float64]] = []
    gaps: list[Gap] = []
    first = expected = int(chunks[0].first_index)
    for chunk in chunks:
        if chunk.n_channels != n_channels or len(chunk.samples) % n_channels:
            raise RecordingError(f"{path.name}: {len(chunk.samples)} samples of {chunk.n_channels} channels")
        n_lost = int(chunk.first_index) - expected
        if n_lost < 0 or n_lost > _MOST_GAP_S * rate_hz:
            raise RecordingError(f"{path.name}: sample {chunk.first_index} follows sample {expected - 1}")
        if n_lost:
            gaps.append(Gap((expected - first) / rate_hz, n_lost / rate_hz, "lost"))
            blocks.append(np.zeros((n_lost, n_channels)))
        blocks.append(np.array(chunk.samples, np.float64).reshape(-1, n_channels))
        expected = int(chunk.first_index) + len(blocks[-1])
    n_first = len(chunks[0].samples) // n_channels
    names = source.channels if len(source.channels) == n_channels else ()
    known = source.unit in {"µV", "μV", "uV", "mV", "V"}
    return Muscles(
        np.concatenate(blocks),
        rate_hz,
        names or tuple(f"ch{number}" for number in range(1, n_channels + 1)),
        source.unit.replace("µ", "u").replace("μ", "u") if known else "n/a",
        source.label,
        int(chunks[0].t_ns) - round((n_first - 1) / rate_hz * 1e9),
        tuple(gaps),
    )


def write_edf(path: Path, muscles: Muscles) -> tuple[Gap, ...]:
    """Write signals as EDF+ of 16 bits over the range of each channel, without date or name.

    Returns the samples of the file that were not measured: lost ones, and the padding of the last record. A
    sample that is no number is a ``RecordingError``.
    """
    edfio: Any = require("edfio", driver="study export --bids", extra="formats")
    if not np.isfinite(muscles.samples).all():
        raise RecordingError(f"{path.name}: a sample is not a number", "trim the recording before")
    n, per_record = len(muscles.samples), max(1, round(_RECORD_S * muscles.rate_hz))
    n_padding = -n % per_record
    samples = np.pad(muscles.samples, ((0, n_padding), (0, 0)), mode="edge")
    signals = [
        edfio.EdfSignal(
            np.ascontiguousarray(column),
            muscles.rate_hz,
            label=f"EMG {name}".encode("ascii", "replace").decode()[:16],
            physical_dimension="" if muscles.unit == "n/a" else muscles.unit,
            physical_range=_range(column),
        )
        for name, column in zip(muscles.names, samples.T, strict=True)
    ]
    edfio.Edf(signals, data_record_duration=per_record / muscles.rate_hz).write(path)
    padding = [Gap(n / muscles.rate_hz, n_padding / muscles.rate_hz, "padding")] if n_padding else []
    return (*muscles.gaps, *padding)


def _range(column: NDArray[np.float64]) -> tuple[float, float]:
    """Return a range that holds a channel, in numbers of at most eight characters, as EDF's header has them."""
    limit = max(float(np.abs(column).max()), 1e-3)
    digits = 10.0 ** (math.floor(math.log10(limit)) - 3)
    limit = math.ceil(limit / digits) * digits
    return -float(f"{limit:.4g}"), float(f"{limit:.4g}")
