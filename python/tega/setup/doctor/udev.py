"""Read the udev rules that let people use the devices on Linux; they ship with the package."""

from __future__ import annotations

from importlib.resources import files


def udev_rules() -> str:
    """Return the text of the rules' file, its installation in the first lines."""
    return files("tega.setup.doctor").joinpath("70-tega.rules").read_text(encoding="utf-8")
