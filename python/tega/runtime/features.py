"""Find what installed packages add to TEGA: drivers, stages and layouts by entry points, and features.

A feature is one declaration; every target is ``"module:object"`` and is imported when it is first needed. One with a
mistake is left out, and named with the next step; the rest works.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from importlib.metadata import Distribution, EntryPoint, entry_points
from typing import Any

from tega.errors import ConfigError, DeviceUnavailableError, FeatureError, MissingExtraError, TegaError
from tega.runtime.declaration import Feature, Verb, clash, mistake
from tega.runtime.words import nearest_hint

__all__ = ["Broken", "Feature", "Verb", "broken_features", "features", "load_target"]

GROUP = "tega.features"


def plugins(group: str) -> Mapping[str, EntryPoint]:
    """Return the entry points of a group by name; imports none of them. Of two with one name, TEGA's own counts."""
    return {entry.name: entry for entry in reversed(every_plugin(group))}


def every_plugin(group: str) -> tuple[EntryPoint, ...]:
    """Return the entry points of a group, TEGA's own first, of these the core's, then by name; imports none of them."""
    return _plugins(group, tuple(sys.path))


@cache
def _plugins(group: str, _path: tuple[str, ...]) -> tuple[EntryPoint, ...]:
    # Reading the metadata of every installed package takes 10 ms and more.
    def order(entry: EntryPoint) -> tuple[bool, bool, str, str]:
        package = plugin_package(entry)
        return package != "tega", not entry.value.startswith("tega."), entry.name, package

    return tuple(sorted(entry_points(group=group), key=order))


def find_plugin(group: str, subject: str, name: str) -> EntryPoint:
    """Return the entry point of a name in a group; ``subject`` is the messages' term for a member, such as driver."""
    entries = plugins(group)
    entry = entries.get(name)
    if entry is None:
        raise ConfigError(
            f"no {subject} is called {name!r}", nearest_hint(name, sorted(entries), f"installed {subject}s:")
        )
    return entry


def load_plugin(entry: EntryPoint, subject: str) -> Any:
    """Import what an entry point names; ``DeviceUnavailableError`` where the module lacks it.

    ``MissingExtraError`` where the module needs a package that is not installed.
    """
    try:
        return entry.load()
    except ImportError as error:
        missing = error.name or "a package"
        hint = f"install the extra of {plugin_package(entry)!r} that brings {missing!r}"
        if plugin_package(entry) == "tega":
            hint = "install it with: pip install 'tega[lab]'"
        raise MissingExtraError(f"{subject} {entry.name!r} needs {missing!r}: {error}", hint) from error
    except AttributeError as error:
        raise DeviceUnavailableError(
            f"{subject} {entry.name!r} is registered as {entry.value!r}, which does not exist",
            f"reinstall {plugin_package(entry)!r}",
        ) from error


def plugin_package(entry: EntryPoint) -> str:
    """Return the distribution that brings an entry point."""
    return _name(entry.dist) if entry.dist is not None else "an unknown package"


@cache
def _name(package: Distribution) -> str:
    """Read a package's name out of its metadata, which takes a millisecond: once for each package."""
    return package.name


def load_target(target: str, feature: Feature, kind: Any = Callable, words: str = "function or class") -> Any:
    """Import the object that ``"module:object"`` of a feature names, and check that it is of a kind.

    Raises:
        MissingExtraError: Its module needs a package that is not installed.
        ConfigError: There is no such module or object, or it is of another kind.
        FeatureError: Its module cannot be imported.
    """
    module, _, name = target.partition(":")
    said, correct = f"feature {feature.name!r}: {target}", f"correct {feature.package}, or update it"
    try:
        loaded = getattr(importlib.import_module(module), name, None)
    except ModuleNotFoundError as error:
        missing = error.name or "a package"
        if "." in missing and f"{module}.".startswith(f"{missing}."):
            raise ConfigError(f"{said} does not exist", correct) from error
        line = f"pip install '{feature.requirement}'" if feature.extra else f"pip install {missing}"
        raise MissingExtraError(f"{said} needs {missing!r}: {error}", f"install it with: {line}") from error
    except (Exception, SystemExit) as error:
        raise FeatureError(f"{said}: {type(error).__name__}: {error}", _way_out(feature)) from error
    if loaded is None:
        raise ConfigError(f"{said} does not exist", correct)
    if not isinstance(loaded, kind):
        raise ConfigError(f"{said} is {loaded!r}, not a {words}", correct)
    return loaded


def call_feature(
    feature: Feature, what: str, function: Callable[..., Any], /, *arguments: Any, kind: Any = object
) -> Any:
    """Call a function of a feature, ``what`` of it, and return its result.

    Raises:
        TegaError: As the function raised it.
        FeatureError: It raised another error, or its result is not of the kind.
    """
    try:
        result = function(*arguments)
    except TegaError:
        raise
    except (Exception, SystemExit) as error:
        problem = f"{type(error).__name__}: {error}"
        raise FeatureError(f"feature {feature.name!r}: {what}: {problem}", _way_out(feature)) from error
    if not isinstance(result, kind):
        names = " or ".join(one.__name__ for one in (kind if isinstance(kind, tuple) else (kind,)))
        problem = f"feature {feature.name!r}: {what} returned {result!r}, not {names}"
        raise FeatureError(problem, _way_out(feature))
    return result


