"""Drive any live vest: the newest frame only, keep-alive, watchdog, and silence on every way out.

A driver makes *links*; a thread of its own connects one, feeds it, and replaces it when it breaks. The loop hands
its frame over through one slot and never waits for a radio or a socket. Where sending does not wait, as to a local
socket, and the thread is not using the link, the loop sends the frame itself.

==================  ==================================================================================
a frame written     replaces one that was not sent yet; goes out at once, or when the greatest rate lets it
an equal frame      is sent again when the last one is as old as the keep-alive, 100 ms
no frame, 200 ms    zeros, and zeros again every second
link lost           frames are dropped, a new link is tried after 0.5 s, then up to 5 s; it begins with zeros
close, exception,   zeros, then the link is closed
exit, SIGTERM
==================  ==================================================================================
"""

from __future__ import annotations

import contextlib
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Annotated, ClassVar, Final

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega import _native
from tega.devices.at_exit import closes_on_exit, release
from tega.devices.base import DeviceInfo, Kind, Options
from tega.devices.vest.vest_link import VestLink
from tega.errors import DeviceUnavailableError
from tega.haptics import MotorLevels
from tega.runtime.lifecycle import Opened
from tega.runtime.reopening import Reopening
from tega.runtime.threads import run_realtime
from tega.safety.motor_budget import DOSE_S, HEAT_SHARE, MotorBudget

WATCHDOG_S: Final = 0.2
KEEP_ALIVE_S: Final = 0.1
REST_S: Final = 1.0
HOLD_MS: Final = 200
"""How long a frame lasts by itself where the protocol can say so: two keep-alive periods."""

LOW_BATTERY_PERCENT: Final = 15
"""At which a note is made of a vest's battery."""

_POLL_S = 0.05
_STALLED_S = 1.0  # a link that takes no frame for this long counts as lost
_RETRY_S = (0.5, 5.0)
_JOIN_S = 2.0
_KEPT = 256
_ZEROS: Final[NDArray[np.uint8]] = np.zeros(40, np.uint8)


class VestOptions(Options, frozen=True):
    """Settings every live vest has.

    Attributes:
        limit: The highest intensity that is ever sent, percent.
        most_hz: The greatest rate of frames; one that comes sooner waits for its turn, and a newer one takes its place.
        heat_share: Maximum warming of a motor, as a share of its warming under permanent full drive.
        dose_s: Seconds of full drive that a motor may give in all; see docs/evidence/safety.md.
        open_timeout_s: How long opening may take.
    """

    limit: Annotated[int, msgspec.Meta(ge=1, le=100)] = 100
    most_hz: Annotated[float, msgspec.Meta(ge=10, le=1000)] = 50.0
    heat_share: Annotated[float, msgspec.Meta(ge=0.01, le=1)] = HEAT_SHARE
    dose_s: Annotated[float, msgspec.Meta(ge=10, le=86_400)] = DOSE_S
    open_timeout_s: Annotated[float, msgspec.Meta(gt=0, le=60)] = 10.0


class VestCounters(msgspec.Struct, kw_only=True):
    """Counts of a live vest's writer, frames except where noted.

    Attributes:
        written: Handed over.
        sent: Keep-alives and zeros included.
        held: Had to wait for the greatest rate.
        alike: Held frames that show the same as the previous one, so that nothing was lost.
        superseded: Replaced by a newer one before they could be sent.
        silenced: Times the watchdog sent zeros.
        lost: Times the link broke.
        problem: Why it broke last; empty if it never did.
    """

    written: int = 0
    sent: int = 0
    held: int = 0
    alike: int = 0
    superseded: int = 0
    silenced: int = 0
    lost: int = 0
    problem: str = ""


