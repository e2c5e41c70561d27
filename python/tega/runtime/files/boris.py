"""Compose and read BORIS projects, format "7.0", and read its tabular exports.

Times in a project count from the beginning of the media file plus the observation's time offset; here they count from
the beginning. A state has two events in a project, the first and every other one begins it.
"""

from __future__ import annotations

import gzip
import io
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import msgspec

from tega.errors import RecordingError
from tega.runtime.files.annotations import CodedEvent, Edge, edges_of, paired
from tega.runtime.files.csv_tables import read_rows, seconds
from tega.runtime.files.foreign_file import MIB, parse_json, read_foreign
from tega.runtime.words import printable

_MOST_MIB: Final = 64
_EXPORT: Final = "export tabular or aggregated events from BORIS as TSV or CSV"
_NO_PERSON: Final = frozenset({"No focal subject", "NA"})


class BorisBehaviour(NamedTuple):
    """Behaviour coded with one key; of each named set of ``modifiers`` a rater chooses one value."""

    code: str
    key: str
    modifiers: Mapping[str, Sequence[str]] = {}
    is_state: bool = False


def boris_project(
    *,
    name: str,
    description: str,
    behaviours: Sequence[BorisBehaviour],
    subjects: Sequence[str] = (),
    variables: Sequence[str] = (),
    observations: Mapping[str, Any],
) -> bytes:
    """Return a project file; ``observations`` are those of :func:`boris_observation` by name, made printable.

    ``description`` is the origin of its times, ``variables`` are the names of the observations' own facts.
    The subjects' keys are the digits from 1.
    """
    project = {
        "time_format": "seconds",
        "project_date": "",
        "project_name": printable(name),
        "project_description": description,
        "project_format_version": "7.0",
        "subjects_conf": {
            str(n): {"key": str(n + 1), "name": subject, "description": ""}
            for n, subject in enumerate(subjects)
        },
        "behaviors_conf": {
            str(n): {
                "type": "State event" if one.is_state else "Point event",
                "key": one.key,
                "code": one.code,
                **dict.fromkeys(("description", "color", "category"), ""),
                "modifiers": {
                    str(k): {
                        "name": sentence,
                        "description": "",
                        "type": 0,
                        "ask at stop": False,
                        "values": list(values),
                    }
                    for k, (sentence, values) in enumerate(one.modifiers.items())
                },
                **dict.fromkeys(("excluded", "coding map"), ""),
            }
            for n, one in enumerate(behaviours)
        },
        "observations": {printable(one): content for one, content in observations.items()},
        "behavioral_categories": [],
        "behavioral_categories_config": {},
        "independent_variables": {
            str(n): {
                "label": label,
                "description": "",
                "type": "text",
                "default value": "",
                "possible values": "",
            }
            for n, label in enumerate(variables)
        },
        "coding_map": {},
        "behaviors_coding_map": [],
        "converters": {},
    }
    return msgspec.json.format(msgspec.json.encode(project), indent=1) + b"\n"


def boris_observation(
    events: Sequence[CodedEvent],
    *,
    length_s: float,
    variables: Mapping[str, str],
    media: str = "",
    rate_hz: float = 0.0,
    states: Sequence[str] = (),
) -> dict[str, Any]:
    """Return an observation: a live one, or that of a video (``media``, ``""`` for none) beside the project.

    ``variables`` are its own facts, ``rate_hz`` is the video's pictures a second, ``states`` are the
    behaviours that are states.
    """
    times = [(t_s, e) for e in events for t_s in (edges_of(e) if e.code in states else [e.t_s])]
    observation: dict[str, Any] = {
        "file": {str(player): [media] if media and player == 1 else [] for player in range(1, 9)},
        "type": "MEDIA" if media else "LIVE",
        "date": "",
        "description": f"{length_s:.3f} s",
        "time offset": 0.0,
        "events": [
            [round(t_s, 3), e.subject, e.code, "|".join(e.modifiers), e.comment if t_s == e.t_s else ""]
            for t_s, e in sorted(times, key=lambda one: one[0])
        ],
        "independent_variables": dict(variables),
        "observation time interval": [0, 0],
        "close_behaviors_between_videos": False,
    }
    if media:
        observation |= {
            "media_info": {
                "length": {media: round(length_s, 3)},
                "fps": {media: rate_hz},
                "hasVideo": {media: True},
                "hasAudio": {media: False},
                "offset": {"1": 0.0},
            },
            "visualize_spectrogram": False,
            "visualize_waveform": False,
            "media_creation_date_as_offset": False,
            "media_scan_sampling_duration": 0,
            "image_display_duration": 1,
        }
    return observation


def read_boris(path: Path) -> dict[str, list[CodedEvent]]:
    """Return a project's events (``.boris``, ``.boris.gz``, tabular or aggregated export) by observation.

    Raises ``RecordingError`` also where an event has no time.
    """
    if path.name.endswith((".boris", ".boris.gz")):
        return _project(path)
    return _table(path)


