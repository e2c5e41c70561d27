"""Drive a bHaptics vest through the vendor's Player, version 3 or 2 of its websocket."""

from __future__ import annotations

import contextlib
import socket
import threading
import time
from collections import deque
from typing import Any, ClassVar, Final

import numpy as np
from numpy.typing import NDArray

from tega.devices.base import Found, Options
from tega.devices.player_settings import KEY_HINT, PlayerOptions, versions_to_ask
from tega.devices.player_versions import PlayerVersion, heard
from tega.devices.vest_stream import StreamedVest, VestLink
from tega.errors import DeviceUnavailableError, InvalidValueError
from tega.haptics import MotorLevels
from tega.lifecycle import require
from tega.threads import promote

_GRACE_S = 2.0  # a Player that has just been asked may take this long to say which devices it has
_OPENING: Final = 0.6  # of what opening may take, that making the connection may take
_ON_THE_WAY: Final = 2  # frames that a slow Player may not have read yet
_PROMPT_S: Final = 0.02  # one that answers within this is not slow: its own clips have 50 frames a second
_MOST_ON_THE_WAY: Final = 8  # frames that it may not have read either
_BLIND_S = 0.04  # between frames for a Player that does not say whether it has read them
_PROBE_S = 4.0  # its status is not sent regularly
_ROW_FIVE: Final = 16  # the first motor of a panel's fifth row


class PlayerVest(StreamedVest):
    """Streams both panels; each frame takes the place of the one before and ends by itself after 200 ms.

    Every frame is followed by a websocket ping. Of a Player that has not answered one for 20 ms no more than two frames
    are on the way: the next one waits for an answer, and a newer one takes its place. A Player that answers no pings is
    fed 25 frames a second at most, and a note says so.
    """

    name: ClassVar[str] = "bhaptics-player"
    summary: ClassVar[str] = "bHaptics vest through the vendor's Player (websocket, version 3 or 2)"
    extra: ClassVar[str] = "lab"
    requires: ClassVar[tuple[str, ...]] = ("websockets",)
    options_type: ClassVar[type[Options]] = PlayerOptions

    def __init__(self, options: PlayerOptions) -> None:
        super().__init__(options)
        self._options = options

    @classmethod
    def discover(cls, timeout_s: float) -> list[Found]:
        """See whether something listens where a Player on this machine does."""
        here = PlayerOptions()
        if _listens(here.host, here.port, timeout_s):
            return [Found(driver=cls.name, label=f"Player at {here.host}:{here.port}")]
        if _listens(here.host, here.port_v3, timeout_s):
            return [
                Found(
                    driver=cls.name,
                    label=f"Player at {here.host}:{here.port_v3}",
                    problem="it serves version 3 alone, which wants a program's id and key",
                    hint=KEY_HINT,
                    may_open=False,
                )
            ]
        return []

    @property
    def _label(self) -> str:
        return f"{self._options.host}:{self._options.port}"

    def write(self, t_ns: int, frame: MotorLevels) -> MotorLevels:
        """Hand a frame over; returns at once.

        Returns:
            The frame within the limits; all zeros while the link is down or reports no vest.

        Raises:
            DeviceUnavailableError: The vest is not open.
            InvalidValueError: The layout has a fifth row and ``motor_values`` is 32.
        """
        if self._options.motor_values == 32 and np.any(frame.motors % 20 >= _ROW_FIVE):
            raise InvalidValueError(
                f"motor_values is 32, and the layout {frame.layout!r} has a fifth row",
                'set vest.layout = "paper32", or motor_values = 40',
            )
        return super().write(t_ns, frame)

    def _new_link(self) -> VestLink:
        return _PlayerLink(self._options)


def _listens(host: str, port: int, timeout_s: float) -> bool:
    try:
        socket.create_connection((host, port), timeout=min(timeout_s, 1.0)).close()
    except OSError:
        return False
    return True


