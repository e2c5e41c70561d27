"""Give the samples of a recording in their order, and read those of a file; another driver adds bags."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

import msgspec

from tega.devices.base import DeviceInfo, EmgChunk, Kind, Options
from tega.errors import DeviceUnavailableError, RecordingError
from tega.records import HeardMarker
from tega.runtime.lifecycle import Opened

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from tega.runtime.files.tables.table import FileEvent
    from tega.runtime.files.tables.timing import Timing


_CHUNK_S = 0.1


class RecordedEmg(Opened):
    """The samples of a file or bag; number n (from 1) is complete at n/rate, or at the recording's own time.

    Lost samples are a gap in the numbers of the samples, as those of a live source are. A driver's ``open``
    reads the samples, and sets what it learns about them.
    """

    kind: ClassVar[Kind] = "emg"
    name: ClassVar[str]

    def __init__(self, file: Path, rate_hz: float | None, channels: tuple[int, ...]) -> None:
        self._label, self._rate_hz, self._channels = file.name, rate_hz, channels
        self._samples: NDArray[np.float64] | None = None
        self._starts = [(0, 0)]  # rows that follow a loss, and the numbers of their samples
        self._timing: Timing | None = None
        self._begin_ns = 0
        self._unit = "as recorded"
        self._notes: tuple[str, ...] = ()
        self._next = self._stretch = 0

    @property
    def info(self) -> DeviceInfo:
        """Name, rate and channels; once open, also the number of samples, and notes on choices and losses."""
        return DeviceInfo(
            driver=self.name,
            kind="emg",
            label=self._label,
            live=False,
            rate_hz=self._rate_hz,
            channels=tuple(f"ch{c}" for c in self._channels),
            unit=self._unit,
            n_items=None if self._samples is None else len(self._samples),
            notes=self._notes,
        )

    def close(self) -> None:
        """Forget the samples."""
        self._samples = None

    @property
    def ended(self) -> bool:
        """Whether all samples were read."""
        return self._samples is not None and self._next >= len(self._samples)

    def read(self, timeout_s: float) -> EmgChunk | None:  # noqa: ARG002  # a file never keeps one waiting
        """Return the next tenth of a second, cut where samples were lost."""
        samples, rate_hz = self._samples, self._rate_hz
        if samples is None or rate_hz is None:
            raise DeviceUnavailableError(f"{self.name} {self._label!r} is not open", "open it first")
        if self.ended:
            return None
        begins, number = self._starts[self._stretch]
        following = self._stretch + 1
        ends = self._starts[following][0] if following < len(self._starts) else len(samples)
        first = self._next
        self._next = min(first + max(1, round(_CHUNK_S * rate_hz)), ends)
        self._stretch += self._next == ends
        first_index = first - begins + number
        t_ns = self._begin_ns + round((first_index + self._next - first) * 1_000_000_000 / rate_hz)
        if self._timing is not None:
            t_ns += round(self._timing.offset_s(self._next - 1) * 1e9)
        return EmgChunk(t_ns, first_index, samples[first : self._next])


class EmgFileOptions(Options, frozen=True):
    """Settings of :class:`EmgFile`; all but ``file`` are for files that leave something open.

    Attributes:
        file: A text table, an array file, or a recording of a format that ``emg inspect`` lists.
        rate_hz: Samples per second; ``None`` for the rate that the file states or its times show.
        channels: Columns to read, counted from 1; empty for those that are EMG.
        variable: Array or stream of a file that has several.
        decimal: Decimal sign of a text table.
        time: Column of the time, counted from 1; ``none`` to ignore the file's times.
        rows: Meaning of each row of a table or an array.
    """

    file: Path
    rate_hz: Annotated[float, msgspec.Meta(gt=0, le=10_000_000)] | None = None
    channels: tuple[Annotated[int, msgspec.Meta(ge=1)], ...] = ()
    variable: str = "emg"
    decimal: Literal["auto", "point", "comma"] = "auto"
    time: Literal["auto", "none"] | Annotated[int, msgspec.Meta(ge=1)] = "auto"
    rows: Literal["auto", "samples", "channels"] = "auto"


class EmgFile(RecordedEmg):
    """The samples of a file."""

    name: ClassVar[str] = "emg-file"
    summary: ClassVar[str] = "a recording: text, .npy, .mat, EDF, XDF and others"
    extra: ClassVar[str] = "lab"
    requires: ClassVar[tuple[str, ...]] = ("scipy",)
    options_type: ClassVar[type[Options]] = EmgFileOptions

    def __init__(self, options: EmgFileOptions) -> None:
        super().__init__(options.file, options.rate_hz, options.channels)
        self._options = options
        self._events: list[FileEvent] = []

    def open(self) -> None:
        """Read the file; ``RecordingError`` also if it contradicts the given rate or is ambiguous."""
        from tega.runtime.files.signals import read_signals
        from tega.runtime.files.tables.table import Reading

        if self._samples is None:
            options = self._options
            given = {name: getattr(options, name) for name in Reading.__struct_fields__}
            signals = read_signals(options.file, Reading(**given))
            if signals.rate_hz is None:
                raise RecordingError(
                    f"{self._label}: neither the file nor the settings state its rate",
                    "set rate_hz, --emg-rate-hz of replay, to the samples per second of one channel",
                )
            self._samples, self._rate_hz, self._channels = signals.samples, signals.rate_hz, signals.channels
            self._starts, self._timing = signals.starts, signals.timing
            self._unit = signals.decision.unit or self._unit
            self._notes = tuple(f"{self._label}: {note}" for note in signals.notes)
            self._events = sorted(signals.decision.events, key=lambda one: one.t_s)
        self._next = self._stretch = 0

    @property
    def marked(self) -> tuple[HeardMarker, ...]:
        """Events that the file holds beside its samples, by time; those before the first sample come with it."""
        return tuple(
            HeardMarker(t_ns=max(0, round(one.t_s * 1e9)), text=one.text, source=self._label, stamp_s=one.t_s)
            for one in self._events
        )
