"""Explain wrong settings: file, key, value, unit or range, the nearest known key, and settings of earlier versions."""

from __future__ import annotations

import math
import re
import types
import typing
from collections.abc import Collection, Iterator, Mapping
from typing import Any, Final

import msgspec

from tega.errors import ConfigError
from tega.runtime.features import broken_features, named
from tega.runtime.removed import Removed
from tega.runtime.words import nearest_hint, number_text

REMOVED: Final[Mapping[str, Removed]] = {
    "vest.feedback": Removed(
        "0.2", "a mapping replaced it", "set stages.mapping.name: columns for continuous, pulses for events"
    ),
    "vest.pulses": Removed(
        "0.2", "a mapping replaced it", "set stages.mapping.options, with stages.mapping.name = pulses"
    ),
    "stages.mapping.options.threshold_percent": Removed(
        "0.3", "the wearer's own threshold is taken", "set vest.threshold; tega-teleop calibrate measures it"
    ),
    "stages.mapping.options.weber": Removed(
        "0.3", "the wearer's own step is taken", "set vest.step; tega-teleop calibrate measures it"
    ),
    "stages.metric.options.noise_counts": Removed(
        "0.3", "the calibration's is taken, or else a DIGIT's", "tega-teleop calibrate measures it"
    ),
    "arm.driver = panda": Removed(
        "0.3", "franky drives a Panda too", "set arm.driver = franky, with arm.options.robot = panda or fr3"
    ),
}
"""By key, or by ``key = value``. An entry stays for a year."""

