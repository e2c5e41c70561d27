"""Make protobuf messages from :mod:`tega.records`, for records without a well-known schema.

Pictures, joint angles, poses and log lines use Foxglove's own schemas. All times here are nanoseconds since the start
of the session; ``taken_ns`` is the loop's tick at which an item was taken in.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any

from tega.records import Record
from tega.records.schema import Part, fields, own_schema, parts, schema_name, units, values
from tega.records.types import record_types
from tega.runtime.lifecycle import require

PACKAGE = "tega"


@cache
def record_messages() -> Mapping[str, Part]:
    """Return the struct of each message by its name, those that others are made of first.

    Two records of one shape share a message.
    """
    found: dict[str, Part] = {}
    for kind in filter(own_schema, record_types()):
        for part in parts(kind):
            found.setdefault(schema_name(part), part)
        found.setdefault(schema_name(kind), kind)
    return found


@cache
def record_versions() -> Mapping[str, int]:
    """Return the version of each record's message."""
    return {name: kind.version for name, kind in record_messages().items() if issubclass(kind, Record)}


def _protobuf(module: str) -> Any:
    return require(f"google.protobuf.{module}", driver="recording", extra="record")


@cache
def _file() -> Any:
    """Describe the messages as protoc would."""
    pb2 = _protobuf("descriptor_pb2")
    file = pb2.FileDescriptorProto(name="tega/recording.proto", package=PACKAGE, syntax="proto3")
    kinds = pb2.FieldDescriptorProto
    for name, kind in record_messages().items():
        message = file.message_type.add(name=name)
        for number, text in enumerate(fields(kind), 1):
            label = kinds.LABEL_REPEATED if text.repeated else kinds.LABEL_OPTIONAL
            field = message.field.add(name=text.name, number=number, label=label)
            if text.part is not None:
                field.type, field.type_name = kinds.TYPE_MESSAGE, f".{PACKAGE}.{text.wire}"
            else:
                field.type = getattr(kinds, f"TYPE_{text.wire.upper()}")
            if text.optional:
                # As protoc spells a number that may not be there.
                field.proto3_optional, field.oneof_index = True, len(message.oneof_decl)
                message.oneof_decl.add(name=f"_{text.name}")
    return file


@cache
def schema_bytes() -> bytes:
    """Return the file descriptor set, the form in which an MCAP file carries a protobuf schema."""
    described = _protobuf("descriptor_pb2").FileDescriptorSet(file=[_file()])
    data: bytes = described.SerializeToString(deterministic=True)
    return data


@cache
def message_class(name: str) -> Any:
    """Return the class of a message by its name in :func:`record_messages`; needs protobuf."""
    return decoder(f"{PACKAGE}.{name}", schema_bytes())


def encoded(record: Record) -> bytes:
    """Return the message of a record as it stands in a file."""
    data: bytes = message_class(schema_name(type(record)))(**values(record)).SerializeToString()
    return data


def unit_table() -> dict[str, str]:
    """Return the unit of every field that has one, such as ``Contact.cci``: a table of a recording's head."""
    return {
        f"{name}.{field}": unit
        for name, kind in record_messages().items()
        if issubclass(kind, Record)
        for field, unit in units(kind).items()
    }


@cache
def decoder(name: str, descriptor_set: bytes) -> Any:
    """Return the class of a message, such as ``foxglove.RawImage``, out of the schema that a file carries."""
    files = _protobuf("descriptor_pb2").FileDescriptorSet.FromString(descriptor_set)
    pool = _protobuf("descriptor_pool").DescriptorPool()
    for file in files.file:
        pool.Add(file)
    return _protobuf("message_factory").GetMessageClass(pool.FindMessageTypeByName(name))
