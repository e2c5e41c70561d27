"""Check settings against the schema, the drivers and the stages that they name."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

import msgspec

from tega.config.errors import Overridden, check_removed, explain, without_constants
from tega.config.fingers import in_order
from tega.config.guests import TableContext, read_guest_tables
from tega.config.origins import LoadedConfig, SettingValue, fields_of, origin_of, where
from tega.config.sections import (
    DEFAULT_LAYOUT,
    DEFAULT_PACE,
    InputConfig,
    InputSection,
    SessionConfig,
)
from tega.config.stage_sections import DEFAULT_STAGES, STAGE_GROUPS, StagesSection
from tega.devices.registry import driver_class
from tega.errors import ConfigError, InvalidValueError
from tega.haptics.motor_layout import find_layout
from tega.records.types import record_types
from tega.runtime.features import named
from tega.runtime.files.toml_text import tree_values
from tega.stages.columns import column_of_each
from tega.stages.registry import stage_class

LEAST: Final = 1e-12
"""The smallest size of a number in the settings that is not 0, in the unit of its key."""

MOST: Final = 1e15
"""The largest size."""

_TAKEN: Final = {*SessionConfig.__struct_fields__, "forearm"}
"""Names of other devices and tables, and of the tracker of the arm: no finger's."""


def check_magnitudes(tree: Mapping[str, Any], origins: Mapping[str, str]) -> None:
    """Refuse a number of the settings that is neither 0 nor :data:`LEAST` to :data:`MOST` in size."""
    for key, value in tree_values(tree):
        # The schema checks other values.
        if (
            isinstance(value, float)
            and value != 0
            and math.isfinite(value)
            and not LEAST <= abs(value) <= MOST
        ):
            size = "small" if abs(value) < LEAST else "large"
            raise ConfigError(
                f"{where(origins, key)}: {key} = {value!r} is too {size}",
                f"numbers are 0, or {LEAST:g} to {MOST:g} in size: is the unit right?",
            )


@contextmanager
def _named(origins: Mapping[str, str], key: str) -> Iterator[None]:
    """Put a key and its origin before an error about its value."""
    try:
        yield
    except ConfigError as error:
        raise ConfigError(f"{where(origins, key)}: {key}: {error.message}", error.hint) from None


def paths_below(base: Path) -> Callable[[type, Any], Any]:
    """Return msgspec's hook for paths: relative ones are below ``base``, or here where given outside the file."""

    def place(wanted: type, value: Any) -> Any:
        if "\0" in str(value):
            raise ValueError("a path holds no NUL character")
        if wanted is Path and isinstance(value, str | Path):
            return (Path.cwd() if isinstance(value, Overridden) else base) / Path(value).expanduser()
        raise TypeError(f"expected {'a path' if wanted is Path else wanted.__name__}")

    return place


