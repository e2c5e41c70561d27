"""Track the forearm by a HoloLens 2 that runs the hl2ss app: the wrist of one hand, and nothing else of it."""

from __future__ import annotations

import socket
import struct
import time
from collections import deque
from collections.abc import Mapping
from typing import Annotated, ClassVar, Final, Literal

import msgspec

from tega.arm.pose import StampedPose
from tega.devices.base import DeviceInfo, Options
from tega.devices.tracker.tracker_thread import RESTART_NS, SILENT_S, DeviceClock, ThreadedTracker
from tega.errors import DeviceUnavailableError, WrongDeviceError
from tega.runtime.evidence import Evidence

# One packet of the spatial input: time, size and validity, head and eyes, 26 joints of each hand.
_PACKET_BYTES: Final = 1948
_PAYLOAD_BYTES: Final = 1936
_HEAD: Final = struct.Struct("<QII")
_WRIST: Final = struct.Struct("<4f3ffi")
_JOINT_BYTES: Final = 36
_FIRST_JOINT: Final = {"left": 76, "right": 1012}
_VALID: Final = {"left": 4, "right": 8}
# The wrist is the second of the joints. No other is ever taken out of a packet: where fingers are is not read.
_WRIST_NUMBER: Final = 1
_EXACT: Final = 0

_POLL_S: Final = 0.05
# The app sends so many packets a second; a stream well below it is another one, or a bad network.
_RATE_HZ: Final = 60.0
_LEAST_SHARE: Final = 0.8
_RATE_NS: Final = 2_000_000_000


class HoloLensOptions(Options, frozen=True, kw_only=True):
    """Settings of :class:`HoloLens`.

    Attributes:
        host: Address of the headset, as its settings or the hl2ss app show it.
        port: Port of the app's spatial input.
        hand: Hand of the tracked wrist.
        guessed: Whether a wrist counts that the headset only guesses ("approximate") since it does not see it.
        connect_s: How long to wait for the first packet.
        silent_s: A connection that is silent for this long is closed and reopened: on a wireless network the other
            end can vanish without notice.
    """

    host: str
    port: Annotated[int, msgspec.Meta(ge=1, le=65535)] = 3812
    hand: Literal["right", "left"] = "right"
    guessed: bool = False
    connect_s: Annotated[float, msgspec.Meta(gt=0, le=60)] = 3.0
    silent_s: Annotated[float, msgspec.Meta(ge=0.2, le=60)] = 1.0


