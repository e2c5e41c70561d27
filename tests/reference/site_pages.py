"""Pages of the docs that teach, from the site's navigation."""

from __future__ import annotations

import re
from pathlib import Path

__all__ = ["pages_of", "user_pages"]

PROJECT = Path(__file__).resolve().parents[2]
TEACHING = ("Start", "Tutorials", "Hardware", "Reference", "Explanation")


def pages_of(*parts: str) -> list[Path]:
    """Return the committed pages of these parts of mkdocs.yml, in its order."""
    navigation = (PROJECT / "mkdocs.yml").read_text(encoding="utf-8").split("\nnav:\n")[1]
    found = []
    part = ""
    for line in navigation.splitlines():
        if top := re.match(r"  - (\w+):$", line):
            part = top[1]
        elif (item := re.match(r"      - .+: (\S+\.md)$", line)) and part in parts:
            found.append(PROJECT / "docs" / item[1])
    return [page for page in found if page.is_file()]


def user_pages() -> list[Path]:
    """Return README and the pages that teach."""
    return [PROJECT / "README.md", *pages_of(*TEACHING)]
