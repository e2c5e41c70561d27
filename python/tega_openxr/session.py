"""Connect to an OpenXR runtime, run a session without a picture, and locate something in it.

:mod:`tega_openxr.tracker` does so in a thread. What a runtime lacks is reported in plain words.
"""

from __future__ import annotations

import ctypes
import os
import sys
import time
from collections.abc import Collection
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any, Final, Literal, NamedTuple

import msgspec

from tega.errors import DeviceUnavailableError
from tega.runtime.device_items import Options

_TIMES: Final = "XR_KHR_convert_timespec_time"
_HEADLESS: Final = "XR_MND_headless"
_NEEDED: Final = {"wrist": "XR_EXT_hand_tracking", "tracker": "XR_HTCX_vive_tracker_interaction"}
_MANIFEST: Final = "openxr/1/active_runtime.json"


def _make_instance(xr: Any) -> tuple[Any, str, list[str]]:
    """Connect to the active runtime, and return its handle, its name and what it can do beyond the standard.

    ``DeviceUnavailableError``: there is none, or it does not answer.
    """
    # Times are converted to CLOCK_MONOTONIC, which is Python's monotonic clock on Linux alone.
    wanted = {_HEADLESS, *_NEEDED.values(), *((_TIMES,) if sys.platform == "linux" else ())}
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
        raise DeviceUnavailableError(f"openxr: no OpenXR runtime: {_text(error)}", _where()) from error
    reported = xr.get_instance_properties(instance)
    name = f"{reported.runtime_name.decode()} {xr.Version(reported.runtime_version)}"
    return instance, name, names


def _text(error: Exception) -> str:
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


_VIVE_PROFILE: Final = "/interaction_profiles/htc/vive_tracker_htcx"
# The first has to be known to every runtime; the others save those that have the device from guessing.
_PROFILES: Final = (
    "/interaction_profiles/khr/simple_controller",
    "/interaction_profiles/oculus/touch_controller",
    "/interaction_profiles/valve/index_controller",
    "/interaction_profiles/htc/vive_controller",
    "/interaction_profiles/microsoft/motion_controller",
)
_JOINTS, _WRIST = 26, 1
_VALID, _TRACKED = 1 | 2, 4 | 8
_FAREWELL_POLLS, _FAREWELL_S = 50, 0.01
_CHANGE_S: Final = 1.0


class Located(NamedTuple):
    """Place (x, y, z) and turn; ``valid``: both are known, ``tracked``: both are measured, not guessed."""

    position_m: tuple[float, float, float]
    quaternion_xyzw: tuple[float, float, float, float]
    valid: bool
    tracked: bool


