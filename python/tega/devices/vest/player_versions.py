"""Hold the settings of a vest behind the bHaptics Player, and implement versions 2 and 3 of its websocket.

A version encodes messages and keeps the content of the Player's answers. Nothing here opens a socket:
:class:`~tega.devices.vest.player_link.PlayerLink` carries the messages.
"""

from __future__ import annotations

import ipaddress
import ssl
from pathlib import Path
from typing import Annotated, ClassVar, Final, Literal
from urllib.parse import quote

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.devices.vest.vest_stream import HOLD_MS, VestOptions
from tega.errors import DeviceUnavailableError, WireError
from tega.runtime.files.foreign_file import read_foreign
from tega.wire import (
    player_v2_message,
    player_v2_ping,
    player_v2_status,
    player_v2_stop,
    sdk3_auth_message,
    sdk3_dot_message,
    sdk3_server_message,
    sdk3_stop_message,
    sdk3_stop_request,
)

_NAME: Final = "TEGA"
_CLIENT: Final = "1.0.1"  # what a client that the vendor published for this version calls itself
_REQUESTS: Final = 1 << 31  # a request's number fits into 31 bits, as those of the vendor's clients


class _PlayerVersion:
    """State of a version of the Player's websocket, ``number`` 2 or 3.

    Attributes:
        tls: Encryption of its transport; ``None`` for none.
        admitted: Whether the Player has let the program in; true from the start if it lets any program in.
        has_vest: Whether it reports a connected vest; ``None`` before its first report.
        vest_name: The Player's name for the vest; ``""`` if it gives none.
        battery_percent: The vest's battery; ``None`` where it is not reported.
    """

    number: ClassVar[int]
    path: ClassVar[str]
    tls: ssl.SSLContext | None = None

    def __init__(self, port: int, *, admitted: bool) -> None:
        self._port, self.admitted = port, admitted
        self.has_vest: bool | None = None
        self.vest_name = ""
        self.battery_percent: int | None = None

    def probe(self) -> str:
        """Return a message that provokes a status and is not felt; ``""`` where there is none."""
        return ""


class PlayerVersion2(_PlayerVersion):
    """Version 2: no account, no encryption, two constant keys; a status shows whether there is a vest."""

    number: ClassVar[int] = 2
    path: ClassVar[str] = "/v2/feedbacks"

    def __init__(self, port: int) -> None:
        super().__init__(port, admitted=True)

    def url(self, host: str) -> str:
        """Return the address, with the program's name for the Player."""
        return f"ws://{host}:{self._port}{self.path}?app_id={_NAME}&app_name={_NAME}"

    def hello(self) -> list[str]:
        """Return the first messages: end everything, and ask for a status."""
        return [self.stop(), self.probe()]

    def frame(self, intensities: NDArray[np.uint8]) -> list[str]:
        """Play (40,) intensities, percent, for 200 ms: both panels under their keys, in place of what those play."""
        return [player_v2_message(intensities, duration_ms=HOLD_MS)]

    def stop(self) -> str:
        """Return ``turnOffAll``."""
        return player_v2_stop()

    def probe(self) -> str:
        """Return an empty frame for a foot: the status is not sent regularly."""
        return player_v2_ping()

    def receive(self, message: str) -> None:
        """Take in a status; ``WireError`` if it is none."""
        self.has_vest = "Vest" in player_v2_status(message).connected_positions


class PlayerVersion3(_PlayerVersion):
    """Version 3: needs the vendor's app id and key; the Player reports the vest's name, link and battery.

    The Player's certificate is self-signed, so it proves nothing and is not checked; only the key and frames
    are sent that way. A ping of this version makes devices vibrate outside of every budget: it is never sent.
    """

    number: ClassVar[int] = 3
    path: ClassVar[str] = "/v3/feedback"

    def __init__(self, port: int, app_id: str, api_key: str, motor_values: Literal[40, 32]) -> None:
        super().__init__(port, admitted=False)
        self._app_id, self._api_key, self._motor_values, self._request = app_id, api_key, motor_values, 0
        # TLS 1.2 or later, without a check of the other end's identity.
        self.tls = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
        self.tls.minimum_version = ssl.TLSVersion.TLSv1_2
        self.tls.check_hostname = False
        self.tls.verify_mode = ssl.CERT_NONE

    def url(self, host: str) -> str:
        """Return the address, which holds the key: it belongs into no message."""
        app_id, key = quote(self._app_id, safe=""), quote(self._api_key, safe="")
        return f"wss://{host}:{self._port}{self.path}?workspace_id={app_id}&api_key={key}&version={_CLIENT}"

    def hello(self) -> list[str]:
        """Return the first messages: introduce the program, and end everything."""
        return [sdk3_auth_message(self._app_id, self._api_key), self.stop()]

    def frame(self, intensities: NDArray[np.uint8]) -> list[str]:
        """Play as version 2 does: a new request, and the end of the one before; how two mix is not published.

        A frame without a lit motor is an end of everything.
        """
        before = self._request
        if not intensities.any():
            return [self.stop()]
        self._request = before % (_REQUESTS - 1) + 1
        values, request = self._motor_values, self._request
        played = sdk3_dot_message(intensities, request_id=request, duration_ms=HOLD_MS, motors=values)
        return [played, sdk3_stop_request(before)] if before else [played]

    def stop(self) -> str:
        """Return ``SdkStopAll``."""
        return sdk3_stop_message()

    def receive(self, message: str) -> None:
        """Process a message: a Player reports its devices only after it has admitted the program."""
        answer = sdk3_server_message(message)
        self.admitted = self.admitted or answer.kind in {"ServerReady", "ServerDevices"}
        if answer.kind != "ServerDevices":
            return
        vests = sorted((d for d in answer.devices if d.is_vest), key=lambda d: not d.connected)
        self.has_vest = bool(vests) and vests[0].connected
        self.vest_name = vests[0].name if vests else ""
        self.battery_percent = vests[0].battery_percent if self.has_vest else None


