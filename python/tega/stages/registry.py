"""Find stages by name, through the entry points of five groups.

A package that declares ::

    [project.entry-points."tega.metrics"]
    my-metric = "my_package.metric:MyMetric"

is found by that name as soon as it is installed. The stages that come with TEGA use the same door.
"""

from __future__ import annotations

import importlib.util
import re
from inspect import getdoc
from typing import Any, Final, Literal, get_args, get_type_hints

import msgspec

from tega.errors import DeviceUnavailableError, TegaError
from tega.haptics.motor_layout import MotorLayout, find_layout
from tega.runtime.features import find_plugin, load_plugin, plugin_package, plugins
from tega.runtime.removed import Removed
from tega.stages.base import Decoder, Mapping, Metric, Reflex, StageOptions

_UNITS = {
    "hz": "Hz",
    "s": "s",
    "s2": "s²",
    "ms": "ms",
    "h": "h",
    "n": "N",
    "nm": "N·m",
    "kg": "kg",
    "mm": "mm",
    "m": "m",
    "px": "px",
    "percent": "%",
    "rad": "rad",
    "dbfs": "dBFS",
    "levels": "levels",
    "mib": "MiB",
    "beta": "1",
}
REMOVED: Final = {
    "stages.metric shear": Removed(
        "0.3", "it was not shown to tell sliding from holding", "choose live, which reads the same contact"
    )
}
"""Stages that were taken out, by group and name."""
_PERCENT = {"vest.threshold", "vest.step", "vest.options.limit"}


def unit_of(key: str) -> str:
    """Return the unit that a dotted key's last part names; percent where a page says so, else ``""``.

    Example:
        >>> unit_of("hand.rise_levels_per_s"), unit_of("arm.limits.speed_m_s"), unit_of("vest.rate_hz")
        ('levels/s', 'm/s', 'Hz')
    """
    last = key.rpartition(".")[2]
    if key in _PERCENT:
        return "%"
    words = last.split("_")
    if "per" in words[1:-1]:  # such as levels_per_s, gain_percent_per_min, mm_per_px
        over = len(words) - 1 - words[::-1].index("per")
        unit, under = words[over - 1], words[over + 1]
        return f"{_UNITS.get(unit, unit)}/{_UNITS.get(under, under)}"
    # One unit, or one by another: speed_m_s.
    return "/".join(_UNITS[word] for word in words[1:][-2:] if word in _UNITS and words[-1] in _UNITS)


Group = Literal["metric", "decoder", "mapping", "layout", "reflex"]

GROUPS: Final[dict[Group, tuple[str, type]]] = {
    "metric": ("tega.metrics", Metric),
    "decoder": ("tega.decoders", Decoder),
    "mapping": ("tega.mappings", Mapping),
    "layout": ("tega.layouts", MotorLayout),
    "reflex": ("tega.reflexes", Reflex),
}
"""Entry-point group and base class of each kind of stage."""


class OptionRecord(msgspec.Struct, frozen=True, kw_only=True):
    """One option of a stage; ``unit`` is ``""`` where it has none, ``choices`` holds the permitted values."""

    name: str
    default: Any
    unit: str = ""
    choices: tuple[str, ...] = ()
    summary: str = ""


class StageRecord(msgspec.Struct, frozen=True, kw_only=True):
    """One line of ``tega-teleop stages``.

    Attributes:
        package: The distribution that brings it.
        ready: Whether it loads and the packages it needs are installed; ``problem`` says what is missing.
        values: Named values that a metric measures under its default options, with their units.
    """

    group: Group
    name: str
    summary: str
    package: str
    ready: bool
    problem: str = ""
    options: tuple[OptionRecord, ...] = ()
    values: dict[str, str] = {}


def stage_names(group: Group) -> list[str]:
    """Return the sorted names of all installed stages of a group, without importing them."""
    return sorted(plugins(GROUPS[group][0]))


def find_stages(name: str) -> list[Group]:
    """Return the groups in which a stage of this name is installed."""
    return [group for group in GROUPS if name in plugins(GROUPS[group][0])]


