"""Name the features that a recording was made with and that are not installed or not loaded here."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from tega.recording.mcap_reader import McapReader
from tega.runtime.features import broken_features, features

# A recording can come from anybody: nothing but the name of a package is printed out of it, and what to install only
# where that package is TEGA's own.
_NAME: Final = re.compile(r"[A-Za-z0-9][\w.-]{0,63}", re.ASCII)
_REQUIREMENT: Final = re.compile(r"[A-Za-z0-9][\w.-]{0,63}(\[[\w,-]{1,64}\])?", re.ASCII)


def absent_features(metadata: Mapping[str, Mapping[str, str]]) -> list[str]:
    """Return a sentence for each feature of a recording's tables that is not installed or not loaded here."""
    broken = {one.name: f"{one.said}; {one.hint}" for one in broken_features()}
    return [
        f"recorded with the feature {name!r}, "
        + broken.get(name, f"which is not installed here: {_next_step(requirement)}")
        for name, requirement in metadata.get("features", {}).items()
        if name not in features() and _NAME.fullmatch(name) and _REQUIREMENT.fullmatch(requirement)
    ]


def _next_step(requirement: str) -> str:
    if requirement.partition("[")[0] == "tega":
        return f"pip install '{requirement}'"
    return f"the recording names the package {requirement!r}; ask who made it before installing that"


def absent_in(path: Path) -> list[str]:
    """Return the sentences of :func:`absent_features` for a file."""
    reader = McapReader(path)
    next(reader.messages(lambda _topic: False), None)  # the tables come before every message
    return absent_features(reader.metadata)
