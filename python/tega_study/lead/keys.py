"""Define the keys of a running trial."""

from __future__ import annotations

END = "e"


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
