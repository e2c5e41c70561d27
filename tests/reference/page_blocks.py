"""Fenced blocks of a page, in order: what a reader types, and the files that they save."""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple


class Block(NamedTuple):
    """What stands below a comment (``install``, ``background``, ``hardware``), and the file that it is saved as."""

    language: str
    mark: str
    title: str
    text: str


_BLOCK = re.compile(
    r'^(?:<!-- (?P<mark>\w+) -->\n)?```(?P<language>\w*)(?: title="(?P<title>[^"]+)")?\n(?P<text>.*?)^```$',
    re.DOTALL | re.MULTILINE,
)


def blocks_of(page: Path) -> list[Block]:
    return [
        Block(m["language"], m["mark"] or "", m["title"] or "", m["text"])
        for m in _BLOCK.finditer(page.read_text(encoding="utf-8"))
    ]


def commands_of(page: Path) -> list[list[str]]:
    """Return the words of every ``tega-teleop`` command that a page shows, without comments."""
    found = []
    for block in blocks_of(page):
        if block.language == "sh":
            lines = re.sub(r"\s+#.*$", "", block.text.replace("\\\n", " "), flags=re.MULTILINE)
            found += [
                words[1].split()
                for line in re.split(r"\n|&&|;", lines)
                if (words := re.match(r"\s*(?:\S*/)?tega-teleop\b(.*)", line))
            ]
    return found
