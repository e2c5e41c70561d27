"""Name the pip line for emulators, campaigns and figure scripts, which are not in the wheel."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

from tega.errors import MissingToolError

# What is installed for each package that a checkout brings; what it needs itself stands before it.
_FOLDERS: Final = {
    "tega_emulators": ("emulators",),
    "tega_campaigns": ("emulators", "campaigns"),
    "tega_figures": ("emulators", "figures"),
}


@contextmanager
def needs_tools(subject: str) -> Iterator[None]:
    """Raise ``MissingToolError`` where an import of ``tools/`` fails; its hint is a checkout's pip line."""
    try:
        yield
    except ModuleNotFoundError as error:
        package = (error.name or "").partition(".")[0]
        if package not in _FOLDERS:
            raise
        places = " ".join(f"'./tools/{folder}'" for folder in _FOLDERS[package])
        raise MissingToolError(
            f"{subject} needs the package {package!r}, which is not part of the wheel",
            f"install it from a checkout of TEGA: pip install {places}",
        ) from error
