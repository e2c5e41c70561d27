"""Read a recorded EMG signal from a file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

import msgspec

from tega.devices.base import DeviceInfo, EmgChunk, Kind, Options
from tega.errors import DeviceUnavailableError, RecordingError
from tega.records import HeardMarker
from tega.runtime.lifecycle import Opened

if TYPE_CHECKING:
    from tega.runtime.files.signals import Signals


_CHUNK_S = 0.1


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


class EmgFile(Opened):
    """The samples of a file; sample number n (from 1) is complete at n/rate, or at the file's own time.

    Lost samples are a gap in the numbers of the samples, as those of a live source are.
    """

    kind: ClassVar[Kind] = "emg"
    summary: ClassVar[str] = "a recording: text, .npy, .mat, EDF, XDF and others"
    extra: ClassVar[str] = "lab"
    requires: ClassVar[tuple[str, ...]] = ("scipy",)
    options_type: ClassVar[type[Options]] = EmgFileOptions

    def __init__(self, options: EmgFileOptions) -> None:
        self._options = options
        self._signals: Signals | None = None
        self._names = tuple(f"ch{c}" for c in options.channels)
        self._next = self._stretch = 0

    @property
    def info(self) -> DeviceInfo:
        """Name, rate and channels; once open, also the number of samples, and notes on choices and losses."""
        signals = self._signals
        notes = () if signals is None else signals.notes
        return DeviceInfo(
            driver="emg-file",
            kind="emg",
            label=self._options.file.name,
            live=False,
            rate_hz=self._options.rate_hz if signals is None else signals.rate_hz,
            channels=self._names,
            unit="as recorded" if signals is None else signals.decision.unit or "as recorded",
            n_items=None if signals is None else len(signals.samples),
            notes=tuple(f"{self._options.file.name}: {note}" for note in notes),
        )

    def open(self) -> None:
        """Read the file; ``RecordingError`` also if it contradicts the given rate or is ambiguous."""
        from tega.runtime.files.signals import read_signals
        from tega.runtime.files.tables.table import Reading

        if self._signals is None:
            options = self._options
            given = {name: getattr(options, name) for name in Reading.__struct_fields__}
            signals = read_signals(options.file, Reading(**given))
            if signals.rate_hz is None:
                raise RecordingError(
                    f"{options.file.name}: neither the file nor the settings state its rate",
                    "set rate_hz, --emg-rate-hz of replay, to the samples per second of one channel",
                )
            self._signals = signals
            self._names = tuple(f"ch{c}" for c in signals.channels)
        self._next = self._stretch = 0

    def close(self) -> None:
        """Forget the samples."""
        self._signals = None

    @property
    def marked(self) -> tuple[HeardMarker, ...]:
        """Events that the file holds beside its samples, by time; those before the first sample come with it."""
        events = () if self._signals is None else self._signals.decision.events
        file = self._options.file.name
        return tuple(
            HeardMarker(t_ns=max(0, round(one.t_s * 1e9)), text=one.text, source=file, stamp_s=one.t_s)
            for one in sorted(events, key=lambda one: one.t_s)
        )

    @property
    def ended(self) -> bool:
        """Whether all samples were read."""
        return self._signals is not None and self._next >= len(self._signals.samples)

    def read(self, timeout_s: float) -> EmgChunk | None:  # noqa: ARG002  # a file never keeps one waiting
        """Return the next tenth of a second, cut where samples were lost."""
        signals = self._signals
        if signals is None or signals.rate_hz is None:
            raise DeviceUnavailableError(f"emg-file {self._options.file.name!r} is not open", "open it first")
        if self.ended:
            return None
        begins, number = signals.starts[self._stretch]
        following = self._stretch + 1
        ends = signals.starts[following][0] if following < len(signals.starts) else len(signals.samples)
        first = self._next
        self._next = min(first + max(1, round(_CHUNK_S * signals.rate_hz)), ends)
        self._stretch += self._next == ends
        first_index = first - begins + number
        t_ns = round((first_index + self._next - first) * 1_000_000_000 / signals.rate_hz)
        if signals.timing is not None:
            t_ns += round(signals.timing.offset_s(self._next - 1) * 1e9)
        return EmgChunk(t_ns, first_index, signals.samples[first : self._next])
