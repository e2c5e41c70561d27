"""Track the forearm by whatever an OpenXR runtime tracks: a controller, a Vive tracker or a wrist."""

from __future__ import annotations

import os
import queue
import threading
import time
from collections.abc import Mapping
from typing import Any, ClassVar, Final

from tega.arm.pose import StampedPose
from tega.devices.base import DeviceInfo, Options
from tega.devices.tracker.tracker_thread import RESTART_NS, SILENT_S, ThreadedTracker
from tega.errors import DeviceUnavailableError
from tega.runtime.evidence import Evidence
from tega.runtime.lifecycle import require
from tega.runtime.reopening import Reopening
from tega_openxr.session import Located, OpenXrOptions, XrSession

_STATES: Final = {
    "unknown": "the runtime has not begun the session",
    "idle": "the runtime keeps the session idle: is the headset on, and awake?",
    "ready": "the runtime has begun the session and not brought it into focus; one that never does is too old, such as"
    " Monado from before December 2023",
    "stopping": "the runtime ends the session",
}
_Outcome = queue.SimpleQueue[DeviceUnavailableError | None]
_OUT_OF_FOCUS: Final = "another OpenXR program, or the runtime's menu, has the focus"


class OpenXr(ThreadedTracker):
    """Asks the active OpenXR runtime for poses, in a session without a picture and a thread of its own.

    Poses are in OpenXR's axes (``openxr``: y up, -z forward) and for the time of the request, which is their
    stamp. A pose is valid only if the runtime reports position and orientation both valid *and* tracked. One
    identical to the last bit was not measured again, and is skipped; a session without focus gives none.
    """

    driver: ClassVar[str] = "openxr"
    leave_s: ClassVar[float] = 2.0
    summary: ClassVar[str] = "OpenXR runtime (Monado, WiVRn, SteamVR): controller, Vive tracker or wrist"
    extra: ClassVar[str] = "openxr"
    requires: ClassVar[tuple[str, ...]] = ("xr",)
    options_type: ClassVar[type[Options]] = OpenXrOptions
    compared: ClassVar[Mapping[Evidence, str]] = {
        "banner": "the runtime has the controller, tracker or hand that is set",
        "stamp": "the runtime converts its times to this machine's clock",
        "values": "a pose is valid and tracked; one that repeats to the last bit is not used",
    }

    def __init__(self, options: OpenXrOptions) -> None:
        self._options = o = options
        subject = {"grip": "controller", "aim": "controller's aim", "wrist": "wrist"}
        super().__init__(
            f"tracker {o.role}" if o.source == "tracker" else f"{o.hand} {subject[o.source]}", o.rate_hz
        )
        self._session: XrSession | None = None
        self._runtime, self._device, self._converts_times = "", "", True
        self._received_ns, self._restart_until_ns = 0, 0
        self._last: Located | None = None
        self._lost = ""

    @property
    def info(self) -> DeviceInfo:
        """Description of the tracker."""
        c, notes = self.counts, []
        if self._device:
            notes.append(f"the runtime calls it {self._device}")
        if not self._converts_times:
            notes.append(
                "the runtime does not convert its clock to this machine's: poses may be some ms older than reported"
            )
        if c.connections > 1:
            notes.append(f"the session was restarted {c.connections - 1} times; last reason: {self._lost}")
        return self._describe(f"{self._subject} through {self._runtime or 'OpenXR'}", notes)

    @property
    def problem(self) -> str:
        """Trouble with the tracker now, for the operator; ``""`` for none."""
        with self._lock:
            if self._trouble:
                return f"openxr: {self._trouble}"
            away_s, device = (time.monotonic_ns() - self._received_ns) / 1e9, self._device
        if self._thread and away_s > SILENT_S:
            return f"openxr: {self._runtime} has not answered for {away_s:.1f} s"
        if self._thread and not device and self._options.source != "wrist":
            return f"openxr: the runtime has no {self._subject}: is it switched on?"
        return ""

    def open(self) -> None:
        """Connect to the runtime, and wait until it begins the session."""
        if self._thread is not None:
            return
        # The loader writes on standard error each request that fails; the errors here say the same in words.
        os.environ.setdefault("XR_LOADER_DEBUG", "none")
        xr = require("xr", driver="openxr", extra=self.extra)
        self._forget()
        self._restart_until_ns, self._last = 0, None
        # Of their own for each thread: one that a runtime never lets go finds that it has to leave.
        self._leaving, outcome = threading.Event(), _Outcome()
        thread = threading.Thread(
            target=self._track, args=(xr, self._leaving, outcome), name="tega-openxr", daemon=True
        )
        thread.start()
        refused: DeviceUnavailableError | None
        try:
            refused = outcome.get(timeout=self._options.connect_s)
        except queue.Empty:
            why = self._trouble or "the runtime does not answer"
            refused = DeviceUnavailableError(
                f"openxr: no session after {self._options.connect_s:g} s: {why}",
                "wake the headset, and see whether the runtime's own window shows it; connect_s may be longer",
            )
        self._thread = thread
        if refused is not None:
            self.close()
            raise refused

    def _track(self, xr: Any, leaving: threading.Event, outcome: _Outcome) -> None:
        """Poll until asked to stop; begin a new session if the session is lost."""
        again = Reopening(*self.back_off_s)
        while not leaving.is_set():
            n_begun = self.counts.connections
            session: XrSession | None = None
            try:
                session = XrSession(xr, self._options)
                self._follow(session, leaving, outcome)
            except Exception as raised:  # a runtime may answer what its library here does not know
                unexpected = DeviceUnavailableError(f"openxr: unexpected {type(raised).__name__}: {raised}")
                error = raised if isinstance(raised, DeviceUnavailableError) else unexpected
                if not self.counts.connections:
                    outcome.put(error)
                    return
                why = error.message.removeprefix("openxr: ")
                if self.counts.connections > n_begun:
                    self._lost = why
                    again.works()
                self._say(f"{why}, connecting again")
            finally:
                if session is not None:
                    session.close()
            again.wait(leaving.wait)

    def _follow(self, session: XrSession, leaving: threading.Event, outcome: _Outcome) -> None:
        """Poll at the set rate until asked to stop or the session ends."""
        state, next_s, is_counted = "", time.monotonic(), False
        self._runtime, self._converts_times = session.runtime, session.converts_times
        while not leaving.wait(max(next_s - time.monotonic(), 0.0)):
            next_s = max(next_s + 1 / self._options.rate_hz, time.monotonic())
            session.poll()
            if session.state != state:
                state = session.state
                self._enter(state)
            self._received_ns, self._device = time.monotonic_ns(), session.device
            if session.is_begun and not is_counted:
                is_counted = True
                self.counts.connections += 1
                outcome.put(None)
            now_ns = time.monotonic_ns()
            self._take(session, session.locate(now_ns), now_ns)

    def _enter(self, state: str) -> None:
        with self._lock:
            self._trouble = "" if state == "focused" else _STATES.get(state, _OUT_OF_FOCUS)
            # Out of focus the origin may have been moved without a word.
            if state == "focused" and self.counts.poses:
                self._restart_until_ns = time.monotonic_ns() + RESTART_NS

    def _take(self, session: XrSession, found: Located | None, now_ns: int) -> None:
        c = self.counts
        with self._lock:
            if session.restart_from_ns:
                c.recentred += 1
                self._restart_until_ns = max(self._restart_until_ns, session.restart_from_ns + RESTART_NS)
                session.restart_from_ns = 0
            if found is None:
                return
            c.poses += 1
            if not found.valid:
                c.lost += 1
                place, turn = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
                if self._last is not None:
                    place, turn = self._last[:2]
                self._poses.append(StampedPose(now_ns, place, turn, valid=False))
                return
            if found == self._last:
                c.repeated += 1
                return
            self._last = found
            c.guessed += not found.tracked
            believed = found.tracked and now_ns >= self._restart_until_ns
            self._poses.append(StampedPose(now_ns, *found[:2], valid=believed))