class HoloLens(ThreadedTracker):
    """Reads the spatial input of the hl2ss app, port 3812, 60 packets a second, in a thread of its own.

    Poses are in the headset's axes (``openxr``: y up, -z forward), stamped by its clock converted to the
    host's (:class:`~tega.devices.tracker.tracker_thread.DeviceClock`), so that those which the network delayed have
    their true age. A wrist that is lost, or only guessed, gives an invalid pose. A pose identical to the last
    bit was not measured again, and is skipped. The origin is where the head was when the app began.
    """

    driver: ClassVar[str] = "hololens"
    summary: ClassVar[str] = "HoloLens 2 with the hl2ss app: a wrist, over TCP"
    options_type: ClassVar[type[Options]] = HoloLensOptions
    compared: ClassVar[Mapping[Evidence, str]] = {
        "banner": "packets have the size of spatial input",
        "stamp": "the headset's clock runs with the arrivals; after a leap no pose is used for 0.35 s",
        "rate": "at least 80 % of 60 packets a second come",
        "values": "a pose that repeats to the last bit is not used; a wrist is seen, not guessed",
    }

    def __init__(self, options: HoloLensOptions) -> None:
        super().__init__(f"{options.hand} wrist", _RATE_HZ)
        self._options = o = options
        self._offset = _FIRST_JOINT[o.hand] + _WRIST_NUMBER * _JOINT_BYTES
        self._bit = _VALID[o.hand]
        self._where = f"{o.host}:{o.port}"
        self._clock = DeviceClock()
        self._last: tuple[int, bytes] | None = None
        self._restart_until_ns = 0
        self._received_ns = 0
        self._arrivals_ns: deque[int] = deque(maxlen=1024)

    @property
    def info(self) -> DeviceInfo:
        """Description of the tracker."""
        c, notes = self.counts, []
        if c.connections > 1:
            notes.append(f"reconnected {c.connections - 1} times")
        if self._clock.n_leaps:
            notes.append(f"stamp: the headset's clock was set {self._clock.n_leaps} times")
        return self._describe(f"HoloLens at {self._where}", notes)

    @property
    def problem(self) -> str:
        """Trouble with the connection now, for the operator; ``""`` for none."""
        with self._lock:
            if self._trouble:
                return f"hololens: {self._trouble}"
            away_s = (time.monotonic_ns() - self._received_ns) / 1e9
            arrivals = self._arrivals_ns
            spans_s = (arrivals[-1] - arrivals[0]) / 1e9 if arrivals else 0.0
            rate_hz = (len(arrivals) - 1) / spans_s if spans_s * 1e9 > 0.75 * _RATE_NS else _RATE_HZ
        if not self._thread:
            return ""
        if away_s > SILENT_S:
            return f"hololens: no packet for {away_s:.1f} s"
        if rate_hz < _LEAST_SHARE * _RATE_HZ:
            return f"hololens: rate: {rate_hz:.0f} packets a second come, {_RATE_HZ:g} are expected"
        return ""

    def open(self) -> None:
        """Connect and wait for the first packet; ``WrongDeviceError`` if it is no spatial input."""
        if self._thread is not None:
            return
        self._forget()
        try:
            link = self._connect()
            try:
                first = self._first_packet(link)
            except BaseException:
                link.close()
                raise
        except OSError as error:
            raise DeviceUnavailableError(
                f"hololens: {self._where} cannot be reached: {error.strerror or error}",
                "is the hl2ss app running on the headset, and is this its address?",
            ) from error
        self._take(first, time.monotonic_ns())
        self._begin(link, "tega-hololens")

    def _connect(self) -> socket.socket:
        o = self._options
        link = socket.create_connection((o.host, o.port), timeout=o.connect_s)
        link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._clock.forget()
        self._arrivals_ns.clear()
        self._last = None
        self._restart_until_ns = 0
        return link

    def _first_packet(self, link: socket.socket) -> bytes:
        """Read one whole packet, so that a device that is none is refused when it is opened."""
        data, until_s = b"", time.monotonic() + self._options.connect_s
        while len(data) < _PACKET_BYTES:
            link.settimeout(max(until_s - time.monotonic(), 1e-3))
            try:
                more = link.recv(_PACKET_BYTES - len(data))
            except TimeoutError:
                raise OSError(
                    f"connected, but only {len(data)} of a packet's {_PACKET_BYTES} bytes came within "
                    f"{self._options.connect_s:g} s"
                ) from None
            if not more:
                raise OSError(f"it hung up after {len(data)} bytes")
            data += more
            if len(data) >= _HEAD.size and (text := self._foreign(data)):
                raise WrongDeviceError(
                    f"hololens: {self._where} answers, but {text}",
                    "3812 is the port of hl2ss's spatial input; is another program there?",
                )
        return data

    @staticmethod
    def _foreign(packet: bytes) -> str:
        size = _HEAD.unpack_from(packet)[1]
        return "" if size == _PAYLOAD_BYTES else f"a packet of {size} bytes is none of spatial input's 1936"

    def _refused(self, error: Exception) -> None:
        self._say(f"{self._where} cannot be reached: {getattr(error, 'strerror', None) or error}")

    def _drain(self, link: socket.socket) -> bool:
        before = self.counts.poses
        self._say(f"{self._receive(link)}, connecting again")
        # One that takes connections and says nothing is not asked ever faster.
        return self.counts.poses > before

    def _receive(self, link: socket.socket) -> str:
        """Read packets until disconnected or asked to stop; return the reason."""
        link.settimeout(_POLL_S)
        data, received_s = bytearray(), time.monotonic()
        while not self._leaving.is_set():
            try:
                more = link.recv(1 << 16)
            except TimeoutError:
                if time.monotonic() - received_s > self._options.silent_s:
                    self.counts.silent += 1
                    return f"nothing came for {self._options.silent_s:g} s"
                continue
            except OSError as error:
                self.counts.broken += bool(data)
                return f"the connection broke: {error.strerror or error}"
            if not more:
                self.counts.broken += bool(data)
                return "the headset hung up"
            received_s, arrival_ns = time.monotonic(), time.monotonic_ns()
            data += more
            while len(data) >= _PACKET_BYTES:
                packet = bytes(data[:_PACKET_BYTES])
                del data[:_PACKET_BYTES]
                if text := self._foreign(packet):
                    # Without a mark to look for, a stream that is out of step stays so.
                    self.counts.broken += 1
                    return text
                self._take(packet, arrival_ns)
        return "left"

    def _take(self, packet: bytes, arrival_ns: int) -> None:
        device_100ns, _, bits = _HEAD.unpack_from(packet)
        record = packet[self._offset : self._offset + _JOINT_BYTES]
        c, last = self.counts, self._last
        with self._lock:
            if not self._restart_until_ns:
                c.connections += 1
                self._restart_until_ns = arrival_ns + (RESTART_NS if c.connections > 1 else 0)
            self._received_ns, self._trouble = arrival_ns, ""
            self._arrivals_ns.append(arrival_ns)
            while arrival_ns - self._arrivals_ns[0] > _RATE_NS:
                self._arrivals_ns.popleft()
            c.poses += 1
            there = bool(bits & self._bit)
            if last is not None and (device_100ns == last[0] or (there and record == last[1])):
                c.repeated += 1
                return
            n_leaps = self._clock.n_leaps
            t_ns = self._clock.to_host_ns(100 * device_100ns, arrival_ns)
            if self._clock.n_leaps > n_leaps:
                self._restart_until_ns = arrival_ns + RESTART_NS
            # A wrist that is lost keeps its bytes; when it is back they may be the same and are new all the same.
            self._last = device_100ns, record if there else b""
            qx, qy, qz, qw, x, y, z, _radius, accuracy = _WRIST.unpack(record)
            exact = accuracy == _EXACT
            c.lost += not there
            c.guessed += there and not exact
            believed = there and (exact or self._options.guessed) and arrival_ns >= self._restart_until_ns
            self._poses.append(StampedPose(t_ns, (x, y, z), (qx, qy, qz, qw), valid=believed))
