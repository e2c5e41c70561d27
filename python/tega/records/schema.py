"""Read off a record's struct how a file or a link spells its fields."""

from __future__ import annotations

import types
from collections.abc import Callable, Mapping
from functools import cache
from typing import Annotated, Any, NamedTuple, TypeVar, Union, get_args, get_origin, get_type_hints

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.errors import InvalidValueError
from tega.records.base import Record

Part = type[msgspec.Struct]

_WIRE: Mapping[Any, str] = {int: "int64", float: "double", str: "string", bool: "bool", bytes: "bytes"}
_SCALARS = {*_WIRE.values(), "int32", "uint32", "uint64", "float"}
# What the annotations of arrays need when they are looked up; the records themselves import no NumPy.
_NAMES = {"np": np, "NDArray": NDArray}

_Struct = TypeVar("_Struct", bound=msgspec.Struct)


class MessageField(NamedTuple):
    """One field of a message, made of the struct's field ``attribute``.

    ``of_pair`` is the index within a pair (``centroid_xy`` is written as ``centroid_x`` and ``centroid_y``),
    else ``None``. ``wire`` is Protobuf's type, or the name of another message, whose struct is ``part``;
    ``None`` for a plain value. ``unit`` is ``""`` where the type says enough.
    """

    name: str
    attribute: str
    of_pair: int | None
    wire: str
    unit: str
    repeated: bool
    optional: bool
    part: Part | None
    array: bool


def schema_name(kind: Part) -> str:
    """Return the name of a record's message, such as ``Contact``."""
    return getattr(kind, "schema", "") or kind.__name__


def own_schema(kind: type[Record]) -> bool:
    """Return whether a record's message has TEGA's own schema, not a schema of viewers."""
    return not kind.schema.startswith("foxglove.")


@cache
def fields(kind: Part) -> tuple[MessageField, ...]:
    """Return the fields of a record's message, in the order of their numbers."""
    hints = get_type_hints(kind, localns=_NAMES, include_extras=True)
    unwritten: tuple[str, ...] = getattr(kind, "unwritten", ())
    found: list[MessageField] = []
    for attribute, name in zip(kind.__struct_fields__, kind.__struct_encode_fields__, strict=True):
        if attribute not in unwritten:
            try:
                found += _fields_of(name, attribute, hints[attribute])
            except (LookupError, TypeError, ValueError, AttributeError) as error:
                raise InvalidValueError(
                    f"record {kind.__name__}: field {attribute} has the type {hints[attribute]}, which no file holds",
                    "use int, float, bool, str, bytes, a quantity of tega.records.base, or a tuple of one of these",
                ) from error
    return tuple(found)


def _fields_of(name: str, attribute: str, hint: Any) -> list[MessageField]:
    optional = False
    if get_origin(hint) in {Union, types.UnionType}:
        (hint,) = (choice for choice in get_args(hint) if choice is not type(None))
        optional = True
    if get_origin(hint) is tuple:
        of = get_args(hint)
        if of[-1] is not Ellipsis:
            stem = name.removesuffix("xy")
            return [
                _field(f"{stem}{axis}", attribute, k, one)
                for k, (axis, one) in enumerate(zip("xy", of, strict=True))
            ]
        return [_field(name, attribute, None, of[0])._replace(repeated=True)]
    one = _field(name, attribute, None, hint)
    if one.wire not in _SCALARS:  # a struct stands in tuples only
        raise ValueError(one.wire)
    return [one._replace(optional=optional)]


def _field(name: str, attribute: str, of_pair: int | None, hint: Any) -> MessageField:
    unit = wire = ""
    if get_origin(hint) is Annotated:
        hint, meta, *_ = get_args(hint)
        unit, wire = meta.extra["unit"], meta.extra["wire"]
    part = hint if isinstance(hint, type) and issubclass(hint, msgspec.Struct) else None
    wire = wire or (schema_name(part) if part is not None else _WIRE[hint])
    repeated, plain = wire.endswith("*"), wire.removesuffix("*")
    # NumPy 2.5 has NDArray as a type alias, whose value is the array.
    array = get_origin(getattr(get_origin(hint), "__value__", hint)) is np.ndarray
    return MessageField(
        name, attribute, of_pair, plain, unit, repeated, optional=False, part=part, array=array
    )


