"""Types of the records that a replay reads, and their messages."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Final

import numpy as np

from tega.devices.base import EmgChunk
from tega.recording.mcap_reader import Message
from tega.recording.mcap_schemas import PACKAGE
from tega.records import (
    Adaptation,
    ArmTurn,
    BesideContact,
    BesideIntent,
    Contact,
    End,
    Event,
    HandCommand,
    HandExchange,
    HandLook,
    Haptics,
    Imposed,
    Intent,
    Marker,
    ProgramFrame,
    Record,
    ReflexGrip,
    SentFrame,
    Skip,
    TriedMotor,
    VestFrame,
)
from tega.records.schema import read, schema_name

KINDS: Final[tuple[type[Record], ...]] = (
    Adaptation,
    ArmTurn,
    BesideContact,
    BesideIntent,
    Contact,
    End,
    Event,
    HandCommand,
    HandExchange,
    HandLook,
    Haptics,
    Imposed,
    Intent,
    Marker,
    ProgramFrame,
    ReflexGrip,
    Skip,
    TriedMotor,
    VestFrame,
    SentFrame,
)
"""Types of the records that replay reads; of two with one schema the last is that of any other topic."""

EMG_SAMPLES: Final = f"{PACKAGE}.EmgSamples"
STATUS: Final = f"{PACKAGE}.Status"
FRAME: Final = f"{PACKAGE}.Frame"
"""Schemas of the messages that are no record of these types."""


def chunk_of(message: Message) -> EmgChunk:
    """Return the EMG samples of a message of schema :data:`EMG_SAMPLES`."""
    value = message.value
    samples = np.array(value.samples, np.float64).reshape(-1, value.n_channels)
    return EmgChunk(value.t_ns, value.first_index, samples)


def dropped_of(message: Message) -> dict[str, int]:
    """Return the records lost so far, by topic, of a message of schema :data:`STATUS`."""
    return dict(zip(message.value.dropped_topics, message.value.dropped_counts, strict=True))


def record_of(message: Message) -> Record | None:
    """Return the record of a message; ``None`` where replay does not need its type."""
    kind = kind_of(message.schema, message.topic)
    return None if kind is None else read(kind, message.value, **_named(kind, message.topic))


@cache
def kind_of(schema: str, topic: str) -> type[Record] | None:
    """Return the type of a message; ``None`` where replay does not need it. Two types of one schema differ in topic."""
    found = [kind for kind in KINDS if f"{PACKAGE}.{schema_name(kind)}" == schema]
    return next((kind for kind in found if kind.topic == topic), found[-1] if found else None)


@cache
def _named(kind: type[Record], topic: str) -> Mapping[str, str]:
    """Return the fields of a record that its topic names, such as its finger."""
    parts = zip(kind.topic.split("/"), topic.split("/"), strict=False)
    return {field[1:-1]: name for field, name in parts if field.startswith("{")}
