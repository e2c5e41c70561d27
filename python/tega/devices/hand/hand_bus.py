"""Read and write a hand's CAN bus through python-can, frame by frame, and reopen it if it goes away."""

from __future__ import annotations

import contextlib
import sys
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from tega.devices.hand.can_open import open_can_bus, slcan_bus
from tega.errors import DeviceUnavailableError
from tega.hand.link import Received
from tega.runtime.lifecycle import require
from tega.runtime.reopening import Reopening
from tega.wire import (
    AllegroInfo,
    CanFrame,
    allegro_decode,
    allegro_limp_frames,
    allegro_request_info,
    allegro_set_period,
)

# Waiting for a frame ends this soon, so that silence is noticed in time.
_WAIT_S = 0.002
_ASK_S = 0.05
SEND_S = 0.01
"""A frame that waits for so long is dropped: three periods of the hand, after which its torque is out of date."""

_REOPEN_S = 1.0
_MOST_FRAMES = 64
_MOST_DRAINED = 64
# Buses that give their own frames back, which are then no other program's; python-can cannot distinguish them.
_ECHOING = frozenset({"udp_multicast"})
_MOST_ECHOES = 64


def bus_label(interface: str, channel: str | int) -> str:
    """Return adapter and bus, without a path."""
    return f"{interface} {Path(str(channel)).name}"


def load_can() -> None:
    """Load python-can without ``asammdf``, for a program of its own that has no time for pandas.

    python-can imports ``asammdf`` for MF4 logs wherever it is installed; that takes ten times as long as all
    the rest.
    """
    sys.modules.setdefault("asammdf", None)  # type: ignore[arg-type]  # an import of it then fails, which is allowed for
    with contextlib.suppress(ImportError):  # opening the bus says what is missing
        import can  # noqa: F401


def off_frames(device_id: int) -> list[CanFrame]:
    """Return the frames that leave a hand without force and silent: zero torque, SERVO OFF and no more reports."""
    return [*allegro_limp_frames(device_id=device_id), allegro_set_period(0, device_id=device_id)]