@cache
def parts(kind: Part) -> tuple[Part, ...]:
    """Return the structs that the fields of a record are made of."""
    return tuple(dict.fromkeys(field.part for field in fields(kind) if field.part is not None))


def units(kind: type[Record]) -> dict[str, str]:
    """Return the unit of every field that has one, by its name in the message."""
    return {field.name: field.unit for field in fields(kind) if field.unit}


class _Plan(NamedTuple):
    """Steps from a struct's dictionary to its message's."""

    dropped: tuple[str, ...]
    pairs: tuple[tuple[str, str, str], ...]
    renamed: tuple[tuple[str, str], ...]
    parts: tuple[str, ...]
    optional: tuple[str, ...]


@cache
def _plan(kind: Part) -> _Plan:
    written = fields(kind)
    first = [field for field in written if field.of_pair == 0]
    second = [field for field in written if field.of_pair == 1]
    plain = [field for field in written if field.of_pair is None]
    return _Plan(
        tuple(getattr(kind, "unwritten", ())),
        tuple((x.attribute, x.name, y.name) for x, y in zip(first, second, strict=True)),
        tuple((field.attribute, field.name) for field in plain if field.attribute != field.name),
        tuple(field.attribute for field in plain if field.part is not None),
        tuple(field.name for field in plain if field.optional),
    )


def values(record: msgspec.Struct) -> dict[str, Any]:
    """Return the values of a record's message, by name; missing values are left out."""
    # Called for every record of a run: all that can be known beforehand is in the plan.
    plan = _plan(type(record))
    by_name = msgspec.structs.asdict(record)
    for name in plan.dropped:
        del by_name[name]
    for attribute, x, y in plan.pairs:
        by_name[x], by_name[y] = by_name.pop(attribute)
    for name in plan.parts:
        if parts_of := by_name.pop(name):
            by_name[name] = [values(part) for part in parts_of]
    for attribute, name in plan.renamed:
        by_name[name] = by_name.pop(attribute)
    for name in plan.optional:
        if by_name[name] is None:
            del by_name[name]
    return by_name


def read(kind: type[_Struct], message: Any, **unwritten: Any) -> _Struct:
    """Return a record out of a file's message; what an older file does not hold is the field's default.

    ``unwritten`` are the fields that no message holds, such as the finger that the topic names.
    """
    record: _Struct = _reader(kind, message.__class__, tuple(unwritten))(message, *unwritten.values())
    return record


@cache
def _reader(kind: type[msgspec.Struct], message: Any, unwritten: tuple[str, ...] = ()) -> Callable[..., Any]:
    """Return the function that makes a record out of a message: one expression, since a file holds millions.

    For a contact it is ``kind(t_ns=m.t_ns, centroid_xy=(m.centroid_x, m.centroid_y), ..., finger=finger)``.
    """
    from google.protobuf.message_factory import GetMessageClass

    names: dict[str, Any] = {"kind": kind, "array": np.array}
    there = [field for field in fields(kind) if field.name in message.DESCRIPTOR.fields_by_name]
    made: dict[str, str] = {}
    for field in there:
        value = f"m.{field.name}"
        if field.of_pair is not None:
            pair = ", ".join(f"m.{one.name}" for one in there if one.attribute == field.attribute)
            value = f"({pair},)"
        elif field.part is not None:
            part = message.DESCRIPTOR.fields_by_name[field.name].message_type
            names[f"read_{field.name}"] = _reader(field.part, GetMessageClass(part))
            value = f"tuple([read_{field.name}(one) for one in {value}])"
        elif field.repeated:
            value = f"array(list({value}))" if field.array else f"tuple({value})"
        elif field.optional:
            value = f"{value} if m.HasField({field.name!r}) else None"
        made[field.attribute] = value
    given = ", ".join(
        f"{name}={value}" for name, value in (made | dict(zip(unwritten, unwritten, strict=True))).items()
    )
    current = ".current()" if getattr(kind, "current", Record.current) is not Record.current else ""
    reader: Callable[[Any, Mapping[str, Any]], Any] = eval(
        f"lambda {', '.join(['m', *unwritten])}: kind({given}){current}", names
    )
    return reader
