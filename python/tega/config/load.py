"""Load a session's settings from one TOML file, checked key by key; check one driver's or stage's options alone.

A value is taken from, in rising order: the defaults here, the file, environment variables such as
``TEGA_EMG__KIND`` (two underscores where the key has a dot), ``--set emg.kind=raw``. Every number's unit is the
end of its key: ``_hz``, ``_s``, ``_ms``. Relative paths in a file are relative to the file; in a variable or
on the command line, to the working directory.

Example:
    >>> loaded = load_config(None, environ={}, sets=["session.preset=paper"])
    >>> loaded.config.session.preset, loaded.values["session.preset"].origin
    ('paper', '--set')
"""

from __future__ import annotations

import os
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, Literal

import msgspec

from tega.config.check import check_tree, paths_below
from tega.config.errors import Overridden, explain
from tega.config.origins import LoadedConfig
from tega.config.stage_sections import STAGE_GROUPS
from tega.devices.registry import driver_class
from tega.errors import ConfigError
from tega.runtime.device_items import Options
from tega.runtime.files.foreign_file import parse_toml, read_words
from tega.runtime.files.toml_text import ESCAPES, swallowed_escape, toml_hint, toml_value
from tega.stages.registry import stage_class

# Lines of one value: each is parsed with all before it.
_LONGEST: Final = 500


def value_lines(text: str) -> dict[str, int]:
    """Return the line, from 1, on which the statement of each value begins.

    The parser itself cuts the text into statements: lines are added until they parse. A table of an array has
    its number in the key, as in ``stages.beside[0].name``.
    """
    lines: dict[str, int] = {}
    table, waiting, first = "", "", 0
    seen: dict[str, int] = {}
    for number, line in enumerate(text.split("\n"), start=1):
        if not waiting:
            if line.lstrip().startswith("["):
                table = line
                if line.lstrip().startswith("[["):
                    # A table of its own, even where nothing follows.
                    ((name, _),) = leaves(tomllib.loads(line), numbered=False)
                    seen[name] = seen.get(name, -1) + 1
                continue
            first = number
        if number - first > _LONGEST:
            raise tomllib.TOMLDecodeError(f"a value has more than {_LONGEST} lines (at line {first})")
        waiting += f"{line}\n"
        try:
            statement = tomllib.loads(f"{table}\n{waiting}")
        except tomllib.TOMLDecodeError:
            continue
        for key, _ in leaves(statement):
            lines[_counted(key, seen) if table.lstrip().startswith("[") else key] = first
        waiting = ""
    return lines


def _counted(key: str, seen: Mapping[str, int]) -> str:
    """Return a key within the newest table of an array: alone, each of them is parsed as number 0."""
    for name, number in seen.items():
        for begin in (f"{name}[0].", f"{name}."):
            if key.startswith(begin):
                return f"{name}[{number}].{key.removeprefix(begin)}"
    return key


def leaves(tree: Mapping[str, Any], prefix: str = "", *, numbered: bool = True) -> Iterator[tuple[str, Any]]:
    """Yield every value that is no table, by its dotted key; tables of an array are numbered, or stay whole."""
    for key, value in tree.items():
        if isinstance(value, dict):
            yield from leaves(value, f"{prefix}{key}.", numbered=numbered)
        elif numbered and isinstance(value, list) and value and all(isinstance(one, dict) for one in value):
            for number, one in enumerate(value):
                yield from leaves(one, f"{prefix}{key}[{number}].")
        else:
            yield f"{prefix}{key}", value


def override_tree(tree: dict[str, Any], sets: Sequence[str]) -> dict[str, str]:
    """Put ``key=value`` texts, in TOML or plain, into a tree of settings; return the origin of each key, ``--set``.

    ``ConfigError`` where a key leads into something that is not a table.
    """
    origins: dict[str, str] = {}
    for item in sets:
        override(tree, origins, *key_and_value(item, "session.preset=paper"), "--set")
    return origins


def override_recorded(tree: dict[str, Any], sets: Sequence[str]) -> dict[str, str]:
    """Put values given as text into the settings of a recording, which are written out in full.

    As :func:`override_tree`; a stage that is replaced by name starts with its own defaults, since the options of the
    recorded stage do not apply to it.
    """
    named = {item.partition("=")[0].strip() for item in sets}
    for group in (*STAGE_GROUPS, "reflex"):
        if f"stages.{group}.name" in named and isinstance(tree.get("stages"), dict):
            tree["stages"].pop(group, None)
    return override_tree(tree, sets)


def key_and_value(item: str, example: str) -> tuple[str, str]:
    """Return the two sides of ``key=value``; ``example`` is one that would do."""
    key, equals, text = item.partition("=")
    if not equals or not key.strip():
        raise ConfigError(f"--set {item!r}: not of the form key=value", f"for example --set {example}")
    if any("\ud800" <= sign <= "\udfff" for sign in item):
        raise ConfigError(f"{item!r}: settings hold no name that is not UTF-8", "rename the file or folder")
    return key.strip(), text.strip()


