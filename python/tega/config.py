"""Settings of a session: one TOML file, checked key by key.

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
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, NamedTuple

import msgspec

from tega.config_errors import Overridden, explain
from tega.config_lines import value_lines
from tega.config_sections import (
    DEFAULT_LAYOUT,
    DEFAULT_PACE,
    DEFAULT_STAGES,
    FINGERS,
    STAGE_GROUPS,
    ArmConfig,
    CalibrationConfig,
    EmgConfig,
    HandConfig,
    InputConfig,
    InputSection,
    MarkersSection,
    Pace,
    RecordingSection,
    SessionConfig,
    SessionSection,
    StageConfig,
    StagesSection,
    TactileConfig,
    TactileSection,
    TrackerConfig,
    VestConfig,
)
from tega.devices.base import Kind, Options
from tega.devices.registry import driver_class
from tega.errors import ConfigError, InvalidValueError
from tega.foreign_file import parse_toml, read_words
from tega.motor_layout import find_layout
from tega.net.settings import checked_net
from tega.stages.registry import stage_class

__all__ = [
    "DEFAULT_LAYOUT",
    "DEFAULT_PACE",
    "DEFAULT_STAGES",
    "FINGERS",
    "STAGE_GROUPS",
    "ArmConfig",
    "CalibrationConfig",
    "EmgConfig",
    "HandConfig",
    "InputConfig",
    "InputSection",
    "LoadedConfig",
    "MarkersSection",
    "Pace",
    "RecordingSection",
    "SessionConfig",
    "SessionSection",
    "StageConfig",
    "StagesSection",
    "TactileConfig",
    "TactileSection",
    "TrackerConfig",
    "Value",
    "VestConfig",
    "check_tree",
    "driver_options",
    "load_config",
    "stage_options",
]

ENVIRONMENT_PREFIX = "TEGA_"


class Value(NamedTuple):
    """A setting and where it came from.

    That is ``default``, ``preset live``, a file's name and line (``lab.toml:12``), a variable's name, or ``--set``.
    """

    value: Any
    origin: str


class LoadedConfig(NamedTuple):
    """A checked configuration and the origin of every value in it, by dotted key."""

    config: SessionConfig
    values: dict[str, Value]


def load_config(
    path: Path | None, *, environ: Mapping[str, str] | None = None, sets: Sequence[str] = ()
) -> LoadedConfig:
    """Load and check a session's settings.

    Args:
        path: The TOML file; ``None`` for the defaults alone.
        environ: Environment variables; the process's own when ``None``.
        sets: Overrides as ``key=value``, the value in TOML or plain text.

    Returns:
        The configuration and the origin of every value.

    Raises:
        ConfigError: The file is missing or is not TOML, or a key is unknown, of a wrong type or out of range.
        MissingExtraError: A driver it names needs a package that is not installed.
    """
    tree: dict[str, Any] = {}
    origins: dict[str, str] = {}
    if path is not None:
        tree, lines = _read_toml(path)
        origins = {key: f"{path.name}:{line}" for key, line in lines.items()}
    for name, text in sorted((os.environ if environ is None else environ).items()):
        if name.startswith(ENVIRONMENT_PREFIX) and "__" in name:
            key = name.removeprefix(ENVIRONMENT_PREFIX).lower().replace("__", ".")
            _override(tree, origins, key, text, name)
    base = path.absolute().parent if path is not None else Path.cwd()
    return check_tree(tree, origins, base=base, sets=sets)


def check_tree(
    tree: dict[str, Any], origins: Mapping[str, str], *, base: Path, sets: Sequence[str] = ()
) -> LoadedConfig:
    """Check a tree of settings against the schema and the drivers it names.

    Args:
        tree: Settings as nested tables.
        origins: Where each dotted key came from.
        base: Folder to which relative paths refer.
        sets: Overrides as ``key=value``, the value in TOML or plain text; they are put into the tree.

    Returns:
        The configuration and the origin of every value.

    Raises:
        ConfigError: A key is unknown, of a wrong type or out of range.
        MissingExtraError: A driver it names needs a package that is not installed.
    """
    origins = dict(origins)
    for item in sets:
        _override(tree, origins, *_key_and_value(item, "session.preset=paper"), "--set")

    def place(wanted: type, value: Any) -> Any:
        if wanted is Path and isinstance(value, str | Path):
            return (Path.cwd() if isinstance(value, Overridden) else base) / Path(value).expanduser()
        raise TypeError(f"expected {'a path' if wanted is Path else wanted.__name__}")

    def convert(subtree: Any, wanted: Any, prefix: str) -> Any:
        try:
            return msgspec.convert(subtree, wanted, dec_hook=place)
        except msgspec.ValidationError as error:
            raise explain(error, subtree, wanted, prefix=prefix, origins=origins) from None

    def with_options(section: Any, kind: Kind, key: str) -> Any:
        if section is None:
            return None
        if section.driver is None:
            if section.options:
                raise ConfigError(f"{key}.options: given, but no driver is named", f"set {key}.driver")
            return section
        try:
            wanted = driver_class(section.driver, kind).options_type
        except ConfigError as error:
            raise ConfigError(
                f"{_where(origins, f'{key}.driver')}: {key}.driver: {error.message}", error.hint
            ) from None
        options = convert(section.options, wanted, f"{key}.options")
        return msgspec.structs.replace(section, options=options)

    _check_moved(tree, origins)
    config: SessionConfig = convert(tree, SessionConfig, "")
    tactile = TactileSection(
        **{f: with_options(c, "tactile", f"tactile.{f}") for f, c in config.tactile.in_use().items()}
    )
    arm = with_options(config.arm, "arm", "arm")
    if arm is not None:
        tracker = with_options(arm.tracker, "tracker", "arm.tracker")
        arm = msgspec.structs.replace(arm, tracker=tracker)
    net = config.net
    if net is not None:
        checked_net(net)
    if net is not None and net.tracker is not None:
        net = msgspec.structs.replace(net, tracker=with_options(net.tracker, "tracker", "net.tracker"))
    config = msgspec.structs.replace(
        config,
        stages=_typed_stages(config, origins, convert),
        tactile=tactile,
        arm=arm,
        net=net,
        emg=with_options(config.emg, "emg", "emg"),
        vest=with_options(config.vest, "vest", "vest"),
        hand=with_options(config.hand, "hand", "hand"),
        input=InputSection(
            **{seat: with_options(c, "input", f"input.{seat}") for seat, c in config.input.in_use().items()}
        ),
    )
    _check_dead_man(config.input.dead_man)
    # A person's calibrations are kept there, and how long the vest's motors take to start.
    kept_there = config.calibration.person is not None or config.vest.driver is not None
    if kept_there and config.calibration.folder is None:
        beside = msgspec.structs.replace(config.calibration, folder=base / "calibrations")
        config = msgspec.structs.replace(config, calibration=beside)
    values = {key: Value(value, origins.get(key, "default")) for key, value in _fields(config)}
    preset = config.session.preset
    for group in STAGE_GROUPS:
        if getattr(config.stages, group).name is None:
            values[f"stages.{group}.name"] = Value(DEFAULT_STAGES[preset][group], f"preset {preset}")
    if config.vest.layout is None:
        values["vest.layout"] = Value(DEFAULT_LAYOUT[preset], f"preset {preset}")
    if config.vest.pace is None:
        values["vest.pace"] = Value(DEFAULT_PACE[preset], f"preset {preset}")
    if config.calibration.person is None:
        return LoadedConfig(config, values)
    from tega.calibration.person import with_person

    return with_person(LoadedConfig(config, values), given=set(origins))


def _typed_stages(
    config: SessionConfig, origins: Mapping[str, str], convert: Callable[[Any, Any, str], Any]
) -> StagesSection:
    """Return the stages with the options that each of them has, and refuse names that nothing has."""
    sections: dict[str, StageConfig] = {}
    for group in STAGE_GROUPS:
        section: StageConfig = getattr(config.stages, group)
        key = f"stages.{group}"
        try:
            wanted = stage_class(group, section.name or DEFAULT_STAGES[config.session.preset][group])
        except ConfigError as error:
            where = f"{_where(origins, f'{key}.name')}: {key}.name"
            raise ConfigError(f"{where}: {error.message}", error.hint) from None
        options = convert(section.options, wanted.options_type, f"{key}.options")
        sections[group] = msgspec.structs.replace(section, options=options)
    if config.vest.layout is not None:
        try:
            find_layout(config.vest.layout)
        except InvalidValueError as error:
            where = _where(origins, "vest.layout")
            raise ConfigError(f"{where}: vest.{error.message}", error.hint) from None
    beside = []
    for number, one in enumerate(config.stages.beside):
        key = f"stages.beside[{number}]"
        try:
            wanted = stage_class(one.group, one.name)
        except ConfigError as error:
            where = f"{_where(origins, 'stages.beside')}: {key}.name"
            raise ConfigError(f"{where}: {error.message}", error.hint) from None
        typed = convert(one.options, wanted.options_type, f"{key}.options")
        beside.append(msgspec.structs.replace(one, options=typed))
    return StagesSection(**sections, beside=tuple(beside))


# Settings that have another name now.
_MOVED = {
    "vest.feedback": "stages.mapping.name: columns for continuous, pulses for events",
    "vest.pulses": "stages.mapping.options, with stages.mapping.name = pulses",
}


def _check_moved(tree: Mapping[str, Any], origins: Mapping[str, str]) -> None:
    """Refuse a setting under the name it had in an earlier version, and say the one it has now."""
    vest = tree.get("vest", {})
    for key, now in _MOVED.items():
        if isinstance(vest, dict) and key.removeprefix("vest.") in vest:
            where = next((o for k, o in origins.items() if k == key or k.startswith(f"{key}.")), "settings")
            raise ConfigError(f"{where}: {key}: unknown key", f"it is {now}")


def _check_dead_man(seat: InputConfig | None) -> None:
    """Refuse a dead-man that would stay held for ever if it froze; a driver without the option answers for itself."""
    if seat is not None and getattr(seat.options, "silent_after_ms", 0.0) is None:
        raise ConfigError(
            f"input.dead_man: a {seat.driver} that freezes while it is held would stay held: "
            "options.silent_after_ms is not set",
            "set input.dead_man.options.silent_after_ms: 100 where it repeats its report while held; else up to "
            "10000: it then has to be pressed anew that often",
        )


def driver_options(name: str, tree: Mapping[str, Any], *, sets: Sequence[str] = ()) -> Options:
    """Check a driver's options outside a session, as its ``options`` table would be.

    Args:
        name: The driver's name.
        tree: Its options; paths are relative to the working directory.
        sets: Further options as ``key=value``.

    Returns:
        The typed options.

    Raises:
        ConfigError: No such driver, or an option is unknown, missing, of a wrong type or out of range.
        MissingExtraError: The driver needs a package that is not installed.
    """
    typed: Options = _checked_options(driver_class(name).options_type, tree, sets)
    return typed


def stage_options(
    group: Literal["metric", "decoder", "mapping"], name: str, *, sets: Sequence[str] = ()
) -> Any:
    """Check a stage's options outside a session, as its ``options`` table would be.

    Args:
        group: Which kind of stage.
        name: Its name.
        sets: Options as ``key=value``; paths are relative to the working directory.

    Returns:
        The typed options.

    Raises:
        ConfigError: No such stage, or an option is unknown, missing, of a wrong type or out of range.
        MissingExtraError: The stage needs a package that is not installed.
    """
    return _checked_options(stage_class(group, name).options_type, {}, sets)


def _checked_options(wanted: Any, tree: Mapping[str, Any], sets: Sequence[str]) -> Any:
    options: dict[str, Any] = dict(tree)
    origins: dict[str, str] = {}
    for item in sets:
        _override(options, origins, *_key_and_value(item, "rate_hz=30"), "--set")

    def place(kind: type, value: Any) -> Any:
        if kind is Path and isinstance(value, str | Path):
            return Path.cwd() / Path(value).expanduser()
        raise TypeError(f"expected {'a path' if kind is Path else kind.__name__}")

    try:
        return msgspec.convert(options, wanted, dec_hook=place)
    except msgspec.ValidationError as error:
        raise explain(error, options, wanted, prefix="options", origins=origins) from None


def _key_and_value(item: str, example: str) -> tuple[str, str]:
    key, equals, text = item.partition("=")
    if not equals or not key.strip():
        raise ConfigError(f"--set {item!r}: not of the form key=value", f"for example --set {example}")
    return key.strip(), text.strip()


def _where(origins: Mapping[str, str], key: str) -> str:
    return origins.get(key, "settings")


def _read_toml(path: Path) -> tuple[dict[str, Any], dict[str, int]]:
    """Return a file's tree, and the line of each value."""
    try:
        text = read_words(path, error=ConfigError)
        return parse_toml(text), value_lines(text)
    except OSError as error:
        raise ConfigError(
            f"{path.name}: cannot be read: {error.strerror or error}", f"looked for {path}"
        ) from error
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path.name}: not UTF-8 text: {error.reason}", "save it as UTF-8") from error
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{path.name}: not valid TOML: {error}", "see https://toml.io") from error


def _override(tree: dict[str, Any], origins: dict[str, str], key: str, text: str, origin: str) -> None:
    """Put one value given as text into the tree."""
    try:
        value: Any = tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        value = text
    if isinstance(value, str):
        value = Overridden(value)
    *tables, last = key.split(".")
    node = tree
    for i, table in enumerate(tables):
        node = node.setdefault(table, {})
        if not isinstance(node, dict):
            raise ConfigError(
                f"{origin}: {key}: {'.'.join(tables[: i + 1])} is a value, not a table", "check the key"
            )
    node[last] = value
    origins[key] = origin


def _fields(struct: msgspec.Struct, prefix: str = "") -> Iterator[tuple[str, Any]]:
    for name in struct.__struct_fields__:
        value = getattr(struct, name)
        if isinstance(value, msgspec.Struct):
            yield from _fields(value, f"{prefix}{name}.")
        elif name != "options":
            yield f"{prefix}{name}", value
