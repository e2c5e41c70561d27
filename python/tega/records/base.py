"""Define the base of every record: a typed struct that knows its topic, its units and its version.

A record is a fact that passes through a run: a fingertip camera's measurement, the muscles' intent, a frame for the
vest. Files, links and tables are made from its fields; see :mod:`tega.records.schema` and :mod:`tega.records.table`.

Append a new field to its struct, with a default, and raise the struct's ``version``. Old files then still open, and
missing fields have their defaults.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache, lru_cache
from string import Formatter
from typing import Annotated, Any, ClassVar, Self

import msgspec


def quantity(unit: str, wire: str = "") -> msgspec.Meta:
    """Annotate a field: its unit, such as ``"ns"``, and Protobuf's type where it is not the usual one."""
    return msgspec.Meta(extra={"unit": unit, "wire": wire})


Ns = Annotated[int, quantity("ns")]
Count = Annotated[int, quantity("1")]
Step = Annotated[int, quantity("1", "int32")]
SquarePixels = Annotated[int, quantity("px²")]
Pixels = Annotated[float, quantity("px")]
Grey = Annotated[float, quantity("grey")]
GreyPerPixel = Annotated[float, quantity("grey/px² or grey/px")]
SquareMillimetres = Annotated[float, quantity("mm²")]
Millimetres = Annotated[float, quantity("mm")]
Newtons = Annotated[float, quantity("N")]
Share = Annotated[float, quantity("1")]
Percent = Annotated[float, quantity("%")]
Milliseconds = Annotated[float, quantity("ms")]


@cache
def _named_in(topic: str) -> tuple[str, ...]:
    return tuple(name for _, name, _, _ in Formatter().parse(topic) if name is not None)


@lru_cache
def _topic_of(topic: str, *values: object) -> str:
    return topic.format_map(dict(zip(_named_in(topic), values, strict=True)))


DRAWINGS: dict[type[msgspec.Struct], Callable[[Any], str]] = {}
"""What draws a record type as HTML for a notebook; the module that can do so adds it."""


class Record(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """A fact that passes through a run, and the topic that it belongs to.

    A record's ``t_ns`` counts from the start of the session where its documentation names no other clock.

    Attributes:
        topic: Where it is published; ``{finger}`` stands for the field of that name.
        schema: Name of its message in files; ``""`` for the class's own.
        version: Version of its fields; 1 for those of the first recordings.
        unwritten: Fields that a message does not hold: the topic says them, or a viewer's own schema.
        table: Fields that its table in a run's own folder holds, ``t_s`` being ``t_ns`` in seconds; empty where it has
            none. ``recording export`` writes every field.
        columns: Column names of the fields that hold a fixed number of numbers or none.
        logged: Field with the time at which the fact came to be known: files are in this order.
        bulk: Field that takes memory besides the record's numbers.
    """

    topic: ClassVar[str] = ""
    schema: ClassVar[str] = ""
    version: ClassVar[int] = 1
    unwritten: ClassVar[tuple[str, ...]] = ()
    table: ClassVar[tuple[str, ...]] = ()
    columns: ClassVar[Mapping[str, tuple[str, ...]]] = {}
    logged: ClassVar[str] = "t_ns"
    bulk: ClassVar[str] = ""

    @property
    def where(self) -> str:
        """Topic of this record, such as ``/tactile/thumb/contact``."""
        named = _named_in(self.topic)
        return _topic_of(self.topic, *[getattr(self, name) for name in named]) if named else self.topic

    @property
    def log_ns(self) -> int:
        """Time at which the fact came to be known, nanoseconds since the session's start."""
        t_ns: int = getattr(self, self.logged, 0)
        return t_ns

    def _repr_html_(self) -> str | None:
        """Return the record as HTML for a notebook; ``None`` for a type that nothing draws."""
        draw = next((DRAWINGS[kind] for kind in type(self).__mro__ if kind in DRAWINGS), None)
        return None if draw is None else draw(self)

    def current(self) -> Self:
        """Return this record as the newest version spells it."""
        return self

    @property
    def n_bytes(self) -> int:
        """Memory that the record takes besides its numbers, bytes."""
        value: Any = getattr(self, self.bulk, b"")
        return int(getattr(value, "nbytes", 0) or len(value))


class VideoPacket(Record, frozen=True, kw_only=True):
    """One encoded picture of a camera; a feature gives the topic.

    Attributes:
        t_ns: Time at which the machine received the picture, since the start of the session.
        data: The packet: Annex B of H.264, or a temporal unit of AV1.
        video: ``h264`` or ``av1``.
    """

    schema: ClassVar[str] = "foxglove.CompressedVideo"
    bulk: ClassVar[str] = "data"

    camera: str
    t_ns: Ns
    data: bytes
    video: str