CONSTANTS: Final[Mapping[str, Any]] = {
    "arm.options.place_m": [0.5, 0.0, 0.3],
    "arm.options.turn_xyzw": [0.0, math.sqrt(0.5), 0.0, math.sqrt(0.5)],
    "calibration.baseline_old_h": 24.0,
    "calibration.emg_old_h": 12.0,
    "calibration.touch_old_h": 720.0,
    "calibration.vest_old_h": 2160.0,
    "hand.options.send_timeout_s": 0.01,
    "stages.mapping.options.offset_percent": 0.0,
    "stages.mapping.options.remind_s": 1.0,
    "stages.mapping.options.slip_again_s": 0.3,
    "stages.mapping.options.slip_burst_s": 0.15,
    "stages.mapping.options.slip_bursts": 2,
    "stages.mapping.options.slip_percent": 100.0,
    "stages.mapping.options.slip_rest_s": 0.1,
    "stages.reflex.options.rise_from": 0.0,
    "vest.options.app_name": "TEGA",
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
        raise gone.refusal(f"{origin}: {name}")


def without_constants(tree: Any, prefix: str, known: Collection[str]) -> Any:
    """Return a table of settings without the :data:`CONSTANTS` in it that have their value.

    Anything but a table is returned as it is. ``prefix`` is the dotted key at which it stands, or ``""``.
    Keys that are ``known`` stay: a driver or stage of another package may have an option of that name.
    """
    ours = {
        key.rpartition(".")[2]: value for key, value in CONSTANTS.items() if key.rpartition(".")[0] == prefix
    }
    if not prefix and "calibration" in tree:  # whose keys are checked with all tables of TEGA's own
        return {**tree, "calibration": without_constants(tree["calibration"], "calibration", ())}
    if not ours or not isinstance(tree, Mapping):
        return tree
    return {name: value for name, value in tree.items() if name in known or ours.get(name, object()) != value}


_UNITS = {
    "hz": "hertz",
    "s": "seconds",
    "ms": "milliseconds",
    "ns": "nanoseconds",
    "rad": "radians",
    "n": "newtons",
    "kg": "kilograms",
}
_TYPES = {
    "float": "a number",
    "int": "a whole number",
    "str": "text in quotes",
    "bool": "true or false",
    "array": "a list",
    "object": "a table",
    "null": "nothing",
}

_MOST_ELSEWHERE: Final = 3


class Overridden(str):
    """A text given outside the file: relative paths in it refer to the working directory."""

    __slots__ = ()


def explain(
    error: msgspec.ValidationError, tree: Any, wanted: Any, *, prefix: str, origins: Mapping[str, str]
) -> ConfigError:
    """Explain a validation error of msgspec to the author of the settings.

    ``tree`` stands at the dotted key ``prefix``, or ``""``; ``wanted`` is the type it was checked for.
    ``origins`` holds where each dotted key came from.
    """
    subject, steps = _parts(error)
    value, kind, key = tree, wanted, prefix
    for step, index in steps:
        name = _wrong_entry(value, kind) if step == "*" else step
        if step == "*":
            named_by, kind = typing.get_args(kind)
        else:
            kind = _fields_at(kind).get(name, Any)
        key = f"{key}[{index}]" if index else f"{key}.{name}".lstrip(".")
        value = _value_at(value, name, index)
    if "`key` in `" in str(error):
        hint = next((meta.description or "" for meta in getattr(named_by, "__metadata__", ())), "")
        return ConfigError(f"{_origin(origins, key)}: {key}: {name!r} is no name here", hint)
    if (unknown := re.match(r"Object contains unknown field `(.*)`", subject)) is not None:
        name = unknown.group(1)
        full = f"{key}.{name}".lstrip(".")
        if full in CONSTANTS:
            text = f"{_origin(origins, full)}: {full} was taken out in 0.3"
            return ConfigError(text, f"leave it out: it is always {CONSTANTS[full]!r}")
        fields = [*_fields_at(kind), *(named("settings") if not key else ())]
        # Tables of features stand under their own names.
        known = [one for one in fields if one != "guests"]
        hint = nearest_hint(name, known, "known here:", cutoff=0.5)
        elsewhere = [full for full in _dotted_keys(wanted) if full.rpartition(".")[2] == name]
        if 0 < len(elsewhere) <= _MOST_ELSEWHERE:
            hint = f"did you mean {' or '.join(map(repr, elsewhere))}?"
        elif not key and isinstance(_value_at(value, name, ""), dict | list):
            hint = _of_feature(name, hint)
        return ConfigError(f"{_origin(origins, full)}: {full}: unknown key", hint)
    if (missing := re.match(r"Object missing required field `(.*)`", subject)) is not None:
        full = f"{key}.{missing.group(1)}".lstrip(".")
        choices = _choices(_fields_at(kind).get(missing.group(1), Any))
        return ConfigError(f"{_origin(origins, key)}: {full}: missing", choices)
    return ConfigError(f"{_origin(origins, key)}: {_wrong_value(key, value, subject)}", _choices(kind))


def _of_feature(name: str, otherwise: str) -> str:
    """Return what to do with an unknown table, which may be that of a feature that is left out or missing."""
    for one in broken_features():
        whose = f"of the feature {one.name!r}, {one.said}; {one.hint}"
        if name in one.settings:
            return f"this is a table {whose}"
        if not one.settings:
            return f"if this is a table {whose}; else {otherwise}"
    return f"if this is a feature's table, install its package; else {otherwise}"


def wrong_value(error: msgspec.ValidationError, tree: Any) -> str:
    """Return a validation error in plain words, such as ``mass_kg = 0.1: expected a number >= 0.15 (kilograms)``."""
    subject, steps = _parts(error)
    value, key = tree, ""
    for name, index in steps:
        key = f"{key}[{index}]" if index else f"{key}.{name}".lstrip(".")
        value = _value_at(value, name, index)
    return _wrong_value(key, value, subject) if key else _plain(subject)


def _wrong_value(key: str, value: Any, subject: str) -> str:
    displayed = f"'{value}'" if isinstance(value, str) else repr(value)
    if isinstance(value, float):
        displayed = number_text(value, 12)
    unit = _UNITS.get(key.rpartition("_")[2], "")
    return f"{key} = {displayed}: {_plain(subject)}{f' ({unit})' if unit else ''}"


def _parts(error: msgspec.ValidationError) -> tuple[str, list[tuple[str, str]]]:
    """Return what is wrong, and the steps to the value: a name or an index each, ``*`` for one of a table's names."""
    text = re.sub(r"`key` in `\$(.*)`$", r"`$\1[...]`", str(error))
    subject, _, path = text.partition(" - at `$")
    return subject, re.findall(r"\.([^.\[\]]+)|\[(\d+)\]", path.removesuffix("`").replace("[...]", ".*"))


def _wrong_entry(table: Mapping[str, Any], kind: Any) -> str:
    """Return the first name in a table whose entry, or which itself, is not of the table's type."""
    for name, entry in table.items():
        try:
            msgspec.convert({name: entry}, kind, dec_hook=lambda wanted, value: wanted(value))
        except msgspec.ValidationError:
            return name
    return "*"


def _origin(origins: Mapping[str, str], key: str) -> str:
    if key in origins:
        return origins[key]
    inside = {o for k, o in origins.items() if k.startswith(f"{key}.") or key.startswith(f"{k}[")}
    files = {file for o in origins.values() if (file := o.rpartition(":")[0]).endswith(".toml")}
    return (sorted(inside, key=_file_and_line) or sorted(files) or ["settings"])[0]


def _file_and_line(origin: str) -> tuple[str, int]:
    file, _, line = origin.rpartition(":")
    return (file, int(line)) if file and line.isdigit() else (origin, 0)


def _plain(subject: str) -> str:
    if subject.startswith("Invalid enum value"):
        return "not one of the choices"
    named = re.sub(r"`([a-z |]+)`", lambda m: _kinds(m.group(1)), subject.replace("got `str`", "got text"))
    return named[:1].lower() + named[1:]


def _kinds(union: str) -> str:
    """Return the types of a union in words; an optional value is its type."""
    names = union.split(" | ")
    return " or ".join(_TYPES.get(name, name) for name in names if name != "null" or len(names) == 1)


def _dotted_keys(kind: Any, prefix: str = "") -> Iterator[str]:
    """Yield the dotted keys of all settings in a type; options belong to a driver or stage and are not in it."""
    for member in _members(kind):
        if isinstance(member, type) and issubclass(member, msgspec.Struct):
            for name, inner in typing.get_type_hints(member, include_extras=True).items():
                yield f"{prefix}{name}"
                yield from _dotted_keys(inner, f"{prefix}{name}.")


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


def _fields_at(kind: Any) -> dict[str, Any]:
    """Return the fields of the first table that a type stands for, with their types."""
    tables = (one for one in _members(kind) if isinstance(one, type) and issubclass(one, msgspec.Struct))
    return next((typing.get_type_hints(one, include_extras=True) for one in tables), {})


def _value_at(value: Any, name: str, index: str) -> Any:
    try:
        return value[int(index)] if index else value[name]
    except (KeyError, IndexError, TypeError):
        return None
