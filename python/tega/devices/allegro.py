"""Steer an Allegro Hand v4 on the angles that it reports, over any CAN adapter that python-can knows."""

from __future__ import annotations

import contextlib
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import msgspec
import numpy as np

from tega.devices.at_exit import closes_on_exit, last_words, release
from tega.devices.base import DeviceInfo, Found, Kind, Options
from tega.devices.can_links import can_links, link_trouble
from tega.devices.guard_process import GuardProcess
from tega.devices.hand_bus import HandBus
from tega.devices.hand_guard import LONGEST_S, guard_hand
from tega.errors import DeviceUnavailableError, InvalidValueError, WrongDeviceError
from tega.lifecycle import Opened
from tega.safety.hand_alert import HandAlert
from tega.threads import run_realtime
from tega.wire import allegro_limp_frames

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tega.hand_link import HandFault, HandLink, HandState, Received
    from tega.wire import CanFrame


_BITRATE = 1_000_000
# Python changes threads every 5 ms when left alone; the hand reports every 3 ms.
_SWITCH_S = 0.0005
_START_S = 10.0
_LEAVE_S = 1.0
# An adapter that was closed is opened again within a second.
_CONFIRM_S = 3.0
_KEPT = 16_384
_REFUSED = frozenset({"wrong-version", "wrong-side"})

_Share = Annotated[float, msgspec.Meta(gt=0, le=1)]


class AllegroOptions(Options, frozen=True):
    """Settings of :class:`Allegro`.

    Attributes:
        interface: The adapter's name in python-can, such as ``socketcan``, ``pcan``, ``slcan``, ``virtual``.
        channel: Which of its buses.
        bitrate: Bits per second; ``socketcan`` is set with ``ip link`` instead.
        bus: Further options, passed to ``can.Bus`` as they are.
        device_id: The hand's number on its bus, 0 from the factory.
        side: Which hand is mounted; the other one is refused.
        poses: Pose file of the closure levels; ``None`` for the built-in ones.
        torque_share: Ceiling of every torque, as a share of the vendor's limits.
        kp: Torque units per rad; ``None`` for the built-in gains, 1.5 and 2 for the thumb.
        kd: Torque units per rad/s; ``None`` for 0.08.
        torque: Switch the motors on; without it the hand is only read.
        silent_after_ms: Without a set of positions for so long the motors go off.
        lowest_rate_hz: Sets of positions a second that are needed; the hand sends 333.
        reconnects: How often a silent hand is looked for again, once a second.
        guard: Have a second process let go of the hand if this one is killed or stands still.
    """

    interface: str
    channel: str | int
    bitrate: Annotated[int, msgspec.Meta(gt=0, le=1_000_000)] = _BITRATE
    bus: dict[str, Any] = msgspec.field(default_factory=dict)
    device_id: Annotated[int, msgspec.Meta(ge=0, le=3)] = 0
    side: Literal["right", "left"] = "right"
    poses: Path | None = None
    torque_share: _Share = 1.0
    kp: Annotated[float, msgspec.Meta(gt=0, le=10)] | None = None
    kd: Annotated[float, msgspec.Meta(ge=0, le=1)] | None = None
    torque: bool = True
    silent_after_ms: Annotated[float, msgspec.Meta(ge=10, le=10_000)] = 30.0
    lowest_rate_hz: Annotated[float, msgspec.Meta(ge=0, le=1000)] = 250.0
    reconnects: Annotated[int, msgspec.Meta(ge=0, le=100)] = 5
    guard: bool = True


