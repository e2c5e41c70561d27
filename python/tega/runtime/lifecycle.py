"""Open and close a driver by a ``with`` block, and import the package that it needs."""

from __future__ import annotations

import importlib
from types import ModuleType
from typing import TYPE_CHECKING, Any, Self

from tega.errors import MissingExtraError

if TYPE_CHECKING:
    from tega.runtime.device_items import DeviceInfo


class Opened:
    """Gives a driver its ``with`` block: open on entry, close on exit."""

    def open(self) -> None:
        """Open the device."""
        raise NotImplementedError

    def close(self) -> None:
        """Close the device."""
        raise NotImplementedError

    def __enter__(self) -> Self:
        """Open the device."""
        self.open()
        return self

    def __exit__(self, *_error: object) -> None:
        """Close the device."""
        self.close()


class Elsewhere(Opened):
    """Stands in for a device that is open somewhere else, such as at another station or in a program."""

    def __init__(self, info: DeviceInfo) -> None:
        self.info = info

    def open(self) -> None:
        """Do nothing: it is open elsewhere."""

    def close(self) -> None:
        """Do nothing: it is closed elsewhere."""


def require(module: str, *, driver: str, extra: str) -> Any | ModuleType:
    """Import a package that an optional driver needs.

    Args:
        module: Name of the module to import.
        driver: Name of the driver that needs it, for the message.
        extra: The optional dependency that brings it.

    Returns:
        The module.

    Raises:
        MissingExtraError: The package is not installed, or does not load on this machine.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise MissingExtraError(
            f"{driver!r} needs the package {module!r}, which cannot be imported ({error})",
            f"install it with: pip install 'tega[{extra}]'" if extra else f"install {module}",
        ) from error