class HandBus:
    """A bus on any adapter that python-can knows, of the arguments of ``can.Bus``; one thread at a time uses it.

    ``driver`` is named in messages. Without ``exclusive`` a serial adapter opens although another program has it.
    ``trouble`` is why the adapter went away, to be put behind a message; ``""`` while
    it is there. ``n_garbled`` counts pieces of the adapter's stream that were no frame, ``n_unsent`` frames the adapter
    did not take, and ``unsent`` is why it did not take the last of them.
    """

    def __init__(
        self, settings: Mapping[str, Any], driver: str = "allegro", *, exclusive: bool = True
    ) -> None:
        self.settings, self._driver, self._exclusive = dict(settings), driver, exclusive
        self.trouble = self.unsent = ""
        self.n_garbled = self.n_unsent = 0
        self._can: Any = None
        self._bus: Any = None
        self._terminal = self._terminal_now()
        self._again = Reopening(_REOPEN_S, _REOPEN_S)
        self._echoes: deque[tuple[int, bytes, bool]] = deque(maxlen=_MOST_ECHOES)

    @property
    def replaced(self) -> bool:
        """Whether the name of an emulated adapter's terminal belongs to another one now, perhaps another hand's."""
        return self._terminal is not None and self._terminal_now() != self._terminal

    def load(self) -> None:
        """Load python-can, which takes its time."""
        self._can = require("can", driver=self._driver, extra="lab")

    def open(self) -> None:
        """Open the bus; ``DeviceUnavailableError`` where the adapter is not there, or refuses."""
        self.load()
        self._bus, self.trouble = self._opened(), ""

    def drop(self) -> None:
        """Close the bus, whatever state it is in."""
        bus, self._bus = self._bus, None
        if bus is not None:
            with contextlib.suppress(Exception):  # adapters raise what they like
                bus.shutdown()

    def receive(self, *, may_reopen: bool) -> list[Received]:
        """Return the frames that have come, after 2 ms at most.

        ``may_reopen``: a bus that went away is opened again, tried once a second.
        """
        frames: list[Received] = []
        if self._bus is None and not (may_reopen and self._reopened()):
            time.sleep(_WAIT_S)
            return frames
        wait_s = _WAIT_S
        # Garbled ones count too: an adapter that pours out noise must not hold up the loop.
        for _ in range(_MOST_FRAMES):
            try:
                message = self._bus.recv(timeout=wait_s)
            except (ValueError, IndexError):
                self.n_garbled += 1
                continue
            except Exception as error:  # as above
                self.trouble = f" (the adapter failed: {error})"
                self.drop()
                break
            if message is None:
                break
            if self._echoes and self._is_echo(message):
                continue
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

    def drain(self) -> None:
        """Discard the frames that wait in the adapter."""
        for _ in range(_MOST_DRAINED):
            if len(self.receive(may_reopen=False)) < _MOST_FRAMES:
                return

    def send(
        self, frames: Sequence[CanFrame], *, outdated: Callable[[], bool] | None = None
    ) -> list[CanFrame]:
        """Send frames in order and return those that the adapter took.

        ``outdated`` is called right before each; once it returns true, the remaining ones are skipped.
        """
        sent: list[CanFrame] = []
        together = hasattr(self._bus, "send_together")
        for part in [frames] if together else [[frame] for frame in frames]:
            if self._bus is None or (outdated is not None and outdated()):
                break
            # Classic CAN, identifiers of 11 bits.
            kind = {"is_extended_id": False, "is_fd": False}
            messages = [
                self._can.Message(arbitration_id=f.id, data=f.data, is_remote_frame=f.remote, **kind)
                for f in part
            ]
            try:
                if together:
                    self._bus.send_together(messages, timeout=SEND_S)
                else:
                    self._bus.send(messages[0], timeout=SEND_S)
                sent += part
                if self.settings["interface"] in _ECHOING:
                    self._echoes += [(frame.id, bytes(frame.data), frame.remote) for frame in part]
            except Exception as error:  # as above
                self.n_unsent += len(part)
                self.unsent = str(error)
        return sent

    def switch_off(self, frames: Sequence[CanFrame], *, device_id: int, patience_s: float) -> bool:
        """Command a hand to release until it confirms that its motors are off; return whether it did.

        A hand does not report its torques. The query is sent behind the frames that remove them, and a bus
        delivers frames in order: an answer with SERVO OFF confirms both.
        """
        question = allegro_request_info(device_id=device_id)
        until_s, ask_s = time.monotonic() + patience_s, 0.0
        while (now_s := time.monotonic()) < until_s:
            if now_s >= ask_s and self._bus is not None:
                ask_s = now_s + _ASK_S
                self.send([*frames, question])
            for got in self.receive(may_reopen=True):
                report = allegro_decode(
                    CanFrame(got.id, bytes(got.data), got.remote),
                    device_id=device_id,
                    extended=got.extended,
                    error=got.error,
                )
                if ask_s and isinstance(report, AllegroInfo) and not report.servo_on:
                    return True
        return False

    def _is_echo(self, message: Any) -> bool:
        """Whether a message is one of the frames sent, given back by the bus; each is given back once."""
        try:
            self._echoes.remove((message.arbitration_id, bytes(message.data), message.is_remote_frame))
        except ValueError:
            return False
        return True

    def _reopened(self) -> bool:
        """Open the adapter again, at most once a second; return whether it is open.

        Reopening alone moves nothing. The hand's link identifies the hand before it sends torque, and sends
        none after a fault until a person has the hand reopened: a bus that comes back by itself must not make
        the hand grip a person.
        """
        if not self._again.due() or self.replaced:
            return False
        with contextlib.suppress(DeviceUnavailableError):
            self._bus, self.trouble = self._opened(), ""
        return self._bus is not None

    def _terminal_now(self) -> tuple[int, int] | None:
        channel = str(self.settings["channel"])
        if not channel.startswith("/dev/pts/"):
            return None
        with contextlib.suppress(OSError):
            seen = Path(channel).stat()
            return seen.st_ino, seen.st_ctime_ns
        return None

    def _opened(self) -> Any:
        settings = dict(self.settings)
        interface, channel = settings.pop("interface"), settings.pop("channel")

        def make() -> Any:
            bus = (
                slcan_bus(exclusive=self._exclusive)
                if interface == "slcan"
                else partial(self._can.Bus, interface=interface)
            )
            return bus(channel=channel, **settings)

        return open_can_bus(self._driver, interface, make, can=self._can, channel=channel)
