"""Define an OpenXR tracker's settings, connect to the runtime, and explain missing features in plain words."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Annotated, Any, Final, Literal, NamedTuple

import msgspec

from tega.errors import DeviceUnavailableError
from tega.runtime.device_items import Options

TIMES: Final = "XR_KHR_convert_timespec_time"
_HEADLESS: Final = "XR_MND_headless"
_NEEDED: Final = {"wrist": "XR_EXT_hand_tracking", "tracker": "XR_HTCX_vive_tracker_interaction"}
_MANIFEST: Final = "openxr/1/active_runtime.json"


class Made(NamedTuple):
    """An instance of the runtime; ``handle`` is for OpenXR's calls."""

    handle: Any
    name: str
    extensions: frozenset[str]

    def check(self, source: str) -> None:
        """Check that the runtime supports a source; ``DeviceUnavailableError`` if it does not."""
        if _HEADLESS not in self.extensions:
            raise DeviceUnavailableError(
                f"openxr: {self.name} has no sessions without a picture ({_HEADLESS})",
                "make another runtime the active one, such as Monado or WiVRn",
            )
        if (needed := _NEEDED.get(source, _HEADLESS)) not in self.extensions:
            raise DeviceUnavailableError(
                f"openxr: {self.name} knows no source = {source!r} ({needed})",
                'set source = "grip" and hold a controller, or take another runtime',
            )


def make_instance(xr: Any) -> Made:
    """Connect to the active runtime; ``DeviceUnavailableError`` if there is none, or it does not answer."""
    # Times are converted to CLOCK_MONOTONIC, which is Python's monotonic clock on Linux alone.
    wanted = {_HEADLESS, *_NEEDED.values(), *((TIMES,) if sys.platform == "linux" else ())}
    try:
        there = {e.extension_name.decode() for e in xr.enumerate_instance_extension_properties()}
        names = sorted(wanted & there)
        about = xr.ApplicationInfo("TEGA", 1, "TEGA", 1, xr.Version(1, 0, 0))
        info = xr.InstanceCreateInfo(application_info=about, enabled_extension_names=names)
        instance = xr.create_instance(info)
    except xr.LimitReachedError as error:
        raise DeviceUnavailableError(
            "openxr: this program uses OpenXR already, and can only once", "set one tracker of it"
        ) from error
    except xr.XrException as error:
        raise DeviceUnavailableError(f"openxr: no OpenXR runtime: {text(error)}", _where()) from error
    reported = xr.get_instance_properties(instance)
    name = f"{reported.runtime_name.decode()} {xr.Version(reported.runtime_version)}"
    return Made(instance, name, frozenset(names))


def text(error: Exception) -> str:
    """Return OpenXR's message for an error, with the name under which it can be looked up."""
    return f"{str(error).rstrip('.')} ({type(error).__name__})"


def _where() -> str:
    """Describe the places that the loader has searched, and the fix."""
    if file := os.environ.get("XR_RUNTIME_JSON"):
        there = "does not load" if Path(file).is_file() else "does not exist"
        return f"XR_RUNTIME_JSON names {file}, which {there}; is that runtime installed, and does its service run?"
    home = Path(os.environ.get("XDG_CONFIG_HOME", Path.home() / ".config"))
    for folder in (home, Path("/etc/xdg"), Path("/etc")):
        if (folder / _MANIFEST).is_file():
            return f"{folder / _MANIFEST} names the runtime; is it installed, and does its service run?"
    return (
        "install and start one, such as Monado, WiVRn or SteamVR, and make it the active one "
        f"({home / _MANIFEST}), or let XR_RUNTIME_JSON name its .json"
    )


class OpenXrOptions(Options, frozen=True, kw_only=True):
    """Settings of :class:`OpenXr`.

    Attributes:
        source: Tracked device on the forearm: the ``grip`` or the ``aim`` of a controller, the ``wrist`` of a hand
            that the headset sees, or a Vive ``tracker``.
        hand: Hand of the controller or wrist.
        role: Role of the Vive tracker, as set in the runtime.
        base: Where the origin is: where the head was (``local``), or on the floor in the middle of the room
            (``stage``).
        rate_hz: How often the runtime is asked.
        connect_s: How long to wait for the runtime to begin the session.
    """

    source: Literal["grip", "aim", "wrist", "tracker"] = "grip"
    hand: Literal["right", "left"] = "right"
    role: Literal["handheld_object", "right_elbow", "left_elbow", "right_wrist", "left_wrist"] = "right_elbow"
    base: Literal["local", "stage"] = "local"
    rate_hz: Annotated[float, msgspec.Meta(ge=10, le=500)] = 90.0
    connect_s: Annotated[float, msgspec.Meta(gt=0, le=60)] = 5.0
