"""Refuse settings of an earlier version with one sentence: what was taken out, when, and what to set instead."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any, Final

from tega.errors import ConfigError
from tega.runtime.words import Removed

REMOVED: Final[Mapping[str, Removed]] = {
    "vest.feedback": Removed(
        "0.2", "a mapping replaced it", "set stages.mapping.name: columns for continuous, pulses for events"
    ),
    "vest.pulses": Removed(
        "0.2", "a mapping replaced it", "set stages.mapping.options, with stages.mapping.name = pulses"
    ),
    "arm.driver = panda": Removed(
        "0.3", "franky drives a Panda too", "set arm.driver = franky, with arm.options.robot = panda or fr3"
    ),
}
"""By key, or by ``key = value``. An entry stays for a year."""

CONSTANTS: Final[Mapping[str, float]] = {
    "hand.options.send_timeout_s": 0.01,
    "stages.mapping.options.remind_s": 1.0,
    "stages.mapping.options.slip_again_s": 0.3,
    "stages.mapping.options.slip_burst_s": 0.15,
    "stages.mapping.options.slip_bursts": 2,
    "stages.mapping.options.slip_percent": 100.0,
    "stages.mapping.options.slip_rest_s": 0.1,
}
"""Settings that became constants in 0.3. Files and recordings that have them with this value are read as before."""


def check_removed(tree: Mapping[str, Any], origins: Mapping[str, str]) -> None:
    """Refuse a setting that an earlier version had: a key or a value of :data:`REMOVED`."""
    for name, gone in REMOVED.items():
        key, _, wanted = name.partition(" = ")
        found: Any = tree
        for step in key.split("."):
            found = found.get(step) if isinstance(found, Mapping) else None
        if found is None or (wanted and found != wanted):
            continue
        origin = next((o for k, o in origins.items() if k == key or k.startswith(f"{key}.")), "settings")
        raise ConfigError(f"{origin}: {gone.sentence(name)}", gone.hint)


def without_constants(tree: Any, prefix: str, known: Collection[str]) -> Any:
    """Return a table of settings without the :data:`CONSTANTS` in it that have their value.

    Anything but a table is returned as it is. ``prefix`` is the dotted key at which it stands, or ``""``.
    Keys that are ``known`` stay: a driver or stage of another package may have an option of that name.
    """
    ours = {
        key.rpartition(".")[2]: value for key, value in CONSTANTS.items() if key.rpartition(".")[0] == prefix
    }
    if not ours or not isinstance(tree, Mapping):
        return tree
    return {name: value for name, value in tree.items() if name in known or ours.get(name, object()) != value}