def check_tree(tree: dict[str, Any], origins: Mapping[str, str], *, base: Path) -> LoadedConfig:
    """Check a tree of settings against the schema and the drivers it names.

    ``origins`` are the origins of the dotted keys, ``base`` is the folder of relative paths. Raises
    ``ConfigError`` if a key is unknown, of a wrong type or out of range, ``MissingExtraError`` if a driver's
    package is not installed.
    """

    def convert(subtree: Any, wanted: Any, prefix: str) -> Any:
        subtree = without_constants(subtree, prefix, getattr(wanted, "__struct_fields__", ()))
        try:
            return msgspec.convert(subtree, wanted, dec_hook=paths_below(base))
        except msgspec.ValidationError as error:
            raise explain(error, subtree, wanted, prefix=prefix, origins=origins) from None

    def with_options(section: Any, kind: Any, key: str) -> Any:
        if section is None:
            return None
        if section.driver is None:
            if section.options:
                raise ConfigError(f"{key}.options: given, but no driver is named", f"set {key}.driver")
            return section
        with _named(origins, f"{key}.driver"):
            wanted = driver_class(section.driver, kind).options_type
        options = convert(section.options, wanted, f"{key}.options")
        return msgspec.structs.replace(section, options=options)

    check_removed(tree, origins)
    check_magnitudes(tree, origins)
    tree = dict(tree)
    if tree.keys() & named("settings"):
        record_types()  # leaves out features whose records cannot be recorded
    given = {key: tree.pop(key) for key in named("settings") if key in tree}
    if "guests" in tree:
        raise ConfigError(f"{where(origins, 'guests')}: guests: unknown key", "use the feature's own table")
    config: SessionConfig = convert(tree, SessionConfig, "")
    if taken := _TAKEN & config.tactile.keys():
        place = f"{where(origins, f'tactile.{min(taken)}.driver')}: tactile.{min(taken)}"
        raise ConfigError(f"{place}: something else in a run has that name", "name the finger otherwise")
    tactile = {f: with_options(c, "tactile", f"tactile.{f}") for f, c in in_order(config.tactile).items()}
    arm = with_options(config.arm, "arm", "arm")
    if arm is not None:
        tracker = with_options(arm.tracker, "tracker", "arm.tracker")
        arm = msgspec.structs.replace(arm, tracker=tracker)
        _ = arm.start  # a start outside of the workspace is refused before anything is opened
    config = msgspec.structs.replace(
        config,
        stages=_typed_stages(config, origins, convert),
        tactile=tactile,
        arm=arm,
        emg=with_options(config.emg, "emg", "emg"),
        vest=with_options(config.vest, "vest", "vest"),
        hand=with_options(config.hand, "hand", "hand"),
        input=InputSection(
            **{seat: with_options(c, "input", f"input.{seat}") for seat, c in config.input.in_use().items()}
        ),
    )
    # Another package's mapping may show fingers otherwise, and then refuses them itself.
    shown = getattr(config.stages.mapping.options, "fingers", None)
    if isinstance(shown, tuple):
        for finger in tactile:
            with _named(origins, f"tactile.{finger}.driver"):
                column_of_each(shown, [finger])
    _check_dead_man(config.input.dead_man)
    fingers = {f"tactile.{f}": section for f, section in tactile.items()}
    _check_once({**fingers, "emg": config.emg, "vest": config.vest, "hand": config.hand}, origins)
    config, mounted = _with_mounted_hand(config, origins)
    guests = read_guest_tables(given, TableContext(base, config, with_options), convert)
    config = msgspec.structs.replace(config, guests=guests)
    # A person's calibrations are kept there, and how long the vest's motors take to start.
    kept_there = config.calibration.person is not None or config.vest.driver is not None
    if kept_there and config.calibration.folder is None:
        beside = msgspec.structs.replace(config.calibration, folder=base / "calibrations")
        config = msgspec.structs.replace(config, calibration=beside)
    values = _values_of(config, origins, mounted)
    if config.calibration.person is None:
        return LoadedConfig(config, values)
    from tega.config.person_settings import with_person

    return with_person(LoadedConfig(config, values), given=set(origins))


def _values_of(config: SessionConfig, origins: Mapping[str, str], mounted: str) -> dict[str, SettingValue]:
    """Return every value with its origin, those that the preset chooses included."""
    values = {key: SettingValue(value, origin_of(key, origins)) for key, value in fields_of(config)}
    preset = config.session.preset
    for group in STAGE_GROUPS:
        if getattr(config.stages, group).name is None:
            values[f"stages.{group}.name"] = SettingValue(DEFAULT_STAGES[preset][group], f"preset {preset}")
    if config.vest.layout is None:
        values["vest.layout"] = SettingValue(DEFAULT_LAYOUT[preset], f"preset {preset}")
    if config.vest.pace is None:
        values["vest.pace"] = SettingValue(DEFAULT_PACE[preset], f"preset {preset}")
    if mounted:
        values["arm.mapping.robot_hand"] = SettingValue(mounted, "hand.options.side")
    return values


