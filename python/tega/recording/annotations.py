"""Keep the events that raters code of a recording, in a file beside it: one JSON object a line, never changed.

``trial-001.mcap`` has ``trial-001.annotations.jsonl``. An event is on the disk once it is added; an undo is a line that
names the undone one, and the end of a state one that names its beginning. BORIS and ELAN exchange them.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Final

import msgspec

from tega.errors import InvalidValueError, RecordingError, TegaError
from tega.recording.inspection import inspect_file
from tega.recording.mcap_folder import recording_stem
from tega.runtime.files.annotations import CodedEvent, check_times, known_code
from tega.runtime.files.boris import BorisBehaviour, boris_observation, boris_project, read_boris
from tega.runtime.files.eaf import read_eaf, write_eaf
from tega.runtime.files.whole_file import JsonLines, read_json_lines, write_whole
from tega.runtime.words import printable

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
    return recording.with_name(f"{recording_stem(recording)}.annotations.jsonl")


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
        self._step(**event._replace(t_s=round(event.t_s, 6))._asdict())

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


@contextmanager
def annotation_keys(recording: Path, rater: str, at_s: Callable[[], float]) -> Iterator[Callable[[str], str]]:
    """Code an event for each key, at the moment of the recording that ``at_s`` returns then, seconds.

    Yields the function that takes a key from any thread, ``u`` to undo the last step, and returns the effect in words,
    ``""`` for none. Raises what :class:`AnnotationFile` does.
    """
    file, lock = AnnotationFile(recording, rater), threading.Lock()

    def press(key: str) -> str:
        t_s = at_s()
        with lock:
            try:
                if key == "u":
                    return file.undo()
                code = KEYS.get(key)
                return "" if code is None else file.press(code, t_s, is_state=code in STATES)
            except (TegaError, OSError, ValueError) as error:  # a full disk; or the file is closed already
                return f"not kept: {error}"

    try:
        yield press
    finally:
        with lock:
            file.close()


def import_annotations(recording: Path, path: Path, rater: str) -> int:
    """Add a BORIS or ELAN file's events to a recording as those of a new rater; return their number.

    ``path`` may be a BORIS project, a tabular or aggregated export, or an ELAN file. Of several observations
    or raters in it the one named like the recording or like the rater counts. ``InvalidValueError`` if the
    rater has coded the recording already; ``RecordingError`` also where an event is outside of it.
    """
    found = read_eaf(path, list(KEYS.values())) if path.suffix.lower() == ".eaf" else read_boris(path)
    stem = printable(recording_stem(recording))
    name = next((one for one in (f"{stem}_{rater}", stem, rater) if one in found), None)
    if name is None and len(found) != 1:
        names = ", ".join(sorted(found)[:5]) or "none"
        raise RecordingError(
            f"{path.name}: holds {len(found)} observations ({names}), none of them {stem!r}",
            "name the recording's observation like its file",
        )
    coded = found[name] if name is not None else next(iter(found.values()))
    length_s = inspect_file(recording).duration_s
    hint = f"times count from the beginning of {recording.name}"
    events = check_times(coded, length_s=length_s, name=f"{path.name}: {name or stem}", hint=hint)
    if read_annotations(recording).get(rater):
        raise InvalidValueError(f"{rater} has annotated {recording.name} already", "give another --rater")
    with AnnotationFile(recording, rater) as file:
        for event in events:
            file.add(event._replace(code=known_code(event.code, KEYS.values()) or event.code.strip()))
    return len(events)


def export_annotations(recording: Path, path: Path, *, video: str = "") -> None:
    """Write a recording's annotations as a new BORIS project, or as an ELAN file (``.eaf``).

    ``video`` names a video of the recording beside it; ``""`` for none. An existing file is
    ``InvalidValueError``.
    """
    if path.exists():
        raise InvalidValueError(f"{path}: is there already", "name a new file")
    if video != (text := printable(video)):
        raise InvalidValueError(f"the name {text!r} cannot be written as text", "rename the video")
    length_s = inspect_file(recording).duration_s
    raters = read_annotations(recording) or {"": []}
    raters = {
        rater: check_times(events, length_s=length_s, name=recording.name, hint="")
        for rater, events in raters.items()
    }
    every = [event for events in raters.values() for event in events]
    codes = list(dict.fromkeys([*KEYS.values(), *(event.code for event in every)]))
    if path.suffix.lower() == ".eaf":
        write_eaf(path, raters, codes=codes, media=video)
        return
    states = sorted(STATES | {event.code for event in every if event.duration_s})
    key_of, stem = {code: key for key, code in KEYS.items()}, recording_stem(recording)
    write_whole(
        path,
        boris_project(
            name=stem,
            description="events of a recording; times count from its beginning",
            behaviours=[BorisBehaviour(c, key_of.get(c, ""), is_state=c in states) for c in codes],
            subjects=sorted({event.subject for event in every if event.subject}),
            observations={
                f"{stem}_{rater}" if rater else stem: boris_observation(
                    events, length_s=length_s, variables={}, media=video, states=states
                )
                for rater, events in raters.items()
            },
        ),
    )
