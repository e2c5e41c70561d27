"""Encode and decode messages of the bHaptics Player's websocket, version 3, beside the frames.

Every message is ``{"Type": ..., "Message": ...}``; what stands in ``Message`` is JSON again, as text or as it is.
Clients and servers of this version write the two names with a capital and without; both are read.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import msgspec

from tega.errors import InvalidValueError, WireError

_VEST: Final = 0
_LONGEST_NAME: Final = 40
_MOST_DEVICES: Final = 64


@dataclass(frozen=True, slots=True)
class Sdk3Device:
    """Device that the Player knows, as it describes it.

    Attributes:
        position: Where it is worn; 0 is a vest.
        name: What the vendor calls it, such as ``TactSuitX40``; at most 40 printable characters.
        connected: Whether the Player has a link to it.
        battery_percent: Its battery, 0 to 100; ``None`` where the Player does not say.
    """

    position: int
    name: str
    connected: bool
    battery_percent: int | None

    @property
    def is_vest(self) -> bool:
        """Whether it is a vest."""
        return self.position == _VEST


@dataclass(frozen=True, slots=True)
class Sdk3Message:
    """Message of the Player, version 3.

    Attributes:
        kind: Its type, such as ``ServerReady``.
        devices: All devices of a message of the type ``ServerDevices``; empty in every other.
    """

    kind: str
    devices: tuple[Sdk3Device, ...] = ()


def sdk3_auth_message(app_id: str, api_key: str) -> str:
    """Return the message that introduces a program to the Player (websocket, version 3).

    Args:
        app_id: The program's id from the vendor's portal; it stands for cipher and hashes, too, as in a client that
            the vendor published.
        api_key: The key that belongs to it.

    Raises:
        InvalidValueError: One of them is empty.

    Example:
        >>> sdk3_auth_message("lab", "key")[:26]
        '{"Type":"SdkRequestAuth","'
    """
    if not app_id or not api_key:
        raise InvalidValueError("app_id and api_key may not be empty", "the vendor's portal gives both")
    inner = {
        "sdkApiKey": api_key,
        "cipher": app_id,
        "applicationId": app_id,
        "nonceHashValue": app_id,
        "applicationIdHashValue": app_id,
        "version": 1,
    }
    message = msgspec.json.encode(inner).decode()
    return msgspec.json.encode({"Type": "SdkRequestAuth", "Message": message}).decode()


def sdk3_stop_request(request_id: int) -> str:
    """Return the message that ends one request (websocket, version 3).

    Args:
        request_id: The number that it was played with.

    Example:
        >>> sdk3_stop_request(7)
        '{"Type":"SdkStopByRequestId","Message":"7"}'
    """
    return msgspec.json.encode({"Type": "SdkStopByRequestId", "Message": str(request_id)}).decode()


def sdk3_server_message(text: str) -> Sdk3Message:
    """Parse a message of the Player (websocket, version 3). Types and fields that are unknown do not matter.

    Raises:
        WireError: It is no JSON object with a type, or a list of devices that is none.

    Example:
        >>> sdk3_server_message('{"Type":"ServerReady"}').kind
        'ServerReady'
    """
    envelope = _json(text)
    kind = _either(envelope, "Type") if isinstance(envelope, dict) else None
    if not isinstance(kind, str):
        raise WireError(f"a Player's message without a type: {text[:60]!r}")
    if kind != "ServerDevices":
        return Sdk3Message(kind)
    inner = _either(envelope, "Message")
    listed = _json(inner) if isinstance(inner, str) else inner
    if not isinstance(listed, list) or len(listed) > _MOST_DEVICES:
        raise WireError(f"ServerDevices holds no list of at most {_MOST_DEVICES} devices: {text[:60]!r}")
    return Sdk3Message(kind, tuple(_device(item) for item in listed))


def _json(text: str) -> Any:
    try:
        return msgspec.json.decode(text)
    except (msgspec.DecodeError, RecursionError, UnicodeError) as error:
        raise WireError(f"a Player's message is not JSON: {error}") from error


def _either(envelope: dict[str, Any], name: str) -> Any:
    return envelope.get(name, envelope.get(name.lower()))


def _device(item: Any) -> Sdk3Device:
    fields = item if isinstance(item, dict) else {}
    position, name, connected = fields.get("position"), fields.get("deviceName", ""), fields.get("connected")
    # A truth value is an integer to Python, and 98.0 none to anybody.
    if type(position) is not int or not isinstance(name, str) or not isinstance(connected, bool):
        raise WireError(f"no device of the Player, version 3: {str(item)[:60]!r}")
    battery = fields.get("battery")
    # The Player gives -1 for a battery that it has not heard of.
    known = type(battery) is int and 0 <= battery <= 100
    plain = "".join(c for c in name if c.isprintable())[:_LONGEST_NAME]
    return Sdk3Device(position, plain, connected, battery if known else None)