class _PlayerLink:
    def __init__(self, options: PlayerOptions) -> None:
        self._options = options
        self._where = f"Player at {options.host}:{options.port}"
        self._spoken: PlayerVersion | None = None
        self._ws: Any = None
        self._closing = contextlib.ExitStack()
        self._broken: tuple[type[Exception], ...] = (OSError,)
        self._pongs: deque[tuple[threading.Event, float]] = deque()
        self._acknowledges = True
        self._unasked = False
        self._garbage = 0
        self._probed_s = self._said_s = 0.0
        self._passed_over = ""

    @property
    def present(self) -> bool:
        return self._spoken is not None and self._spoken.has_vest is not False

    @property
    def battery_percent(self) -> int | None:
        return None if self._spoken is None else self._spoken.battery_percent

    @property
    def condition(self) -> str:
        spoken = self._spoken
        if spoken is None:
            return ""
        link = {None: "connection unknown", True: "connected", False: "not connected"}[spoken.has_vest]
        return f"{spoken.vest_name or 'vest'} {link}, Player version {spoken.number}"

    @property
    def notes(self) -> tuple[str, ...]:
        notes = []
        has_vest = None if self._spoken is None else self._spoken.has_vest
        if self._passed_over:
            notes.append(f"version 2 is spoken, since version 3 did not answer: {self._passed_over}")
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
        asked = versions_to_ask(self._options)
        for version in asked:
            try:
                self._connect(version, share=_OPENING / len(asked))
                break
            except DeviceUnavailableError as error:
                if version is asked[-1]:
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
        client = require("websockets.sync.client", driver=PlayerVest.name, extra="lab")
        exceptions = require("websockets.exceptions", driver=PlayerVest.name, extra="lab")
        self._broken = (OSError, exceptions.WebSocketException)
        self._where = f"Player at {o.host}:{o.port_v3 if version.number == 3 else o.port}"
        self._spoken = version
        try:
            self._ws = self._closing.enter_context(
                client.connect(
                    version.url(o.host),
                    ssl=version.tls,
                    compression=None,
                    proxy=None,
                    open_timeout=o.open_timeout_s * share,
                    close_timeout=0.3,
                    ping_interval=None,
                )
            )
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
        # It holds what every send needs, and the interpreter.
        promote(self._ws.recv_events_thread, "act")
        self._probed_s = time.monotonic()
        for message in version.hello():
            self._say(message)
        pong = self._ping()
        deadline = time.monotonic() + _GRACE_S
        while time.monotonic() < deadline and (version.has_vest is None or not pong.is_set()):
            self._hear(0.05)
        self._acknowledges = pong.is_set()
        if not version.admitted:
            raise DeviceUnavailableError(
                f"the {self._where} has not let this program in within {_GRACE_S:g} s",
                "are app_id and the key those of one app at the vendor's portal? The Player asks there: is it online?",
            )

    def ready(self, timeout_s: float) -> bool:
        if not self._acknowledges:
            time.sleep(min(timeout_s, max(0.0, self._said_s + _BLIND_S - time.monotonic())))
            return True
        pongs = self._pongs
        while pongs and pongs[0][0].is_set():
            pongs.popleft()
        if len(pongs) < _ON_THE_WAY:
            return True
        if len(pongs) < _MOST_ON_THE_WAY and time.monotonic() - pongs[0][1] < _PROMPT_S:
            return True
        return pongs[-_ON_THE_WAY][0].wait(timeout_s)

    def send(self, intensities: NDArray[np.uint8]) -> None:
        for message in self._version.frame(intensities):
            self._say(message)
        self._said_s = time.monotonic()
        self._unasked = self._acknowledges

    def poll(self) -> None:
        if self._unasked:
            self._unasked = False
            self._pongs.append((self._ping(), time.monotonic()))
        if time.monotonic() - self._probed_s > _PROBE_S and (probe := self._version.probe()):
            self._probed_s = time.monotonic()
            self._say(probe)
        self._hear(0.0)

    def close(self) -> None:
        ws, self._ws = self._ws, None
        if ws is not None:
            with contextlib.suppress(*self._broken):
                if self.ready(0.1):
                    ws.send(self._version.stop())
            with contextlib.suppress(*self._broken):
                self._closing.close()

    def abort(self) -> None:
        ws = self._ws
        if ws is not None:
            with contextlib.suppress(OSError):
                ws.socket.shutdown(socket.SHUT_RDWR)

    @property
    def _version(self) -> PlayerVersion:
        if self._spoken is None:
            raise DeviceUnavailableError(f"the {self._where} is not connected")
        return self._spoken

    def _say(self, message: str) -> None:
        if self._ws is None:
            raise DeviceUnavailableError(f"the {self._where} is not connected")
        try:
            self._ws.send(message)
        except self._broken as error:
            raise self._lost(error) from error

    def _ping(self) -> threading.Event:
        try:
            pong: threading.Event = self._ws.ping()
        except self._broken as error:
            raise self._lost(error) from error
        return pong

    def _hear(self, timeout_s: float) -> None:
        """Read what has come; waits for the first message only."""
        while True:
            try:
                message = self._ws.recv(timeout=timeout_s)
            except TimeoutError:
                return
            except self._broken as error:
                raise self._lost(error) from error
            timeout_s = 0.0
            self._garbage += not heard(self._version, message)

    def _lost(self, error: Exception) -> DeviceUnavailableError:
        return DeviceUnavailableError(f"the {self._where} ended the connection: {error}")
