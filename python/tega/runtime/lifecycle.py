"""Open and close a driver by a ``with`` block, and import optional packages, with a pip line where one is missing."""

from __future__ import annotations

import importlib
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import ModuleType
from typing import TYPE_CHECKING, Any, ClassVar, Final, Self

from tega.errors import DeviceUnavailableError, MissingExtraError, MissingToolError

if TYPE_CHECKING:
    from tega.runtime.device_items import DeviceInfo

# What is installed for each package that a checkout brings; what it needs itself stands before it.
_FOLDERS: Final = {
    "tega_emulators": ("emulators",),
    "tega_campaigns": ("emulators", "campaigns"),
    "tega_figures": ("emulators", "figures"),
}


class Opened:
    """Gives a driver its ``with`` block: open on entry, close on exit; and it needs no package, unless it says so."""

    extra: ClassVar[str] = ""
    requires: ClassVar[tuple[str, ...]] = ()

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
    """Return a module that a driver needs and an extra brings; ``MissingExtraError`` where it does not load."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise MissingExtraError(
            f"{driver!r} needs the package {module!r}, which cannot be imported ({error})",
            f"install it with: pip install 'tega[{extra}]'" if extra else f"install {module}",
        ) from error


@contextmanager
def needs_tools(subject: str) -> Iterator[None]:
    """Raise ``MissingToolError`` where an import of ``tools/`` fails; its hint is a checkout's pip line."""
    try:
        yield
    except ModuleNotFoundError as error:
        package = (error.name or "").partition(".")[0]
        if package not in _FOLDERS:
            raise
        places = " ".join(f"'./tools/{folder}'" for folder in _FOLDERS[package])
        raise MissingToolError(
            f"{subject} needs the package {package!r}, which is not part of the wheel",
            f"install it from a checkout of TEGA: pip install {places}",
        ) from error


def scipy_stats() -> Any:
    """Return ``scipy.stats``, or raise ``MissingExtraError``."""
    return require("scipy.stats", driver="statistics", extra="study")


def statsmodels(name: str) -> Any:
    """Return a module of statsmodels, or raise ``MissingExtraError``."""
    return require(f"statsmodels.{name}", driver="statistics", extra="study")


def load_sounddevice() -> Any:
    """Import sounddevice; ``DeviceUnavailableError`` where PortAudio, which it needs, is not installed."""
    try:
        return require("sounddevice", driver="sound", extra="sound")
    except OSError as error:
        raise DeviceUnavailableError(
            f"the package 'sounddevice' does not find PortAudio: {error}",
            "sudo apt install libportaudio2; elsewhere it comes with the package",
        ) from error


def end_sound(stream: Any, silent: Callable[[], bool], within_s: float) -> None:
    """Close a stream of sounddevice after its fade-out, whose last sample is made once ``silent()`` is true."""
    until_s = time.monotonic() + within_s
    while stream.active and not silent() and time.monotonic() < until_s:
        time.sleep(0.005)
    # The fade-out still waits in the sound card, which drops it on closing: the sound would end in a click.
    if stream.active:
        time.sleep(min(stream.latency, within_s))
    stream.abort()
    stream.close()