def stage_class(group: Literal["metric", "decoder", "mapping", "reflex"], name: str) -> Any:
    """Return the class of a metric, decoder, mapping or reflex, by its name, such as ``"paper"``.

    Raises:
        ConfigError: No stage of the group has that name, or it was taken out.
        MissingExtraError: Its module needs a package that is not installed.
        DeviceUnavailableError: Its module lacks the name in its entry point.
    """
    where, base = GROUPS[group]
    removed = f"stages.{group} {name}"
    if removed in REMOVED and name not in plugins(where):
        raise REMOVED[removed].refusal(removed)
    entry = find_plugin(where, group, name)
    loaded = kind = load_plugin(entry, group)
    problem = ""
    if not (isinstance(loaded, type) and issubclass(loaded, base)):
        problem = f" is registered as {entry.value!r}, which is no subclass of tega.stages.{base.__name__}"
    elif not (isinstance(kind.options_type, type) and issubclass(kind.options_type, StageOptions)):
        problem = ": options_type is no subclass of tega.stages.StageOptions"
    if problem:
        raise DeviceUnavailableError(f"{group} {name!r}{problem}", "see docs/own-stage.md")
    return kind


def list_stages() -> list[StageRecord]:
    """Describe every installed stage, by group and name; a stage that fails to load is listed as not ready."""
    records = []
    for group, (where, _) in GROUPS.items():
        for name, entry in sorted(plugins(where).items()):
            reported: dict[str, Any] = {"group": group, "name": name, "package": plugin_package(entry)}
            try:
                records.append(_described(group, name, reported))
            except (TegaError, msgspec.ValidationError, TypeError) as error:
                records.append(StageRecord(**reported, summary="", ready=False, problem=str(error)))
    return records


def _described(group: Group, name: str, reported: dict[str, Any]) -> StageRecord:
    if group == "layout":
        layout = find_layout(name)
        return StageRecord(**reported, summary=f"{layout.summary} ({len(layout.motors)} motors)", ready=True)
    stage = stage_class(group, name)
    missing = [module for module in stage.requires if importlib.util.find_spec(module) is None]
    problem = ""
    if missing:
        problem = f"needs {', '.join(missing)}: pip install '{reported['package']}[{stage.extra}]'"
    values = {}
    if group == "metric" and not any(f.required for f in msgspec.structs.fields(stage.options_type)):
        values = stage.units(stage.options_type())
    return StageRecord(
        **reported,
        summary=stage.summary,
        ready=not missing,
        problem=problem,
        options=_options(stage.options_type),
        values=values,
    )


def _options(options_type: type[StageOptions]) -> tuple[OptionRecord, ...]:
    attributes = _attributes(options_type)
    hints = get_type_hints(options_type)
    records = []
    for field in msgspec.structs.fields(options_type):
        default = None if field.default is msgspec.NODEFAULT else field.default
        if field.default_factory is not msgspec.NODEFAULT:
            default = field.default_factory()
        records.append(
            OptionRecord(
                name=field.name,
                default=msgspec.to_builtins(default, enc_hook=str),
                unit=unit_of(field.name),
                choices=tuple(map(str, _literals(hints[field.name]))),
                summary=attributes.get(field.name, ""),
            )
        )
    return tuple(records)


def _literals(kind: Any) -> tuple[Any, ...]:
    if getattr(kind, "__origin__", None) is Literal:
        return get_args(kind)
    return tuple(value for part in get_args(kind) for value in _literals(part))


def _attributes(kind: type) -> dict[str, str]:
    bases = (base for base in reversed(kind.__mro__) if issubclass(base, StageOptions))
    return {name: text for base in bases for name, text in _own_attributes(base).items()}


def _own_attributes(kind: type) -> dict[str, str]:
    _, _, section = (getdoc(kind) or "").partition("Attributes:\n")
    found: dict[str, str] = {}
    name = ""
    for line in section.splitlines():
        if (begin := re.match(r" {4}(\w+): (.*)", line)) is not None:
            name = begin.group(1)
            found[name] = begin.group(2).strip()
        elif name and line.startswith(" " * 8):
            found[name] += f" {line.strip()}"
        else:
            break
    return {name: re.sub(r":\w+:`|`", "", text) for name, text in found.items()}
