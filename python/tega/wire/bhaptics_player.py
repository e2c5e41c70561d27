"""Encode and decode the JSON messages of the bHaptics Player, versions 2 and 3 of its websocket, and of the Hub.

Key order is fixed and there are no blanks, so that messages can be compared byte for byte. A message of version 3 is
``{"Type": ..., "Message": ...}``; the content of ``Message`` is JSON again, either as text or directly. Servers write
names with a capital and without; both are read.

``intensities`` are (40,) integers, 0 to 100, in the wearer's order, and ``duration_ms`` is 20 to 100000. Others raise
``ShapeError``, ``DtypeError`` (no integers) or ``WireError`` (out of range).
"""

from __future__ import annotations

from dataclasses import dataclass
from operator import index
from typing import Any, Final, Literal, TypeVar

import msgspec
import numpy as np
from numpy.typing import ArrayLike

from tega.errors import InvalidValueError, WireError
from tega.wire.arrays import integer_array

_Kind = TypeVar("_Kind")

_VEST: Final = 0
_DURATION_MS: Final = (20, 100_000)  # the shortest and the longest that the vendor's clients accept
_LONGEST_NAME: Final = 40
_MOST_DEVICES: Final = 64


def player_v2_message(
    intensities: ArrayLike,
    *,
    duration_ms: int,
    front_key: str | None = "tega_front",
    back_key: str | None = "tega_back",
) -> str:
    """Return the message that makes the vendor's Player (websocket, version 2) play intensities.

    A frame replaces the running one of its key and ends by itself, so a stream with constant keys and a
    duration of 1.5 to 3 periods goes silent when the host does. A panel that is all zero is sent without
    dots, which silences it. The keys name the panels' frames; None leaves a panel out, but not both (``WireError``).
    """
    values = _forty(intensities)
    _check("duration_ms", duration_ms, _DURATION_MS, " ms")
    if front_key is None and back_key is None:
        raise WireError("front_key and back_key is empty", "name at least one panel")
    panels = (
        ("front_key", front_key, "VestFront", values[:20]),
        ("back_key", back_key, "VestBack", values[20:]),
    )
    frames = [
        _frame(_named(name, key), at, duration_ms, panel)
        for name, key, at, panel in panels
        if key is not None
    ]
    return _text({"Register": [], "Submit": frames})


def player_v2_stop(key: str | None = None) -> str:
    """Return the message that stops one key, or all of them; ``WireError`` for an empty one.

    Example:
        >>> player_v2_stop()
        '{"Submit":[{"Type":"turnOffAll"}]}'
    """
    ended = {"Type": "turnOffAll"} if key is None else {"Type": "turnOff", "Key": _named("key", key)}
    return _text({"Submit": [ended]})


def player_v2_ping() -> str:
    """Return a frame without dots, for a foot, which makes the Player send a fresh status."""
    return _text({"Submit": [_frame("ping", "FootL", 100, [])]})


@dataclass(frozen=True, slots=True)
class PlayerStatus:
    """Status of the Player. It is no acknowledgement that anything moved.

    Attributes:
        connected_devices: How many devices it is connected to.
        connected_positions: Their positions; a vest is "Vest".
        active_keys: Keys that are playing.
        front: Levels of the front panel, usually 20; empty if the message has none.
        back: Levels of the back panel, usually 20; empty if the message has none.
    """

    connected_devices: int
    connected_positions: tuple[str, ...]
    active_keys: tuple[str, ...]
    front: tuple[int, ...]
    back: tuple[int, ...]


def player_v2_status(message: str) -> PlayerStatus:
    """Parse a message of the Player. Fields that are missing, null or unknown do not matter.

    ``WireError`` if the text is not a JSON object, or a known field is of another type.
    """
    envelope = _json(message)
    if not isinstance(envelope, dict):
        raise WireError("player status: not a JSON object")
    try:
        panels = _known(envelope, "Status", dict[str, Any])
        return PlayerStatus(
            _known(envelope, "ConnectedDeviceCount", int),
            _known(envelope, "ConnectedPositions", tuple[str, ...]),
            _known(envelope, "ActiveKeys", tuple[str, ...]),
            _known(panels, "VestFront", tuple[int, ...]),
            _known(panels, "VestBack", tuple[int, ...]),
        )
    except msgspec.ValidationError as error:
        raise WireError(f"player status: {error}") from error


