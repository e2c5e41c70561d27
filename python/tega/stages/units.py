"""Read the unit of a setting off the end of its key."""

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
    """Return the unit that a dotted key's last part names; percent where a page says so, else ``""``.

    Example:
        >>> unit_of("hand.rise_levels_per_s"), unit_of("stages.metric.mm_per_px"), unit_of("vest.rate_hz")
        ('levels/s', 'mm/px', 'Hz')
    """
    last = key.rpartition(".")[2]
    if key in _PERCENT:
        return "%"
    words = last.split("_")
    if "per" in words[1:-1]:  # such as levels_per_s, gain_percent_per_min, mm_per_px
        over = len(words) - 1 - words[::-1].index("per")
        unit, under = words[over - 1], words[over + 1]
        return f"{_UNITS.get(unit, unit)}/{_UNITS.get(under, under)}"
    return _UNITS.get(words[-1], "") if len(words) > 1 else ""