def read_settings(path: Path) -> tuple[dict[str, Any], dict[str, int]]:
    """Return a file's tree, and the line of each value."""
    text = ""
    try:
        text = read_words(path, error=ConfigError)
        tree, lines = parse_toml(text), value_lines(text)
    except FileNotFoundError as error:
        hint = f"write a settings file with: tega-teleop init --out {path}"
        raise ConfigError(f"{path.name}: no such file", hint) from error
    except OSError as error:
        message = f"{path.name}: cannot be read: {error.strerror or error}"
        raise ConfigError(message, f"looked for {path}") from error
    except UnicodeDecodeError as error:
        utf16 = error.object[:2] in {b"\xff\xfe", b"\xfe\xff"}
        message = f"{path.name}: not UTF-8 text: {'it looks like UTF-16' if utf16 else error.reason}"
        raise ConfigError(message, "save it as UTF-8") from error
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{path.name}: not valid TOML: {error}", toml_hint(text, error)) from error
    if str(tree.get("format", "")).startswith("tega-"):
        raise ConfigError(f"{path.name}: a {tree['format']} file, no settings", "name the settings instead")
    if (changed := swallowed_escape(tree)) is not None:
        key, value = changed
        raise ConfigError(f"{path.name}: {key} = {value!r} has a control character in it", ESCAPES)
    return tree, lines


def override(tree: dict[str, Any], origins: dict[str, str], key: str, text: str, origin: str) -> None:
    """Put one value given as text into the tree."""
    try:
        value: Any = tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        value = text
    *tables, last = key.split(".")
    node = tree
    for i, table in enumerate(tables):
        node = node.setdefault(table, {})
        if not isinstance(node, dict):
            raise ConfigError(
                f"{origin}: {key}: {'.'.join(tables[: i + 1])} is a value, not a table", "check the key"
            )
    node[last] = _overridden(value)
    for replaced in [name for name in origins if name.startswith((f"{key}.", f"{key}["))]:
        del origins[replaced]
    origins |= dict.fromkeys((key, *(name for name, _ in leaves({key: value}))), origin)


def _overridden(value: Any) -> Any:
    """Mark all texts of a value as given outside the file."""
    if isinstance(value, str):
        return Overridden(value)
    if isinstance(value, list):
        return [_overridden(one) for one in value]
    return {name: _overridden(one) for name, one in value.items()} if isinstance(value, dict) else value


ENVIRONMENT_PREFIX = "TEGA_"


def load_config(
    path: Path | None, *, environ: Mapping[str, str] | None = None, sets: Sequence[str] = ()
) -> LoadedConfig:
    """Load and check a session's settings.

    ``path`` is the TOML file, ``None`` for the defaults alone; ``environ`` are environment variables, ``None``
    for the process's own; ``sets`` are overrides as ``key=value``, the value in TOML or plain text. A
    ``calibration.person`` among these sets aside a ``calibration.file`` that is not. Raises ``ConfigError`` if
    the file cannot be read or a setting is wrong, ``MissingExtraError`` if a driver's package is not installed.
    """
    tree: dict[str, Any] = {}
    origins: dict[str, str] = {}
    if path is not None:
        tree, lines = read_settings(path)
        origins = {key: f"{path.name}:{line}" for key, line in lines.items()}
    for name, text in sorted((os.environ if environ is None else environ).items()):
        if name.startswith(ENVIRONMENT_PREFIX) and "__" in name:
            key = name.removeprefix(ENVIRONMENT_PREFIX).lower().replace("__", ".")
            override(tree, origins, key, text, name)
    origins |= (typed := override_tree(tree, sets))
    # Whoever names a person means that person's maxima, not those of a file that the settings name.
    if "calibration.person" in typed and "calibration.file" not in typed:
        tree["calibration"].pop("file", None)
        origins.pop("calibration.file", None)
    base = path.absolute().parent if path is not None else Path.cwd()
    return check_tree(tree, origins, base=base)


LOOP_KEYS: Final = ("vest.layout", "vest.mirror", "vest.threshold", "vest.step", "session.pose_base")
"""Settings of the loop besides those of its stages, which a simulated trial has as well."""


def file_sets(path: Path) -> tuple[str, ...]:
    """Return a settings file's stages and :data:`LOOP_KEYS` as ``key=value``, for a loop that has no devices.

    Paths are absolute; errors are those of :func:`load_config`.
    """
    loaded = load_config(path, environ={})
    found = {
        key: value.value
        for key, value in loaded.values.items()
        if value.origin.startswith(f"{path.name}:") and (key.startswith("stages.") or key in LOOP_KEYS)
    }
    if any("[" in key for key in found):
        found = {key: value for key, value in found.items() if "[" not in key}
        found["stages.beside"] = loaded.config.stages.beside
    return tuple(
        f"{key}={toml_value(msgspec.to_builtins(value, enc_hook=str))}" for key, value in found.items()
    )


def driver_options(name: str, tree: Mapping[str, Any], *, sets: Sequence[str] = ()) -> Options:
    """Return a driver's options, checked outside a session as its ``options`` table would be.

    ``sets`` are further options as ``key=value``; paths are relative to the working directory. Errors are those
    of :func:`load_config`.
    """
    typed: Options = _checked_options(driver_class(name).options_type, tree, sets)
    return typed


def stage_options(
    group: Literal["metric", "decoder", "mapping", "reflex"], name: str, *, sets: Sequence[str] = ()
) -> Any:
    """Return a stage's options; ``sets`` and errors are those of :func:`driver_options`."""
    return _checked_options(stage_class(group, name).options_type, {}, sets)


def _checked_options(wanted: Any, tree: Mapping[str, Any], sets: Sequence[str]) -> Any:
    options: dict[str, Any] = dict(tree)
    origins: dict[str, str] = {}
    for item in sets:
        override(options, origins, *key_and_value(item, "rate_hz=30"), "--set")
    try:
        return msgspec.convert(options, wanted, dec_hook=paths_below(Path.cwd()))
    except msgspec.ValidationError as error:
        raise explain(error, options, wanted, prefix="options", origins=origins) from None
