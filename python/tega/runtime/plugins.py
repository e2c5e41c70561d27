"""Find and load drivers and stages that packages register under the entry-point groups of TEGA."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from functools import cache
from importlib.metadata import Distribution, EntryPoint, entry_points
from typing import Any

from tega.errors import ConfigError, DeviceUnavailableError, MissingExtraError
from tega.runtime.words import nearest_hint


def plugins(group: str) -> Mapping[str, EntryPoint]:
    """Return the entry points of a group by name; imports none of them. Of two with one name, TEGA's own counts."""
    return {entry.name: entry for entry in reversed(every_plugin(group))}


def every_plugin(group: str) -> tuple[EntryPoint, ...]:
    """Return the entry points of a group, TEGA's own first, of these the core's, then by name; imports none of them."""
    return _plugins(group, tuple(sys.path))


@cache
def _plugins(group: str, _path: tuple[str, ...]) -> tuple[EntryPoint, ...]:
    """Read the metadata of every installed package, which takes 10 ms and more: once for each search path."""

    def order(entry: EntryPoint) -> tuple[bool, bool, str, str]:
        package = plugin_package(entry)
        return package != "tega", not entry.value.startswith("tega."), entry.name, package

    return tuple(sorted(entry_points(group=group), key=order))


def find_plugin(group: str, subject: str, name: str) -> EntryPoint:
    """Return the entry point of a name in a group, such as ``"tega.devices"``; the nearest name is the hint.

    ``subject`` is the messages' term for a member: driver, metric, decoder, mapping or layout.
    """
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
