"""Keep the events that raters code of a recording, in a file beside it: one JSON object a line, never changed.

``trial-001.mcap`` has ``trial-001.annotations.jsonl``. An event is on the disk once it is added; an undo is a line that
names the undone one, and the end of a state one that names its beginning.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Final, Protocol

import msgspec

from tega.errors import InvalidValueError, RecordingError, TegaError
from tega.runtime.files.annotations import CodedEvent
from tega.runtime.files.json_lines import JsonLines, read_json_lines

KEYS: Final = {"s": "slip", "d": "deformation", "x": "drop", "l": "lift_off"}
"""Behaviours by key."""

STATES: Final = frozenset({"deformation"})
"""Behaviours of :data:`KEYS` that last: the first press begins one, the second ends it."""


class _Line(msgspec.Struct, frozen=True, omit_defaults=True, forbid_unknown_fields=True):
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
    """Return the coded events of a recording by rater, in the order of their beginnings."""
    return _events(_checked(read_json_lines(annotations_path(recording), _Line, "annotation"), recording))


def _checked(lines: list[_Line], recording: Path) -> list[_Line]:
    """Return the lines, each of which names none but an earlier one."""
    for line in lines:
        named = line.ends or line.undoes
        if named is not None and not 0 < named < line.n:
            raise RecordingError(
                f"{annotations_path(recording).name}: line {line.n} names line {named}, which is no earlier one",
                "restore the file from a copy",
            )
    return lines


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


class AnnotationFile(JsonLines[_Line]):
    """A recording's annotations, open for one rater to add to; one program at a time.

    ``InvalidValueError`` where the rater has no code; the others are those of :class:`JsonLines`.
    """

    def __init__(self, recording: Path, rater: str) -> None:
        if not rater.strip():
            raise InvalidValueError("the rater has no code", "give one, such as --rater r1")
        self.path, self._rater = annotations_path(recording), rater
        self._ours = False
        taken = f"{self.path.name}: another program has it open", "close that first"
        super().__init__(self.path, _Line, "annotation", taken=taken)
        self._ours = True
        try:
            _checked(self.entries, recording)
        except RecordingError:
            self.close()
            raise

    @property
    def events(self) -> list[CodedEvent]:
        """Events of this rater, in the order of their beginnings."""
        return _events(self.entries).get(self._rater, [])

    def add(self, event: CodedEvent) -> None:
        """Add an event; when this returns it is on the disk."""
        self._step(
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
            self._step(t_s=round(t_s, 6), ends=begun.n)
            return f"{code} {begun.t_s:.2f} to {t_s:.2f} s"
        self.add(CodedEvent(t_s, "", code, duration_s=None if is_state else 0.0))
        return f"{code} from {t_s:.2f} s" if is_state else f"{code} at {t_s:.2f} s"

    def undo(self) -> str:
        """Undo this rater's last step that is not undone; return that step in words, ``""`` for none."""
        undone = {line.undoes for line in self.entries}
        for line in reversed(self.entries):
            if line.rater == self._rater and line.undoes is None and line.n not in undone:
                self._step(undoes=line.n)
                return f"undone: {line.code or 'the end of a state'} at {line.t_s:.2f} s"
        return ""

    def close(self) -> None:
        """Close the file; one without an annotation is removed."""
        super().close()
        if self._ours and not self.entries:
            self.path.unlink(missing_ok=True)
        self._ours = False

    def _open_state(self, code: str) -> _Line | None:
        undone = {line.undoes for line in self.entries}
        ended = {line.ends for line in self.entries if line.n not in undone}
        for line in reversed(self.entries):
            if (line.rater, line.code) == (self._rater, code) and line.n not in undone:
                return line if line.duration_s is None and line.n not in ended else None
        return None

    def _step(self, **fields: object) -> None:
        line = _Line(n=len(self.entries) + 1, rater=self._rater, **fields)  # type: ignore[arg-type]  # fields of a line
        self.append(line)


class _Played(Protocol):
    """Knows the moment of the recording that is played."""

    @property
    def at_s(self) -> float:
        """Seconds from the beginning of the recording."""
        ...


class AnnotationKeys:
    """Codes an event for each key, at the moment of the recording that ``played`` has then; from any thread.

    Raises what :class:`~tega.recording.annotations.AnnotationFile` does.
    """

    def __init__(self, recording: Path, rater: str, played: _Played) -> None:
        self._file = AnnotationFile(recording, rater)
        self._played = played
        self._lock = threading.Lock()

    def __enter__(self) -> Callable[[str], str]:
        """Return the function that takes a key and returns its effect in words."""
        return self.press

    def __exit__(self, *_error: object) -> None:
        """Close the file."""
        with self._lock:
            self._file.close()

    def press(self, key: str) -> str:
        """Code the behaviour of a key, or undo the last step (``u``); return the effect in words, ``""`` for none."""
        t_s = self._played.at_s
        with self._lock:
            try:
                if key == "u":
                    return self._file.undo()
                code = KEYS.get(key)
                return "" if code is None else self._file.press(code, t_s, is_state=code in STATES)
            except (TegaError, OSError, ValueError) as error:  # a full disk; or the file is closed already
                return f"not kept: {error}"
