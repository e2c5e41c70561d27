"""Read the kernel's own account of a device: small text files."""

from __future__ import annotations

from pathlib import Path


def attribute(file: Path) -> str:
    """Return what a file of sysfs says, without spaces around it; ``""`` where it is not there."""
    try:
        return file.read_text(encoding="utf-8").strip()
    except (OSError, UnicodeDecodeError):
        return ""
