"""Keep the events that raters code of a recording, in a file beside it: one JSON object a line, never changed.

``trial-001.mcap`` has ``trial-001.annotations.jsonl``. An event is on the disk once it is added; an undo is a line that
names the undone one, and the end of a state one that names its beginning.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import IO, Annotated, Final, Self

import msgspec

from tega.errors import DeviceUnavailableError, InvalidValueError, RecordingError
from tega.runtime.files.annotations import CodedEvent
from tega.runtime.files.foreign_file import check_file, parse_json, read_foreign
from tega.runtime.files.lock import lock_file
from tega.runtime.files.whole_file import open_to_append

_MOST_MIB: Final = 64
KEYS: Final = {"s": "slip", "d": "deformation", "x": "drop", "l": "lift_off"}
"""Behaviours by key."""

STATES: Final = frozenset({"deformation"})
"""Behaviours of :data:`KEYS` that last: the first press begins one, the second ends it."""


class _Line(msgspec.Struct, frozen=True, omit_defaults=True, forbid_unknown_fields=True):
    """A line of the file."""

    n: Annotated[int, msgspec.Meta(ge=1)]
    rater: Annotated[str, msgspec.Meta(max_length=200)]
    t_s: Annotated[float, msgspec.Meta(ge=-1e9, le=1e9)] = 0.0
    code: str = ""
    duration_s: Annotated[float, msgspec.Meta(ge=0, le=1e9)] | None = 0.0
    subject: str = ""
    modifiers: tuple[str, ...] = ()
    comment: str = ""
    ends: int | None = None
    undoes: int | None = None


def annotations_path(recording: Path) -> Path:
    """Return where a recording's annotations are."""
    return recording.with_suffix(".annotations.jsonl")


def read_annotations(recording: Path) -> dict[str, list[CodedEvent]]:
    """Return the coded events of a recording by rater, in the order of their beginnings.

    Raises:
        RecordingError: A line of the file is no annotation.
    """
    path = annotations_path(recording)
    if not path.exists():
        return {}
    return _events(_parse(read_foreign(path, most_mib=_MOST_MIB), path)[0])


def _parse(content: bytes, path: Path) -> tuple[list[_Line], int]:
    """Return the lines, and how many bytes they take; a last line that was cut off is left out."""
    lines: list[_Line] = []
    *whole, _cut = content.split(b"\n")
    for number, line in enumerate(whole, start=1):
        try:
            one = parse_json(line, _Line)
        except msgspec.DecodeError as error:
            raise RecordingError(
                f"{path.name}: line {number} is no annotation: {error}", "restore the file from a copy"
            ) from error
        named = one.ends or one.undoes
        if one.n != number or (named is not None and not 0 < named < number):
            raise RecordingError(
                f"{path.name}: line {number} is not the next one", "restore the file from a copy"
            )
        lines.append(one)
    return lines, sum(len(line) + 1 for line in whole)


def _events(lines: list[_Line]) -> dict[str, list[CodedEvent]]:
    undone = {line.undoes for line in lines}
    ends = {line.ends: line.t_s for line in lines if line.ends is not None and line.n not in undone}
    found: dict[str, list[CodedEvent]] = {}
    for line in lines:
        events = found.setdefault(line.rater, [])
        if line.code and line.n not in undone:
            lasted = line.duration_s if line.n not in ends else max(ends[line.n] - line.t_s, 0.0)
            events.append(CodedEvent(line.t_s, line.subject, line.code, line.modifiers, line.comment, lasted))
    return {rater: sorted(events, key=lambda one: one.t_s) for rater, events in found.items()}


class AnnotationFile:
    """A recording's annotations, open for one rater to add to; one program at a time.

    Args:
        recording: The recording.
        rater: Code of the rater.

    Raises:
        RecordingError: The file holds something else.
        DeviceUnavailableError: Another program has it open.
        InvalidValueError: The rater has no code.
    """

    def __init__(self, recording: Path, rater: str) -> None:
        if not rater.strip():
            raise InvalidValueError("the rater has no code", "give one, such as --rater r1")
        self.path, self._rater = annotations_path(recording), rater
        if self.path.exists():
            check_file(self.path, most_mib=_MOST_MIB)
        self._file: IO[bytes] = open_to_append(self.path)
        if not lock_file(self._file, self.path):
            self._file.close()
            raise DeviceUnavailableError(f"{self.path.name}: another program has it open", "close that first")
        try:
            self._file.seek(0)
            self._lines, good = _parse(self._file.read(), self.path)
            self._file.truncate(good)
        except BaseException:
            self._file.close()
            raise

    @property
    def events(self) -> list[CodedEvent]:
        """Events of this rater, in the order of their beginnings."""
        return _events(self._lines).get(self._rater, [])

    def add(self, event: CodedEvent) -> None:
        """Add an event; when this returns it is on the disk."""
        self._put(
            t_s=round(event.t_s, 6),
            code=event.code,
            duration_s=event.duration_s,
            subject=event.subject,
            modifiers=event.modifiers,
            comment=event.comment,
        )

    def press(self, code: str, t_s: float, *, is_state: bool) -> str:
        """Add a point event, or begin or end a state; return the effect in words."""
        begun = self._open_state(code)
        if is_state and begun is not None and t_s >= begun.t_s:
            self._put(t_s=round(t_s, 6), ends=begun.n)
            return f"{code} {begun.t_s:.2f} to {t_s:.2f} s"
        self.add(CodedEvent(t_s, "", code, duration_s=None if is_state else 0.0))
        return f"{code} from {t_s:.2f} s" if is_state else f"{code} at {t_s:.2f} s"

    def undo(self) -> str:
        """Undo this rater's last step that is not undone; return that step in words, ``""`` for none."""
        undone = {line.undoes for line in self._lines}
        for line in reversed(self._lines):
            if line.rater == self._rater and line.undoes is None and line.n not in undone:
                self._put(undoes=line.n)
                return f"undone: {line.code or 'the end of a state'} at {line.t_s:.2f} s"
        return ""

    def close(self) -> None:
        """Close the file; one without an annotation is removed."""
        if not self._file.closed:
            empty = self._file.seek(0, os.SEEK_END) == 0
            self._file.close()
            if empty:
                self.path.unlink(missing_ok=True)

    def __enter__(self) -> Self:
        """Return itself."""
        return self

    def __exit__(self, *_error: object) -> None:
        """Close the file."""
        self.close()

    def _open_state(self, code: str) -> _Line | None:
        undone = {line.undoes for line in self._lines}
        ended = {line.ends for line in self._lines if line.n not in undone}
        for line in reversed(self._lines):
            if (line.rater, line.code) == (self._rater, code) and line.n not in undone:
                return line if line.duration_s is None and line.n not in ended else None
        return None

    def _put(self, **fields: object) -> None:
        line = _Line(n=len(self._lines) + 1, rater=self._rater, **fields)  # type: ignore[arg-type]  # fields of a line
        self._file.write(msgspec.json.encode(line) + b"\n")
        self._file.flush()
        os.fsync(self._file.fileno())
        self._lines.append(line)
