"""What each live vest driver does when something breaks, and in what time: ``python -m tega.testing.vest_faults``.

Every fault of every emulated vest is switched on while a touch is written 30 times a second, left on for three seconds
(a broken connection is broken once), and switched off; from then on another touch is written. The times come from the
emulated motors' own record. Needs Linux, for the emulators.
"""

from __future__ import annotations

import os
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from typing import Any, NamedTuple

from tega.devices import driver_class
from tega.devices.vest_stream import StreamedVest
from tega.haptics import VestFrame, vest_frame
from tega.testing.emulators.hid_port import HidPort
from tega.testing.emulators.vests import EmulatedVest
from tega.wire import vest_levels

__all__ = ["DRIVERS", "FAULT_S", "FaultRow", "VestBench", "fault_rows", "vest_bench"]

DRIVERS = {
    "bhaptics-player": ("no writes", "drop", "close", "freeze", "slow", "garbage", "no-vest", "refuse"),
    "bhaptics-ble": ("no writes", "drop", "freeze", "slow", "off"),
    "hid-vest": ("no writes", "close", "freeze", "slow", "garbage", "wrong-version", "no-vest"),
}
"""The faults of each driver; ``no writes`` is the caller's own."""

_BUS = "DBUS_SYSTEM_BUS_ADDRESS"
FAULT_S = 3.0
_RECOVERY_S = 15.0
_AT_ONCE = {("bhaptics-player", "drop"), ("bhaptics-player", "close"), ("bhaptics-ble", "drop")}
_TOUCH = vest_frame([80, 60, 40, 20], [13, 0, 100, 53], layout="x40")
_AFTERWARDS = vest_frame([20, 40, 60, 80], [53, 100, 0, 13], layout="x40")


class FaultRow(NamedTuple):
    """What one fault did.

    Attributes:
        driver: Whose.
        fault: Which.
        silent_s: From the fault to motors at rest; ``None`` if they were not before the touch was back.
        lost: How often the driver gave a link up.
        recovered_s: From the fault's end to the new touch on the motors; ``None`` if it never came.
        write_ms: The longest call of ``write`` meanwhile.
    """

    driver: str
    fault: str
    silent_s: float | None
    lost: int
    recovered_s: float | None
    write_ms: float


class VestBench(NamedTuple):
    """A live vest driver that is not open yet, and the emulator at its other end.

    Attributes:
        vest: The driver.
        peer: The emulator.
        port: What stands for hidapi, where the driver uses it.
    """

    vest: StreamedVest
    peer: EmulatedVest
    port: HidPort | None


@contextmanager
def vest_bench(driver: str, **options: Any) -> Iterator[VestBench]:
    """Start the emulated vest of a driver and make a driver that reaches it.

    Args:
        driver: One of :data:`DRIVERS`.
        options: The driver's options, beside those that lead to the emulator.

    Yields:
        Both.
    """
    port = None
    with ExitStack() as stack:
        if driver == "bhaptics-player":
            peer = stack.enter_context(EmulatedVest("bhaptics_player"))
            options = {"port": peer.address["port"], **options}
        elif driver == "hid-vest":
            folder = stack.enter_context(tempfile.TemporaryDirectory())
            peer = stack.enter_context(EmulatedVest("hid_bridge", (folder,)))
            port = HidPort(peer.address["path"])
            stack.enter_context(port.installed())
        else:
            peer = stack.enter_context(EmulatedVest("bluez_vest"))
            stack.enter_context(_system_bus(peer.address["bus"]))
            options = {"scan_s": 1.0, **options}
        make: Any = driver_class(driver, "vest")
        yield VestBench(make(make.options_type(**options)), peer, port)


@contextmanager
def _system_bus(address: str) -> Iterator[None]:
    before = os.environ.get(_BUS)
    os.environ[_BUS] = address
    try:
        yield
    finally:
        os.environ.pop(_BUS)
        if before is not None:
            os.environ[_BUS] = before


class _Writer(threading.Thread):
    """Writes the touch 30 times a second, as the loop does."""

    def __init__(self, vest: StreamedVest) -> None:
        super().__init__()
        self._vest = vest
        self.frame = _TOUCH
        self.paused = False
        self.stopped = False
        self.longest_s = 0.0

    def run(self) -> None:
        while not self.stopped:
            if not self.paused:
                before = time.perf_counter()
                self._vest.write(0, self.frame)
                self.longest_s = max(self.longest_s, time.perf_counter() - before)
            time.sleep(1 / 30)


def _row(driver: str, fault: str, vest: StreamedVest, peer: EmulatedVest, fault_s: float) -> FaultRow:
    before, after = _shown(_TOUCH, peer), _shown(_AFTERWARDS, peer)
    writer = _Writer(vest)
    writer.start()
    try:
        _until(lambda: peer.report().motors == before)
        writer.longest_s, begun_s = 0.0, time.monotonic()
        if fault == "no writes":
            writer.paused = True
        else:
            peer.fault(fault)
        if (driver, fault) not in _AT_ONCE:
            time.sleep(fault_s)
        ended_s = time.monotonic()
        writer.frame, writer.paused = _AFTERWARDS, False
        peer.fault("")
        _until(lambda: peer.report().motors == after)
    finally:
        writer.stopped = True
        writer.join()
    history = peer.report().history
    silent = [t for t, motors in history if t >= begun_s and not any(motors)]
    back = [t for t, motors in history if t >= ended_s and motors == after]
    return FaultRow(
        driver,
        fault,
        silent[0] - begun_s if silent and (not back or silent[0] < back[0]) else None,
        vest.counters.lost,
        back[0] - ended_s if back else None,
        writer.longest_s * 1000,
    )


def _until(condition: Callable[[], bool]) -> None:
    given_up_s = time.monotonic() + _RECOVERY_S
    while not condition() and time.monotonic() < given_up_s:
        time.sleep(0.05)


def _shown(frame: VestFrame, peer: EmulatedVest) -> list[int]:
    """Return what a frame looks like on this peer's motors: the X40's know sixteen levels only."""
    if "bus" in peer.address:
        return [round(level * 100 / 15) for level in vest_levels(frame.x40()).tolist()]
    return [int(i) for i in frame.x40()]


def fault_rows(
    drivers: Mapping[str, Iterable[str]] = DRIVERS, *, fault_s: float = FAULT_S
) -> Iterator[FaultRow]:
    """Try faults of drivers, one after the other; all of them take about two minutes.

    Args:
        drivers: Which faults of which drivers.
        fault_s: How long a fault lasts that is not over at once.

    Yields:
        What each did.
    """
    for driver, faults in drivers.items():
        for fault in faults:
            with vest_bench(driver) as bench, bench.vest:
                yield _row(driver, fault, bench.vest, bench.peer, fault_s)


def _seconds(value: float | None, otherwise: str) -> str:
    return otherwise if value is None else f"{value:.2f} s"


def main() -> None:
    """Print the table."""
    out = sys.stdout
    out.write("| driver | fault | vest at rest after | links lost | touch back after | longest write |\n")
    out.write("|---|---|---|---|---|---|\n")
    for row in fault_rows():
        rest = _seconds(row.silent_s, "goes on")
        back = _seconds(row.recovered_s, "never")
        out.write(
            f"| `{row.driver}` | {row.fault} | {rest} | {row.lost} | {back} | {row.write_ms:.1f} ms |\n"
        )
        out.flush()


if __name__ == "__main__":
    main()