def call_member(feature: Feature, member: str, *arguments: Any, kind: Any = object) -> Any:
    """Import and call a member of a feature, such as ``"part"``; errors are those of both steps."""
    target = getattr(feature, member)
    return call_feature(feature, f"{member} {target}", load_target(target, feature), *arguments, kind=kind)


def _way_out(feature: Feature) -> str:
    if feature.own:
        return "run again with --debug and report it"
    tables = "".join(f"leave out [{key}], or " for key in feature.settings)
    return f"to go on without it, {tables}pip uninstall {feature.package}; --debug shows where"


@dataclass(frozen=True, slots=True)
class Broken:
    """A feature that is left out, with the error, how to repair or remove it, and the known keys of its tables."""

    name: str
    problem: str
    hint: str
    settings: tuple[str, ...] = ()

    @property
    def said(self) -> str:
        """Sentence that it is installed, with the error."""
        return f"which is installed but could not be loaded: {self.problem}"


def features() -> dict[str, Feature]:
    """Return the features of all installed packages by name; those that are left out are not among them."""
    return dict(_loaded()[0])


def having(member: str) -> list[Feature]:
    """Return the features that give a member, such as ``"part"``."""
    return [feature for feature in features().values() if getattr(feature, member)]


def named(member: str) -> dict[str, tuple[Feature, Any]]:
    """Return the feature and the value of every name in a member of names, such as ``"formats"``."""
    return {name: (one, value) for one in having(member) for name, value in getattr(one, member).items()}


def broken_features() -> tuple[Broken, ...]:
    """Return the features that are left out."""
    return tuple(_loaded()[1])


def leave_out(feature: Feature, error: TegaError) -> None:
    """Leave out a feature from now on, and warn of it."""
    _loaded()[0].pop(feature.name, None)
    problem = error.message.removeprefix(f"feature {feature.name!r}: ")
    _warn_of(Broken(feature.name, problem, error.hint, tuple(feature.settings)), _loaded()[1])


def author_of(module: str) -> Feature | None:
    """Return the feature of another package to which a module belongs; ``None`` for none."""
    top = module.partition(".")[0]
    return next((one for one in features().values() if one.module == top and not one.own), None)


_WARNINGS: dict[str, str] = {}
_SHOW: list[Callable[[str, str], None]] = []


def warn(message: str, hint: str) -> None:
    """Warn of a feature, once for each message."""
    if message not in _WARNINGS:
        _WARNINGS[message] = hint
        for show in _SHOW:
            show(message, hint)


def show_warnings(show: Callable[[str, str], None]) -> None:
    """Have ``show(message, hint)`` called with every warning of a feature: those so far, and later ones."""
    _loaded()
    _SHOW[:] = [show]
    for message, hint in _WARNINGS.items():
        show(message, hint)


def _warn_of(feature: Broken, broken: list[Broken]) -> None:
    broken.append(feature)
    warn(f"feature {feature.name!r} is left out: {feature.problem}", feature.hint)


@cache
def _loaded() -> tuple[dict[str, Feature], list[Broken]]:
    """Import every declaration, TEGA's own first; one that fails does not keep the others out."""
    found: dict[str, Feature] = {}
    broken: list[Broken] = []
    for entry in every_plugin(GROUP):
        try:
            found[entry.name] = _declared(entry, found)
        except ConfigError as error:
            _warn_of(Broken(entry.name, error.message, error.hint), broken)
    return found, broken


def _declared(entry: EntryPoint, found: dict[str, Feature]) -> Feature:
    """Import a declaration and check it against those that were found; ``ConfigError`` with the next step."""
    package, module = plugin_package(entry), entry.module.partition(".")[0]
    correct = f"correct the declaration {entry.value}, or update or remove {package}"
    try:
        feature = entry.load()
    except (Exception, SystemExit) as error:
        if isinstance(error, ImportError):
            missing = (error.name or module).partition(".")[0]
            lacks = isinstance(error, ModuleNotFoundError) and missing != module
            what = missing if lacks else f"--force-reinstall {package}"
            correct = f"pip install {what}, or remove {package}"
        raise ConfigError(f"{type(error).__name__}: {error}", correct) from error
    if not isinstance(feature, Feature):
        problem = f"{entry.value} is a {type(feature).__name__}, not a tega.runtime.features.Feature"
        raise ConfigError(problem, correct)
    feature = replace(feature, name=entry.name, package=package, module=module)
    if problem := mistake(feature) or clash(feature, found):
        raise ConfigError(problem, correct)
    return feature
