"""An Allegro Hand v4 on any CAN adapter that python-can knows, steered on the angles it reports."""

from __future__ import annotations

import contextlib
import os
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import msgspec
import numpy as np

from tega.devices.base import DeviceInfo, Found, Kind, Options
from tega.devices.can_links import can_links, link_trouble
from tega.devices.hand_guard import Guard
from tega.devices.lifecycle import Opened, require
from tega.devices.slcan import slcan_bus
from tega.devices.ways_out import closes_on_exit, release
from tega.errors import DeviceUnavailableError, InvalidValueError, WrongDeviceError
from tega.priority import ahead_of_others

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tega.hand_link import HandFault, HandLink, HandState, Received
    from tega.wire import CanFrame

__all__ = ["Allegro", "AllegroOptions"]

_BITRATE = 1_000_000
# Waiting for a frame ends this soon, so that silence is noticed in time.
_WAIT_S = 0.002
# A frame that waits longer is dropped: the next cycle has a newer one.
_SEND_S = 0.01
# Python changes threads every 5 ms when left alone; the hand reports every 3 ms.
_SWITCH_S = 0.0005
_REOPEN_NS = 1_000_000_000
_START_S = 10.0
_LEAVE_S = 1.0
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
    OFF are sent three times; a second process sends them if this one is killed. A hand whose bus is gone keeps its
    last torque as far as is known, so mount a switch.

    Args:
        options: The settings.
    """

    kind: ClassVar[Kind] = "hand"
    summary: ClassVar[str] = "Allegro Hand v4 over CAN, steered on the angles it reports"
    extra: ClassVar[str] = "lab"
    requires: ClassVar[tuple[str, ...]] = ("can",)
    options_type: ClassVar[type[Options]] = AllegroOptions

    label = "Allegro Hand v4: torques from the angles it reported"

    def __init__(self, options: AllegroOptions) -> None:
        self._options = options
        self._can: Any = None
        self._bus: Any = None
        self._link: HandLink | None = None
        self._thread: threading.Thread | None = None
        self._ready = threading.Event()
        self._leaving = threading.Event()
        self._level = 1
        self._reopen_ns = 0
        self._trouble = ""
        self._guard: Guard | None = None
        self._switch_s = 0.0
        self._sent: deque[CanFrame] = deque(maxlen=_KEPT)
        self._cycles: deque[tuple[int, int]] = deque(maxlen=_KEPT)
        self.on_exchange: Callable[[int, int, Sequence[Received], Sequence[CanFrame], str], None] | None = (
            None
        )
        """Told in the hand's thread of every exchange: time, level, frames received and to be sent, and ``exchange``,
        ``release`` or ``abandon``. From these the same conversation can be held again."""
        self.n_garbled = 0
        """Pieces of the adapter's stream that were no frame."""
        self.n_unsent = 0
        """Frames the adapter did not take; the next cycle sends new ones."""

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
        o = self._options
        label = f"{o.interface} {Path(str(o.channel)).name}"
        notes: tuple[str, ...] = ()
        if self._link is not None and (state := self._link.state(0)).hardware:
            notes = (f"version {state.hardware}, firmware {state.firmware}, serial SAH040{state.serial}",)
        return DeviceInfo(
            driver="allegro",
            kind="hand",
            label=label,
            live=True,
            rate_hz=1000 / 3,
            unit="CAN frames",
            notes=notes,
        )

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
        from tega.teleop.hand import limp_frames
        from tega.wire import allegro_set_period

        o = self._options
        self.close()
        controller = HandController(
            poses_rad=None if o.poses is None else load_poses(o.poses),
            kp=o.kp,
            kd=o.kd,
            torque_limits=TORQUE_LIMITS * o.torque_share,
        )
        self._can = require("can", driver="allegro", extra="lab")
        self._bus = self._open_bus()
        self._level, self._trouble = 1, ""
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
        if o.guard and o.torque and o.interface != "virtual" and os.name == "posix":
            frames = [*limp_frames(o.device_id), allegro_set_period(0, device_id=o.device_id)]
            self._guard = Guard(self._bus_settings(), frames)
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
                thread.join(_LEAVE_S)
                release(self.close)
                sys.setswitchinterval(self._switch_s)
                guard, self._guard = self._guard, None
                if guard is not None:
                    guard.dismiss()
        self._link = None

    def step(self, level: int) -> list[CanFrame]:
        """Ask for a closure level; the hand's own thread moves there.

        Args:
            level: Closure level, 1 to 5.

        Returns:
            The frames sent to the hand since the last call.

        Raises:
            InvalidValueError: The level is none of the five.
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

    def state(self) -> HandState:
        """Return phase, version, temperatures and counters.

        Raises:
            DeviceUnavailableError: The hand is not open.
        """
        if self._link is None:
            raise DeviceUnavailableError("allegro: the hand is not open", "open it first")
        return self._link.state(time.monotonic_ns())

    @property
    def cycles(self) -> list[tuple[int, int]]:
        """Of the last 16,384 cycles, when its torques were sent and how long after their frames, both in ns."""
        return list(self._cycles)

    def answered_ns(self, since_ns: int) -> int | None:
        """Return when torques first left at or after a monotonic time; ``None`` if none have yet."""
        found = None
        for k in range(1, len(self._cycles) + 1):
            sent_ns = self._cycles[-k][0]
            if sent_ns < since_ns:
                break
            found = sent_ns
        return found

    @property
    def cpu_s(self) -> float:
        """Processor time of the hand's thread so far, seconds; 0 when closed."""
        thread = self._thread
        if thread is None or thread.ident is None:
            return 0.0
        return time.clock_gettime(time.pthread_getcpuclockid(thread.ident))

    def _taken(self) -> list[CanFrame]:
        return [self._sent.popleft() for _ in range(len(self._sent))]

    def _check(self, *, started: bool = True) -> None:
        link = self._link
        if link is None:
            raise DeviceUnavailableError("allegro: the hand is not open", "open it first")
        fault: HandFault | None = link.fault
        if fault is not None:
            wrong = WrongDeviceError if fault.kind in _REFUSED else DeviceUnavailableError
            raise wrong(f"allegro: {fault.message}{self._trouble}", fault.hint)
        if self._thread is None or not self._thread.is_alive():
            raise DeviceUnavailableError(
                f"allegro: the hand's thread has ended{self._trouble}", "open it again"
            )
        if not started:
            raise DeviceUnavailableError(
                f"allegro: the hand was not ready within {_START_S:g} s{self._trouble}",
                "try again; then check the adapter",
            )

    def _bus_settings(self) -> dict[str, Any]:
        o = self._options
        return {"interface": o.interface, "channel": o.channel, "bitrate": o.bitrate, **o.bus}

    def _open_bus(self) -> Any:
        o = self._options
        try:
            if o.interface == "slcan":
                return slcan_bus()(o.channel, bitrate=o.bitrate, **o.bus)
            return self._can.Bus(**self._bus_settings())
        except (self._can.CanError, OSError, ValueError, TypeError, ImportError) as error:
            raise DeviceUnavailableError(
                f"allegro: interface {o.interface!r} did not open {self.info.label.split()[-1]!r}: {error}",
                "check the adapter and its name; a socketcan bus has to be up: "
                "ip link set can0 up type can bitrate 1000000 restart-ms 100",
            ) from error

    @ahead_of_others("act")
    def _run(self, link: HandLink) -> None:
        """Exchange frames until told to leave; then let go, and leave whatever happens."""
        leave_ns = 0
        try:
            while not (link.released or (leave_ns and time.monotonic_ns() > leave_ns)):
                if leave_ns and link.phase == "faulted":
                    break
                frames = self._receive()
                t_ns = time.monotonic_ns()
                if self._leaving.is_set() and not leave_ns:
                    link.release(t_ns)
                    self._tell(t_ns, 0, (), (), "release")
                    leave_ns = t_ns + round(_LEAVE_S * 1e9)
                level = self._level
                before = link.phase
                out = link.exchange(frames, t_ns, level)
                if out:
                    self._send(out)
                    if len(out) >= 4 and link.phase == "running":
                        now_ns = time.monotonic_ns()
                        self._cycles.append((now_ns, now_ns - t_ns))
                if link.phase == "silent" != before:
                    # Whoever else let go of the hand, as the guard does, has closed the adapter behind itself.
                    self._drop_bus()
                self._tell(t_ns, level, frames, out, "exchange")
                if link.phase in {"running", "faulted"}:
                    self._ready.set()
                if self._guard is not None and self._ready.is_set():
                    self._guard.beat()
        except Exception as error:  # told by the next step, in the thread that can act on it
            self._trouble = f" ({type(error).__name__}: {error})"
        finally:
            # Whatever was sent before: a hand that hears this is without force.
            last = link.abandon()
            self._send(last)
            self._tell(time.monotonic_ns(), 0, (), last, "abandon")
            self._ready.set()
            with contextlib.suppress(Exception):
                self._drop_bus()

    def _tell(
        self, t_ns: int, level: int, received: Sequence[Received], sent: Sequence[CanFrame], action: str
    ) -> None:
        if self.on_exchange is not None:
            self.on_exchange(t_ns, level, received, sent, action)

    def _receive(self) -> list[Received]:
        from tega.hand_link import Received

        frames: list[Received] = []
        if self._bus is None and not self._reopened():
            time.sleep(_WAIT_S)
            return frames
        wait_s = _WAIT_S
        while len(frames) < 64:
            try:
                message = self._bus.recv(timeout=wait_s)
            except (self._can.CanError, OSError) as error:
                self._trouble = f" (the adapter failed: {error})"
                self._drop_bus()
                break
            except (ValueError, IndexError):
                self.n_garbled += 1
                continue
            if message is None:
                break
            frames.append(
                Received(
                    message.arbitration_id,
                    message.data,
                    message.is_remote_frame,
                    message.is_extended_id,
                    message.is_error_frame,
                )
            )
            wait_s = 0.0
        return frames

    def _reopened(self) -> bool:
        """Try to open a bus that went away, once a second."""
        t_ns = time.monotonic_ns()
        if self._leaving.is_set() or t_ns < self._reopen_ns:
            return False
        self._reopen_ns = t_ns + _REOPEN_NS
        with contextlib.suppress(DeviceUnavailableError):
            self._bus = self._open_bus()
            self._trouble = ""
        return self._bus is not None

    def _drop_bus(self) -> None:
        bus, self._bus = self._bus, None
        if bus is not None:
            with contextlib.suppress(self._can.CanError, OSError):
                bus.shutdown()

    def _send(self, frames: list[CanFrame]) -> None:
        for message, frame in self._messages(frames):
            if self._bus is None:
                return
            try:
                self._bus.send(message, timeout=_SEND_S)
                self._sent.append(frame)
            except (self._can.CanError, OSError):
                self.n_unsent += 1

    def _messages(self, frames: list[CanFrame]) -> Iterator[tuple[Any, CanFrame]]:
        make: Callable[..., Any] = self._can.Message
        for frame in frames:
            yield (
                make(
                    arbitration_id=frame.id,
                    data=frame.data,
                    is_remote_frame=frame.remote,
                    is_extended_id=False,
                    is_fd=False,
                ),
                frame,
            )
