"""Steer an Allegro Hand v4 on the angles that it reports, over any CAN adapter that python-can knows."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, ClassVar

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.devices.at_exit import closes_on_exit, last_words, release
from tega.devices.base import DeviceInfo, Found, Kind, Options
from tega.devices.hand.allegro_options import BITRATE, AllegroOptions
from tega.devices.hand.guard_process import STUCK_S
from tega.devices.hand.hand_bus import bus_label
from tega.devices.hand.hand_reports import LET_GO, HandAlert, HandNews
from tega.devices.machine import can_links, link_trouble
from tega.errors import DeviceUnavailableError, InvalidValueError, WrongDeviceError
from tega.hand import MOST_ADDED_LEVELS
from tega.hand.link import HandSpoken, HandState
from tega.runtime.evidence import Evidence
from tega.runtime.lifecycle import Opened
from tega.wire import CanFrame

if TYPE_CHECKING:
    from tega.devices.hand.hand_ends import HandProcess


# A guard whose adapter is gone ends at once.
_GIVES_UP_S = 0.5
_START_S = 10.0
_KEPT = 16_384
# The hand's process reports its state 125 times a second.
_UNHEARD_S = 0.1
_REFUSED = frozenset({"wrong-version", "wrong-side", "other-hand"})


class Allegro(Opened):
    """Closes the loop on the hand's own angles, in a process of its own that the hand's own frames wake.

    Opening checks version and side before any torque, switches the motors on, and holds the current pose
    until :meth:`step` asks for a level. On every way out the torque fades within 0.2 s, then zero torque and
    SERVO OFF are sent until the hand confirms that its motors are off. The process also does so if this
    program is killed; a further process does so if that process is killed, if this program hangs, or if the
    hand does not confirm. A hand without its bus is believed to keep its last torque, so mount a switch.
    """

    kind: ClassVar[Kind] = "hand"
    unseen: ClassVar[str] = "the kernel lists no CAN interface"
    summary: ClassVar[str] = "Allegro Hand v4 over CAN, steered on the angles it reports"
    extra: ClassVar[str] = "lab"
    requires: ClassVar[tuple[str, ...]] = ("can",)
    options_type: ClassVar[type[Options]] = AllegroOptions

    label = "Allegro Hand v4: torques from the angles it reported"
    compared: ClassVar[Mapping[Evidence, str]] = {
        "banner": "version 4 and the side that is set; after a silence, the same serial number",
        "rate": "at least 250 sets of joint angles a second",
        "values": "four frames make a set; no joint jumps, none stands still to the last bit, temperatures hold",
    }

    def __init__(self, options: AllegroOptions) -> None:
        self._options = options
        self._end: HandProcess | None = None
        self._warm: HandProcess | None = None
        self._seen: HandNews | None = None
        self._received_s = 0.0
        self._ready = threading.Event()
        self._alert = HandAlert()
        self.watched = False
        """Whether the hand is let go while no :meth:`step` is called for a second, from the first call on."""
        self._sent: deque[CanFrame] = deque(maxlen=_KEPT)
        self._cycles: deque[tuple[int, int]] = deque(maxlen=_KEPT)
        self.on_exchange: Callable[[HandSpoken], None] | None = None
        """Called, in a thread of the driver, with every exchange: they suffice to repeat the conversation. Set it
        before the hand is opened."""

    @classmethod
    def discover(cls, timeout_s: float) -> list[Found]:  # noqa: ARG003  # the kernel knows at once
        """List the CAN buses a hand may be on (Linux only); sends nothing on them."""
        found = []
        for link in can_links():
            problem, hint = link_trouble(link, bitrate=BITRATE)
            options = {"interface": "socketcan", "channel": link.name}
            found.append(
                Found(driver="allegro", label=link.name, options=options, problem=problem, hint=hint)
            )
        return found

    @classmethod
    def harmless(cls, options: AllegroOptions) -> AllegroOptions:
        """The same settings with the motors off, so that the hand is only read."""
        return msgspec.structs.replace(options, torque=False)

    @property
    def info(self) -> DeviceInfo:
        """Name, version and serial number of the hand, as far as it has reported them."""
        notes: tuple[str, ...] = ()
        if self._seen is not None and (state := self._seen.state).hardware:
            notes = (f"version {state.hardware}, firmware {state.firmware}, serial SAH040{state.serial}",)
        return DeviceInfo(
            driver="allegro",
            kind="hand",
            label=self._label,
            live=True,
            rate_hz=1000 / 3,
            unit="CAN frames",
            notes=notes,
        )

    @property
    def problem(self) -> str:
        """Trouble of the hand now, while it can still be steered or may come back; ``""`` for none."""
        return self.unsteered or self._alert(self._seen)

    @property
    def unsteered(self) -> str:
        """Why the hand does not follow commands now; ``""`` if it does."""
        if self._end is not None and time.monotonic() - self._received_s > STUCK_S:
            return "hand: its process reports nothing"
        return self._alert.unsteered(self._seen)

    def warm_up(self) -> None:
        """Start the hand's process, which makes ready meanwhile; the hand is not touched before :meth:`open`."""
        from tega.devices.hand.hand_ends import HandProcess

        self.close()
        self._warm = HandProcess(self._options, self._take)
        self._warm.warm_up()

    def open(self) -> None:
        """Open the bus, check the hand, and hold it where it is.

        ``WrongDeviceError``: the hand is of another version or side. ``DeviceUnavailableError`` also for a
        hand that must not be steered; the message gives the reason.
        """
        from tega.devices.hand.hand_ends import HandProcess

        warm, self._warm = self._warm, None
        self.close()
        self._seen = None
        self._sent.clear()
        self._cycles.clear()
        self._ready.clear()
        process = warm or HandProcess(self._options, self._take)
        process.open(whole=self.on_exchange is not None)
        self._end, self._received_s = process, time.monotonic()
        # A program that ends without closing must not leave the fingers pushing.
        closes_on_exit(self.close)
        try:
            self._check(started=self._ready.wait(_START_S))
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Let go of the hand and close the bus."""
        warm, self._warm = self._warm, None
        if warm is not None:
            warm.end()
        end, self._end = self._end, None
        if end is None:
            return
        from tega.devices.hand.hand_loop import CONFIRM_S, LEAVE_S

        end.say(LET_GO)
        try:
            end.join(LEAVE_S + _START_S)
        finally:
            # An impatient Ctrl-C does not cut the letting go short.
            end.join(LEAVE_S + CONFIRM_S)
            end.end()
            release(self.close)
            self._notify_end()

    def _notify_end(self) -> None:
        """Print, as the program's last output, that a hand has not confirmed that its motors are off."""
        from tega.devices.hand.hand_guard import LONGEST_S, guard_runs

        seen, self._seen = self._seen, None
        if seen is None or seen.let_go:
            return
        tries = "no other process goes on switching it off"
        end_s = time.monotonic() + _GIVES_UP_S
        while (guarded := guard_runs(seen.guard_pid)) and time.monotonic() < end_s:
            time.sleep(0.02)
        if guarded:
            tries = f"process {seen.guard_pid} goes on switching it off, for {LONGEST_S / 60:g} minutes"
        last_words(
            f"USE THE HAND'S EMERGENCY SWITCH: {self._label}: the hand has not confirmed that its motors are off, "
            f"so it may still be pushing; {tries}"
        )

    @property
    def _label(self) -> str:
        return bus_label(self._options.interface, self._options.channel)

    @property
    def pid(self) -> int:
        """The number of the hand's process, for a look from outside; 0 where there is none."""
        return 0 if self._end is None else self._end.pid

    @property
    def guard_problem(self) -> str:
        """Why no guard would release the hand if this program were killed now; ``""`` if one would."""
        seen = self._seen
        return "" if seen is None or not seen.guard_problem else f"hand: {seen.guard_problem}"

    def step(self, level: float, added: float = 0.0) -> list[CanFrame]:
        """Request a closure level, 1 to 5 with fractions between two poses; the hand's process moves there.

        ``added`` are levels that a reflex adds, 0 to 1. Returns the frames sent to the hand since the last
        call. ``WrongDeviceError``: another hand has answered after a silence. ``DeviceUnavailableError``: not
        open, or the hand was let go because of a fault, which the message names.
        """
        if not 1 <= level <= 5:
            raise InvalidValueError(f"level = {level} is out of range: 1 (open) to 5 (tight)")
        if not 0 <= added <= MOST_ADDED_LEVELS:
            raise InvalidValueError(f"added = {added} levels is out of range: 0 to {MOST_ADDED_LEVELS:g}")
        self._check().say(level, added, alone=self.watched)
        return self._taken()

    def limp(self) -> list[CanFrame]:
        """Begin to let go and return the frames sent since the last call.

        The torque fades within 0.2 s in the hand's own process; :meth:`close` waits for it. The frames of
        that time come with the next call.
        """
        if self._end is not None:
            self._end.say(LET_GO)
        return self._taken()

    @property
    def angles_rad(self) -> NDArray[np.float64]:
        """The hand's joint angles as last reported, float64 (16,), rad; NaN before the first report."""
        seen = self._seen
        return np.full(16, np.nan) if seen is None or seen.angles_rad is None else seen.angles_rad

    @property
    def silent(self) -> bool:
        """Whether the joint angles are older than the watchdog allows, or the hand's process is silent."""
        seen = self._seen
        late = time.monotonic() - self._received_s > _UNHEARD_S
        return seen is None or seen.state.phase != "running" or late

    @property
    def target_rad(self) -> NDArray[np.float64] | None:
        """Joint targets of the last cycle, float64 (16,), rad; ``None`` before the first."""
        return None if self._seen is None else self._seen.target_rad

    @property
    def news(self) -> HandNews:
        """The hand and its loop, as they were at most 50 ms ago."""
        if self._seen is None:
            raise DeviceUnavailableError("allegro: the hand is not open", "open it first")
        return self._seen

    def state(self) -> HandState:
        """Return phase, version, temperatures and counters, as they were at most 50 ms ago."""
        return self.news.state

    @property
    def cycles(self) -> list[tuple[int, int]]:
        """For the last 16,384 cycles: send time of the torques and delay after their frames, both in ns."""
        return list(self._cycles)

    def answered_ns(self, since_ns: int) -> tuple[int, int] | None:
        """Return when a report was in and its answer left, as defined by ``AnsweringHand.answered_ns``."""
        found = None
        for k in range(1, len(self._cycles) + 1):
            sent_ns, took_ns = self._cycles[-k]
            if sent_ns < since_ns:
                break
            found = (sent_ns - took_ns, sent_ns)
        return found

    def _taken(self) -> list[CanFrame]:
        return [self._sent.popleft() for _ in range(len(self._sent))]

    def _check(self, *, started: bool = True) -> HandProcess:
        """Return the hand's process, if it can be asked for anything."""
        end, seen = self._end, self._seen
        if end is None:
            raise DeviceUnavailableError("allegro: the hand is not open", "open it first")
        trouble = "" if seen is None else seen.trouble
        if seen is not None and seen.fault is not None:
            wrong = WrongDeviceError if seen.fault.kind in _REFUSED else DeviceUnavailableError
            raise wrong(f"allegro: {seen.fault.message}{trouble}", seen.fault.hint)
        lost = end.lost or ("the hand's loop has ended" if seen is not None and seen.ended else "")
        if lost:
            raise DeviceUnavailableError(f"allegro: {lost}{trouble}", "open it again")
        if not started:
            raise DeviceUnavailableError(
                f"allegro: the hand was not ready within {_START_S:g} s{trouble}",
                "try again; then check the adapter",
            )
        return end

    def _take(self, spoken: list[HandSpoken], seen: HandNews) -> None:
        self._seen, self._received_s = seen, time.monotonic()
        for text in spoken:
            self._sent.extend(text.taken)
            if text.left_ns:
                self._cycles.append((text.left_ns, text.left_ns - text.t_ns))
            if self.on_exchange is not None:
                self.on_exchange(text)
        if seen.ready:
            self._ready.set()
