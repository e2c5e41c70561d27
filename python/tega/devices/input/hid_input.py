"""Read input devices through hidapi in a thread that drains them: the newest state, presses, loss and return."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Iterator, Mapping, Sequence, Set
from itertools import count
from typing import Annotated, Any, ClassVar

import msgspec

from tega.devices.base import DeviceInfo, Found, InputEvent, InputReading, Kind, Options
from tega.devices.drained import Drained
from tega.devices.machine import hid_module, open_hid
from tega.errors import DeviceUnavailableError

AT_REST = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
"""The motion of a device that is not touched."""

# A device is looked at this often when it says nothing: a tenth of the watchdogs that hang on it.
_POLL_MS = 10
_REPORT_BYTES = 64
_MOST_EVENTS = 1024


class Debounce:
    """Follows the contacts of some buttons; time is an argument.

    A dead-man switch must release at the first sign of a release, so a release counts at once and a bouncing
    contact counts as released. A press counts once the contact has held for ``hold_ns`` (0 takes every
    press), with the time of its first contact. Together they give one press for one step on a pedal with
    shorter bounces. Events are numbered from 0.
    """

    def __init__(self, hold_ns: int) -> None:
        self._hold_ns = hold_ns
        self._since: dict[str, int] = {}
        self._numbers = count()
        self.held: frozenset[str] = frozenset()

    def take(self, t_ns: int, down: Set[str]) -> Iterator[InputEvent]:
        """Process a report; yield the events that have become certain, in time order."""
        yield from self.settle(t_ns)
        for button in sorted(self._since.keys() - down):
            del self._since[button]
            if button in self.held:
                self.held -= {button}
                yield InputEvent(t_ns, next(self._numbers), button, pressed=False)
        for button in sorted(down - self._since.keys()):
            self._since[button] = t_ns
        yield from self.settle(t_ns)

    def settle(self, t_ns: int) -> Iterator[InputEvent]:
        """Let time pass; yield the presses that have held long enough."""
        for button, since_ns in sorted(self._since.items()):
            if button not in self.held and t_ns - since_ns >= self._hold_ns:
                self.held |= {button}
                yield InputEvent(since_ns, next(self._numbers), button, pressed=True)


class HidInputOptions(Options, frozen=True, kw_only=True):
    """Settings that all input devices on USB have.

    Attributes:
        vendor_id: USB vendor number; none means those that are known.
        product_id: USB product number; none means those that are known.
        serial: Serial number; empty for the first one found.
        silent_after_ms: While a button is held, after this long without a report it counts as released and the state
            is "no data", until it is let go. Required for a dead-man. Use about 100 for a device that repeats its
            report while held. With a device that reports only changes, the button has to be pressed again at least
            this often. None: never.
    """

    vendor_id: Annotated[int, msgspec.Meta(ge=0, le=0xFFFF)] | None = None
    product_id: Annotated[int, msgspec.Meta(ge=0, le=0xFFFF)] | None = None
    serial: str = ""
    silent_after_ms: Annotated[float, msgspec.Meta(ge=20, le=10_000)] | None = None


class InputCounts(msgspec.Struct, kw_only=True):
    """Counts of the reports of an input device.

    ``odd`` ones have a wrong length, an unknown kind or impossible values and are not used. ``stalled``
    counts the times it fell silent in the middle of a motion or a press, ``lost`` those it went away.
    """

    reports: int = 0
    odd: int = 0
    stalled: int = 0
    lost: int = 0


class HidInput(Drained):
    """An input device on USB; a driver adds its identity, its reports, and the meaning of silence.

    A thread takes every report as it comes, so that none waits and the state is always the newest. A device
    that goes away is at rest, with nothing held, from that moment on, and is looked for again after 0.25 s
    and then at most every 2 s. ``known``: devices that are found unnamed, by vendor and product number.
    """

    kind: ClassVar[Kind] = "input"
    extra: ClassVar[str] = "lab"
    requires: ClassVar[tuple[str, ...]] = ("hid",)
    name: ClassVar[str]
    known: ClassVar[Mapping[tuple[int, int], str]]

    def __init__(self, options: HidInputOptions, *, hold_ms: float = 0.0) -> None:
        super().__init__()
        self._options = options
        self._hold_ns = round(hold_ms * 1e6)
        self._lock = threading.Lock()
        self._found_as = ""
        self._there = False
        self._is_stalled = False
        self._received_ns = 0
        self._buttons = Debounce(self._hold_ns)
        self._events: deque[InputEvent] = deque(maxlen=_MOST_EVENTS)
        self.counts = InputCounts()

    # What a driver adds. All but the first two are called with the lock held, time in monotonic nanoseconds.

    def _fits(self, numbers: tuple[int, int]) -> bool:
        """Return whether a device is wanted, by its vendor and product number."""
        raise NotImplementedError

    def _usages(self) -> Sequence[tuple[int, int]]:
        """Return usage page and usage of the interfaces to prefer: a device may have several."""
        raise NotImplementedError

    def _absence(self, found: Sequence[Mapping[str, Any]]) -> DeviceUnavailableError:
        """Return the error where none of those that are there will do."""
        raise NotImplementedError

    def _take(self, report: bytes, t_ns: int) -> bool:
        """Take a report; return whether it was understood."""
        raise NotImplementedError

    def _pass_time(self, t_ns: int) -> None:
        """Release a button that is held in silence: a held pedal and a frozen pedal send the same."""
        limit_ms = self._options.silent_after_ms
        if limit_ms is None or self._is_stalled or not self._buttons.held:
            return
        if t_ns - self._received_ns > limit_ms * 1e6:
            self._stall(t_ns)

    def _press(self, down: set[str], t_ns: int) -> None:
        """Take the buttons that are down; what was held through a silence has to be let go before it counts again."""
        if not (self._is_stalled and down):
            self._is_stalled = False
            self._events.extend(self._buttons.take(t_ns, down))

    def _come_to_rest(self) -> None:
        """Forget every motion."""

    def _motion(self) -> tuple[float, float, float, float, float, float]:
        """Return the motion asked for."""
        return AT_REST

    def _own_notes(self) -> tuple[str, ...]:
        """Return further notes that a reader of the results must know."""
        return ()

    # What is the same in all of them.

    @classmethod
    def discover(cls, timeout_s: float) -> list[Found]:  # noqa: ARG003  # the system knows at once
        """List the known devices that are there, each once whatever number of interfaces it has."""
        there = {
            (d["vendor_id"], d["product_id"], d["serial_number"]) for d in hid_module(cls.name).enumerate()
        }
        return [
            Found(
                driver=cls.name,
                label=f"{cls.known[vendor, product]} {serial}".strip(),
                options={"vendor_id": vendor, "product_id": product} | ({"serial": serial} if serial else {}),
            )
            for vendor, product, serial in sorted(there)
            if (vendor, product) in cls.known
        ]

    @property
    def info(self) -> DeviceInfo:
        """Description of the device, and problems so far."""
        counts, notes = self.counts, []
        if counts.odd:
            notes.append(f"{counts.odd} of {counts.reports} reports could not be read and were not used")
        if counts.stalled:
            notes.append(f"it fell silent in the middle of a motion or a press {counts.stalled} times")
        if counts.lost:
            notes.append(f"it was lost {counts.lost} times{self._trouble}")
        return DeviceInfo(
            driver=self.name,
            kind="input",
            label=self._options.serial or self._found_as or self.name,
            live=True,
            unit="share of full deflection",
            notes=(*notes, *self._own_notes()),
        )

    def state(self) -> InputReading:
        """Return the device's state now."""
        self._require_open()
        with self._lock:
            live = self._there and not self._is_stalled
            return InputReading(
                self._received_ns,
                live,
                self._motion() if live else AT_REST,
                self._buttons.held if live else frozenset(),
            )

    def events(self) -> Sequence[InputEvent]:
        """Return the buttons' events since the last call, oldest first."""
        self._require_open()
        with self._lock:
            events = tuple(self._events)
            self._events.clear()
        return events

    def open(self) -> None:
        """Find the device, open it and begin to read."""
        self.close()
        self.counts, self._trouble = InputCounts(), ""
        self._events.clear()
        self._buttons = Debounce(self._hold_ns)
        self._begin(self._connect(), self.name)

    def _require_open(self) -> None:
        if self._thread is None:
            raise DeviceUnavailableError(f"{self.name} is not open", "open it first")

    def _stall(self, t_ns: int) -> None:
        """Note that it stands still in the middle of something; with the lock held."""
        self._is_stalled = True
        self.counts.stalled += 1
        self._release(t_ns)

    def _release(self, t_ns: int) -> None:
        """Let go of every button and forget every motion; with the lock held."""
        self._come_to_rest()
        self._events.extend(self._buttons.take(t_ns, frozenset()))

    def _connect(self) -> Any:
        o = self._options
        there = [d for d in hid_module(self.name).enumerate() if o.serial in {"", d["serial_number"]}]
        fitting = [d for d in there if self._fits((d["vendor_id"], d["product_id"]))]
        if not fitting:
            raise self._absence(there)
        which = min(fitting, key=lambda d: (d.get("usage_page"), d.get("usage")) not in self._usages())
        numbers = which["vendor_id"], which["product_id"]
        self._found_as = self.known.get(numbers, "{:04x}:{:04x}".format(*numbers))
        device = open_hid(self.name, which, f"{self.name}: {self._found_as}")
        with self._lock:
            self._there, self._is_stalled, self._received_ns = True, False, time.monotonic_ns()
        return device

    def _disconnect(self, device: Any) -> None:
        """Let go of everything that was held: nobody follows the device from here on, for whatever reason."""
        with self._lock:
            self.counts.lost += not self._leaving.is_set()
            self._there = False
            self._release(time.monotonic_ns())
        device.close()

    def _drain(self, device: Any) -> bool:
        self._trouble = ""
        while not self._leaving.is_set():
            try:
                report = bytes(device.read(_REPORT_BYTES, _POLL_MS))
            except (OSError, ValueError):
                break
            t_ns = time.monotonic_ns()
            with self._lock:
                if report:
                    self.counts.reports += 1
                    if self._take(report, t_ns):
                        self._received_ns = t_ns
                    else:
                        self.counts.odd += 1
                self._pass_time(t_ns)
                self._events.extend(self._buttons.settle(t_ns))
        return True