class Allegro(Opened):
    """Closes the loop on the hand's own angles, in a thread that the hand's own frames wake.

    Opening it checks version and side before any torque, switches the motors on and holds the pose the hand is in
    until :meth:`step` asks for a level. On every way out the torque fades within 0.2 s, then zero torque and SERVO
    OFF are sent until the hand says that its motors are off; a second process sends them if this one is killed, or if
    the hand does not say so. A hand whose bus is gone keeps its last torque as far as is known, so mount a switch.
    """

    kind: ClassVar[Kind] = "hand"
    summary: ClassVar[str] = "Allegro Hand v4 over CAN, steered on the angles it reports"
    extra: ClassVar[str] = "lab"
    requires: ClassVar[tuple[str, ...]] = ("can",)
    options_type: ClassVar[type[Options]] = AllegroOptions

    label = "Allegro Hand v4: torques from the angles it reported"

    def __init__(self, options: AllegroOptions) -> None:
        self._options = options
        o = options
        self._bus = HandBus(o.interface, o.channel, bitrate=o.bitrate, more=o.bus)
        self._link: HandLink | None = None
        self._thread: threading.Thread | None = None
        self._ready = threading.Event()
        self._leaving = threading.Event()
        self._level: float = 1
        self._died = ""
        self._alert = HandAlert(self)
        self._guard: GuardProcess | None = None
        self._off: list[CanFrame] = []
        self._pushed, self._let_go, self._cpu_s = False, True, 0.0
        self._switch_s = 0.0
        self._sent: deque[CanFrame] = deque(maxlen=_KEPT)
        self._cycles: deque[tuple[int, int]] = deque(maxlen=_KEPT)
        self.on_exchange: Callable[[int, float, Sequence[Received], Sequence[CanFrame], str], None] | None = (
            None
        )
        """Told in the hand's thread of every exchange: time, level, frames received and to be sent, and ``exchange``,
        ``release`` or ``abandon``. From these the same conversation can be held again."""

    @classmethod
    def discover(cls, timeout_s: float) -> list[Found]:  # noqa: ARG003  # the kernel knows at once
        """List the CAN buses a hand may be on (Linux only); says nothing on them."""
        found = []
        for link in can_links():
            problem, hint = link_trouble(link, bitrate=_BITRATE)
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
        """Name, version and serial number of the hand, as far as it has said them."""
        notes: tuple[str, ...] = ()
        if self._link is not None and (state := self._link.state(0)).hardware:
            notes = (f"version {state.hardware}, firmware {state.firmware}, serial SAH040{state.serial}",)
        return DeviceInfo(
            driver="allegro",
            kind="hand",
            label=self._bus.label,
            live=True,
            rate_hz=1000 / 3,
            unit="CAN frames",
            notes=notes,
        )

    @property
    def problem(self) -> str:
        """Trouble of the hand now, while it can still be steered or may come back; ``""`` for none."""
        return self._alert()

    def open(self) -> None:
        """Open the bus, check the hand, and hold it where it is.

        Raises:
            WrongDeviceError: The hand is of another version or side.
            DeviceUnavailableError: No adapter, no hand, or one that must not be steered; the message says which.
            ConfigError: The pose file cannot be used.
            MissingExtraError: python-can is not installed.
        """
        from tega.hand import TORQUE_LIMITS, HandController
        from tega.hand_link import HandLink
        from tega.hand_poses import load_poses
        from tega.wire import allegro_set_period

        o = self._options
        self.close()
        controller = HandController(
            poses_rad=None if o.poses is None else load_poses(o.poses),
            kp=o.kp,
            kd=o.kd,
            torque_limits=TORQUE_LIMITS * o.torque_share,
        )
        self._bus.open()
        self._level, self._died = 1, ""
        self._pushed, self._let_go, self._cpu_s = False, True, 0.0
        self._off = [
            *allegro_limp_frames(device_id=o.device_id),
            allegro_set_period(0, device_id=o.device_id),
        ]
        self._sent.clear()
        self._cycles.clear()
        self._ready.clear()
        self._leaving.clear()
        self._switch_s = sys.getswitchinterval()
        sys.setswitchinterval(min(self._switch_s, _SWITCH_S))
        self._link = HandLink(
            controller,
            device_id=o.device_id,
            side=o.side,
            torque=o.torque,
            silent_after_ms=o.silent_after_ms,
            lowest_rate_hz=o.lowest_rate_hz,
            reconnects=o.reconnects,
        )
        # A bus inside this process ends with it.
        if o.guard and o.torque and o.interface != "virtual":
            try:
                self._guard = guard_hand(self._bus.settings, self._off, device_id=o.device_id)
            except BaseException:
                self._bus.drop()
                raise
        self._thread = threading.Thread(target=self._run, args=(self._link,), name="allegro", daemon=True)
        self._thread.start()
        # A program that ends without closing must not leave the fingers pushing.
        closes_on_exit(self.close)
        try:
            self._check(started=self._ready.wait(_START_S))
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Let go of the hand and close the bus."""
        thread, self._thread = self._thread, None
        if thread is not None:
            self._leaving.set()
            try:
                thread.join(_LEAVE_S + _START_S)
            finally:
                # An impatient Ctrl-C does not cut the letting go short.
                thread.join(_LEAVE_S + _CONFIRM_S)
                release(self.close)
                sys.setswitchinterval(self._switch_s)
                self._dismiss()
        self._link = None

    def _dismiss(self) -> None:
        """Dismiss the process that guards the hand if the hand has confirmed that its motors are off."""
        guard, self._guard = self._guard, None
        if self._let_go:
            if guard is not None:
                guard.dismiss()
            return
        tries = ""
        if guard is not None:
            guard.leave_to_it()
            tries = f"; another process goes on telling it to, for {LONGEST_S / 60:g} minutes"
        last_words(
            f"USE THE HAND'S EMERGENCY SWITCH: {self._bus.label}: the hand has not confirmed that its motors are off, "
            f"so it may still be pushing{tries}"
        )

    @property
    def guard_problem(self) -> str:
        """Why nobody would let go of the hand if this program were killed now; ``""`` if somebody would."""
        guard = self._guard
        return "" if guard is None or not guard.problem else f"hand: {guard.problem}"

    def step(self, level: float) -> list[CanFrame]:
        """Ask for a closure level; the hand's own thread moves there.

        Args:
            level: Closure level, 1 to 5 with fractions between two poses.

        Returns:
            The frames sent to the hand since the last call.

        Raises:
            InvalidValueError: The level is not from 1 to 5.
            WrongDeviceError: Another hand has answered after a silence.
            DeviceUnavailableError: Not open, or the hand was let go because of a fault; the message says which.
        """
        if not 1 <= level <= 5:
            raise InvalidValueError(f"level = {level} is out of range: 1 (open) to 5 (tight)")
        self._check()
        self._level = level
        return self._taken()

    def limp(self) -> list[CanFrame]:
        """Begin to let go and return the frames sent since the last call.

        The torque fades within 0.2 s in the hand's own thread; :meth:`close` waits for it. The frames of that time
        come with the next call.
        """
        self._leaving.set()
        return self._taken()

    @property
    def angles_rad(self) -> NDArray[np.float64]:
        """The hand's joint angles as last reported, float64 (16,), rad; NaN before the first report."""
        angles = None if self._link is None else self._link.angles_rad
        return np.full(16, np.nan) if angles is None else angles

    @property
    def target_rad(self) -> NDArray[np.float64] | None:
        """Joint targets of the last cycle, float64 (16,), rad; ``None`` before the first."""
        return None if self._link is None else self._link.target_rad

    def state(self) -> HandState:
        """Return phase, version, temperatures and counters.

        Raises:
            DeviceUnavailableError: The hand is not open.
        """
        if self._link is None:
            raise DeviceUnavailableError("allegro: the hand is not open", "open it first")
        return self._link.state(time.monotonic_ns())

    @property
    def n_garbled(self) -> int:
        """Pieces of the adapter's stream that were no frame."""
        return self._bus.n_garbled

    @property
    def n_unsent(self) -> int:
        """Frames the adapter did not take; the next cycle sends new ones."""
        return self._bus.n_unsent

    @property
    def cycles(self) -> list[tuple[int, int]]:
        """Of the last 16,384 cycles, when its torques were sent and how long after their frames, both in ns."""
        return list(self._cycles)

    def answered_ns(self, since_ns: int) -> tuple[int, int] | None:
        """Return when a hand's report was in and when the torques that answer it left, at or after a monotonic time.

        ``None`` if none have left since.
        """
        found = None
        for k in range(1, len(self._cycles) + 1):
            sent_ns, took_ns = self._cycles[-k]
            if sent_ns < since_ns:
                break
            found = (sent_ns - took_ns, sent_ns)
        return found

    @property
    def cpu_s(self) -> float:
        """Processor time of the hand's thread up to its last cycle, seconds; 0 when closed."""
        return self._cpu_s if self._thread is not None else 0.0

    def _taken(self) -> list[CanFrame]:
        return [self._sent.popleft() for _ in range(len(self._sent))]

    def _check(self, *, started: bool = True) -> None:
        link, trouble = self._link, self._died or self._bus.trouble
        if link is None:
            raise DeviceUnavailableError("allegro: the hand is not open", "open it first")
        fault: HandFault | None = link.fault
        if fault is not None:
            wrong = WrongDeviceError if fault.kind in _REFUSED else DeviceUnavailableError
            raise wrong(f"allegro: {fault.message}{trouble}", fault.hint)
        if self._thread is None or not self._thread.is_alive():
            raise DeviceUnavailableError(f"allegro: the hand's thread has ended{trouble}", "open it again")
        if not started:
            raise DeviceUnavailableError(
                f"allegro: the hand was not ready within {_START_S:g} s{trouble}",
                "try again; then check the adapter",
            )

    @run_realtime("act")
    def _run(self, link: HandLink) -> None:
        """Exchange frames until told to leave; then let go, and leave whatever happens."""
        leave_ns = 0
        try:
            while not (link.released or (leave_ns and time.monotonic_ns() > leave_ns)):
                if leave_ns and link.phase == "faulted":
                    break
                frames = self._bus.receive(may_reopen=not self._leaving.is_set())
                t_ns = time.monotonic_ns()
                self._cpu_s = time.thread_time()
                if self._leaving.is_set() and not leave_ns:
                    link.release(t_ns)
                    self._tell(t_ns, 0, (), (), "release")
                    leave_ns = t_ns + round(_LEAVE_S * 1e9)
                level = self._level
                before = link.phase
                out = link.exchange(frames, t_ns, level)
                if out:
                    self._sent.extend(self._bus.send(out))
                    if len(out) >= 4 and link.phase == "running":
                        now_ns = time.monotonic_ns()
                        self._cycles.append((now_ns, now_ns - t_ns))
                if link.phase == "silent" != before:
                    # Whoever else let go of the hand, as the guard does, has closed the adapter behind itself.
                    self._bus.drop()
                self._tell(t_ns, level, frames, out, "exchange")
                self._pushed = self._pushed or (link.phase == "running" and self._options.torque)
                if link.phase in {"running", "faulted"}:
                    self._ready.set()
                if self._guard is not None and self._ready.is_set():
                    self._guard.beat()
        except (
            BaseException
        ) as error:  # a panic of native code, too; told by the next step, which can act on it
            self._died = f" ({type(error).__name__}: {error})"
        finally:
            # Whatever was sent before: a hand that hears this is without force.
            last = link.abandon()
            self._sent.extend(self._bus.send(last))
            self._tell(time.monotonic_ns(), 0, (), last, "abandon")
            self._ready.set()
            if self._pushed:
                self._let_go = False
                with contextlib.suppress(Exception):
                    device_id = self._options.device_id
                    self._let_go = self._bus.switch_off(self._off, device_id=device_id, patience_s=_CONFIRM_S)
            with contextlib.suppress(Exception):
                self._bus.drop()

    def _tell(
        self, t_ns: int, level: float, received: Sequence[Received], sent: Sequence[CanFrame], action: str
    ) -> None:
        if self.on_exchange is not None:
            self.on_exchange(t_ns, level, received, sent, action)
