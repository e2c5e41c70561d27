"""Compose and read BORIS projects, format "7.0": behaviours with keys and modifiers, subjects, observations, media."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from tega.errors import RecordingError
from tega.runtime.files.foreign_file import parse_json, read_foreign

_MOST_MIB = 64


class BorisBehaviour(NamedTuple):
    """Behaviour that a rater codes with one key.

    Attributes:
        code: Its name.
        key: The key.
        modifiers: Sets of values, by what each set is called; of each a rater chooses one value.
    """

    code: str
    key: str
    modifiers: Mapping[str, Sequence[str]] = {}


class CodedEvent(NamedTuple):
    """Event as a rater coded it.

    Attributes:
        t_s: Seconds from the observation's beginning.
        subject: Whom it concerns; ``""`` for nobody.
        code: Its behaviour.
        modifiers: The chosen values, ``None`` where none was chosen.
        comment: What was written beside it.
    """

    t_s: float
    subject: str
    code: str
    modifiers: tuple[str, ...] = ()
    comment: str = ""


def boris_project(
    *,
    name: str,
    description: str,
    behaviours: Sequence[BorisBehaviour],
    subjects: Sequence[str] = (),
    variables: Sequence[str] = (),
    observations: Mapping[str, Any],
) -> bytes:
    """Return a project file.

    Args:
        name: Of the project.
        description: What its times count from.
        behaviours: What can be coded.
        subjects: Whom events may concern; their keys are the digits from 1.
        variables: Names of the observations' own facts.
        observations: By name (:func:`boris_observation`).
    """
    project = {
        "time_format": "seconds",
        "project_date": "",
        "project_name": name,
        "project_description": description,
        "project_format_version": "7.0",
        "subjects_conf": {
            str(n): {"key": str(n + 1), "name": subject, "description": ""}
            for n, subject in enumerate(subjects)
        },
        "behaviors_conf": {
            str(n): {
                "type": "Point event",
                "key": one.key,
                "code": one.code,
                "description": "",
                "color": "",
                "category": "",
                "modifiers": {
                    str(k): {
                        "name": what,
                        "description": "",
                        "type": 0,
                        "ask at stop": False,
                        "values": list(values),
                    }
                    for k, (what, values) in enumerate(one.modifiers.items())
                },
                "excluded": "",
                "coding map": "",
            }
            for n, one in enumerate(behaviours)
        },
        "observations": dict(observations),
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
) -> dict[str, Any]:
    """Return an observation: a live one, or that of a video beside the project.

    Args:
        events: What it holds already.
        length_s: How long it is.
        variables: Its own facts.
        media: The video's name; ``""`` for a live observation.
        rate_hz: Its pictures a second.
    """
    observation: dict[str, Any] = {
        "file": {str(player): [media] if media and player == 1 else [] for player in range(1, 9)},
        "type": "MEDIA" if media else "LIVE",
        "date": "",
        "description": f"{length_s:.3f} s",
        "time offset": 0.0,
        "events": [
            [round(e.t_s, 3), e.subject, e.code, "|".join(e.modifiers), e.comment]
            for e in sorted(events, key=lambda e: e.t_s)
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
    """Return a project's events by observation.

    Raises:
        RecordingError: It is no project.
    """
    try:
        tree = parse_json(read_foreign(path, most_mib=_MOST_MIB), dict[str, Any])
        return {
            str(name): [_event(event) for event in observation["events"]]
            for name, observation in tree["observations"].items()
        }
    except (OSError, KeyError, IndexError, TypeError, ValueError, AttributeError) as error:
        raise RecordingError(f"{path}: is no BORIS project: {error}", "name a .boris file") from error


def _event(event: Any) -> CodedEvent:
    t_s, subject, code, *more = event
    if not math.isfinite(float(t_s)):
        raise ValueError(f"an event at {t_s!r}")
    modifiers = str(more[0]) if more else ""
    comment = str(more[1]) if len(more) > 1 else ""
    return CodedEvent(
        float(t_s), str(subject), str(code), tuple(modifiers.split("|")) if modifiers else (), comment
    )
