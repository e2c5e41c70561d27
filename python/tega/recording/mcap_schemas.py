"""The messages of a recording that no well-known schema has, as protobuf built from the table below.

Pictures, joint angles, poses and log lines use Foxglove's own schemas. All times here are nanoseconds since the start
of the session; ``taken_ns`` is the loop's tick at which an item was taken in.
"""

from __future__ import annotations

from functools import cache
from typing import Any

from tega.devices.lifecycle import require

__all__ = ["MESSAGES", "PACKAGE", "decoder", "message_class", "schema_bytes"]

PACKAGE = "tega"
_EXTRA = "record"

# Per message its fields as (name, type); ``*`` marks a repeated one. Numbers of fields are their places, so a new field
# goes to the end.
MESSAGES: dict[str, tuple[tuple[str, str], ...]] = {
    "Frame": (
        ("t_ns", "int64"),
        ("received_ns", "int64"),
        ("seq", "int64"),
        ("name", "string"),
        ("pixels_crc32", "uint32"),
    ),
    "Contact": (
        ("t_ns", "int64"),
        ("taken_ns", "int64"),
        ("mass", "double"),
        ("centroid_x", "double"),
        ("centroid_y", "double"),
        ("spread", "double"),
        ("threshold", "double"),
        ("eda", "int64"),
        ("cci", "double"),
        ("peak", "double"),
        ("peak_x", "int32"),
        ("peak_y", "int32"),
        ("in_contact", "bool"),
        ("cci_norm", "double"),
        ("eda_norm", "double"),
        ("front", "double"),
        ("back", "double"),
        ("known_ns", "int64"),
    ),
    "EmgSamples": (
        ("t_ns", "int64"),
        ("received_ns", "int64"),
        ("first_index", "int64"),
        ("n_channels", "int32"),
        ("samples", "double*"),
    ),
    "Levels": (("t_ns", "int64"), ("taken_ns", "int64"), ("channels", "int32*"), ("fused", "int32")),
    "VestFrame": (
        ("t_ns", "int64"),
        ("layout", "string"),
        ("intensities", "uint32*"),
        ("handed_ns", "int64"),
    ),
    "CanFrame": (("id", "uint32"), ("data", "bytes"), ("remote", "bool"), ("flags", "uint32")),
    "CanFrames": (("t_ns", "int64"), ("level", "int32"), ("frames", "CanFrame*")),
    "HandExchange": (
        ("t_ns", "int64"),
        ("level", "int32"),
        ("received", "CanFrame*"),
        ("sent", "CanFrame*"),
        ("action", "string"),
    ),
    "State": (("t_ns", "int64"), ("state", "string"), ("reason", "string")),
    "Marker": (
        ("t_ns", "int64"),
        ("text", "string"),
        ("source", "string"),
        ("received_ns", "int64"),
        ("stamp_s", "double"),
        ("correction_s", "double"),
    ),
    "Input": (("t_ns", "int64"), ("live", "bool"), ("motion", "double*"), ("held", "string*")),
    "Button": (("t_ns", "int64"), ("seq", "int64"), ("button", "string"), ("pressed", "bool")),
    "Skip": (("t_ns", "int64"),),
    "Haptics": (("t_ns", "int64"), ("n_asked", "int64"), ("on", "bool")),
    "Imposed": (("t_ns", "int64"), ("level", "int32")),
    "Value": (("t_ns", "int64"), ("name", "string"), ("value", "double")),
    "Alert": (("t_ns", "int64"), ("name", "string"), ("said", "string")),
    "Latency": (("path", "string"), ("source", "string"), ("stamps_ns", "int64*")),
    "ArmPose": (("t_ns", "int64"), ("position", "double*"), ("quaternion", "double*"), ("valid", "bool")),
    "ArmTurn": (
        ("t_ns", "int64"),
        ("poses", "ArmPose*"),
        ("clutch", "bool"),
        ("dead_man", "bool"),
        ("may_move", "bool"),
        ("measured", "ArmPose*"),
        ("stopped", "string"),
        ("cleared", "bool"),
        ("state", "string"),
        ("reason", "string"),
        ("holds", "int64"),
        ("target", "double*"),
        ("velocity", "double*"),
        ("phase", "string"),
    ),
    "ArmHealth": (
        ("t_ns", "int64"),
        ("rate_hz", "double"),
        ("worst_ms", "double"),
        ("late", "int64"),
        ("refused", "int64"),
        ("success_rate", "double"),
    ),
    "End": (("end_ns", "int64"), ("ended", "string"), ("n_waits", "int64")),
    "Status": (
        ("t_ns", "int64"),
        ("queued", "int64"),
        ("queued_bytes", "int64"),
        ("written_bytes", "int64"),
        ("free_bytes", "int64"),
        ("dropped_topics", "string*"),
        ("dropped_counts", "int64*"),
    ),
}

_FILE = "tega/recording.proto"


def _protobuf(module: str) -> Any:
    return require(f"google.protobuf.{module}", driver="recording", extra=_EXTRA)


@cache
def _file() -> Any:
    """Describe the messages as protoc would."""
    pb2 = _protobuf("descriptor_pb2")
    file = pb2.FileDescriptorProto(name=_FILE, package=PACKAGE, syntax="proto3")
    kinds = pb2.FieldDescriptorProto
    for name, fields in MESSAGES.items():
        message = file.message_type.add(name=name)
        for number, (field_name, kind) in enumerate(fields, 1):
            base = kind.removesuffix("*")
            label = kinds.LABEL_REPEATED if kind.endswith("*") else kinds.LABEL_OPTIONAL
            field = message.field.add(name=field_name, number=number, label=label)
            if base in MESSAGES:
                field.type, field.type_name = kinds.TYPE_MESSAGE, f".{PACKAGE}.{base}"
            else:
                field.type = getattr(kinds, f"TYPE_{base.upper()}")
    return file


@cache
def schema_bytes() -> bytes:
    """Return the file descriptor set, the form in which an MCAP file carries a protobuf schema."""
    described: bytes = (
        _protobuf("descriptor_pb2").FileDescriptorSet(file=[_file()]).SerializeToString(deterministic=True)
    )
    return described


@cache
def message_class(name: str) -> Any:
    """Return the class of one of :data:`MESSAGES`.

    Raises:
        MissingExtraError: protobuf is not installed.
    """
    return decoder(f"{PACKAGE}.{name}", schema_bytes())


@cache
def decoder(name: str, descriptor_set: bytes) -> Any:
    """Return the class of any message out of the schema that a file carries.

    Args:
        name: Full name, such as ``foxglove.RawImage``.
        descriptor_set: The schema's bytes.
    """
    files = _protobuf("descriptor_pb2").FileDescriptorSet.FromString(descriptor_set)
    pool = _protobuf("descriptor_pool").DescriptorPool()
    for file in files.file:
        pool.Add(file)
    return _protobuf("message_factory").GetMessageClass(pool.FindMessageTypeByName(name))
