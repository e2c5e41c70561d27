"""Define the messages: JSON objects, one each WebSocket message, named by ``type``."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, Final

import msgspec
import numpy as np

from tega.records import Record
from tega.records.schema import schema_name, units, values

PROTOCOL: Final = 1
"""Version of the messages."""

MOST_BYTES: Final = 4096
"""Length of a client's message at most."""

_Share = Annotated[float, msgspec.Meta(ge=0, le=1)]
_Level = Annotated[int, msgspec.Meta(ge=1, le=5)]
_Time = Annotated[int, msgspec.Meta(ge=0, le=2**53)]
_Metres = Annotated[float, msgspec.Meta(ge=-100, le=100)]
_Unit = Annotated[float, msgspec.Meta(ge=-1.001, le=1.001)]


class Hand(msgspec.Struct, tag=True, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Request for a closure of the hand: ``level``, 1 to 5, or ``closure``, 0 (open) to 1 (closed).

    ``t_ns`` is that of the newest ``State`` that the client has received.
    """

    t_ns: _Time
    level: _Level | None = None
    closure: _Share | None = None


class Arm(msgspec.Struct, tag=True, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Forearm pose and switches that lead the arm.

    Attributes:
        t_ns: ``t_ns`` of the newest ``State`` that the client has received.
        position_m: x, y, z in the axes of ``arm.mapping.frame``.
        quaternion_xyzw: Orientation, unit length.
        valid: Whether the pose is measured, not guessed.
        dead_man: Whether the dead-man is held.
        clutch: Whether the clutch is held: the arm follows.
        recover: Whether recovery is asked for.
    """

    t_ns: _Time
    position_m: tuple[_Metres, _Metres, _Metres]
    quaternion_xyzw: tuple[_Unit, _Unit, _Unit, _Unit]
    valid: bool = True
    dead_man: bool = False
    clutch: bool = False
    recover: bool = False


class Release(msgspec.Struct, tag=True, frozen=True, forbid_unknown_fields=True):
    """End of leading: the run holds, as after a lost input."""


class Mark(msgspec.Struct, tag=True, frozen=True, forbid_unknown_fields=True):
    """Marker, recorded with its arrival."""

    text: Annotated[str, msgspec.Meta(max_length=1000)]


Command = Hand | Arm | Release | Mark

_DECODER: Final[msgspec.json.Decoder[Command]] = msgspec.json.Decoder(Command)


class MessageError(ValueError):
    """A client's message cannot be used; the text is the reason."""


def decode(data: str | bytes) -> Command:
    """Return a client's message; another, or a value out of range, raises :class:`MessageError`."""
    try:
        command = _DECODER.decode(data)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise MessageError(str(error)[:300]) from error
    if isinstance(command, Hand) and (command.level is None) == (command.closure is None):
        raise MessageError("give either level, 1 to 5, or closure, 0 to 1")
    if isinstance(command, Arm) and abs(math.hypot(*command.quaternion_xyzw) - 1.0) > 1e-3:
        raise MessageError("quaternion_xyzw has not unit length")
    return command


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise NotImplementedError(type(value).__name__)


_ENCODER: Final = msgspec.json.Encoder(enc_hook=_plain)


def encode(kind: str, content: Mapping[str, Any]) -> bytes:
    """Return a message of the server."""
    return _ENCODER.encode({"type": kind, **content})


def encode_record(record: Record, **more: Any) -> bytes:
    """Return the message of a record: its name, its topic, and its fields as a recording has them."""
    content = {"name": schema_name(type(record)), "topic": record.where}
    return encode("Record", content | {"fields": values(record) | more})


def field_units(kinds: tuple[type[Record], ...]) -> dict[str, dict[str, str]]:
    """Return the units of the fields of records, by the records' names."""
    return {schema_name(kind): units(kind) for kind in kinds}
