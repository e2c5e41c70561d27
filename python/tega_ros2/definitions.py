"""Derive ROS 2 message definitions of package ``tega_msgs`` from the protobuf messages of records."""

from __future__ import annotations

import re
from collections.abc import Mapping
from types import ModuleType
from typing import Any, Final

from tega.errors import RecordingError
from tega.runtime.lifecycle import require

PACKAGE: Final = "tega_msgs"
"""ROS package of TEGA's own messages."""

VIDEO: Final = "foxglove_msgs/msg/CompressedVideo"
"""Foxglove's message of a packet of video; ROS 2 itself has none."""

_VIDEO_TEXT: Final = "builtin_interfaces/msg/Time timestamp\nstring frame_id\nuint8[] data\nstring format\n"
_HEADER: Final = "std_msgs/msg/Header header"
SCALARS: Final = {
    1: "float64", 2: "float32", 3: "int64", 4: "uint64", 5: "int32", 8: "bool", 9: "string", 12: "uint8[]",
    13: "uint32",
}  # fmt: skip
"""ROS 2's type for each number of protobuf's ``FieldDescriptorProto.Type``."""

# Names that ROS 2 allows; see "Field names" and "Naming of messages" of its interface definition.
_FIELD: Final = re.compile(r"[a-z](?:_?[a-z0-9])*")
_MESSAGE: Final = re.compile(r"[A-Z][A-Za-z0-9]*")


def load_rosbags(module: str) -> Any | ModuleType:
    """Import a module of rosbags."""
    return require(f"rosbags.{module}", driver="ros2", extra="ros2")


class Definitions:
    """Message types of one bag: those of ROS 2 Jazzy, and TEGA's own as they are met.

    A field that may be absent has a flag ``has_NAME`` beside it; an absent number is NaN, or 0.
    """

    def __init__(self, source: str) -> None:
        stores, self._messages = load_rosbags("typesys"), load_rosbags("typesys.msg")
        self.store: Any = stores.get_typestore(stores.Stores.ROS2_JAZZY)
        self._source = source
        self._texts: dict[str, str] = {}
        self._units: dict[str, str] = {}
        self._register(VIDEO, _VIDEO_TEXT)

    def set_units(self, table: Mapping[str, str]) -> None:
        """Set the units of the fields, by names such as ``Contact.cci``; they become comments."""
        self._units = {name: unit for name, unit in table.items() if unit.isprintable()}

    def own(self, descriptor: Any, *, header: bool = True) -> str:
        """Return the ROS type of a protobuf message of TEGA's own, defined at its first use.

        A part of another message has no ``header``. Names or types that ROS 2 does not have, or two messages
        of one name, raise :class:`RecordingError`.
        """
        name = descriptor.name
        if not _MESSAGE.fullmatch(name):
            raise self._foreign(f"message {name[:80]!r}")
        lines = [_HEADER] if header else []
        for field in descriptor.fields:
            lines += self._lines(name, field)
        kind, text = f"{PACKAGE}/msg/{name}", "\n".join(lines) + "\n"
        if self._texts.setdefault(kind, text) != text:
            raise self._foreign(f"message {name!r}, in two forms,")
        if kind not in self.store.fielddefs:
            self._register(kind, text)
        return kind

    def text(self, kind: str) -> str:
        """Return the definition of a type with those that it is made of, as a bag carries it."""
        blocks = self.store.generate_msgdef(kind, ros_version=2)[0].split(f"{'=' * 80}\n")
        made = [self._with_units(kind, blocks[0])]
        for block in blocks[1:]:
            head, _, rest = block.partition("\n")
            made.append(f"{head}\n{self._with_units(head.removeprefix('MSG: '), rest)}")
        return f"{'=' * 80}\n".join(made)

    def _with_units(self, kind: str, text: str) -> str:
        package, _, name = kind.replace("/msg/", "/").partition("/")
        if package != PACKAGE:
            return text
        lines = []
        for line in text.splitlines():
            unit = self._units.get(f"{name}.{line.partition(' ')[2]}", "")
            lines.append(f"{line}  # {unit}" if unit else line)
        return "\n".join(lines) + "\n"

    def _lines(self, message: str, field: Any) -> list[str]:
        if not _FIELD.fullmatch(field.name) or field.name == "header":
            raise self._foreign(f"field {f'{message}.{field.name}'[:80]!r}")
        if field.message_type is not None:
            kind = self.own(field.message_type, header=False)
        else:
            kind = SCALARS.get(field.type, "")
            if not kind or (field.is_repeated and kind.endswith("[]")):
                raise self._foreign(f"field {f'{message}.{field.name}'[:80]!r}")
        if field.is_repeated:
            return [f"{kind}[] {field.name}"]
        return [f"{kind} {field.name}", *([f"bool has_{field.name}"] if field.has_presence else [])]

    def _foreign(self, subject: str) -> RecordingError:
        return RecordingError(
            f"{self._source}: {subject} cannot be a message of ROS 2",
            "export it as csv, or name a recording of TEGA",
        )

    def _register(self, kind: str, text: str) -> None:
        self.store.register(self._messages.get_types_from_msg(text, kind))
