"""Read the kernel's own account of a device: small text files."""

from __future__ import annotations

from pathlib import Path


def attribute(file: Path) -> str:
    """Return the content of a sysfs file, stripped; ``""`` if it does not exist."""
    try:
        return file.read_text(encoding="utf-8").strip()
    except (OSError, UnicodeDecodeError):
        return ""
