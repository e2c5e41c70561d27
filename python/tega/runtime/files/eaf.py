"""Read and write annotations in ELAN's format (EAF 3.0).

ELAN has a tier for each rater and behaviour, here named ``slip_r1``, and annotations with a beginning, an end and a
text. A point event is one of a millisecond. Modifiers stand before the comment: ``[long|soft] on the thumb``.
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Final, NamedTuple
from xml.parsers import expat

from tega.errors import RecordingError
from tega.runtime.files.annotations import CodedEvent, edges_of, known_code
from tega.runtime.files.foreign_file import read_foreign
from tega.runtime.files.whole_file import write_whole

_MOST_MIB: Final = 64
_POINT_S: Final = 0.0015
_SCHEMA: Final = "http://www.mpi.nl/tools/elan/EAFv3.0.xsd"
_MODIFIED: Final = re.compile(r"\[([^\]]*)\] ?(.*)", re.DOTALL)
_UNPRINTABLE: Final = re.compile("[^\t\n -\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_TYPE: Final = "event"
_CONSTRAINTS: Final = {
    "Time_Subdivision": "Time subdivision of parent annotation's time interval, no time gaps allowed within this "
    "interval",
    "Symbolic_Subdivision": "Symbolic subdivision of a parent annotation. Annotations refering to the same parent are "
    "ordered",
    "Symbolic_Association": "1-1 association with a parent annotation",
    "Included_In": "Time alignable annotations within the parent annotation's time interval, gaps are allowed",
}


class _Tier(NamedTuple):
    """A tier: its name, its annotator, its participant, and annotations as slots and text."""

    name: str
    rater: str
    subject: str
    annotations: list[tuple[str, str, str]]


def read_eaf(path: Path, known: Sequence[str] = ()) -> dict[str, list[CodedEvent]]:
    """Return the events of an ELAN file by rater, in the order of their beginnings.

    A tier codes a behaviour of ``known`` if the tier's name begins with it, and several if each of its
    annotations names one. Other tiers name their behaviour themselves. Annotations need a time.
    """
    try:
        slots_s, tiers, origin_s = _parsed(read_foreign(path, most_mib=_MOST_MIB))
    except OSError as error:
        raise RecordingError(
            f"{path.name}: cannot be read: {error.strerror}", f"looked for {path}"
        ) from error
    except (expat.ExpatError, ET.ParseError, ValueError, LookupError) as error:
        raise RecordingError(f"{path.name}: is no ELAN file: {error}", "name an .eaf file") from error
    found: dict[str, list[CodedEvent]] = {}
    for tier in tiers:
        values = [known_code(value, known) for _, _, value in tier.annotations]
        code, rater = _tier_names(tier, known)
        by_value = all(values) and known_code(code, known) is None
        for (begin, end, value), named in zip(tier.annotations, values, strict=True):
            if begin not in slots_s or end not in slots_s:
                raise RecordingError(
                    f"{path.name}: an annotation of tier {tier.name!r} has no time ({value[:40]!r})",
                    "align it in ELAN",
                )
            begin_s, end_s = slots_s[begin] + origin_s, slots_s[end] + origin_s
            if end_s < begin_s:
                raise RecordingError(
                    f"{path.name}: an annotation of tier {tier.name!r} ends before it begins"
                )
            modified = None if by_value else _MODIFIED.fullmatch(value)
            modifiers = tuple(filter(None, modified[1].split("|"))) if modified else ()
            found.setdefault(rater, []).append(
                CodedEvent(
                    t_s=begin_s,
                    subject=tier.subject,
                    code=named if by_value and named else code,
                    modifiers=modifiers,
                    comment="" if by_value else modified[2] if modified else value,
                    duration_s=0.0 if end_s - begin_s <= _POINT_S else end_s - begin_s,
                )
            )
    return {rater: sorted(events, key=lambda one: one.t_s) for rater, events in found.items()}


def write_eaf(
    path: Path, raters: Mapping[str, Sequence[CodedEvent]], *, codes: Sequence[str], media: str = ""
) -> None:
    """Write an ELAN file; the events of a rater without a name are for a file to fill in.

    ``codes`` get a tier of each rater, even without an event; ``media`` names a video beside it, ``""`` for
    none.
    """
    root = ET.Element(
        "ANNOTATION_DOCUMENT",
        {
            "AUTHOR": "TEGA",
            "DATE": datetime.now(UTC).isoformat(timespec="seconds"),
            "FORMAT": "3.0",
            "VERSION": "3.0",
            "xmlns:xsi": "http://www.w3.org/2001/XMLSchema-instance",
            "xsi:noNamespaceSchemaLocation": _SCHEMA,
        },
    )
    header = ET.SubElement(root, "HEADER", MEDIA_FILE="", TIME_UNITS="milliseconds")
    if media:
        kind = "video/mp4" if media.endswith(".mp4") else "video/*"
        ET.SubElement(
            header,
            "MEDIA_DESCRIPTOR",
            MEDIA_URL=f"./{media}",
            MIME_TYPE=kind,
            RELATIVE_MEDIA_URL=f"./{media}",
        )
    order, n = ET.SubElement(root, "TIME_ORDER"), 0
    for name, rater, subject, events in _lanes(raters, codes):
        tier = ET.SubElement(root, "TIER", LINGUISTIC_TYPE_REF=_TYPE, TIER_ID=_text(name))
        tier.attrib |= {k: _text(v) for k, v in (("ANNOTATOR", rater), ("PARTICIPANT", subject)) if v}
        for event in events:
            n += 1
            slots = [f"ts{2 * n - 1}", f"ts{2 * n}"]
            for slot, t_s in zip(slots, edges_of(event), strict=True):
                ET.SubElement(
                    order, "TIME_SLOT", TIME_SLOT_ID=slot, TIME_VALUE=str(max(0, round(t_s * 1000)))
                )
            one = ET.SubElement(
                ET.SubElement(tier, "ANNOTATION"), "ALIGNABLE_ANNOTATION",
                ANNOTATION_ID=f"a{n}", TIME_SLOT_REF1=slots[0], TIME_SLOT_REF2=slots[1],
            )  # fmt: skip
            ET.SubElement(one, "ANNOTATION_VALUE").text = _text(_value(event))
    ET.SubElement(
        root, "LINGUISTIC_TYPE", GRAPHIC_REFERENCES="false", LINGUISTIC_TYPE_ID=_TYPE, TIME_ALIGNABLE="true"
    )
    for stereotype, meaning in _CONSTRAINTS.items():
        ET.SubElement(root, "CONSTRAINT", DESCRIPTION=meaning, STEREOTYPE=stereotype)
    ET.indent(root)
    write_whole(path, ET.tostring(root, encoding="utf-8", xml_declaration=True))


def _parsed(data: bytes) -> tuple[dict[str, float], list[_Tier], float]:
    """Return the time of each slot that has one, the tiers, and the time of the first medium at which times begin.

    Times are in seconds. Entities and types of document are refused, nothing is expanded.
    """
    guard = expat.ParserCreate()
    guard.StartDoctypeDeclHandler = guard.EntityDeclHandler = _refuse
    guard.Parse(data, True)  # noqa: FBT003  # this is the end of the data
    root = ET.fromstring(data)
    if root.tag != "ANNOTATION_DOCUMENT":
        raise ValueError(f"it begins with {root.tag!r}")
    for header in root.iter("HEADER"):
        if (unit := header.get("TIME_UNITS", "milliseconds")) != "milliseconds":
            raise ValueError(f"its times are in {unit}")
    origin = next((medium.get("TIME_ORIGIN", "0") for medium in root.iter("MEDIA_DESCRIPTOR")), "0")
    slots_s = {
        slot.attrib["TIME_SLOT_ID"]: int(slot.attrib["TIME_VALUE"][:18]) / 1000
        for slot in root.iter("TIME_SLOT")
        if "TIME_VALUE" in slot.attrib
    }
    tiers = []
    for tier in root.iter("TIER"):
        found = [
            (
                one.attrib["TIME_SLOT_REF1"],
                one.attrib["TIME_SLOT_REF2"],
                one.findtext("ANNOTATION_VALUE", "").strip(),
            )
            for one in tier.iter("ALIGNABLE_ANNOTATION")
        ]
        rater, subject = tier.get("ANNOTATOR", ""), tier.get("PARTICIPANT", "")
        tiers.append(_Tier(tier.attrib["TIER_ID"], rater, subject, found))
    return slots_s, tiers, int(origin[:18]) / 1000


def _refuse(*_declared: object) -> None:
    raise ValueError("it declares a type of document or entities, which no ELAN file does")


def _tier_names(tier: _Tier, known: Sequence[str]) -> tuple[str, str]:
    for cut in range(len(tier.name), 0, -1):
        code = known_code(tier.name[:cut], known)
        if code is not None and (cut == len(tier.name) or not tier.name[cut - 1 : cut + 1].isalnum()):
            rest = re.sub(r"_\d+$", "", tier.name[cut:]).strip(" _-@")
            return code, tier.rater or rest
    suffix = f"_{tier.rater}" if tier.rater else ""
    name = re.sub(r"_\d+$", "", tier.name) if suffix and suffix + "_" in tier.name else tier.name
    return name.removesuffix(suffix) or name, tier.rater


def _lanes(
    raters: Mapping[str, Sequence[CodedEvent]], codes: Sequence[str]
) -> list[tuple[str, str, str, list[CodedEvent]]]:
    """Return name, rater, subject and events of each tier; events that overlap lie in several."""
    found = []
    for rater, events in raters.items():
        keys = dict.fromkeys([(code, "") for code in codes] + [(e.code, e.subject) for e in events])
        for code, subject in keys:
            lanes: list[list[CodedEvent]] = [[]]
            for event in sorted(
                (e for e in events if (e.code, e.subject) == (code, subject)), key=lambda e: e.t_s
            ):
                free = (lane for lane in lanes if not lane or edges_of(lane[-1])[1] + 0.001 <= event.t_s)
                if (lane := next(free, None)) is None:
                    lanes.append(lane := [])
                lane.append(event)
            stem = "_".join(part for part in (code, subject, rater) if part)
            found += [
                (f"{stem}_{k}" if k > 1 else stem, rater, subject, lane) for k, lane in enumerate(lanes, 1)
            ]
    return found


def _value(event: CodedEvent) -> str:
    if event.modifiers or event.comment.startswith("["):
        return f"[{'|'.join(event.modifiers)}] {event.comment}".rstrip()
    return event.comment


def _text(value: str) -> str:
    return _UNPRINTABLE.sub(" ", value)
