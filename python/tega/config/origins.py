"""Keep the origin of every value of a session's settings, by its dotted key."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import msgspec

from tega.config.sections import SessionConfig


class SettingValue(NamedTuple):
    """A setting and where it came from.

    That is ``default``, ``preset live``, a file's name and line (``lab.toml:12``), a variable's name, or ``--set``.
    """

    value: Any
    origin: str


class LoadedConfig(NamedTuple):
    """A checked configuration and the origin of every value in it, by dotted key."""

    config: SessionConfig
    values: dict[str, SettingValue]


def where(origins: Mapping[str, str], key: str) -> str:
    """Return the origin of a value, for an error; by default the settings."""
    found = origin_of(key, origins)
    return "settings" if found == "default" else found


def origin_of(key: str, origins: Mapping[str, str]) -> str:
    """Return the origin of a value; an array that was given whole brought all that is said in it."""
    whole = key.partition("[")[0]
    return origins.get(key) or (origins.get(whole) if whole != key else None) or "default"


def fields_of(struct: msgspec.Struct, prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the value of every field of settings by its dotted key; options are one value each."""
    for name in struct.__struct_fields__:
        value = getattr(struct, name)
        if name == "guests":
            yield from _entries("", value)
        elif name != "options" or isinstance(value, msgspec.Struct):
            yield from _fields_under(f"{prefix}{name}", value)


def _fields_under(key: str, value: Any) -> Iterator[tuple[str, Any]]:
    """Yield a value by its dotted key, or the fields of a table or of an array of tables."""
    if isinstance(value, msgspec.Struct):
        yield from fields_of(value, f"{key}.")
    elif isinstance(value, dict) and all(isinstance(one, msgspec.Struct) for one in value.values()):
        yield from _entries(f"{key}.", value)
    elif isinstance(value, tuple) and value and all(isinstance(one, msgspec.Struct) for one in value):
        for number, one in enumerate(value):
            yield from fields_of(one, f"{key}[{number}].")
    else:
        yield key, value


def _entries(prefix: str, table: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    for name, value in table.items():
        yield from _fields_under(f"{prefix}{name}", value)
