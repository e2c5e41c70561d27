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
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple

import msgspec

from tega.config_errors import Overridden, explain
from tega.config_lines import value_lines
from tega.devices.base import Kind, Options
from tega.devices.registry import driver_class
from tega.errors import ConfigError
from tega.safety.settings import SafetySection

if TYPE_CHECKING:
    from tega.haptics import Layout

__all__ = [
    "DEFAULT_LAYOUT",
    "FINGERS",
    "CalibrationConfig",
    "EmgConfig",
    "HandConfig",
    "InputConfig",
    "InputSection",
    "LoadedConfig",
    "MarkersSection",
    "RecordingSection",
    "SessionConfig",
    "SessionSection",
    "TactileConfig",
    "TactileSection",
    "Value",
    "VestConfig",
    "check_tree",
    "driver_options",
    "load_config",
]

FINGERS = ("thumb", "index", "middle", "ring")
ENVIRONMENT_PREFIX = "TEGA_"

DEFAULT_LAYOUT: dict[str, Layout] = {"paper": "paper32", "live": "x40"}
"""The vest's layout where the settings name none, by preset."""


class _Section(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    pass


class SessionSection(_Section, frozen=True):
    """The run as a whole.

    Attributes:
        preset: ``paper`` (the printed law and the least that keeps it from breaking) or ``live`` (for people).
        pace: ``real`` waits for the clock, ``fast`` runs recordings as fast as they can be computed.
        out_dir: Folder for the outputs; none means nothing is written.
        duration_s: Stop after this long; none means when the last recording ends, or never.
    """

    preset: Literal["paper", "live"] = "live"
    pace: Literal["real", "fast"] = "real"
    out_dir: Path | None = None
    duration_s: Annotated[float, msgspec.Meta(gt=0, le=1e6)] | None = None


_Hours = Annotated[float, msgspec.Meta(gt=0, le=1e6)]


class CalibrationConfig(_Section, frozen=True):
    """Where baselines, maxima and the wearer's thresholds come from.

    Attributes:
        file: A file of maxima; none means those of ``person``, or, for recordings only, of the recording itself, which
            is not causal.
        person: Whose calibration to use, as ``tega-teleop calibrate`` has kept it.
        folder: Where it keeps them; none means ``calibrations`` beside the settings file.
        baseline_old_h: A baseline older than this is warned of, hours.
        touch_old_h: Likewise maxima of a fingertip.
        emg_old_h: Likewise rest and maxima of the muscles; a refresh makes them new.
        vest_old_h: Likewise thresholds of the vest.
    """

    file: Path | None = None
    person: str | None = None
    folder: Path | None = None
    baseline_old_h: _Hours = 24.0
    touch_old_h: _Hours = 720.0
    emg_old_h: _Hours = 12.0
    vest_old_h: _Hours = 2160.0


class TactileConfig(_Section, frozen=True):
    """One fingertip.

    Attributes:
        driver: Name of a tactile driver.
        baseline: Picture of the untouched gel (an image or ``.npy``); none means it is estimated from the
            recording's quietest frames.
        options: The driver's own settings.
    """

    driver: str
    baseline: Path | None = None
    options: Any = msgspec.field(default_factory=dict)


class TactileSection(_Section, frozen=True):
    """The fingertips in use; a finger that is not named has no sensor."""

    thumb: TactileConfig | None = None
    index: TactileConfig | None = None
    middle: TactileConfig | None = None
    ring: TactileConfig | None = None

    def in_use(self) -> dict[str, TactileConfig]:
        """Return the fingers that have a sensor, thumb first."""
        return {f: c for f in FINGERS if (c := getattr(self, f)) is not None}


class EmgConfig(_Section, frozen=True):
    """The muscle signal.

    Attributes:
        driver: Name of an EMG driver.
        kind: What the samples are: ``raw`` (offset removed and rectified here), ``rectified`` or ``envelope``.
        muscles: What each channel sits on, for the words of a calibration; none means ECR, FCU, FDS where
            there are three.
        options: The driver's own settings.
    """

    driver: str
    kind: Literal["raw", "rectified", "envelope"]
    muscles: tuple[str, ...] = ()
    options: Any = msgspec.field(default_factory=dict)


_Threshold = Annotated[float, msgspec.Meta(ge=0, le=99)]
_EachThreshold = Annotated[tuple[_Threshold, ...], msgspec.Meta(min_length=40, max_length=40)]
_Step = Annotated[float, msgspec.Meta(gt=0, le=100)]
_EachStep = Annotated[tuple[_Step, ...], msgspec.Meta(min_length=40, max_length=40)]


class VestConfig(_Section, frozen=True):
    """The vest.

    Attributes:
        driver: Name of a vest driver; none means the frames are only recorded.
        layout: Which motors: ``paper32``, ``x40`` or ``x16``; none means the preset's own.
        rate_hz: Frames per second.
        keep_alive_s: A frame equal to the last one sent is sent to a real vest again after this long at the latest;
            0 sends every frame. It stays well below the 200 ms after which a vest has to fall silent by itself.
        mirror: ``back`` reverses the back's columns, ``all`` both faces' (a left hand, or a mirrored vest).
        threshold: The lowest intensity that this person feels, percent: one number, or 40 in the wearer's order.
        step: The smallest increase that this person notices, percent; likewise. See ``tega.haptics.FeltMap``.
        options: The driver's own settings.
    """

    driver: str | None = None
    layout: Literal["paper32", "x40", "x16"] | None = None
    rate_hz: Annotated[float, msgspec.Meta(gt=0, le=100)] = 30.0
    keep_alive_s: Annotated[float, msgspec.Meta(ge=0, le=0.15)] = 0.1
    mirror: Literal["none", "back", "all"] = "none"
    threshold: _Threshold | _EachThreshold = 0.0
    step: _Step | _EachStep = 1.0
    options: Any = msgspec.field(default_factory=dict)


class HandConfig(_Section, frozen=True):
    """The robot hand.

    Attributes:
        driver: Name of a hand driver; none means the frames are only recorded.
        device_id: The hand's number on its bus.
        options: The driver's own settings.
    """

    driver: str | None = None
    device_id: Annotated[int, msgspec.Meta(ge=0, le=3)] = 0
    options: Any = msgspec.field(default_factory=dict)


class InputConfig(_Section, frozen=True):
    """An operator's input device.

    Attributes:
        driver: Name of an input driver.
        button: Which of its buttons is meant, for ``dead_man`` and ``marker``; none means any.
        options: The driver's own settings.
    """

    driver: str
    button: str | None = None
    options: Any = msgspec.field(default_factory=dict)


class InputSection(_Section, frozen=True):
    """What the operator holds or steps on, by what it is for.

    Attributes:
        motion: Six axes that are to move the arm.
        dead_man: A switch that is held as long as things may move.
        marker: A switch that marks a moment.
    """

    motion: InputConfig | None = None
    dead_man: InputConfig | None = None
    marker: InputConfig | None = None

    def in_use(self) -> dict[str, InputConfig]:
        """Return the inputs that have a device."""
        return {seat: c for seat in self.__struct_fields__ if (c := getattr(self, seat)) is not None}


class RecordingSection(_Section, frozen=True):
    """The recording of a run; needs the extra ``record``.

    Attributes:
        dir: Folder of the session, to which every run adds a file; none means nothing is recorded.
        lossless: Pictures as they are, so that a replay computes the same bits; otherwise as JPEG.
        jpeg_quality: 1 to 100.
        queue_mib: What may wait for the disk; beyond it pictures are dropped and counted.
        warn_free_mib: A disk with less room than this is warned of.
        stop_free_mib: With less room than this the recording is finished, and the run goes on without.
    """

    dir: Path | None = None
    lossless: bool = False
    jpeg_quality: Annotated[int, msgspec.Meta(ge=1, le=100)] = 95
    queue_mib: Annotated[float, msgspec.Meta(gt=0, le=65536)] = 128.0
    warn_free_mib: Annotated[float, msgspec.Meta(ge=0)] = 2048.0
    stop_free_mib: Annotated[float, msgspec.Meta(ge=0)] = 256.0


class MarkersSection(_Section, frozen=True):
    """Markers by the Lab Streaming Layer; needs the extra ``lsl``.

    Attributes:
        lsl_out: Name of the stream on which a run tells its states, faults, trials and pedals; none means it does not.
        lsl_in: Name of another program's stream of markers, which are recorded; none means none are.
    """

    lsl_out: str | None = None
    lsl_in: str | None = None


class SessionConfig(_Section, frozen=True):
    """Everything a session needs to know, checked, with absolute paths and typed driver options."""

    session: SessionSection = SessionSection()
    calibration: CalibrationConfig = CalibrationConfig()
    tactile: TactileSection = TactileSection()
    emg: EmgConfig | None = None
    vest: VestConfig = VestConfig()
    hand: HandConfig = HandConfig()
    input: InputSection = InputSection()
    recording: RecordingSection = RecordingSection()
    markers: MarkersSection = MarkersSection()
    safety: SafetySection = SafetySection()


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
    for item in sets:
        key, equals, text = item.partition("=")
        if not equals or not key.strip():
            raise ConfigError(
                f"--set {item!r}: not of the form key=value", "for example --set session.preset=paper"
            )
        _override(tree, origins, key.strip(), text.strip(), "--set")
    base = path.absolute().parent if path is not None else Path.cwd()
    return check_tree(tree, origins, base=base)


def check_tree(tree: dict[str, Any], origins: Mapping[str, str], *, base: Path) -> LoadedConfig:
    """Check a tree of settings against the schema and the drivers it names.

    Args:
        tree: Settings as nested tables.
        origins: Where each dotted key came from.
        base: Folder to which relative paths refer.

    Returns:
        The configuration and the origin of every value.

    Raises:
        ConfigError: A key is unknown, of a wrong type or out of range.
        MissingExtraError: A driver it names needs a package that is not installed.
    """

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

    config: SessionConfig = convert(tree, SessionConfig, "")
    tactile = TactileSection(
        **{f: with_options(c, "tactile", f"tactile.{f}") for f, c in config.tactile.in_use().items()}
    )
    config = msgspec.structs.replace(
        config,
        tactile=tactile,
        emg=with_options(config.emg, "emg", "emg"),
        vest=with_options(config.vest, "vest", "vest"),
        hand=with_options(config.hand, "hand", "hand"),
        input=InputSection(
            **{seat: with_options(c, "input", f"input.{seat}") for seat, c in config.input.in_use().items()}
        ),
    )
    if config.calibration.person is not None and config.calibration.folder is None:
        beside = msgspec.structs.replace(config.calibration, folder=base / "calibrations")
        config = msgspec.structs.replace(config, calibration=beside)
    values = {key: Value(value, origins.get(key, "default")) for key, value in _fields(config)}
    if config.vest.layout is None:
        preset = config.session.preset
        values["vest.layout"] = Value(DEFAULT_LAYOUT[preset], f"preset {preset}")
    if config.calibration.person is None:
        return LoadedConfig(config, values)
    from tega.calibration.person import with_person

    return with_person(LoadedConfig(config, values), given=set(origins))


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
    options: dict[str, Any] = dict(tree)
    origins: dict[str, str] = {}
    for item in sets:
        key, _, text = item.partition("=")
        _override(options, origins, key.strip(), text.strip(), "--set")

    def place(wanted: type, value: Any) -> Any:
        if wanted is Path and isinstance(value, str | Path):
            return Path.cwd() / Path(value).expanduser()
        raise TypeError(f"expected {'a path' if wanted is Path else wanted.__name__}")

    wanted = driver_class(name).options_type
    try:
        return msgspec.convert(options, wanted, dec_hook=place)
    except msgspec.ValidationError as error:
        raise explain(error, options, wanted, prefix="options", origins=origins) from None


def _where(origins: Mapping[str, str], key: str) -> str:
    return origins.get(key, "settings")


def _read_toml(path: Path) -> tuple[dict[str, Any], dict[str, int]]:
    """Return a file's tree, and the line of each value."""
    try:
        text = path.read_text(encoding="utf-8")
        return tomllib.loads(text), value_lines(text)
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
        elif not (name == "options" and not isinstance(value, Options)):
            yield f"{prefix}{name}", value
