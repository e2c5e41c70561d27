"""Refuse numbers in the settings that no quantity has: so small or so large that a product with them is no number."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Final

from tega.config.origins import where
from tega.errors import ConfigError

LEAST: Final = 1e-12
"""The smallest size of a number in the settings that is not 0, in the unit of its key."""

MOST: Final = 1e15
"""The largest size."""


def check_magnitudes(tree: Mapping[str, Any], origins: Mapping[str, str]) -> None:
    """Check every number of the settings.

    Raises:
        ConfigError: One is not 0 and smaller than :data:`LEAST`, or larger than :data:`MOST`.
    """
    for key, value in _numbers(tree, ""):
        if value != 0 and not LEAST <= abs(value) <= MOST:
            size = "small" if abs(value) < LEAST else "large"
            raise ConfigError(
                f"{where(origins, key)}: {key} = {value!r} is too {size}",
                f"numbers are 0, or {LEAST:g} to {MOST:g} in size: is the unit right?",
            )


def _numbers(value: Any, key: str) -> Iterator[tuple[str, float]]:
    """Return every finite number with its key; the schema checks other values."""
    if isinstance(value, Mapping):
        for name, one in value.items():
            yield from _numbers(one, f"{key}.{name}" if key else str(name))
    elif isinstance(value, list | tuple):
        for k, one in enumerate(value):
            yield from _numbers(one, f"{key}[{k}]")
    elif isinstance(value, float) and abs(value) < float("inf"):
        yield key, value
