"""Name the next step for a TOML file that cannot be parsed, or that says another thing than it was meant to."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any, Final

_PLACE: Final = re.compile(r"at line (\d+)")
ESCAPES: Final = "a backslash in double quotes is an escape: write a path in single quotes, or with /"
"""Next step for a value that a backslash has changed."""

# What may stand wrong in a line, and what to do, the surest first.
_RULES: Final = (
    (re.compile("[\u201c\u201d\u201e\u2018\u2019\u00ab\u00bb]"), 'use straight quotes: "…"'),
    (re.compile(r'"[^"]*\\'), ESCAPES),
    (re.compile(r"=\s*[+-]?\d+,\d+\s*([,}#]|$)"), "write a decimal point, such as 250.5"),
    (
        re.compile(r"\{[^}]*$"),
        "an inline table { … } stands on one line; or write a [table] with a line for each key",
    ),
    (re.compile(r"=\s*[A-Za-z_~/][^\"']*$"), 'put text into quotes, such as driver = "allegro"'),
)


def toml_hint(text: str, error: ValueError) -> str:
    """Return the next step for a text that is no TOML."""
    message = str(error)
    if "twice" in message or "overwrite" in message:
        return "a table or a key stands in the file twice: join them"
    place = _PLACE.search(message)
    lines = text.splitlines()
    line = lines[int(place[1]) - 1] if place and 0 < int(place[1]) <= len(lines) else ""
    return next((hint for rule, hint in _RULES if rule.search(line)), "see https://toml.io")


def swallowed_escape(tree: object) -> tuple[str, str] | None:
    r"""Return key and text of a value that a backslash has changed, such as ``"C:\temp"`` with a tab in it."""
    for key, value in _texts(tree, ""):
        if re.search("[\b\t\f\r]", value) or (re.match("[A-Za-z]:", value) and "\n" in value):
            return key, value
    return None


def _texts(tree: Any, key: str) -> Iterator[tuple[str, str]]:
    if isinstance(tree, str):
        yield key, tree
    elif isinstance(tree, dict):
        for name, value in tree.items():
            yield from _texts(value, f"{key}.{name}" if key else name)
    elif isinstance(tree, list):
        for value in tree:
            yield from _texts(value, key)
