"""Hold the settings of a vest behind the bHaptics Player, and choose which versions of its websocket to ask for."""

from __future__ import annotations

import ipaddress
from pathlib import Path
from typing import Annotated, Final, Literal

import msgspec

from tega.devices.vest.player_versions import PlayerVersion, PlayerVersion2, PlayerVersion3
from tega.devices.vest.vest_stream import VestOptions
from tega.errors import DeviceUnavailableError
from tega.runtime.files.foreign_file import read_foreign

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
        app_name: Under which name version 2 lists this program.
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
    app_name: Annotated[str, msgspec.Meta(min_length=1, max_length=64)] = "TEGA"
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
        requested.append(PlayerVersion2(o.port, o.app_name))
    return requested