PlayerVersion = PlayerVersion2 | PlayerVersion3


def received(version: PlayerVersion, message: str | bytes) -> bool:
    """Give a message to a version; return whether it could be read."""
    if isinstance(message, bytes):
        return False
    try:
        version.receive(message)
    except WireError:
        return False
    return True


KEY_HINT: Final = "make an app at the vendor's developer portal, and set vest.options app_id and api_key_file"
"""Fix if version 3 needs an id and a key."""

_LONGEST_KEY: Final = 512


class PlayerOptions(VestOptions, frozen=True):
    """Settings of a vest behind the Player.

    Attributes:
        host: Where the Player runs.
        allow_remote: If true, the host may be another machine. Any program that answers there receives the frames,
            and with version 3 the key: the certificate is not checked.
        port: Its port for version 2.
        port_v3: Its port for version 3.
        version: Version to use; ``auto`` asks for version 3 if an ``app_id`` is set, then for version 2.
        app_id: The program's id at the vendor's portal, for version 3.
        api_key_file: File that holds the key of that id, and nothing else.
        motor_values: How many values version 3 is sent; 32 leaves out each panel's fifth row, which a TactSuit Pro has
            not.
        require_vest: Refuse to open when the Player says that no vest is connected to it.
        most_hz: As above. Frames wait for the Player's answers anyway, and each replaces the one it plays, so nothing
            piles up; the pause puts frames that come together into one.
    """

    host: str = "127.0.0.1"
    allow_remote: bool = False
    port: Annotated[int, msgspec.Meta(ge=1, le=65535)] = 15881
    port_v3: Annotated[int, msgspec.Meta(ge=1, le=65535)] = 15882
    version: Literal["auto", "2", "3"] = "auto"
    app_id: Annotated[str, msgspec.Meta(max_length=128)] = ""
    api_key_file: Path | None = None
    motor_values: Literal[40, 32] = 40
    require_vest: bool = True
    most_hz: Annotated[float, msgspec.Meta(ge=10, le=1000)] = 500.0


def _key(file: Path | None) -> str:
    """Read the key of version 3, which stands in no settings file and in no message."""
    if file is None:
        raise DeviceUnavailableError("version 3 of the Player needs api_key_file", KEY_HINT)
    try:
        key = read_foreign(file, most_mib=1, error=DeviceUnavailableError).decode("ascii").strip()
    except (OSError, ValueError) as error:
        raise DeviceUnavailableError(
            f"the key in {file.name} cannot be read: {type(error).__name__}", KEY_HINT
        ) from error
    if not key or len(key) > _LONGEST_KEY or not key.isprintable():
        raise DeviceUnavailableError(
            f"{file.name} does not hold one key of at most {_LONGEST_KEY} characters", KEY_HINT
        )
    return key


def _is_here(host: str) -> bool:
    """Return whether a host is this machine, without a name lookup."""
    if host.lower() == "localhost":
        return True
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return False


def versions_to_ask(o: PlayerOptions) -> list[PlayerVersion]:
    """Return the versions of the websocket to ask for, in order.

    ``DeviceUnavailableError``: version 3 without an id and a key, or another machine that is not allowed.
    """
    if not (o.allow_remote or _is_here(o.host)):
        raise DeviceUnavailableError(
            f"the host {o.host!r} is not this machine, and the program that answers there is not checked",
            "set vest.options allow_remote = true if the Player there is yours",
        )
    requested: list[PlayerVersion] = []
    if o.version == "3" or (o.version == "auto" and o.app_id):
        if not o.app_id:
            raise DeviceUnavailableError("version 3 of the Player needs app_id", KEY_HINT)
        requested.append(PlayerVersion3(o.port_v3, o.app_id, _key(o.api_key_file), o.motor_values))
    if o.version != "3":
        requested.append(PlayerVersion2(o.port))
    return requested
