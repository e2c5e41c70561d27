"""Refuse settings of an earlier version with one sentence: what was taken out, when, and what to set instead."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from tega.errors import ConfigError

REMOVED: Final[Mapping[str, tuple[str, str]]] = {
    "vest.feedback": ("0.2", "set stages.mapping.name: columns for continuous, pulses for events"),
    "vest.pulses": ("0.2", "set stages.mapping.options, with stages.mapping.name = pulses"),
    "arm.driver = panda": ("0.3", "set arm.driver = franky, with arm.options.robot = panda or fr3"),
}
"""By key, or by ``key = value``: the version that took it out, and the next step. An entry stays for a year."""


def check_removed(tree: Mapping[str, Any], origins: Mapping[str, str]) -> None:
    """Refuse a setting that an earlier version had.

    Args:
        tree: Settings as nested tables.
        origins: Where each dotted key came from.

    Raises:
        ConfigError: A key or a value of :data:`REMOVED` is set.
    """
    for name, (version, instead) in REMOVED.items():
        key, _, wanted = name.partition(" = ")
        found: Any = tree
        for step in key.split("."):
            found = found.get(step) if isinstance(found, Mapping) else None
        if found is None or (wanted and found != wanted):
            continue
        origin = next((o for k, o in origins.items() if k == key or k.startswith(f"{key}.")), "settings")
        raise ConfigError(f"{origin}: {name} was taken out in {version}", instead)
