"""Define what a feature declares, and check a declaration before anything else of the feature is imported."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Final

__all__ = ["OWN_NAMES", "Feature", "Verb", "clash", "mistake"]

OWN_NAMES: Final[Mapping[str, tuple[str, ...]]] = {
    "settings": (
        *("session", "calibration", "tactile", "emg", "vest", "hand", "stages", "input", "arm"),
        *("recording", "safety", "guests"),
    ),
    "verbs": (
        *("run", "replay", "verify", "play", "init", "doctor", "calibrate", "stages", "devices", "audit"),
        *("bench", "soak", "recording", "emg", "vest", "hand", "config"),
        *("inspect", "export", "trim", "merge", "sim-trials", "identify"),
        *("recording annotate", "recording export", "recording inspect", "recording merge", "recording trim"),
        *("emg inspect", "vest identify"),
        *("hand measure", "hand show", "hand teach"),
        *("config check", "config show"),
    ),
    "formats": ("csv", "parquet"),
}
"""Names of TEGA's own tables, verbs (earlier ones too) and formats: no feature can have them."""


@dataclass(frozen=True, slots=True)
class Verb:
    """A verb of the command line.

    Attributes:
        target: The click command or group, ``"module:object"``.
        summary: One line for the help.
        group: Section of the help of ``tega-teleop`` in which it stands.
    """

    target: str
    summary: str
    group: str = "Groups"


@dataclass(frozen=True, slots=True, kw_only=True)
class Feature:
    """Everything that one package adds to TEGA; every member is optional.

    Attributes:
        summary: The feature in one line.
        settings: Tables of the settings file: the key, and the msgspec type of the table.
        check: Check of those tables, called as ``check(table, context)`` with a
            :class:`tega.config.guests.TableContext`; returns the table to use.
        records: Record types, a tuple of :class:`tega.records.Record` classes.
        part: Part of a run, called as ``open_part(context)`` with a :class:`tega.loop.parts.PartContext`; returns a
            :class:`tega.loop.parts.Part`, or ``None`` where this run does not need it.
        verbs: Verbs by name; a name of two words, such as ``"emg fitts"``, joins a group.
        checks: Check for ``doctor``, called with the settings; returns findings.
        panels: Panel of page and terminal, called with the run's bus: it subscribes to its records and publishes
            :class:`~tega.records.display.DisplayRow` and :class:`~tega.records.display.DisplayPicture`.
        in_play: Whether its part, with its tables, joins when a recording is played; none that steers or films may.
        played: Player of its recorded topics for ``play``, a ``Player`` of :mod:`tega.recording.replay.followed_file`.
        formats: Formats of ``recording export`` by name, each a :class:`tega.ui.cli.export_format.ExportFormat`.
        streams: Programs for ``run --stream`` by name, each called with the run's bus; returns a context manager that
            has an attribute ``url`` once it is entered.
        extra: Extra of the package that brings the libraries it needs.
        name, package, module: Its name, the package that declares it, and the top-level module of the declaration;
            set where the declaration is found.
    """

    summary: str
    settings: Mapping[str, str] = field(default_factory=dict)
    check: str = ""
    records: str = ""
    part: str = ""
    verbs: Mapping[str, Verb] = field(default_factory=dict)
    checks: str = ""
    panels: str = ""
    in_play: bool = False
    played: str = ""
    formats: Mapping[str, str] = field(default_factory=dict)
    streams: Mapping[str, str] = field(default_factory=dict)
    extra: str = ""
    name: str = ""
    package: str = ""
    module: str = ""

    @property
    def requirement(self) -> str:
        """Its package, with the extra that brings the libraries it needs."""
        return f"{self.package}[{self.extra}]" if self.extra else self.package

    @property
    def own(self) -> bool:
        """Whether it is one of TEGA's own."""
        return self.package == "tega"


_KINDS: Final[Mapping[str, type]] = {
    "str": str,
    "bool": bool,
    "Mapping[str, str]": str,
    "Mapping[str, Verb]": Verb,
}


def mistake(declared: Feature | Verb, where: str = "") -> str:
    """Return which member of a declaration has a wrong type, with its value and the type; ``""`` for none."""
    for one in fields(declared):
        value, name, kind = getattr(declared, one.name), f"{where}{one.name}", str(one.type)
        items = {name: value}
        if kind.startswith("Mapping"):
            if not isinstance(value, Mapping) or not all(isinstance(key, str) for key in value):
                return f"{name} is {value!r}, not a {kind}"
            items = {f"{name}[{key!r}]": item for key, item in value.items()}
        for place, item in items.items():
            if not isinstance(item, _KINDS[kind]):
                return f"{place} is {item!r}, not a {_KINDS[kind].__name__}"
            if isinstance(item, Verb) and (wrong := mistake(item, f"{place}.")):
                return wrong
    return ""


def clash(feature: Feature, others: Mapping[str, Feature]) -> str:
    """Return which name of a feature is taken by TEGA or by another feature, or joins nothing; ``""`` for none."""
    if feature.name in others:
        return f"the entry point {feature.name!r} has the name of a feature of {others[feature.name].package}"
    for member in ("settings", "verbs", "formats", "streams"):
        taken = {key: f"feature {name!r}" for name, one in others.items() for key in getattr(one, member)}
        taken |= dict.fromkeys(OWN_NAMES.get(member, ()), "TEGA")
        for key in getattr(feature, member):
            if key in taken:
                return f"{member}: the name {key!r} is taken by {taken[key]}"
    groups = {name.partition(" ")[0] for name in OWN_NAMES["verbs"] if " " in name}
    groups |= {verb for one in (*others.values(), feature) for verb in one.verbs}
    for verb in feature.verbs:
        group, *name = verb.split(" ")
        if len(name) > 1 or not all((group, *name)):
            return f"verbs: {verb!r} is neither one word nor two"
        if name and group not in groups and not feature.own:  # one of TEGA's may have been taken out
            return f"verbs: {verb!r} joins no group: there is no group {group!r}"
    return ""
