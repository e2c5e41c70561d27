"""Events that a person coded of a recording, whatever program they come from: point events and states."""

from __future__ import annotations

import logging
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Final, Literal, NamedTuple

from tega.errors import RecordingError

_log = logging.getLogger(__name__)

SLACK_S: Final = 0.05
"""Tolerance for events outside of the coded time: times are rounded to a video frame and a half."""


class CodedEvent(NamedTuple):
    """Event as a rater coded it.

    Attributes:
        t_s: Seconds from the observation's beginning.
        subject: Person or thing that it concerns; ``""`` for none.
        modifiers: The chosen values, ``None`` as a word where none was chosen.
        duration_s: Length of a state, seconds; 0 for a point event, ``None`` for a state without an end.
    """

    t_s: float
    subject: str
    code: str
    modifiers: tuple[str, ...] = ()
    comment: str = ""
    duration_s: float | None = 0.0

    @property
    def end_s(self) -> float:
        """End, seconds; the beginning for a point event and for a state without an end."""
        return self.t_s + (self.duration_s or 0.0)


Edge = Literal["POINT", "START", "STOP", ""]
"""Part of an event that a line of a file holds; ``""`` for a state with alternating lines."""


def paired(edges: Iterable[tuple[Edge, CodedEvent]], *, name: str) -> list[CodedEvent]:
    """Join point events, beginnings and ends, in any order, to events in the order of their beginnings.

    States are joined by subject, behaviour and modifiers. Raises ``RecordingError`` where one ends before it
    has begun, or begins twice.
    """
    found: list[CodedEvent] = []
    opened: dict[tuple[str, str, tuple[str, ...]], int] = {}
    for edge, event in sorted(edges, key=lambda one: one[1].t_s):
        key = (event.subject, event.code, event.modifiers)
        if edge == "POINT":
            found.append(event)
        elif key in opened and edge != "START":
            place = opened.pop(key)
            begun = found[place]
            comment = "; ".join(text for text in (begun.comment, event.comment) if text)
            found[place] = begun._replace(duration_s=event.t_s - begun.t_s, comment=comment)
        elif edge == "STOP" or key in opened:
            message = "ends without a beginning" if edge == "STOP" else "begins again before its end"
            raise RecordingError(
                f"{name}: the state {event.code!r} {message} at {event.t_s:.3f} s",
                "add the missing event where it was coded",
            )
        else:
            opened[key] = len(found)
            found.append(event._replace(duration_s=None))
    return found


def edges_of(event: CodedEvent) -> list[float]:
    """Return the times at which a state begins and ends, at least a millisecond apart: no program keeps none."""
    return [event.t_s, event.t_s + max(event.duration_s or 0.0, 0.001)]


def check_times(events: Sequence[CodedEvent], *, length_s: float, name: str, hint: str) -> list[CodedEvent]:
    """Refuse events outside of the coded time; an event without an end ends with the coded time."""
    checked = []
    for event in events:
        if event.duration_s is None:
            _log.warning(
                "warning: %s: %r from %.3f s on has no end; it lasts to the end", name, event.code, event.t_s
            )
            event = event._replace(duration_s=max(length_s - event.t_s, 0.0))  # noqa: PLW2901  # completed
        for t_s in (event.t_s, event.end_s):
            if not -SLACK_S <= t_s <= length_s + SLACK_S:
                raise RecordingError(
                    f"{name}: {event.code!r} at {t_s:.3f} s is outside: it is {length_s:.3f} s long", hint
                )
        checked.append(event)
    return checked


def known_code(code: str, known: Iterable[str]) -> str | None:
    """Return the behaviour that a text names, but for case, spaces and hyphens; ``None`` for none of those known.

    Example:
        >>> known_code("Lift-off ", ["slip", "lift_off"])
        'lift_off'
    """
    plain: Mapping[str, str] = {_plain(one): one for one in known}
    return plain.get(_plain(code))


def _plain(code: str) -> str:
    return re.sub(r"[\s_-]+", "_", code.strip().casefold())
