"""Say the unit of a setting from the end of its key."""

from __future__ import annotations

_UNITS = {
    "hz": "Hz",
    "s": "s",
    "ms": "ms",
    "n": "N",
    "mm": "mm",
    "px": "px",
    "percent": "%",
    "rad": "rad",
    "dbfs": "dBFS",
}
_PERCENT = {"vest.threshold", "vest.step", "vest.options.limit"}


def unit_of(key: str) -> str:
    """Return the unit that a dotted key's last part names; percent where a page says so, else ``""``."""
    last = key.rpartition(".")[2]
    if key in _PERCENT:
        return "%"
    return _UNITS.get(last.rpartition("_")[2], "") if "_" in last else ""