class StreamedVest(Opened):
    """Base of the live vest drivers."""

    kind: ClassVar[Kind] = "vest"
    name: ClassVar[str]
    in_steps: ClassVar[bool] = True
    """Whether the vest shows 16 steps and nothing between; a bHaptics vest takes four bits a motor."""
    sends_at_once: ClassVar[bool] = False
    """Whether a link's ``send`` never waits for a device, so that a thread with a deadline may call it."""

    def __init__(self, options: VestOptions, label: str) -> None:
        self._options, self._label = options, label
        self.budget = MotorBudget(limit=options.limit, heat_share=options.heat_share, dose_s=options.dose_s)
        """Remaining budget of the motors; kept over reconnections and reopenings."""
        self.keep_alive_s = KEEP_ALIVE_S
        """How old a frame may get before it is sent again; 0 sends every frame that is handed over."""
        self._gap_s = 1.0 / options.most_hz
        self.counters = VestCounters()
        self._link: VestLink | None = None
        self._thread: threading.Thread | None = None
        self._last: threading.Thread | None = None
        self._changed = threading.Condition()
        self._turn = threading.Lock()  # of the thread that uses the link
        self._displayed, self._displayed_s = _ZEROS, 0.0
        self._stopping = False
        self._slot = _ZEROS
        self._slot_is_new = False
        self._slot_t_ns = 0
        self._handed: deque[tuple[int, int, int]] = deque(maxlen=_KEPT)
        self._written_s = 0.0
        self._up = threading.Event()
        self._failure: DeviceUnavailableError | None = None

    def _new_link(self) -> VestLink:
        """Make a link that is not connected yet."""
        raise NotImplementedError

    @property
    def info(self) -> DeviceInfo:
        """Description of the vest, and its problems since it was opened."""
        link, counters = self._link, self.counters
        notes = () if link is None else link.notes
        if (battery := self.battery_percent) is not None and battery <= LOW_BATTERY_PERCENT:
            notes = (*notes, f"the vest's battery is at {battery} %")
        notes = (*notes, *self.budget.words())
        if counters.lost:
            notes = (*notes, f"the link was lost {counters.lost} times, at last: {counters.problem}")
        return DeviceInfo(
            driver=self.name, kind="vest", label=self._label, live=True, unit="0 to 100", notes=notes
        )

    @property
    def reached(self) -> bool:
        """Whether the link stands and reports a vest at its other end."""
        link = self._link
        return self._up.is_set() and link is not None and link.present

    @property
    def battery_percent(self) -> int | None:
        """The vest's battery, 0 to 100; ``None`` where it is not known."""
        link = self._link
        return link.battery_percent if self._up.is_set() and link is not None else None

    @property
    def condition(self) -> str:
        """The vest's current status and its unknown properties, one line; ``""`` while there is no link."""
        link = self._link
        if not self._up.is_set() or link is None:
            return ""
        if not link.present or not link.condition:
            return link.condition
        battery = link.battery_percent
        return f"{link.condition}, battery {'unknown' if battery is None else f'{battery} %'}, fit unknown"

    @property
    def spared(self) -> int:
        """Frames handed over that were not sent, since the vest showed them already."""
        return self.counters.alike

    def open(self) -> None:
        """Connect and send zeros; ``DeviceUnavailableError`` where the vest does not answer in time."""
        self.close()
        if self._last is not None and self._last.is_alive():
            raise DeviceUnavailableError(
                f"{self.name}: the link used before has not let go yet", "try again in some seconds"
            )
        self._begin()
        connected = threading.Event()
        self._thread = threading.Thread(target=self._run, args=(connected,), name=self.name, daemon=True)
        self._thread.start()
        closes_on_exit(self.close)
        in_time = connected.wait(self._options.open_timeout_s)
        failure = self._failure
        if in_time and failure is None:
            return
        self.close()
        raise failure or DeviceUnavailableError(
            f"{self.name}: no answer within {self._options.open_timeout_s} s",
            "is it switched on and in reach?",
        )

    def _begin(self) -> None:
        self.counters = VestCounters()
        self._stopping, self._failure = False, None
        self._slot, self._slot_is_new, self._written_s = _ZEROS, False, time.monotonic()

    def close(self) -> None:
        """Send zeros and disconnect; waits for that, but not for a peer that hangs."""
        thread, self._thread = self._thread, None
        if thread is None:
            return
        self._last = thread
        with self._changed:
            self._stopping = True
            self._changed.notify()
        thread.join(_JOIN_S)
        if thread.is_alive() and (link := self._link) is not None:
            link.abort()
            thread.join(_JOIN_S)
        release(self.close)

    def write(self, t_ns: int, frame: MotorLevels) -> MotorLevels:
        """Hand a frame over at once, and return it within limits; all zeros while no vest is reached."""
        if self._thread is None:
            raise DeviceUnavailableError(f"{self.name} is not open", "open it first")
        with self._changed:
            # The last place before the device: nothing reaches a link but what is allowed here, and zeros.
            allowed = self.budget.allow(time.monotonic_ns(), frame.x40())
            self.counters.written += 1
            if self.keep_alive_s and self.shows_alike(allowed, self._slot):
                self.counters.alike += 1
            else:
                self.counters.superseded += self._slot_is_new
                self._slot_is_new, self._slot_t_ns = True, t_ns
            self._slot, self._written_s = allowed, time.monotonic()
            is_new = self._slot_is_new
        if is_new and not (self.sends_at_once and self._sent_here()):
            with self._changed:
                self._changed.notify()
        displayed = allowed if self.reached else _ZEROS
        return MotorLevels(frame.layout, displayed[frame.motors])

    def _sent_here(self) -> bool:
        """Send the newest frame in the calling thread; ``False`` leaves it to the writer's."""
        if not self._turn.acquire(blocking=False):
            return False
        try:
            link = self._link
            if link is None or not self._up.is_set() or time.monotonic() - self._displayed_s < self._gap_s:
                return False
            if not link.ready(0.0):
                return False
            self._put(link, 0)
        except Exception:  # the link broke: the writer's thread finds that out, and opens another
            with self._changed:
                self._slot_is_new = True
            return False
        finally:
            self._turn.release()
        return True

    def shows_alike(self, one: NDArray[np.uint8], other: NDArray[np.uint8]) -> bool:
        """Return whether the vest shows two frames, uint8 (40,), percent, identically."""
        if one.tobytes() == other.tobytes() or not self.in_steps:
            return one.tobytes() == other.tobytes()
        # Nobody knows how others round: a motor that is to rest is stopped at once.
        return (
            _native.motor_steps(one).tobytes() == _native.motor_steps(other).tobytes()
            and (one == 0).tobytes() == (other == 0).tobytes()
        )

    def handed_over(self) -> list[tuple[int, int, int]]:
        """Return the frames that left since the last call, as defined by ``StampingVest.handed_over``."""
        return [self._handed.popleft() for _ in range(len(self._handed))]

    @run_realtime("act")
    def _run(self, connected: threading.Event) -> None:
        again = Reopening(*_RETRY_S, spread=0.2)
        while not self._stopping:
            self._link = link = self._new_link()
            try:
                link.connect()
                link.send(_ZEROS)
                self._displayed, self._displayed_s = _ZEROS, time.monotonic()
                self._up.set()
                connected.set()
                again.works()
                self._serve(link)
            # A panic of native code, too: the vest is silenced and tried again.
            except BaseException as error:
                if not connected.is_set():
                    self._failure = _text(error)
                    self._stopping = True
                elif self._up.is_set():
                    self.counters.lost += 1
                    self.counters.problem = _text(error).message
            finally:
                with self._turn:
                    self._up.clear()
                    _leave(link)
            connected.set()
            again.wait(self._over)

    def _over(self, rest_s: float) -> bool:
        """Wait so long, or until the driver is closed; return whether it is."""
        with self._changed:
            return self._changed.wait_for(lambda: self._stopping, rest_s)

    def _serve(self, link: VestLink) -> None:
        """Feed a link until the driver is closed or the link breaks."""
        while True:
            free_ns = 0
            with self._changed:
                rest_s = self._displayed_s + self._renew_s(self._slot) - time.monotonic()
                self._changed.wait_for(
                    lambda: self._slot_is_new or self._stopping, min(_POLL_S, max(0.0, rest_s))
                )
                if self._slot_is_new and (held_s := self._displayed_s + self._gap_s - time.monotonic()) > 0:
                    self.counters.held += 1
                    self._changed.wait_for(lambda: self._stopping, held_s)
                    free_ns = time.monotonic_ns()
                if self._stopping:
                    return
            with self._turn:
                if link.ready(_POLL_S):
                    self._put(link, free_ns)
                elif time.monotonic() - self._displayed_s > _STALLED_S:
                    raise DeviceUnavailableError(f"{self.name}: takes no frames, for {_STALLED_S:g} s now")
                link.poll()  # last, since it may take a while and nobody waits for it

    def _put(self, link: VestLink, free_ns: int) -> None:
        """Send the newest frame where the vest does not show it, and renew it where it is old."""
        with self._changed:
            wanted, is_new, t_ns = self._slot, self._slot_is_new, self._slot_t_ns
            self._slot_is_new = False
            now = time.monotonic()
            if now - self._written_s > WATCHDOG_S:
                self.counters.silenced += bool(wanted.any())
                wanted = self._slot = _ZEROS
        if (
            (is_new and not self.keep_alive_s)
            or now - self._displayed_s >= self._renew_s(wanted)
            or not self.shows_alike(wanted, self._displayed)
        ):
            link.send(wanted)
            self._displayed, self._displayed_s = wanted, now
            self.counters.sent += 1
        if is_new:
            self._handed.append((t_ns, free_ns, time.monotonic_ns()))

    def _renew_s(self, frame: NDArray[np.uint8]) -> float:
        """Return the interval after which a frame is sent again, unless the link gets a newer one."""
        return (self.keep_alive_s or KEEP_ALIVE_S) if frame.any() else REST_S


def _text(error: BaseException) -> DeviceUnavailableError:
    if isinstance(error, DeviceUnavailableError):
        return error
    return DeviceUnavailableError(f"unexpected {type(error).__name__}: {error}", "report it")


def _leave(link: VestLink) -> None:
    """Silence a vest and let go of it, whatever state the link is in."""
    steps: tuple[Callable[[], None], ...] = (lambda: link.send(_ZEROS), link.close)
    for step in steps:
        with contextlib.suppress(BaseException):  # it may be left because it does not work
            step()