def _with_mounted_hand(config: SessionConfig, origins: Mapping[str, str]) -> tuple[SessionConfig, str]:
    """Set the arm's robot hand to the mounted side; settings that name another side or hand are refused.

    Return the side, too; ``""`` where the settings name it or no driver knows it.
    """
    number = getattr(config.hand.options, "device_id", config.hand.device_id)
    if number != config.hand.device_id and "hand.device_id" in origins:
        place = f"{where(origins, 'hand.device_id')}: hand.device_id = {config.hand.device_id}"
        raise ConfigError(f"{place}, but hand.options.device_id = {number}", "set the latter alone")
    side = getattr(config.hand.options, "side", None)
    if config.arm is None or side is None:
        return config, ""
    text, key = config.arm.mapping.robot_hand, "arm.mapping.robot_hand"
    if key in origins:
        if text != side:
            place = f"{where(origins, key)}: {key}"
            raise ConfigError(
                f"{place} is {text!r}, but hand.options.side is {side!r}", f"leave {key} out, or correct one"
            )
        return config, ""
    mapping = msgspec.structs.replace(config.arm.mapping, robot_hand=side)
    return msgspec.structs.replace(config, arm=msgspec.structs.replace(config.arm, mapping=mapping)), side


def _typed_stages(
    config: SessionConfig, origins: Mapping[str, str], convert: Callable[[Any, Any, str], Any]
) -> StagesSection:
    """Return the stages with the options that each of them has, and refuse names that nothing has."""

    def typed(section: Any, group: Any, name: str, key: str) -> Any:
        with _named(origins, f"{key}.name"):
            wanted = stage_class(group, name)
        options = convert(section.options, wanted.options_type, f"{key}.options")
        return msgspec.structs.replace(section, options=options)

    stages, names = config.stages, DEFAULT_STAGES[config.session.preset]
    changed: dict[str, Any] = {
        group: typed(section, group, section.name or names[group], f"stages.{group}")
        for group in STAGE_GROUPS
        for section in (getattr(stages, group),)
    }
    if config.vest.layout is not None:
        try:
            find_layout(config.vest.layout)
        except InvalidValueError as error:
            place = where(origins, "vest.layout")
            raise ConfigError(f"{place}: vest.{error.message}", error.hint) from None
    changed["beside"] = tuple(
        typed(one, one.group, one.name, f"stages.beside[{number}]")
        for number, one in enumerate(stages.beside)
    )
    if (reflex := stages.reflex).name is not None:
        changed["reflex"] = typed(reflex, "reflex", reflex.name, "stages.reflex")
    elif reflex.authority > 0 or reflex.options:  # one without a name is off, and has none
        place = where(origins, f"stages.reflex{'.authority' if reflex.authority > 0 else ''}")
        raise ConfigError(
            f"{place}: stages.reflex has settings, but stages.reflex.name is not set",
            'name a reflex, such as stages.reflex.name = "grip", or leave them out',
        )
    return msgspec.structs.replace(stages, **changed)


def _check_once(sections: Mapping[str, Any], origins: Mapping[str, str]) -> None:
    """Refuse a device, or a file that an output writes, which an earlier part of the settings names as well."""
    users: dict[str, str] = {}
    for key, section in sections.items():
        for option in ("serial", "source", "port", "channel", "file"):
            value = getattr(getattr(section, "options", None), option, None)
            if not isinstance(value, str | Path) or users.setdefault(str(value), key) == key:
                continue
            # One recording may have pictures of several fingers, and EMG.
            if option != "file" or key in {"vest", "hand"}:
                path = f"{key}.options.{option}"
                raise ConfigError(
                    f"{where(origins, path)}: {path} = {str(value)!r}: {users[str(value)]} has it, too",
                    "name another: a device is one part's alone, and so is a file that is written",
                )


def _check_dead_man(seat: InputConfig | None) -> None:
    """Refuse a dead-man that would stay held for ever if it froze; a driver without the option answers for itself."""
    if seat is not None and getattr(seat.options, "silent_after_ms", 0.0) is None:
        raise ConfigError(
            f"input.dead_man: a {seat.driver} that freezes while it is held would stay held: "
            "options.silent_after_ms is not set",
            "set input.dead_man.options.silent_after_ms: 100 where it repeats its report while held; else up to "
            "10000: it then has to be pressed again that often",
        )
