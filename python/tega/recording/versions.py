"""List the versions that the results of a run may depend on besides its settings."""

from __future__ import annotations

import platform
import sys
from importlib.metadata import PackageNotFoundError, version

_PACKAGES = ("tega", "numpy", "msgspec", "foxglove-sdk", "protobuf", "mcap", "opencv-contrib-python-headless")


def versions() -> dict[str, str]:
    """Return the versions of Python, machine, system and packages, by name."""
    known = {"python": sys.version.split()[0], "machine": platform.machine(), "system": platform.system()}
    for package in _PACKAGES:
        try:
            known[package] = version(package)
        except PackageNotFoundError:
            known[package] = "not installed"
    return known