@dataclass(frozen=True, slots=True)
class Sdk3Device:
    """Device that the Player knows, as it describes it.

    Attributes:
        position: Where it is worn; 0 is a vest.
        name: The vendor's name, such as ``TactSuitX40``; at most 40 printable characters.
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

    ``app_id`` is the program's from the vendor's portal; it stands for cipher and hashes, too, as in a client that the
    vendor published. ``InvalidValueError``: it or the key that belongs to it is empty.

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
    return _text({"Type": "SdkRequestAuth", "Message": _text(inner)})


def sdk3_dot_message(
    intensities: ArrayLike, *, request_id: int = 1, duration_ms: int = 150, motors: Literal[40, 32] = 40
) -> str:
    """Return the message that makes the vendor's Player (websocket, version 3) play intensities.

    ``request_id`` is a number of the caller's, below 2³². ``motors`` is the number of values to send. Both are in use,
    and it is unknown how the Player distinguishes them; 32 sends rows 0 to 3 of each panel, and a lit row 4 is then a
    ``WireError``. ``InvalidValueError``: ``motors`` is neither.
    """
    values = _played(intensities, request_id, duration_ms)
    if motors not in {40, 32}:
        raise InvalidValueError(f"motors = {motors} is out of range: 40 or 32")
    if motors == 32:
        for at in (*range(16, 20), *range(36, 40)):
            if values[at]:
                raise WireError(
                    f"intensities[{at}] = {values[at]} is in row 4, which the 32-motor form does not have",
                    "fill rows 0 to 3 only, or send the 40-motor form",
                )
        values = values[:16] + values[20:36]
    dots = {"requestId": request_id, "position": _VEST, "motorValues": values, "durationMillis": duration_ms}
    return _text({"Type": "SdkPlayDotMode", "Message": _text(dots | {"deviceIndex": -1})})


def sdk3_stop_message() -> str:
    """Return the message that ends everything (websocket, version 3)."""
    return _text({"Type": "SdkStopAll"})


def sdk3_stop_request(request_id: int) -> str:
    """Return the message that ends one request (websocket, version 3), by the number that it was played with.

    Example:
        >>> sdk3_stop_request(7)
        '{"Type":"SdkStopByRequestId","Message":"7"}'
    """
    return _text({"Type": "SdkStopByRequestId", "Message": str(request_id)})


def sdk3_server_message(text: str) -> Sdk3Message:
    """Parse a message of the Player (websocket, version 3). Types and fields that are unknown do not matter.

    ``WireError``: it is no JSON object with a type, or a list of devices that is none.

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


def hub_line(intensities: ArrayLike, *, request_id: int = 1, duration_ms: int = 150) -> str:
    """Return the line, newline included, that makes a Hub (TCP) play intensities; see :func:`sdk3_dot_message`."""
    values = _played(intensities, request_id, duration_ms)
    dots = {"requestId": request_id, "pos": _VEST, "motors": values, "durationMillis": duration_ms}
    return _text({"message": _text(dots), "type": "SdkPlayDotMode"}) + "\n"


def _forty(intensities: ArrayLike) -> list[int]:
    values: list[int] = integer_array("intensities", intensities, np.uint8, (0, 100), ((40,),)).tolist()
    return values


def _check(name: str, value: int, limits: tuple[int, int], unit: str = "") -> None:
    low, high = limits
    if not low <= index(value) <= high:
        raise WireError(f"{name} = {value}{unit} is out of range: {low} to {high}")


def _played(intensities: ArrayLike, request_id: int, duration_ms: int) -> list[int]:
    _check("request_id", request_id, (0, 2**32 - 1))
    _check("duration_ms", duration_ms, _DURATION_MS, " ms")
    return _forty(intensities)


def _named(name: str, key: str) -> str:
    if not key:
        raise WireError(f"{name} is empty")
    return key


def _frame(key: str, position: str, duration_ms: int, panel: list[int]) -> dict[str, Any]:
    dots = [{"Index": at, "Intensity": value} for at, value in enumerate(panel) if value]
    frame = {"Position": position, "DurationMillis": duration_ms, "DotPoints": dots, "PathPoints": []}
    return {"Type": "frame", "Key": key, "Frame": frame}


def _text(message: dict[str, Any]) -> str:
    return msgspec.json.encode(message).decode()


def _json(text: str) -> Any:
    try:
        return msgspec.json.decode(text)
    except (msgspec.DecodeError, RecursionError, UnicodeError) as error:
        raise WireError(f"a Player's message is not JSON: {error}") from error


def _either(envelope: dict[str, Any], name: str) -> Any:
    return envelope.get(name, envelope.get(name[0].lower() + name[1:]))


def _known(holder: dict[str, Any], name: str, kind: type[_Kind]) -> _Kind:
    value = _either(holder, name)
    return kind() if value is None else msgspec.convert(value, kind)


def _device(item: Any) -> Sdk3Device:
    fields = item if isinstance(item, dict) else {}
    position, name, connected = fields.get("position"), fields.get("deviceName", ""), fields.get("connected")
    # A truth value is an integer to Python, and 98.0 none to anybody.
    if type(position) is not int or not isinstance(name, str) or not isinstance(connected, bool):
        raise WireError(f"no device of the Player, version 3: {str(item)[:60]!r}")
    battery = fields.get("battery")
    # The Player gives -1 for a battery that no vest has reported.
    known = type(battery) is int and 0 <= battery <= 100
    plain = "".join(c for c in name if c.isprintable())[:_LONGEST_NAME]
    return Sdk3Device(position, plain, connected, battery if known else None)
