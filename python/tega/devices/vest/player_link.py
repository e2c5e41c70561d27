"""Connect to the bHaptics Player's websocket, send frames and receive the vest's status."""

from __future__ import annotations

import asyncio
import contextlib
import ctypes
import socket
import sys
import time
from collections import deque
from collections.abc import Coroutine
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from tega.devices.vest.player_versions import (
    KEY_HINT,
    PlayerOptions,
    PlayerVersion,
    received,
    versions_to_ask,
)
from tega.devices.vest.vest_link import VestLink
from tega.errors import DeviceUnavailableError
from tega.runtime.lifecycle import require

_DRIVER: Final = "bhaptics-player"
_GRACE_S = 2.0  # a Player that has just been asked may take this long to say which devices it has
_OPENING: Final = 0.6  # of what opening may take, that making the connection may take
_IN_FLIGHT: Final = 2  # frames that a slow Player may not have read yet
_PROMPT_S: Final = 0.02  # one that answers within this is not slow: its own clips have 50 frames a second
_MOST_IN_FLIGHT: Final = 8  # frames that it may not have read either
_BLIND_S = 0.04  # between frames for a Player that does not say whether it has read them
_CALL_S: Final = 1.5  # no frame may take longer to leave
_MOST_HEARD: Final = 64  # messages taken in at once, whatever else is waiting
_PROBE_S = 4.0  # its status is not sent regularly


def _system_send() -> Any:
    """Return the C library's ``send``, called with the interpreter lock held; ``None`` where there is none."""
    if sys.platform == "win32":
        return None
    send = ctypes.PyDLL(None).send
    send.argtypes = (ctypes.c_int, ctypes.c_char_p, ctypes.c_size_t, ctypes.c_int)
    send.restype = ctypes.c_ssize_t
    return send


_SEND: Final = _system_send()
_NO_SIGNAL: Final = getattr(socket, "MSG_NOSIGNAL", 0)


