"""Define the keys of a running trial, and give the keys that foot switches type their meaning."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from tega.errors import InvalidValueError
from tega_study.lead.experimenter import ENTER
from tega_study.lead.rest_tasks import RestTask

END = "e"

_PRESSED: Final = ((ENTER, " "), (END,), ("s",), ("d",), ("r",))
"""What each pedal presses: go on and mark the height, end the trial, slip, deformation, do it again."""
_BETWEEN: Final = frozenset("yfurnqk ")


def keys_of(*, sees_height: bool, measures_height: bool = False) -> list[tuple[str, str]]:
    """Return the keys of a running trial and their descriptions."""
    words = ("correct: " if measures_height else "") + "left the table, then at the mark"
    mark = [] if sees_height else [("space", words)]
    return [
        *mark,
        ("s", "slip"),
        ("d", "deformation"),
        ("x", "dropped"),
        ("u", "undo"),
        (END, "done"),
        ("a", "break off, technical"),
        ("z", "stop for safety"),
    ]


def pedal_keys(pedals: str, tasks: Iterable[RestTask]) -> dict[str, tuple[str, ...]]:
    """Return which keys of the session each pedal presses.

    ``pedals`` are one to five different keys that mean nothing else, also in ``tasks``, which the bench
    offers in a rest: to go on and mark the height, to end the trial, for a slip, for a deformation, to do the
    trial again; empty for none.
    """
    for task in tasks:
        if task.key in pedals:
            raise InvalidValueError(
                f"pedal {task.key!r}: begins {task.words} in a rest", "take digits, such as 12345"
            )
    taken = _BETWEEN | {key for key, _ in keys_of(sees_height=False)}
    odd = len(set(pedals)) != len(pedals) or len(pedals) > len(_PRESSED) or not pedals.isprintable()
    if odd or set(pedals) & taken:
        raise InvalidValueError(
            f"pedals {pedals!r}: they are not one to five keys that mean nothing else in a session",
            "name what pedals type to go on, to end, for a slip, a deformation and to do it again, such as 12345",
        )
    return dict(zip(pedals, _PRESSED, strict=False))


def check_answer_key(key: str, pedals: str) -> None:
    """Raise ``InvalidValueError`` unless the key is one printable key without another meaning in a trial."""
    taken = {one for one, _ in keys_of(sees_height=False)} | {" ", "\n", *pedals}
    if len(key) != 1 or not key.isprintable() or key in taken:
        raise InvalidValueError(
            f"answer key {key!r}: it is not one key, or means something else in a trial",
            "take p, for example",
        )
