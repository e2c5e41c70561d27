"""Keep what is noted beside a plan: objects, who has withdrawn, and who compared conditions before it was complete.

Properties of objects are in ``objects.toml``, one table an object, for people to read and edit; photos are in
``objects/``. The plan names the objects only, and stays unchanged.
"""

from __future__ import annotations

import logging
import os
import re
import time
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any, Final

import msgspec

from tega.config.errors import wrong_value
from tega.errors import InvalidValueError, RecordingError
from tega.runtime.files.foreign_file import parse_toml, path_below, read_foreign, read_words
from tega.runtime.files.toml_text import tree_text
from tega.runtime.files.whole_file import write_whole
from tega.runtime.words import nearest_hint
from tega_study.journal import Journal, events_path, read_events
from tega_study.plan import StudyPlan, read_plan

_LOG = logging.getLogger(__name__)

WITHDRAWN = "withdrawn.txt"


def withdrawn_ids(folder: Path) -> set[str]:
    """Return the ids of those who have withdrawn; nothing is deleted by asking."""
    path = folder / WITHDRAWN
    ids = {line for line in lines_of(path) if re.fullmatch(r"p\d+", line)} if path.exists() else set()
    for person in sorted(ids):
        if os.path.lexists(events_path(folder, person).parent):
            said = "%s has withdrawn, but something of theirs is left: tega-teleop study withdraw %s %s"
            _LOG.warning(said, person, folder, person)
    return ids


def check_stays(folder: Path, participant: str) -> None:
    """Raise ``RecordingError`` for a participant who has withdrawn."""
    if participant in withdrawn_ids(folder):
        raise RecordingError(f"{participant} has withdrawn", "go on with another participant")


def staying(folder: Path, plan: StudyPlan) -> list[str]:
    """Return the IDs of a plan's participants who have not withdrawn, in the plan's order."""
    gone = withdrawn_ids(folder)
    return [person for person in plan.participants if person not in gone]


def lines_of(path: Path) -> list[str]:
    """Return the lines of a list; ``RecordingError`` if it is no text."""
    try:
        return read_words(path).splitlines()
    except UnicodeDecodeError as error:
        raise RecordingError(f"{path}: no list of lines: {error}", "restore it from a copy") from error


JOURNAL = "journal.jsonl"
"""The study's own journal, beside its plan; sessions have theirs."""


def note_unblinding(folder: Path, text: str, t_ns: int | None = None) -> None:
    """Write into the study's journal that its conditions are compared now, or at another time of day."""
    with Journal(folder / JOURNAL) as journal:
        journal.add("unblind", t_ns=time.time_ns() if t_ns is None else t_ns, source="auto", text=text)


def unblindings(folder: Path) -> tuple[str, ...]:
    """Return when the study was unblinded before its plan was complete, and how far it was, one text each.

    An anonymised copy has no dates.
    """
    found = []
    for event in read_events(folder / JOURNAL):
        if event.kind == "unblind":
            day = datetime.fromtimestamp(event.t_ns / 1e9, UTC).date().isoformat()
            found.append(f"{day}: {event.text}" if event.t_ns else event.text)
    return tuple(found)


def copy_unblindings(folder: Path, out: Path) -> None:
    """Copy them into an anonymised copy of the study, without dates."""
    for event in read_events(folder / JOURNAL):
        if event.kind == "unblind":
            note_unblinding(out, event.text, t_ns=0)


OBJECTS: Final = "objects.toml"
PHOTOS: Final = "objects"
_MOST_PHOTO_MIB = 32
_PHOTO_STARTS = {b"\xff\xd8\xff": ".jpg", b"\x89PNG\r\n\x1a\n": ".png"}

_Amount = Annotated[float, msgspec.Meta(gt=0, le=100_000)]


class ObjectFacts(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Properties of an object; ``None`` for those not measured.

    Stiffness is force over indentation where it is grasped, friction static against the fingertips' gel;
    ``photo`` is below the study's folder, such as ``objects/bag.jpg``.
    """

    mass_g: _Amount | None = None
    stiffness_n_per_mm: _Amount | None = None
    friction: Annotated[float, msgspec.Meta(gt=0, le=10)] | None = None
    measured: Annotated[str, msgspec.Meta(max_length=1000)] = ""
    photo: str = ""


def read_objects(folder: Path) -> dict[str, ObjectFacts]:
    """Read the properties of a study's objects; nothing if none were recorded.

    ``UnsafeNameError`` if a photo's name could lie outside of the folder.
    """
    path = folder / OBJECTS
    try:
        found = msgspec.convert(parse_toml(read_words(path)), dict[str, ObjectFacts]) if path.exists() else {}
    except (ValueError, UnicodeDecodeError) as error:  # of TOML and of msgspec
        raise RecordingError(
            f"{path}: {error}", "correct it, or write it with tega-teleop study object"
        ) from error
    for facts in found.values():
        if facts.photo:
            path_below(folder, facts.photo, subject="photo", source=OBJECTS)
    return found


def objects_text(known: Mapping[str, ObjectFacts]) -> str:
    """Return the content of ``objects.toml``; unknown properties are left out."""
    tree: dict[str, dict[str, Any]] = {
        name: {key: value for key, value in msgspec.to_builtins(facts).items() if value not in {None, ""}}
        for name, facts in known.items()
    }
    return tree_text(tree)


def note_object(folder: Path, name: str, *, photo: Path | None = None, **changes: Any) -> ObjectFacts:
    """Record properties of an object of the plan: ``changes``, and a JPEG or PNG file, which is copied.

    Properties that are not given stay unchanged. ``RecordingError`` if the photo is too large.
    """
    objects = read_plan(folder).settings.objects
    if name not in objects:
        raise InvalidValueError(f"object {name!r} is not in the plan", nearest_hint(name, objects, "it has"))
    known = read_objects(folder)
    try:
        tree = msgspec.to_builtins(known.get(name, ObjectFacts())) | changes
        facts = msgspec.convert(tree, ObjectFacts)
    except msgspec.ValidationError as error:
        raise InvalidValueError(
            f"object {name}: {wrong_value(error, tree)}", "masses are in grams, stiffness in N/mm"
        ) from error
    if photo is not None:
        content = read_foreign(photo, most_mib=_MOST_PHOTO_MIB)
        ending = next((e for start, e in _PHOTO_STARTS.items() if content.startswith(start)), None)
        if ending is None:
            raise InvalidValueError(f"{photo}: is no JPEG and no PNG", "save the photo as one of them")
        write_whole(folder / PHOTOS / f"{name}{ending}", content, sync=True)
        facts = msgspec.structs.replace(facts, photo=f"{PHOTOS}/{name}{ending}")
    known = {one: known[one] for one in known if one != name} | {name: facts}
    write_whole(folder / OBJECTS, objects_text(known), sync=True)
    return facts