def _project(path: Path) -> dict[str, list[CodedEvent]]:
    try:
        tree = parse_json(_unpacked(read_foreign(path, most_mib=_MOST_MIB)), dict[str, Any])
        states = {
            str(one["code"])
            for one in tree.get("behaviors_conf", {}).values()
            if str(one["type"]).startswith("State event")
        }
        return {
            str(name): _events(str(name), observation, states)
            for name, observation in tree["observations"].items()
        }
    except RecordingError as error:
        raise RecordingError(f"{path.name}: {error.message}", error.hint) from error
    except (OSError, EOFError, KeyError, IndexError, TypeError, ValueError, AttributeError) as error:
        raise RecordingError(f"{path.name}: is no BORIS project: {error}", "name a .boris file") from error


def _unpacked(data: bytes) -> bytes:
    """Return the content of a file that may be compressed; no more of it than a project may have."""
    if not data.startswith(b"\x1f\x8b"):
        return data
    try:
        with gzip.GzipFile(fileobj=io.BytesIO(data)) as file:
            content = file.read(_MOST_MIB * MIB + 1)
    except Exception as error:  # zlib has errors of its own
        raise ValueError(f"damaged: {error}") from error
    if len(content) > _MOST_MIB * MIB:
        raise ValueError(f"more than {_MOST_MIB} MiB when unpacked")
    return content


def _events(name: str, observation: Any, states: set[str]) -> list[CodedEvent]:
    offset_s = float(observation.get("time offset") or 0.0)
    edges: list[tuple[Edge, CodedEvent]] = []
    for t_s, subject, code, *more in observation["events"]:
        at_s = float(t_s) - offset_s if isinstance(t_s, int | float) else math.nan
        if not math.isfinite(at_s):
            raise RecordingError(
                f"{name}: {str(code)!r} has the time {t_s!r}", "give the event a time in BORIS"
            )
        modifiers, comment = (str(more[0]) if more else "", str(more[1]) if len(more) > 1 else "")
        event = CodedEvent(at_s, str(subject), str(code), _chosen(modifiers.split("|")), comment)
        edges.append(("" if event.code in states else "POINT", event))
    return paired(edges, name=name)


def _chosen(modifiers: Sequence[str]) -> tuple[str, ...]:
    return tuple(one.strip() for one in modifiers if one.strip() not in {"", "NA"})


def _table(path: Path) -> dict[str, list[CodedEvent]]:
    needed = ({"Behavior", "Time"}, {"Behavior", "Start (s)", "Stop (s)"})
    rows, head = read_rows(path, *needed, most_mib=_MOST_MIB, hint=_EXPORT)
    names = rows[head]
    begins = "Time" if "Time" in names else "Start (s)"
    before = {row[0]: row[1] for row in rows[:head] if len(row) > 1}
    if "Observation id" not in names and "Observation id" not in before:
        raise RecordingError(f"{path.name}: has no column Observation id", _EXPORT)
    edges: dict[str, list[tuple[Edge, CodedEvent]]] = {}
    for number, row in enumerate(rows[head + 1 :], head + 2):
        cells = before | dict(zip(names, row, strict=False))
        if not any(row):
            continue
        try:
            observation = cells["Observation id"]
            edges.setdefault(observation, []).append(_row(cells, begins))
        except (KeyError, ValueError) as error:
            sentence = f"{error.args[0]} is missing" if isinstance(error, KeyError) else str(error)
            raise RecordingError(f"{path.name}: row {number}: {sentence}", "export it again") from error
    try:
        return {name: paired(found, name=name) for name, found in edges.items()}
    except RecordingError as error:
        raise RecordingError(f"{path.name}: {error.message}", error.hint) from error


def _row(cells: Mapping[str, str], begins: str) -> tuple[Edge, CodedEvent]:
    """Return the event of a row, or the part of it."""
    offset = cells.get("Time offset (s)", "")
    offset_s = seconds(offset) if offset not in {"", "NA"} else 0.0
    subject = cells.get("Subject", "")
    kind = (cells.get("Behavior type") or cells.get("Status") or "POINT").upper()
    modifiers = _chosen([m for name, m in cells.items() if name.startswith("Modifier")])
    comments = (cells.get(name, "") for name in ("Comment", "Comment start", "Comment stop"))
    comment = "; ".join(text for text in comments if text not in {"", "NA"})
    begin_s = seconds(cells[begins]) - offset_s
    event = CodedEvent(
        begin_s, "" if subject in _NO_PERSON else subject, cells["Behavior"], modifiers, comment
    )
    if begins == "Start (s)":
        end_s = begin_s if kind == "POINT" else seconds(cells["Stop (s)"]) - offset_s
        if end_s < begin_s:
            raise ValueError(f"ends at {end_s:g} s, before it begins at {begin_s:g} s")
        return "POINT", event._replace(duration_s=end_s - begin_s)
    if kind not in {"POINT", "START", "STOP"}:
        raise ValueError(f"behaviour type {kind[:40]!r}, expected POINT, START or STOP")
    return ("START" if kind == "START" else "STOP" if kind == "STOP" else "POINT"), event
