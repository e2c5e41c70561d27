"""Read a recording as NumPy arrays, data frames and pictures: ``tega.open_recording``.

Example:
    >>> import tega
    >>> recording = tega.open_recording("examples/recorded-lift")
    >>> touch = recording["/tactile/thumb/contact"].to_numpy()
    >>> touch["t_s"].shape, round(float(touch["force_n"].max()), 1) > 0
    ((276,), True)
    >>> recording["/tactile/thumb/image"][100].shape
    (320, 240, 3)
    >>> recording[1.0:2.0]["/emg/samples"].to_numpy().dtype.names[:2]
    ('t_s', 'log_s')
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import suppress
from datetime import UTC, datetime
from html import escape
from os import PathLike
from pathlib import Path
from typing import overload

import tega.haptics  # noqa: F401  # draws vest frames
from tega.errors import RecordingError
from tega.recording.mcap_folder import session_files
from tega.recording.mcap_index import open_indexed
from tega.recording.mcap_reader import table_ns
from tega.recording.pictures import PICTURES
from tega.recording.record_columns import emg_source
from tega.recording.topics import NEVER_NS, PictureTopic, RecordedFile, Topic

__all__ = ["PictureTopic", "RecordedTopics", "Topic", "open_recording"]


def open_recording(*paths: str | PathLike[str]) -> RecordedTopics:
    """Open recordings, without loading them.

    Args:
        paths: A recording, the folder of a session, or several of them, which are read as one.

    Returns:
        The topics by name.

    Raises:
        RecordingError: There is no recording, or one of them cannot be read or was not recorded by TEGA.
        MissingExtraError: A package of the extra ``record`` is not installed.
    """
    found = list(dict.fromkeys(file for path in paths for file in session_files(Path(path))))
    if not found:
        raise RecordingError("no recording is named", "give a file, or the folder of a session")
    readers = [open_indexed(path) for path in found]
    zeros = [table_ns(reader.metadata.get("tega", {}), "epoch_ns") for reader in readers]
    known = [zero for zero in zeros if zero is not None]
    files = []
    for reader, zero in zip(readers, zeros, strict=True):
        if zero is None and reader.until_ns:
            raise RecordingError(
                f"{reader.path.name}: gives no time of its start", "inspect shows its tables"
            )
        zero_ns = zero or 0
        start_ns = table_ns(reader.metadata.get("tega", {}), "start_ns") or 0
        shift_ns = zero_ns - min(known, default=0) if zero is not None else 0
        files.append(RecordedFile(reader, zero_ns, start_ns, shift_ns, emg_source(reader)))
    files.sort(key=lambda file: file.zero_ns)
    return RecordedTopics(tuple(files), -NEVER_NS, NEVER_NS)


class RecordedTopics(Mapping[str, "Topic"]):
    """Topics of a recording, or of several that are read as one.

    Times are seconds since the start of the first file. A slice of seconds, such as ``recording[10.0:20.0]``, has the
    same topics with the messages of that time by their log time, when the loop received the record.

    Attributes:
        clock: Clock of the times, in words.
        complete: Whether every file was finished.
        files: The files, in the order of their starts.
    """

    def __init__(self, files: tuple[RecordedFile, ...], from_ns: int, to_ns: int) -> None:
        self._files, self._from_ns, self._to_ns = files, from_ns, to_ns
        self.files = tuple(file.reader.path for file in files)
        self.complete = all(file.reader.complete for file in files)
        self._names = sorted({name for file in files for name in file.reader.topics})
        self.clock = (
            f"seconds since the session's start, {self.start.isoformat()}, on the monotonic clock of the recording "
            "machine" + ("; files are placed by their start on its wall clock" if len(files) > 1 else "")
        )

    @property
    def start(self) -> datetime:
        """Start of the session on the wall clock of the recording machine."""
        zero_ns = self._files[0].zero_ns
        with suppress(OverflowError, OSError, ValueError):
            return datetime.fromtimestamp(zero_ns / 1e9, UTC)
        raise RecordingError(f"{self.files[0].name}: start at {zero_ns} ns since 1970 is no time")

    @property
    def duration_s(self) -> float:
        """Time of the last message, seconds since the start."""
        ends = [
            file.reader.until_ns - file.zero_ns + file.shift_ns
            for file in self._files
            if file.reader.until_ns
        ]
        return min(max(ends, default=0), self._to_ns) / 1e9

    def between(self, from_s: float, to_s: float) -> RecordedTopics:
        """Return the part from ``from_s`` to before ``to_s``, seconds; its times count from the same start.

        Raises:
            RecordingError: The times are not numbers, or the end is before the beginning.
        """
        if not from_s <= to_s:
            raise RecordingError(f"from {from_s} s to {to_s} s is no span", "give two times in rising order")
        from_ns, to_ns = (round(min(max(t, -9e9), 9e9) * 1e9) for t in (from_s, to_s))
        return RecordedTopics(self._files, max(self._from_ns, from_ns), min(self._to_ns, to_ns))

    @overload
    def __getitem__(self, key: str, /) -> Topic: ...
    @overload
    def __getitem__(self, key: slice, /) -> RecordedTopics: ...
    def __getitem__(self, key: str | slice, /) -> Topic | RecordedTopics:
        """Return a topic by its name, or the part between two times in seconds."""
        if isinstance(key, slice):
            if key.step is not None:
                raise RecordingError(
                    f"a step of {key.step} has no meaning", "give two times: recording[10.0:20.0]"
                )
            begin = -9e9 if key.start is None else key.start
            return self.between(begin, 9e9 if key.stop is None else key.stop)
        if key not in self._names:
            raise KeyError(f"{key}: no such topic; there are {', '.join(self._names)}")
        files = tuple(file for file in self._files if key in file.reader.topics)
        schema = files[0].reader.topics[key]
        kind = PictureTopic if schema in PICTURES else Topic
        return kind(key, schema, self._files, self._from_ns, self._to_ns, clock=self.clock)

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names of the topics."""
        return iter(self._names)

    def __len__(self) -> int:
        """Return the number of topics."""
        return len(self._names)

    def __repr__(self) -> str:
        """Return files, length and topics."""
        names = ", ".join(path.name for path in self.files)
        state = "" if self.complete else ", unfinished"
        return f"<recording {names}: {self.duration_s:.1f} s, {len(self)} topics{state}>"

    def _repr_html_(self) -> str:
        rows = "".join(
            f"<tr><td>{escape(name)}</td><td>{escape(topic.schema)}</td><td>{len(topic)}</td></tr>"
            for name, topic in self.items()
        )
        return f"<p>{escape(repr(self)[1:-1])}; {escape(self.clock)}</p><table>{rows}</table>"
