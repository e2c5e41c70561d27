"""Read EMG from arrays of numbers in a ROS 2 bag."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, ClassVar

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.devices.base import DeviceInfo, EmgChunk, Kind, Options
from tega.errors import DeviceUnavailableError, RecordingError
from tega.runtime.files.ros2_bag import Ros2Bag, rows_of
from tega.runtime.lifecycle import Opened

_CHUNK_S = 0.1
_MOST_NUMBERS = 1 << 28
# Arrivals vary; a silence is so many times the usual distance of two messages, and a rate differs by so much.
_GAP_PERIODS, _RATE_SHARE = 5.0, 0.02


class Ros2EmgOptions(Options, frozen=True):
    """Settings of :class:`Ros2Emg`.

    Attributes:
        file: An MCAP file of a bag, or the bag's folder.
        topic: Topic with arrays of numbers; by default the only one.
        rate_hz: Samples per second; by default as the messages' times say.
        channels: Columns to use, counted from 1; none means all.
    """

    file: Path
    topic: str = ""
    rate_hz: Annotated[float, msgspec.Meta(gt=0, le=10_000_000)] | None = None
    channels: tuple[Annotated[int, msgspec.Meta(ge=1)], ...] = ()


class Ros2Emg(Opened):
    """The samples of a topic; sample number n (from 1) is complete at n/rate after the first message's time."""

    kind: ClassVar[Kind] = "emg"
    summary: ClassVar[str] = "arrays of numbers of a topic in a ROS 2 bag (MCAP)"
    extra: ClassVar[str] = "ros2"
    requires: ClassVar[tuple[str, ...]] = ("mcap", "mcap_ros2")
    options_type: ClassVar[type[Options]] = Ros2EmgOptions

    def __init__(self, options: Ros2EmgOptions) -> None:
        self._options = options
        self._samples: NDArray[np.float64] | None = None
        self._rate_hz = options.rate_hz
        self._channels: tuple[int, ...] = options.channels
        self._notes: tuple[str, ...] = ()
        self._next = self._begin_ns = 0

    @property
    def info(self) -> DeviceInfo:
        """Name and, once open, rate, channels and number of samples."""
        return DeviceInfo(
            driver="ros2-emg",
            kind="emg",
            label=self._options.file.name,
            live=False,
            rate_hz=self._rate_hz,
            channels=tuple(f"ch{c}" for c in self._channels),
            unit="as recorded",
            n_items=None if self._samples is None else len(self._samples),
            notes=self._notes,
        )

    def open(self) -> None:
        """Read the topic; ``RecordingError`` where it is not a bag, or topic or channel is missing."""
        options, name = self._options, self._options.file.name
        bag = Ros2Bag(options.file, topic=options.topic, pictures=False)
        times: list[int] = []
        rows: list[NDArray[np.float64]] = []
        n_numbers = 0
        for t_ns, value in bag.messages():
            times.append(t_ns)
            rows.append(rows_of(value, f"{name} {bag.topic}"))
            n_numbers += rows[-1].size
            if rows[-1].shape[1] != rows[0].shape[1] or n_numbers > _MOST_NUMBERS:
                raise RecordingError(
                    f"{name}: {bag.topic} has {rows[0].shape[1]} channels, then {rows[-1].shape[1]}",
                    "name another topic",
                )
        if len(times) < 2:
            raise RecordingError(f"{name}: {bag.topic} has {len(times)} messages", "name another topic")
        samples = np.concatenate(rows)
        n_channels = samples.shape[1]
        if (most := max(options.channels, default=0)) > n_channels:
            raise RecordingError(
                f"{name}: {bag.topic} has {n_channels} channels, not {most}", "see --emg-channels"
            )
        self._channels = options.channels or tuple(range(1, n_channels + 1))
        self._samples = np.ascontiguousarray(samples[:, [c - 1 for c in self._channels]])
        self._use_times(np.array(times), np.array([len(one) for one in rows]))
        self._next = 0

    def _use_times(self, times_ns: NDArray[np.int64], counts: NDArray[np.int64]) -> None:
        """Take the rate from the messages' times, or compare it with the given one; note gaps."""
        steps = np.diff(times_ns) / 1e9
        # Of each distance as many samples came as the message behind it has.
        measured_hz = float(np.median(counts[1:] / steps))
        self._rate_hz = self._options.rate_hz or measured_hz
        notes = []
        if abs(measured_hz / self._rate_hz - 1) > _RATE_SHARE:
            notes.append(
                f"the messages' times say {measured_hz:.4g} samples per second, {self._rate_hz:g} is used"
            )
        gaps = steps > _GAP_PERIODS * float(np.median(steps))
        if gaps.any():
            n, longest_s = int(gaps.sum()), float(steps.max())
            notes.append(
                f"{n} gaps, the longest {longest_s:.3f} s: samples are missing, and later ones come early"
            )
        self._notes = tuple(notes)
        self._begin_ns = max(0, int(times_ns[0]) - round(int(counts[0]) * 1e9 / self._rate_hz))

    def close(self) -> None:
        """Forget the samples."""
        self._samples = None

    @property
    def ended(self) -> bool:
        """Whether all samples were read."""
        return self._samples is not None and self._next >= len(self._samples)

    def read(self, timeout_s: float) -> EmgChunk | None:  # noqa: ARG002  # a file never keeps one waiting
        """Return the next tenth of a second."""
        if self._samples is None or self._rate_hz is None:
            raise DeviceUnavailableError(f"bag {self._options.file.name!r} is not open", "open it first")
        if self.ended:
            return None
        first = self._next
        self._next = min(first + max(1, round(_CHUNK_S * self._rate_hz)), len(self._samples))
        t_ns = self._begin_ns + round(self._next * 1_000_000_000 / self._rate_hz)
        return EmgChunk(t_ns, first, self._samples[first : self._next])
