"""Read EMG from arrays of numbers in a ROS 2 bag."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, ClassVar

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.devices.base import Options
from tega.devices.emg.emg_file import RecordedEmg
from tega.errors import RecordingError
from tega_ros2.bag import Ros2Bag, rows_of

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


class Ros2Emg(RecordedEmg):
    """The samples of a topic; sample number n (from 1) is complete at n/rate after the first message's time."""

    name: ClassVar[str] = "ros2-emg"
    summary: ClassVar[str] = "arrays of numbers of a topic in a ROS 2 bag (MCAP)"
    extra: ClassVar[str] = "ros2"
    requires: ClassVar[tuple[str, ...]] = ("mcap", "mcap_ros2")
    options_type: ClassVar[type[Options]] = Ros2EmgOptions

    def __init__(self, options: Ros2EmgOptions) -> None:
        super().__init__(options.file, options.rate_hz, options.channels)
        self._options = options

    def open(self) -> None:
        """Read the topic; ``RecordingError`` where it is not a bag, or topic or channel is missing."""
        options, name = self._options, self._label
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
        self._next = self._stretch = 0

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
