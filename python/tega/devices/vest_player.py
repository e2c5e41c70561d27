"""Drive a bHaptics vest through the vendor's Player, version 2 of its websocket."""

from __future__ import annotations

import contextlib
import socket
import threading
import time
from collections import deque
from typing import Annotated, Any, ClassVar, Final
from urllib.parse import quote

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.devices.base import Found, Options
from tega.devices.vest_stream import HOLD_MS, StreamedVest, VestLink, VestOptions
from tega.errors import DeviceUnavailableError, WireError
from tega.lifecycle import require
from tega.threads import promote
from tega.wire import player_v2_message, player_v2_ping, player_v2_status, player_v2_stop

_PATH: Final = "/v2/feedbacks"
_GRACE_S = 2.0  # a Player that has just been asked may take this long to say which devices it has
_ON_THE_WAY: Final = 2  # frames that a slow Player may not have read yet
_PROMPT_S: Final = 0.02  # one that answers within this is not slow: its own clips have 50 frames a second
_MOST_ON_THE_WAY: Final = 8  # frames that it may not have read either
_BLIND_S = 0.04  # between frames for a Player that does not say whether it has read them
_PROBE_S = 4.0  # its status is not sent regularly: an empty frame for a foot provokes one


class PlayerOptions(VestOptions, frozen=True):
    """Settings of :class:`PlayerVest`.

    Attributes:
        host: Where the Player runs.
        port: Its port.
        app_name: Under which name it lists this program.
        require_vest: Refuse to open when the Player says that no vest is connected to it.
        most_hz: As above. Frames wait for the Player's answers anyway, and each replaces the one it plays, so nothing
            piles up; the pause puts frames that come together into one.
    """

    host: str = "127.0.0.1"
    port: Annotated[int, msgspec.Meta(ge=1, le=65535)] = 15881
    app_name: Annotated[str, msgspec.Meta(min_length=1, max_length=64)] = "TEGA"
    require_vest: bool = True
    most_hz: Annotated[float, msgspec.Meta(ge=10, le=1000)] = 500.0


class PlayerVest(StreamedVest):
    """Streams both panels under two constant names; each frame ends by itself after 200 ms.

    Every frame is followed by a websocket ping. Of a Player that has not answered one for 20 ms no more than two frames
    are on the way: the next one waits for an answer, and a newer one takes its place. A Player that answers no pings is
    fed 25 frames a second at most, and a note says so.
    """

    name: ClassVar[str] = "bhaptics-player"
    summary: ClassVar[str] = "bHaptics vest through the vendor's Player (websocket, version 2)"
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
        try:
            socket.create_connection((here.host, here.port), timeout=min(timeout_s, 1.0)).close()
        except OSError:
            return []
        return [Found(driver=cls.name, label=f"Player at {here.host}:{here.port}")]

    @property
    def _label(self) -> str:
        return f"{self._options.host}:{self._options.port}"

    def _new_link(self) -> VestLink:
        return _PlayerLink(self._options)


class _PlayerLink:
    def __init__(self, options: PlayerOptions) -> None:
        self._options = options
        self._where = f"Player at {options.host}:{options.port}"
        self._ws: Any = None
        self._closing = contextlib.ExitStack()
        self._broken: tuple[type[Exception], ...] = (OSError,)
        self._pongs: deque[tuple[threading.Event, float]] = deque()
        self._acknowledges = True
        self._unasked = False
        self._has_vest: bool | None = None
        self._garbage = 0
        self._probed_s = self._said_s = 0.0

    @property
    def present(self) -> bool:
        return self._has_vest is not False

    @property
    def notes(self) -> tuple[str, ...]:
        notes = []
        if self._has_vest is None and self._ws is not None:
            notes.append(f"the {self._where} did not say whether a vest is connected")
        if self._has_vest is False:
            notes.append(f"the {self._where} has no vest connected")
        if not self._acknowledges:
            notes.append(f"the {self._where} answers no pings: frames may queue up on the way")
        if self._garbage:
            notes.append(f"{self._garbage} messages of the {self._where} could not be read and were ignored")
        return tuple(notes)

    def connect(self) -> None:
        o = self._options
        client = require("websockets.sync.client", driver=PlayerVest.name, extra="lab")
        exceptions = require("websockets.exceptions", driver=PlayerVest.name, extra="lab")
        self._broken = (OSError, exceptions.WebSocketException)
        name = quote(o.app_name, safe="")
        try:
            self._ws = self._closing.enter_context(
                client.connect(
                    f"ws://{o.host}:{o.port}{_PATH}?app_id={name}&app_name={name}",
                    compression=None,
                    proxy=None,
                    open_timeout=o.open_timeout_s * 0.6,
                    close_timeout=0.3,
                    ping_interval=None,
                )
            )
        except exceptions.InvalidStatus as error:
            raise DeviceUnavailableError(
                f"the {self._where} answers HTTP {error.response.status_code} instead of serving {_PATH}",
                "this driver speaks version 2; a Player that has dropped it needs an older one, or use bhaptics-ble",
            ) from error
        except self._broken as error:
            raise DeviceUnavailableError(
                f"the {self._where} cannot be reached: {str(error) or type(error).__name__}",
                "start the bHaptics Player there; from another machine its firewall has to let the port through",
            ) from error
        # It holds what every send needs, and the interpreter.
        promote(self._ws.recv_events_thread, "act")
        self._say(player_v2_stop())
        self._probe()
        pong = self._ping()
        deadline = time.monotonic() + _GRACE_S
        while time.monotonic() < deadline and (self._has_vest is None or not pong.is_set()):
            self._hear(0.05)
        self._acknowledges = pong.is_set()
        if o.require_vest and self._has_vest is False:
            raise DeviceUnavailableError(
                f"the {self._where} has no vest connected",
                "pair it in the Player and look for its battery level there; require_vest = false opens without a vest",
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
        self._say(player_v2_message(intensities, duration_ms=HOLD_MS))
        self._said_s = time.monotonic()
        self._unasked = self._acknowledges

    def poll(self) -> None:
        if self._unasked:
            self._unasked = False
            self._pongs.append((self._ping(), time.monotonic()))
        if time.monotonic() - self._probed_s > _PROBE_S:
            self._probe()
        self._hear(0.0)

    def close(self) -> None:
        ws, self._ws = self._ws, None
        if ws is not None:
            with contextlib.suppress(*self._broken):
                if self.ready(0.1):
                    ws.send(player_v2_stop())
            with contextlib.suppress(*self._broken):
                self._closing.close()

    def abort(self) -> None:
        ws = self._ws
        if ws is not None:
            with contextlib.suppress(OSError):
                ws.socket.shutdown(socket.SHUT_RDWR)

    def _probe(self) -> None:
        self._probed_s = time.monotonic()
        self._say(player_v2_ping())

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
            try:
                status = player_v2_status(message)
            except (WireError, TypeError):
                self._garbage += 1
                continue
            self._has_vest = "Vest" in status.connected_positions

    def _lost(self, error: Exception) -> DeviceUnavailableError:
        return DeviceUnavailableError(f"the {self._where} ended the connection: {error}")
