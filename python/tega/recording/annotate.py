"""Exchange a recording's annotations with BORIS and ELAN."""

from __future__ import annotations

from pathlib import Path

from tega.errors import InvalidValueError, RecordingError
from tega.recording.annotations import KEYS, STATES, AnnotationFile, read_annotations
from tega.recording.inspection import inspect_file
from tega.runtime.files.annotations import check_times, known_code
from tega.runtime.files.boris import BorisBehaviour, boris_observation, boris_project, read_boris
from tega.runtime.files.eaf import read_eaf, write_eaf
from tega.runtime.files.whole_file import write_whole


def import_annotations(recording: Path, path: Path, rater: str) -> int:
    """Add a BORIS or ELAN file's events to a recording as those of a new rater; return their number.

    ``path`` may be a BORIS project, a tabular or aggregated export, or an ELAN file. Of several observations
    or raters in it the one named like the recording or like the rater counts. ``InvalidValueError`` if the
    rater has coded the recording already; ``RecordingError`` also where an event is outside of it.
    """
    found = read_eaf(path, list(KEYS.values())) if path.suffix.lower() == ".eaf" else read_boris(path)
    name = next((one for one in (f"{recording.stem}_{rater}", recording.stem, rater) if one in found), None)
    if name is None and len(found) != 1:
        names = ", ".join(sorted(found)[:5]) or "none"
        raise RecordingError(
            f"{path.name}: holds {len(found)} observations ({names}), none of them {recording.stem!r}",
            "name the recording's observation like its file",
        )
    coded = found[name] if name is not None else next(iter(found.values()))
    length_s = inspect_file(recording).duration_s
    hint = f"times count from the beginning of {recording.name}"
    events = check_times(coded, length_s=length_s, name=f"{path.name}: {name or recording.stem}", hint=hint)
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
    key_of = {code: key for key, code in KEYS.items()}
    write_whole(
        path,
        boris_project(
            name=recording.stem,
            description="events of a recording; times count from its beginning",
            behaviours=[BorisBehaviour(c, key_of.get(c, ""), is_state=c in states) for c in codes],
            subjects=sorted({event.subject for event in every if event.subject}),
            observations={
                f"{recording.stem}_{rater}" if rater else recording.stem: boris_observation(
                    events, length_s=length_s, variables={}, media=video, states=states
                )
                for rater, events in raters.items()
            },
        ),
    )
