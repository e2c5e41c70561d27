"""Turn a validation error into one that names file, key, value, unit or range, and the nearest known key."""

from __future__ import annotations

import difflib
import re
import types
import typing
from collections.abc import Mapping
from typing import Any

import msgspec

from tega.config.guests import guest_tables
from tega.config.removed import CONSTANTS
from tega.errors import ConfigError

_UNITS = {
    "hz": "hertz",
    "s": "seconds",
    "ms": "milliseconds",
    "ns": "nanoseconds",
    "rad": "radians",
    "n": "newtons",
}
_TYPES = {
    "float": "a number",
    "int": "a whole number",
    "str": "a text in quotes",
    "bool": "true or false",
    "array": "a list",
    "object": "a table",
    "null": "nothing",
}


class Overridden(str):
    """A text given outside the file: relative paths in it refer to the working directory."""

    __slots__ = ()


def explain(
    error: msgspec.ValidationError, tree: Any, wanted: Any, *, prefix: str, origins: Mapping[str, str]
) -> ConfigError:
    """Explain a validation error to the author of the settings.

    Args:
        error: Error raised by msgspec.
        tree: The settings it looked at.
        wanted: The type it looked for.
        prefix: Dotted key at which the tree stands, or ``""``.
        origins: Where each dotted key came from.

    Returns:
        The error to raise.
    """
    what, _, path = str(error).partition(" - at `$")
    steps = re.findall(r"\.([^.\[\]]+)|\[(\d+)\]", path.removesuffix("`"))
    value, kind, key = tree, wanted, prefix
    for name, index in steps:
        key = f"{key}[{index}]" if index else f"{key}.{name}".lstrip(".")
        kind = _type_at(kind, name)
        value = _value_at(value, name, index)
    if (unknown := re.match(r"Object contains unknown field `(.*)`", what)) is not None:
        name = unknown.group(1)
        full = f"{key}.{name}".lstrip(".")
        if full in CONSTANTS:
            said = f"{_origin(origins, full)}: {full} was taken out in 0.3"
            return ConfigError(said, f"leave it out: it is always {CONSTANTS[full]:g}")
        known = [*_field_names(kind), *(guest_tables() if not key else ())]
        near = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
        hint = f"did you mean {near[0]!r}?" if near else f"known here: {', '.join(known)}"
        return ConfigError(f"{_origin(origins, full)}: {full}: unknown key", hint)
    if (missing := re.match(r"Object missing required field `(.*)`", what)) is not None:
        full = f"{key}.{missing.group(1)}".lstrip(".")
        return ConfigError(
            f"{_origin(origins, key)}: {full}: missing", _choices(_type_at(kind, missing.group(1)))
        )
    shown = f"{value!r}" if not isinstance(value, str) else f"'{value}'"
    hint = _choices(kind)
    unit = _UNITS.get(key.rpartition("_")[2], "")
    return ConfigError(
        f"{_origin(origins, key)}: {key} = {shown}: {_plain(what)}{f' ({unit})' if unit else ''}", hint
    )


def _origin(origins: Mapping[str, str], key: str) -> str:
    if key in origins:
        return origins[key]
    inside = {o for k, o in origins.items() if k.startswith(f"{key}.") or key.startswith(f"{k}[")}
    files = {file for o in origins.values() if (file := o.rpartition(":")[0]).endswith(".toml")}
    return (sorted(inside, key=_file_and_line) or sorted(files) or ["settings"])[0]


def _file_and_line(origin: str) -> tuple[str, int]:
    file, _, line = origin.rpartition(":")
    return (file, int(line)) if file and line.isdigit() else (origin, 0)


def _plain(what: str) -> str:
    if what.startswith("Invalid enum value"):
        return "not one of the choices"
    named = re.sub(r"`([a-z]+)(?: \| null)?`", lambda m: _TYPES.get(m.group(1), m.group(1)), what)
    return named[:1].lower() + named[1:]


def _choices(kind: Any) -> str:
    options = [
        c for member in _members(kind) if typing.get_origin(member) is typing.Literal for c in member.__args__
    ]
    return f"one of: {', '.join(map(str, options))}" if options else ""


def _members(kind: Any) -> list[Any]:
    """Return the types that a type stands for: a union's members, an annotation's subject."""
    origin = typing.get_origin(kind)
    if origin in {typing.Union, types.UnionType}:
        return [m for member in typing.get_args(kind) for m in _members(member)]
    if origin is typing.Annotated:
        return _members(typing.get_args(kind)[0])
    return [kind]


def _type_at(kind: Any, name: str) -> Any:
    for member in _members(kind):
        if isinstance(member, type) and issubclass(member, msgspec.Struct):
            return typing.get_type_hints(member, include_extras=True).get(name, Any)
    return Any


def _field_names(kind: Any) -> list[str]:
    for member in _members(kind):
        if isinstance(member, type) and issubclass(member, msgspec.Struct):
            return list(member.__struct_fields__)
    return []


def _value_at(value: Any, name: str, index: str) -> Any:
    try:
        return value[int(index)] if index else value[name]
    except (KeyError, IndexError, TypeError):
        return None