class XrSession:
    """One connection to the runtime, used by one thread.

    ``DeviceUnavailableError``: there is no runtime, or it lacks a required feature.

    Attributes:
        runtime: Name and version of the runtime.
        state: State of the session, in OpenXR's terms and lower case.
        device: Held or worn device, as the runtime names it; ``""`` if there is none.
        converts_times: Whether the runtime can convert its times to the machine's clock.
        restart_from_ns: From when on the origin is another one, on the monotonic clock; 0 for never.
    """

    def __init__(self, xr: Any, options: OpenXrOptions) -> None:
        self._xr, self._options = xr, options
        self._session: Any = None
        self._set: Any = None
        self._space: Any = None
        self._joints: Any = None
        self._ahead_ns: int | None = None
        self.is_begun = False
        self.state = "unknown"
        self.device = ""
        self.restart_from_ns = 0
        self._instance, self.runtime, extensions = _make_instance(xr)
        self.converts_times = _TIMES in extensions
        try:
            self._check_extensions(extensions)
            self._make_session()
        except xr.XrException as error:
            self.close()
            raise DeviceUnavailableError(
                f"openxr: {self.runtime} refuses: {_text(error)}", "what does its own log say?"
            ) from error
        except BaseException:
            self.close()
            raise

    def _check_extensions(self, extensions: Collection[str]) -> None:
        source = self._options.source
        if _HEADLESS not in extensions:
            raise DeviceUnavailableError(
                f"openxr: {self.runtime} has no sessions without a picture ({_HEADLESS})",
                "make another runtime the active one, such as Monado or WiVRn",
            )
        if (needed := _NEEDED.get(source, _HEADLESS)) not in extensions:
            raise DeviceUnavailableError(
                f"openxr: {self.runtime} knows no source = {source!r} ({needed})",
                'set source = "grip" and hold a controller, or take another runtime',
            )

    @property
    def _user(self) -> str:
        o = self._options
        return f"/user/vive_tracker_htcx/role/{o.role}" if o.source == "tracker" else f"/user/hand/{o.hand}"

    def _make_session(self) -> None:
        xr, o = self._xr, self._options
        try:
            head = xr.SystemGetInfo(xr.FormFactor.HEAD_MOUNTED_DISPLAY)
            system = xr.get_system(self._instance, head)
        except xr.FormFactorUnavailableError as error:
            raise DeviceUnavailableError(
                f"openxr: {self.runtime} sees no headset", "switch it on and connect it"
            ) from error
        if o.source != "wrist":
            self._make_action()
        self._session = xr.create_session(self._instance, xr.SessionCreateInfo(system_id=system))
        kind = xr.ReferenceSpaceType.LOCAL if o.base == "local" else xr.ReferenceSpaceType.STAGE
        spaces = {int(space) for space in xr.enumerate_reference_spaces(self._session)}
        if kind.value not in spaces:
            raise DeviceUnavailableError(
                f"openxr: {self.runtime} has no base = {o.base!r} now",
                'set up the room in the runtime, or set base = "local"',
            )
        still = xr.Posef(xr.Quaternionf(0, 0, 0, 1), xr.Vector3f(0, 0, 0))
        self._base = xr.create_reference_space(self._session, xr.ReferenceSpaceCreateInfo(kind, still))
        if o.source == "wrist":
            hand = xr.HandEXT.LEFT if o.hand == "left" else xr.HandEXT.RIGHT
            self._space = xr.create_hand_tracker_ext(self._session, xr.HandTrackerCreateInfoEXT(hand))
            self._joints = xr.HandJointLocationsEXT(joint_locations=(xr.HandJointLocationEXT * _JOINTS)())
            # pyopenxr's own call leaves no room for the joints.
            address = xr.get_instance_proc_addr(self._instance, "xrLocateHandJointsEXT")
            self._locate_joints = ctypes.cast(address, xr.PFN_xrLocateHandJointsEXT)
            return
        xr.attach_session_action_sets(self._session, xr.SessionActionSetsAttachInfo(action_sets=[self._set]))
        space = xr.ActionSpaceCreateInfo(self._action, self._path(self._user), still)
        self._space = xr.create_action_space(self._session, space)
        self._sync = xr.ActionsSyncInfo(active_action_sets=[xr.ActiveActionSet(self._set, 0)])

    def _make_action(self) -> None:
        """Suggest to the runtime the wanted pose, by the paths of the devices that could have it."""
        xr, o = self._xr, self._options
        info = xr.ActionSetCreateInfo("tega", "TEGA", 0)
        self._set = xr.create_action_set(self._instance, info)
        users = (ctypes.c_uint64 * 1)(self._path(self._user).value)
        action = xr.ActionCreateInfo("forearm", xr.ActionType.POSE_INPUT, 1, users, "the forearm")
        self._action = xr.create_action(self._set, action)
        source = "grip" if o.source == "tracker" else o.source
        binding = xr.ActionSuggestedBinding(self._action, self._path(f"{self._user}/input/{source}/pose"))
        for profile in (_VIVE_PROFILE,) if o.source == "tracker" else _PROFILES:
            suggested = xr.InteractionProfileSuggestedBinding(
                self._path(profile), suggested_bindings=[binding]
            )
            try:
                xr.suggest_interaction_profile_bindings(self._instance, suggested)
            except xr.PathUnsupportedError:
                if profile == _PROFILES[0] or o.source == "tracker":
                    raise

    def _path(self, path: str) -> Any:
        return self._xr.string_to_path(self._instance, path)

    def poll(self) -> None:
        """Process the runtime's events; ``DeviceUnavailableError`` once the session is over."""
        xr = self._xr
        try:
            while True:
                event = xr.poll_event(self._instance)
                self._reported(event)
        except xr.EventUnavailable:
            return
        except xr.XrException as error:
            raise DeviceUnavailableError(f"openxr: {self.runtime} is gone: {_text(error)}") from error

    def _reported(self, event: Any) -> None:
        xr, kind = self._xr, _as(event, ctypes.c_int32).value  # one that has no name here is passed over
        if kind == xr.StructureType.EVENT_DATA_SESSION_STATE_CHANGED:
            changed = _as(event, xr.EventDataSessionStateChanged)
            if int(changed.time) > 0:
                # The sample that was shortest on its way gives the clocks' difference best.
                ahead_ns = int(changed.time) - time.monotonic_ns()
                self._ahead_ns = ahead_ns if self._ahead_ns is None else max(self._ahead_ns, ahead_ns)
            self._enter(xr.SessionState(changed.state).name.lower())
        elif kind == xr.StructureType.EVENT_DATA_INSTANCE_LOSS_PENDING:
            raise DeviceUnavailableError(f"openxr: {self.runtime} says that it ends")
        elif kind == xr.StructureType.EVENT_DATA_REFERENCE_SPACE_CHANGE_PENDING:
            changed, now_ns = _as(event, xr.EventDataReferenceSpaceChangePending), time.monotonic_ns()
            ahead_s = (int(changed.change_time) - self._time(now_ns)) / 1e9
            self.restart_from_ns = now_ns + round(min(max(ahead_s, 0.0), _CHANGE_S) * 1e9)
        elif kind == xr.StructureType.EVENT_DATA_INTERACTION_PROFILE_CHANGED:
            self._check()

    def _enter(self, state: str) -> None:
        xr, self.state = self._xr, state
        if state == "ready":
            mono = xr.ViewConfigurationType.PRIMARY_STEREO  # has no meaning without a picture
            xr.begin_session(self._session, xr.SessionBeginInfo(mono))
            self.is_begun = True
        elif state == "stopping":
            xr.end_session(self._session)
            self.is_begun = False
        elif state == "focused":
            self._check()
        elif state in {"loss_pending", "exiting"}:
            why = "is gone" if state == "loss_pending" else "has ended the session"
            raise DeviceUnavailableError(f"openxr: {self.runtime} {why}")

    def _check(self) -> None:
        if self._options.source == "wrist":
            return
        path = self._xr.get_current_interaction_profile(self._session, self._path(self._user))
        named = path.interaction_profile
        self.device = self._xr.path_to_string(self._instance, named).split("/", 2)[2] if named else ""

    def _time(self, now_ns: int) -> int:
        """Return a time of the monotonic clock in the runtime's."""
        if not self.converts_times:
            if self._ahead_ns is None:
                raise DeviceUnavailableError(f"openxr: {self.runtime} reports no times")
            return now_ns + self._ahead_ns
        xr = self._xr
        then = xr.timespec(now_ns // 10**9, now_ns % 10**9)
        return int(xr.convert_timespec_time_to_time_khr(self._instance, then).value)

    def locate(self, now_ns: int) -> Located | None:
        """Return place and turn at a time; ``None`` while the runtime does not let this program see them."""
        xr = self._xr
        if self.state != "focused":
            return None
        try:
            if self._joints is not None:
                found = self._wrist(self._time(now_ns))
            else:
                xr.sync_actions(self._session, self._sync)
                found = xr.locate_space(self._space, self._base, self._time(now_ns))
        except xr.SessionNotFocused:
            return None
        except xr.XrException as error:
            raise DeviceUnavailableError(f"openxr: {self.runtime} is gone: {_text(error)}") from error
        flags, p, q = int(found.location_flags), found.pose.position, found.pose.orientation
        return Located(
            (p.x, p.y, p.z), (q.x, q.y, q.z, q.w), flags & _VALID == _VALID, flags & _TRACKED == _TRACKED
        )

    def _wrist(self, time_xr: int) -> Any:
        """Locate the wrist only: positions of the fingers are not read."""
        xr = self._xr
        where = xr.HandJointsLocateInfoEXT(base_space=self._base, time=time_xr)
        result = self._locate_joints(self._space, where, ctypes.byref(self._joints))
        error = xr.check_result(xr.Result(result))
        if error.is_exception():
            raise error
        if not self._joints.is_active:
            return xr.HandJointLocationEXT()
        return self._joints.joint_locations[_WRIST]

    def close(self) -> None:
        """Leave as the runtime wants it, as far as it still takes part."""
        xr = self._xr
        if self._instance is None:
            return
        with suppress(Exception):
            if self.is_begun:
                xr.request_exit_session(self._session)
            for _ in range(_FAREWELL_POLLS):
                if not self.is_begun:
                    break
                self.poll()
                time.sleep(_FAREWELL_S)
        with suppress(xr.XrException):
            if self._session is not None:
                xr.destroy_session(self._session)
        with suppress(xr.XrException):
            xr.destroy_instance(self._instance)
        self._session = self._instance = None


def _as(event: Any, kind: Any) -> Any:
    return ctypes.cast(ctypes.byref(event), ctypes.POINTER(kind)).contents
