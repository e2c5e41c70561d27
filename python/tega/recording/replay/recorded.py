"""Read a recording as the loop needs it: its input with the times of reading, and its output."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TypeVar

import msgspec
import numpy as np

from tega.config import SessionConfig, check_tree, override_recorded
from tega.config.calibration.store import Calibration, parse_calibration
from tega.devices.base import DeviceInfo, EmgChunk, TactileFrame
from tega.errors import RecordingError
from tega.hand import joined_level
from tega.recording.decode_ahead import decode_ahead
from tega.recording.mcap_reader import McapReader, Message, Progress
from tega.recording.mcap_schemas import PACKAGE, VERSIONS
from tega.recording.origin import LEAD_IN, span
from tega.recording.replay.players import Player, players
from tega.recording.session import FORMAT
from tega.records import (
    Adaptation,
    AdaptationSwitch,
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
from tega.runtime.files.foreign_file import load_npy, parse_json, parse_toml, tells_damage

if TYPE_CHECKING:
    from tega.recording.decode_ahead import Decoding

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

Kind = TypeVar("Kind", bound=Record)


class Head(msgspec.Struct, frozen=True):
    """Head of a recording, known before the first message.

    Attributes:
        config: The settings of the run, without its devices.
        tree: Settings as in the file, with the devices.
        calibration: Its maxima.
        baselines: Untouched pictures, by finger, uint8 (H, W, 3).
        sources: Descriptions of the inputs.
        facts: Format, times, and the parts that were live.
        files: Whatever else is attached.
        versions: Version of every record that it may hold; empty in recordings of the first version.
        switches: Switches of the online adaptation of EMG, in order, those of the lead-in first.
    """

    config: SessionConfig
    tree: dict[str, Any]
    calibration: Calibration
    baselines: dict[str, Any]
    sources: dict[str, DeviceInfo]
    facts: dict[str, str]
    files: dict[str, bytes]
    versions: dict[str, str]
    switches: tuple[AdaptationSwitch, ...] = ()

    @property
    def lossless(self) -> bool:
        """Whether the pictures are as they were."""
        return self.facts["lossless"] == "true"

    @property
    def live_vest(self) -> bool:
        """Whether a real vest was worn; it was sent changes only."""
        return self.facts["live_vest"] == "true"


class Recorded(msgspec.Struct):
    """Content of a recording, pictures and samples left out.

    Attributes:
        head: Facts that are known before the first message.
        contacts: Contacts by finger, in order.
        records: Records of each type of :data:`KINDS`, in order, those of the lead-in first; see :meth:`of`.
        dropped: Number of records lost, by topic.
        complete: Whether the file was finished, or else recovered or cut.
        n_frames: Number of pictures, by finger.
        from_ns: Beginning, nanoseconds since the start of the session; records before that are its lead-in.
        n_early: Number of items of the lead-in, by finger, and by type.
        reader: Passes over the file again; ``None`` before the first message.
        players: Players of features, which have noted their messages.
    """

    head: Head
    contacts: dict[str, list[Contact]]
    records: dict[type[Record], list[Any]] = {}
    dropped: dict[str, int] = {}
    complete: bool = False
    n_frames: dict[str, int] = {}
    from_ns: int = 0
    n_early: dict[str | type[Record], int] = {}
    reader: McapReader | None = None
    players: list[Player] = []

    def of(self, kind: type[Kind]) -> list[Kind]:
        """Return the records of a type, in order."""
        return self.records.get(kind, [])

    @property
    def end(self) -> End | None:
        """End of the loop; ``None`` where the recording was cut."""
        return next(reversed(self.of(End)), None)

    @property
    def looks(self) -> dict[int, HandLook]:
        """Looks at hand and arm, by tick; empty in recordings with slips detected by touch."""
        return {look.t_ns: look for look in self.of(HandLook)}

    @property
    def imposed(self) -> list[tuple[int, float]]:
        """Levels that were set against the muscles: time, level (0 for no longer)."""
        return [(one.t_ns, joined_level(one.level, one.closure)) for one in self.of(Imposed)]

    @property
    def last_tick_ns(self) -> int:
        """The newest tick of any record."""
        ticks = [contact.taken_ns for contacts in self.contacts.values() for contact in contacts[-1:]]
        ticks += [intent.taken_ns for intent in self.of(Intent)[-1:]]
        ticks += [row.t_ns for rows in (self.of(VestFrame), self.of(HandCommand)) for row in rows[-1:]]
        return max(ticks, default=0)


@tells_damage
def read_recorded(
    path: Path,
    *,
    begin: Callable[[Head], None] = lambda _head: None,
    frame: Callable[[str, TactileFrame, Any], None] = lambda _finger, _frame, _told: None,
    chunk: Callable[[EmgChunk], None] = lambda _chunk: None,
    pictures_wanted: Callable[[Head], bool] = lambda _head: True,
    progress: Progress | None = None,
) -> Recorded:
    """Read a recording.

    Args:
        path: The file.
        begin: Called with the head, before the first message.
        frame: Given every picture, one at a time (all together they do not fit into memory), and its ``tega.Frame``
            message: the checksum that its pixels had when they were taken, and whether another finger was loaded.
        chunk: Given the EMG samples as they came.
        pictures_wanted: Asked after ``begin`` whether ``frame`` is to be given them; else they are passed over.
        progress: Called as the file is read.

    Raises:
        RecordingError: The file is no recording of a session, or is cut off before its head.
        MissingExtraError: A package of the extra ``record`` is not installed.
    """
    reader = McapReader(path)
    reader.progress = progress or reader.progress
    pictures: dict[str, Decoding] = {}
    recorded: Recorded | None = None
    passed_over: set[str] = set()
    messages = reader.messages(lambda topic: topic.rpartition("/")[2] not in passed_over)
    for message, decoding in decode_ahead(messages):
        if recorded is None:
            recorded = _begin(reader, begin, chunk)
            if not pictures_wanted(recorded.head):
                passed_over.add("image")
        value, topic = message.value, message.topic
        match message.schema:
            case "foxglove.RawImage" | "foxglove.CompressedImage":
                if decoding is not None and not passed_over:
                    pictures[topic.split("/")[2]] = decoding
            case "tega.Frame":
                finger = topic.split("/")[2]
                picture = pictures.pop(finger, None)
                if picture is not None:
                    numbered = TactileFrame(value.t_ns, value.seq, picture.result(), value.name)
                    frame(finger, numbered, value)
                    recorded.n_frames[finger] = recorded.n_frames.get(finger, 0) + 1
            case _:
                _take(recorded, message, chunk)
    if recorded is None:
        _head(reader)
        raise RecordingError(f"{path.name}: holds nothing but its settings", "the run had not begun")
    recorded.complete = not reader.cut and "end" in reader.metadata
    for topic, count in reader.metadata.get("dropped", {}).items():
        recorded.dropped[topic] = int(count)
    return recorded


def _begin(reader: McapReader, begin: Callable[[Head], None], chunk: Callable[[EmgChunk], None]) -> Recorded:
    """Read the head before the first message, and the lead-in of a trimmed recording."""
    head = _head(reader)
    recorded = Recorded(
        head,
        {finger: [] for finger in head.baselines},
        from_ns=span(reader.metadata).from_ns,
        reader=reader,
        players=players(),
    )
    begin(head)
    if recorded.from_ns > 0:
        lead_in = reader.files.get(LEAD_IN)
        if lead_in is None:
            raise RecordingError(
                f"{reader.path.name}: trimmed from {recorded.from_ns / 1e9:g} s on without its lead-in, so that "
                "filters cannot be brought to where they were: it cannot be computed again",
                "trim the original again without --no-lead-in",
            )
        for message in McapReader(reader.path, data=lead_in).messages():
            _take(recorded, message, chunk)
        recorded.n_early = {finger: len(contacts) for finger, contacts in recorded.contacts.items()}
        recorded.n_early |= {kind: len(records) for kind, records in recorded.records.items()}
    return recorded


def _take(recorded: Recorded, message: Message, chunk: Callable[[EmgChunk], None]) -> None:
    """Keep a message as the record of its type; the players of features are offered the messages of other types."""
    value = message.value
    kind = _kind(message.schema, message.topic)
    if message.schema == "tega.EmgSamples":
        samples = np.array(value.samples, np.float64).reshape(-1, value.n_channels)
        chunk(EmgChunk(value.t_ns, value.first_index, samples))
    elif message.schema == "tega.Status":
        recorded.dropped = dict(zip(value.dropped_topics, value.dropped_counts, strict=True))
    elif kind is None:
        for player in recorded.players:
            player.note(message)
    else:
        record = read(kind, value, **_named(kind, message.topic))
        rows = recorded.records.setdefault(kind, [])
        if isinstance(record, Contact):
            rows = recorded.contacts[record.finger]
        rows.append(record)


@cache
def _kind(schema: str, topic: str) -> type[Record] | None:
    """Return the type of a message; ``None`` where replay does not need it. Two types of one schema differ in topic."""
    found = [kind for kind in KINDS if f"{PACKAGE}.{schema_name(kind)}" == schema]
    return next((kind for kind in found if kind.topic == topic), found[-1] if found else None)


@cache
def _named(kind: type[Record], topic: str) -> Mapping[str, str]:
    """Return the fields of a record that its topic names, such as its finger."""
    parts = zip(kind.topic.split("/"), topic.split("/"), strict=False)
    return {field[1:-1]: name for field, name in parts if field.startswith("{")}


def _head(reader: McapReader) -> Head:
    facts = reader.metadata.get("tega", {})
    if facts.get("format") != FORMAT:
        raise RecordingError(
            f"{reader.path.name}: no recording of a session", "name a file made with --record"
        )
    _refuse_newer(reader)
    try:
        tree = _with_mapping(parse_toml(reader.files["session.toml"].decode()), facts)
        calibration = parse_calibration(reader.files["calibration.toml"].decode(), "calibration.toml")
        baselines = {
            name.removeprefix("baseline-").removesuffix(".npy"): load_npy(data, name)
            for name, data in reader.files.items()
            if name.startswith("baseline-")
        }
        sources = {name: parse_json(text, DeviceInfo) for name, text in reader.metadata["sources"].items()}
    except (KeyError, ValueError) as error:
        raise RecordingError(
            f"{reader.path.name}: its head is damaged: {error}", "read it with the public mcap reader"
        ) from error
    versions = dict(reader.metadata.get("records", {}))
    settings = without_devices(tree)
    return Head(
        settings,
        tree,
        calibration,
        baselines,
        sources,
        facts,
        dict(reader.files),
        versions,
        _switches(reader) if settings.stages.adaptation.on else (),
    )


def _switches(reader: McapReader) -> tuple[AdaptationSwitch, ...]:
    """Read the switches of the adaptation beforehand: one is recorded after the samples that it is for."""
    lead_in = reader.files.get(LEAD_IN)
    readers = [McapReader(reader.path)]
    if lead_in is not None:
        readers.insert(0, McapReader(reader.path, data=lead_in))
    found = [
        read(AdaptationSwitch, message.value)
        for one in readers
        for message in one.messages(lambda topic: topic == AdaptationSwitch.topic)
        if message.value is not None
    ]
    # What was received before the span and told in it stands in both.
    return tuple(sorted(set(found), key=lambda switch: switch.n_samples))


def _refuse_newer(reader: McapReader) -> None:
    """Refuse records of a later TEGA, as their format is unknown here; earlier ones are read."""
    for name, version in reader.metadata.get("records", {}).items():
        if not version.isdecimal() or int(version) > VERSIONS.get(name, 0):
            made = reader.metadata.get("versions", {}).get("tega", "unknown")
            raise RecordingError(
                f"{reader.path.name}: its record {name} has version {version}, this TEGA knows "
                f"{VERSIONS.get(name, 'none')}",
                f"read it with the TEGA that made it ({made}) or a later one",
            )


def without_devices(tree: dict[str, Any], sets: Sequence[str] = ()) -> SessionConfig:
    """Check settings without their devices, which need not be installed to replay their data.

    Args:
        tree: The settings.
        sets: Settings to override, as ``key=value``.

    Raises:
        ConfigError: One of them is unknown, of a wrong type or out of range.
    """
    kept: dict[str, Any] = {"session": {k: v for k, v in tree.get("session", {}).items() if k != "out_dir"}}
    tree = _as_named_now(tree)
    kept["stages"] = dict(tree.get("stages", {}))
    for name in ("vest", "hand"):
        section = tree.get(name, {})
        kept[name] = {k: v for k, v in section.items() if k not in {"driver", "options"}}
    return check_tree(kept, override_recorded(kept, sets), base=Path.cwd()).config


def _with_mapping(tree: dict[str, Any], facts: Mapping[str, str]) -> dict[str, Any]:
    """Name the mapping of a run that used the preset's default, as this default has changed since."""
    stages = tree.get("stages", {})
    mapping = stages.get("mapping", {})
    vest = tree.get("vest", {})
    if "name" in mapping or vest.get("feedback", "continuous") == "events":
        return tree
    named = {"name": facts.get("mapping", "columns"), **mapping}
    return tree | {"stages": stages | {"mapping": named}}


def _as_named_now(tree: dict[str, Any]) -> dict[str, Any]:
    """Return the settings of an earlier version's recording under the names that they have now."""
    vest = dict(tree.get("vest", {}))
    feedback, pulses = vest.pop("feedback", "continuous"), vest.pop("pulses", {})
    if feedback != "events":
        return tree | {"vest": vest}
    mapping = {"name": "pulses", "options": pulses}
    return tree | {"vest": vest, "stages": tree.get("stages", {}) | {"mapping": mapping}}
