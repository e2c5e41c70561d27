"""Keep the properties of a study's objects: mass, stiffness, friction, a photo, and how each was measured.

Properties are stored in ``objects.toml`` beside the plan, one table an object, for people to read and edit; photos
are in ``objects/``. The plan names the objects only, and stays unchanged.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Final

import msgspec

from tega.config.errors import wrong_value
from tega.errors import InvalidValueError, RecordingError
from tega.runtime.files.foreign_file import parse_toml, read_foreign, read_words
from tega.runtime.files.plain_name import path_below
from tega.runtime.files.toml_text import tree_text
from tega.runtime.files.whole_file import write_whole
from tega.runtime.nearest import nearest_hint
from tega_study.plan import read_plan

OBJECTS: Final = "objects.toml"
PHOTOS: Final = "objects"
_MOST_PHOTO_MIB = 32
_PHOTO_STARTS = {b"\xff\xd8\xff": ".jpg", b"\x89PNG\r\n\x1a\n": ".png"}

_Amount = Annotated[float, msgspec.Meta(gt=0, le=100_000)]


class ObjectFacts(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Properties of an object; ``None`` for those not measured.

    Attributes:
        stiffness_n_per_mm: Force over indentation where it is grasped.
        friction: Coefficient of static friction against the fingertips' gel.
        photo: Below the study's folder, such as ``objects/bag.jpg``.
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
    if not path.exists():
        return {}
    try:
        found = msgspec.convert(parse_toml(read_words(path)), dict[str, ObjectFacts])
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
    """Record properties of an object of the plan; properties that are not given stay unchanged.

    ``photo`` is a JPEG or PNG file, which is copied; ``changes`` are other attributes of
    :class:`ObjectFacts`. ``RecordingError`` if the photo is too large.
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