class PlayerLink(VestLink):
    """Connects to the Player; one thread reads and writes in turns.

    TLS of Python before 3.13 may be used by one thread at a time; websockets' threaded client reads in one
    and writes in another, which left one opening in some hundred without an answer.
    """

    def __init__(self, options: PlayerOptions) -> None:
        self._options = options
        self._where = f"Player at {options.host}:{options.port}"
        self._spoken: PlayerVersion | None = None
        self._runner: asyncio.Runner | None = None
        self._ws: Any = None
        self._broken: tuple[type[Exception], ...] = (OSError,)
        self._pongs: deque[tuple[asyncio.Future[float], float]] = deque()
        self._acknowledges = True
        self._n_unasked = 0
        self._garbage = 0
        self._probed_s = self._text_s = 0.0
        self._passed_over = ""

    @property
    def present(self) -> bool:
        """Whether the Player reports a connected vest, or has reported nothing."""
        return self._spoken is not None and self._spoken.has_vest is not False

    @property
    def battery_percent(self) -> int | None:
        """The battery, 0 to 100; ``None`` where the Player does not report it."""
        return None if self._spoken is None else self._spoken.battery_percent

    @property
    def condition(self) -> str:
        """The vest's status as the Player reports it, and the Player's version."""
        spoken = self._spoken
        if spoken is None:
            return ""
        link = {None: "connection unknown", True: "connected", False: "not connected"}[spoken.has_vest]
        return f"{spoken.vest_name or 'vest'} {link}, Player version {spoken.number}"

    @property
    def notes(self) -> tuple[str, ...]:
        """Problems, one note each."""
        notes = []
        has_vest = None if self._spoken is None else self._spoken.has_vest
        if self._passed_over:
            notes.append(f"version 2 is used, since version 3 did not answer: {self._passed_over}")
        if has_vest is None and self._ws is not None:
            notes.append(f"the {self._where} did not say whether a vest is connected")
        if has_vest is False:
            notes.append(f"the {self._where} has no vest connected")
        if not self._acknowledges:
            notes.append(f"the {self._where} answers no pings: frames may queue up on the way")
        if self._garbage:
            notes.append(f"{self._garbage} messages of the {self._where} could not be read and were ignored")
        return tuple(notes)

    def connect(self) -> None:
        """Open a version of the websocket that the Player supports; see :class:`VestLink`."""
        requested = versions_to_ask(self._options)
        for version in requested:
            try:
                self._connect(version, share=_OPENING / len(requested))
                break
            except DeviceUnavailableError as error:
                if version is requested[-1]:
                    if self._passed_over:
                        raise DeviceUnavailableError(
                            f"{error.message}; version 3: {self._passed_over}", error.hint
                        ) from error
                    raise
                self.close()
                self._passed_over = error.message
        if self._options.require_vest and not self.present:
            raise DeviceUnavailableError(
                f"the {self._where} has no vest connected",
                "pair it in the Player and look for its battery level there; require_vest = false opens without a vest",
            )

    def _connect(self, version: PlayerVersion, share: float) -> None:
        o = self._options
        client = require("websockets.asyncio.client", driver=_DRIVER, extra="lab")
        exceptions = require("websockets.exceptions", driver=_DRIVER, extra="lab")
        self._broken = (OSError, exceptions.WebSocketException)
        self._where = f"Player at {o.host}:{o.port_v3 if version.number == 3 else o.port}"
        self._spoken = version
        self._runner = asyncio.Runner()
        open_s = o.open_timeout_s * share

        async def opened() -> Any:
            connection = client.connect(
                version.url(o.host),
                ssl=version.tls,
                compression=None,
                proxy=None,
                open_timeout=open_s,
                close_timeout=0.3,
                ping_interval=None,
                create_connection=_held_back(client.ClientConnection),
            )
            connection.process_redirect = lambda error: error  # the key is for this address alone
            return await connection

        try:
            self._ws = self._run(opened(), open_s + _CALL_S)
        except exceptions.InvalidStatus as error:
            raise DeviceUnavailableError(
                f"the {self._where} answers HTTP {error.response.status_code} instead of serving {version.path}",
                f"a Player may serve one version alone: {KEY_HINT}; an older Player and bhaptics-ble need none",
            ) from error
        except (ValueError, exceptions.InvalidURI) as error:  # of the address, before anything was sent
            # The error of the whole address holds the key: neither its text nor the error itself goes on.
            why = error.msg if isinstance(error, exceptions.InvalidURI) else str(error)
            raise DeviceUnavailableError(
                f"the host {o.host!r} is no address: {why}",
                "set vest.options host to a name or an IP address",
            ) from None
        except self._broken as error:
            raise DeviceUnavailableError(
                f"the {self._where} cannot be reached: {str(error) or type(error).__name__}",
                "start the bHaptics Player there; from another machine its firewall has to let the port through",
            ) from error
        self._probed_s = time.monotonic()
        for message in version.hello():
            self._say(message)
        pong = self._ping()
        deadline = time.monotonic() + _GRACE_S
        while time.monotonic() < deadline and (version.has_vest is None or not pong.done()):
            self._receive(0.05)
        self._acknowledges = pong.done()
        if not version.admitted:
            raise DeviceUnavailableError(
                f"the {self._where} has not let this program in within {_GRACE_S:g} s",
                "are app_id and the key those of one app at the vendor's portal? The Player asks there: is it online?",
            )

    def ready(self, timeout_s: float) -> bool:
        """Wait until the Player has read the frames before, so that none queues up."""
        if not self._acknowledges:
            rest_s = max(0.0, self._text_s + _BLIND_S - time.monotonic())
            time.sleep(min(timeout_s, rest_s))
            return rest_s <= timeout_s
        if timeout_s == 0 and self._n_unasked >= _IN_FLIGHT:  # asking takes a while
            return False
        pongs = self._pongs
        if len(pongs) < _IN_FLIGHT:  # a frame has not to wait for a look at what has come
            return True
        self._run(asyncio.sleep(0))  # takes in what has come
        self._forget_answered()
        if len(pongs) < _IN_FLIGHT:
            return True
        if len(pongs) < _MOST_IN_FLIGHT and time.monotonic() - pongs[0][1] < _PROMPT_S:
            return True
        waited = pongs[-_IN_FLIGHT][0]
        self._run(asyncio.wait({waited}, timeout=timeout_s), timeout_s + _CALL_S)
        return waited.done()

    def _forget_answered(self) -> None:
        pongs = self._pongs
        while pongs and pongs[0][0].done():
            pongs.popleft()

    def send(self, intensities: NDArray[np.uint8]) -> None:
        """Send a frame, (40,) intensities, percent."""
        for message in self._version.frame(intensities):
            self._say(message)
        self._text_s = time.monotonic()
        self._n_unasked += self._acknowledges

    def poll(self) -> None:
        """Ask whether the last frame was read, and process the Player's messages."""
        if self._n_unasked:
            self._n_unasked = 0
            self._pongs.append((self._ping(), time.monotonic()))
        if time.monotonic() - self._probed_s > _PROBE_S and (probe := self._version.probe()):
            self._probed_s = time.monotonic()
            self._say(probe)
        self._receive(0.0)
        self._forget_answered()

    def close(self) -> None:
        """End what is played, and disconnect."""
        with contextlib.ExitStack() as steps:  # each is taken, whatever comes of those before it
            if (runner := self._runner) is not None:
                steps.callback(self._forget, runner)
            if (ws := self._ws) is not None:
                steps.push(lambda kind, *_: kind is not None and issubclass(kind, self._broken))
                steps.callback(lambda: self._run(ws.close()))
                if self.ready(0.1):
                    self._run(ws.send(self._version.stop()))

    def _forget(self, runner: asyncio.Runner) -> None:
        if self._ws is not None:
            self._ws.transport.abort()  # one that takes nothing is not closed by words
        self._ws = self._runner = None
        runner.close()

    def abort(self) -> None:
        """Break the connection off, from any thread."""
        ws = self._ws
        if ws is not None:
            with contextlib.suppress(RuntimeError):  # it has just been closed
                ws.loop.call_soon_threadsafe(ws.transport.abort)

    @property
    def _version(self) -> PlayerVersion:
        if self._spoken is None:
            raise DeviceUnavailableError(f"the {self._where} is not connected")
        return self._spoken

    def _run(self, work: Coroutine[Any, Any, Any], timeout_s: float = _CALL_S) -> Any:
        if self._runner is None:
            work.close()
            raise DeviceUnavailableError(f"the {self._where} is not connected")
        # Not `Runner.run`, which takes three times as long for what ends at once.
        return self._runner.get_loop().run_until_complete(_within(work, timeout_s))

    def _call(self, work: Coroutine[Any, Any, Any]) -> Any:
        try:
            return self._run(work)
        except self._broken as error:
            why = "it takes nothing any more" if isinstance(error, TimeoutError) else str(error)
            raise DeviceUnavailableError(f"the {self._where} ended the connection: {why}") from error

    def _say(self, message: str) -> None:
        ws = self._ws
        if ws is None:
            raise DeviceUnavailableError(f"the {self._where} is not connected")
        if ws.protocol.state.name == "OPEN" and not ws.transport.get_write_buffer_size():
            # Past the loop, each turn of which gives the interpreter lock away; what is lost now is seen at the next.
            ws.protocol.send_text(message.encode())
            for part in ws.protocol.data_to_send():
                ws.transport.write(part[self._written(part) :])
        else:
            self._call(ws.send(message))

    def _written(self, part: bytes) -> int:
        """Give bytes to the system without releasing the interpreter lock; return how many it took.

        The socket does not block. A call that releases the lock, as Python's sockets do, may get it back half
        a millisecond later.
        """
        if _SEND is None or not part or self._version.tls is not None:
            return 0
        socket_fd = self._ws.transport.get_extra_info("socket").fileno()
        taken: int = _SEND(socket_fd, part, len(part), _NO_SIGNAL)
        return max(taken, 0)  # what it did not take, or why, the transport finds out

    def _ping(self) -> asyncio.Future[float]:
        pong: asyncio.Future[float] = self._call(self._ws.ping())
        return pong

    def _receive(self, timeout_s: float) -> None:
        """Read the messages that have come; waits for the first one only."""
        for message in self._call(_come(self._ws, timeout_s)):
            self._garbage += not received(self._version, message)


def _held_back(connection: Any) -> Any:
    """Return a type of connection that reads nothing while the other end takes nothing.

    Pings are answered at once; those of a Player that floods and reads no answer would pile up.
    """

    class HeldBack(connection):  # type: ignore[misc]
        def pause_writing(self) -> None:
            super().pause_writing()
            self.transport.pause_reading()

        def resume_writing(self) -> None:
            super().resume_writing()
            if not getattr(self.recv_messages, "paused", False):
                self.transport.resume_reading()

    return HeldBack


async def _within(work: Coroutine[Any, Any, Any], timeout_s: float) -> Any:
    async with asyncio.timeout(timeout_s):
        return await work


async def _come(ws: Any, timeout_s: float) -> list[str | bytes]:
    await asyncio.sleep(0)
    found: list[str | bytes] = []
    with contextlib.suppress(TimeoutError):
        while len(found) < _MOST_HEARD:
            async with asyncio.timeout(0.0 if found else timeout_s):
                found.append(await ws.recv())
    return found
