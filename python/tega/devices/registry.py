"""Find drivers by name, through the entry points of the group ``tega.devices``.

Built-in drivers use the same door as anybody's: a package that declares ::

    [project.entry-points."tega.devices"]
    my-vest = "my_package.vest:MyVest"

is found by that name as soon as it is installed. Listing names imports nothing; a driver's module is imported
when the driver is asked for.
"""

from __future__ import annotations

import importlib.util
from importlib.metadata import EntryPoint
from typing import Any, Literal, overload

import msgspec

from tega.devices.base import (
    ArmDriver,
    Device,
    EmgSource,
    HandDriver,
    InputSource,
    Kind,
    SteeredHand,
    TactileSource,
    Tracker,
    VestSink,
)
from tega.errors import ConfigError, DeviceUnavailableError
from tega.runtime.features import find_plugin, load_plugin, plugin_package, plugins

GROUP = "tega.devices"


class DriverRecord(msgspec.Struct, frozen=True, kw_only=True):
    """One line of ``tega-teleop devices``.

    Attributes:
        name: Name to use in a settings file.
        kind: tactile, emg, vest, hand, input, tracker or arm; ``""`` when the driver's module does not load.
        summary: Description in one line.
        package: The distribution that brings it.
        ready: Whether the packages it needs are installed (nothing is opened to find out).
        problem: Reason why it is not ready.
    """

    name: str
    kind: str
    summary: str
    package: str
    ready: bool
    problem: str = ""


def driver_names() -> list[str]:
    """Return the names of all installed drivers, sorted; imports none of them."""
    return sorted(plugins(GROUP))


@overload
def driver_class(name: str, kind: Literal["tactile"]) -> type[TactileSource]: ...
@overload
def driver_class(name: str, kind: Literal["emg"]) -> type[EmgSource]: ...
@overload
def driver_class(name: str, kind: Literal["vest"]) -> type[VestSink]: ...
@overload
def driver_class(name: str, kind: Literal["hand"]) -> type[HandDriver | SteeredHand]: ...
@overload
def driver_class(name: str, kind: Literal["input"]) -> type[InputSource]: ...
@overload
def driver_class(name: str, kind: Literal["tracker"]) -> type[Tracker]: ...
@overload
def driver_class(name: str, kind: Literal["arm"]) -> type[ArmDriver]: ...
@overload
def driver_class(name: str, kind: Kind | None = None) -> type[Device]: ...
def driver_class(name: str, kind: Kind | None = None) -> type[Device]:
    """Return the driver registered under a name.

    Args:
        name: Its name, such as ``"images"``.
        kind: The kind it has to be; ``None`` for any.

    Returns:
        The driver's class.

    Raises:
        ConfigError: No driver has that name, or it is of another kind.
        MissingExtraError: Its module needs a package that is not installed.
        DeviceUnavailableError: Its module does not hold what its entry point says.
    """
    driver = _load(find_plugin(GROUP, "driver", name))
    if kind is not None and driver.kind != kind:
        fitting = sorted(r.name for r in list_drivers() if r.kind == kind)
        raise ConfigError(
            f"driver {name!r} is of kind {driver.kind!r}, not {kind!r}",
            f"drivers of kind {kind!r}: {', '.join(fitting) or 'none installed'}",
        )
    return driver


def _load(entry: EntryPoint) -> type[Device]:
    loaded: Any = load_plugin(entry, "driver")
    members = ("kind", "options_type", "open", "close")
    if not isinstance(loaded, type) or not all(hasattr(loaded, a) for a in members):
        raise DeviceUnavailableError(
            f"driver {entry.name!r} is registered as {entry.value!r}, which is not a driver class",
            "see tega.devices.base for the protocols",
        )
    return loaded


def list_drivers() -> list[DriverRecord]:
    """Describe every installed driver; opens none of them.

    Returns:
        One record per driver, sorted by kind and name; a driver with a module that does not load is listed as not
        ready.
    """
    records = []
    for name, entry in plugins(GROUP).items():
        kind = summary = problem = ""
        try:
            driver = _load(entry)
        except DeviceUnavailableError as error:
            problem = str(error)
        else:
            kind, summary = driver.kind, driver.summary
            if missing := [m for m in driver.requires if importlib.util.find_spec(m) is None]:
                problem = f"needs {', '.join(missing)}: pip install 'tega[{driver.extra}]'"
        records.append(
            DriverRecord(
                name=name,
                kind=kind,
                summary=summary,
                package=plugin_package(entry),
                ready=not problem,
                problem=problem,
            )
        )
    return sorted(records, key=lambda r: (r.kind, r.name))
