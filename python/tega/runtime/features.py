"""Find the features that installed packages add to TEGA: entry-point group ``tega.features``.

A feature is one declaration. Every target is ``"module:object"`` and is imported when it is first needed, so that a
feature that is not used costs nothing.
"""

from __future__ import annotations

import importlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any

from tega.errors import ConfigError, MissingExtraError, TegaError
from tega.runtime.plugins import plugin_package, plugins

__all__ = ["Broken", "Feature", "Verb", "broken_features", "features", "load_target", "targets"]

GROUP = "tega.features"


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
        formats: Formats of ``recording export`` by name, each called as ``export(recordings, out, **options)``.
        streams: Programs for ``run --stream`` by name, each called with the run's bus; returns a context manager that
            has an attribute ``url`` once it is entered.
        extra: Extra of the package that brings the libraries it needs.
        package: Package that declares it; set where the declaration is found.
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
    package: str = ""

    @property
    def requirement(self) -> str:
        """Its package, with the extra that brings the libraries it needs."""
        return f"{self.package}[{self.extra}]" if self.extra else self.package


def load_target(target: str, feature: Feature) -> Any:
    """Import the object that ``"module:object"`` of a feature names.

    Raises:
        MissingExtraError: Its module needs a package that is not installed.
        ConfigError: There is no such module or object.
    """
    module, _, name = target.partition(":")
    try:
        loaded = importlib.import_module(module)
    except ModuleNotFoundError as error:
        missing = error.name or "a package"
        if "." in missing and f"{module}.".startswith(f"{missing}."):
            raise _misspelt(target, feature) from error
        line = f"pip install '{feature.requirement}'" if feature.extra else f"pip install {missing}"
        raise MissingExtraError(f"{target} needs {missing!r}: {error}", f"install it with: {line}") from error
    if not hasattr(loaded, name):
        raise _misspelt(target, feature)
    return getattr(loaded, name)


def _misspelt(target: str, feature: Feature) -> ConfigError:
    return ConfigError(
        f"{target} does not exist", f"correct the declaration in {feature.package}, or update it"
    )


@dataclass(frozen=True, slots=True)
class Broken:
    """A feature that could not be loaded.

    Attributes:
        name: Its name.
        problem: The error, in one line.
        hint: How to repair or remove it.
    """

    name: str
    problem: str
    hint: str


def features() -> Mapping[str, Feature]:
    """Return the features of all installed packages by name; those that cannot be loaded are left out."""
    return _loaded()[0]


def broken_features() -> tuple[Broken, ...]:
    """Return the features that could not be loaded."""
    return _loaded()[1]


@cache
def _loaded() -> tuple[dict[str, Feature], tuple[Broken, ...]]:
    """Import every declaration; one that fails does not keep the others out."""
    found: dict[str, Feature] = {}
    broken: list[Broken] = []
    own = {name: not entry.value.startswith("tega.") for name, entry in plugins(GROUP).items()}
    for name, entry in sorted(plugins(GROUP).items(), key=lambda pair: (own[pair[0]], pair[0])):
        package = plugin_package(entry)
        try:
            feature = entry.load()
        except Exception as error:
            text = f"{type(error).__name__}: {error}"
            hint = f"correct the declaration {entry.value}, or update or remove {package}"
            if isinstance(error, ImportError):
                hint = f"pip install --force-reinstall {package}, or remove {package}"
            broken.append(Broken(name, text, hint))
            continue
        if isinstance(feature, Feature):
            found[name] = replace(feature, package=package)
        else:
            problem = f"{entry.value} is a {type(feature).__name__}, not a tega.runtime.features.Feature"
            broken.append(Broken(name, problem, f"update or remove {package}"))
    return found, tuple(broken)


def targets(member: str) -> Iterator[tuple[str, Any]]:
    """Yield name and loaded object of every feature that gives a member, such as ``"part"``.

    Raises:
        TegaError: Its module needs a package that is not installed, or there is no such object.
    """
    for name, feature in features().items():
        target = getattr(feature, member)
        if not target:
            continue
        try:
            yield name, load_target(target, feature)
        except TegaError as error:
            raise type(error)(f"feature {name!r}: {error.message}", error.hint) from error
