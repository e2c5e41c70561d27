"""Read a recording as the loop needs it: what came in and when it was taken in, what went out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from tega.config import SessionConfig, check_tree, override_recorded
from tega.config.calibration.store import Calibration, parse_calibration
from tega.devices.base import DeviceInfo, EmgChunk, TactileFrame
from tega.errors import RecordingError
from tega.hand import joined_level
from tega.recording.mcap_reader import McapReader, Message, read_picture
from tega.recording.mcap_schemas import VERSIONS
from tega.recording.origin import LEAD_IN, span
from tega.recording.replay.players import Player, players
from tega.recording.session import FORMAT
from tega.records import (
    Adaptation,
    AdaptationSwitch,
    BesideContact,
    BesideIntent,
    BusFrame,
    Contact,
    Event,
    HandCommand,
    HandExchange,
    HandLook,
    Imposed,
    Intent,
    ReflexGrip,
)
from tega.records.schema import read
from tega.runtime.files.foreign_file import load_npy, parse_json, parse_toml, tells_damage


class Head(msgspec.Struct, frozen=True):
    """Head of a recording, known before the first message.

    Attributes:
        config: The settings of the run, without its devices.
        tree: The same as it stands in the file, devices and all.
        calibration: Its maxima.
        baselines: Untouched pictures, by finger, uint8 (H, W, 3).
        sources: What the inputs said of themselves.
        facts: Format, times, and what was live.
        files: Whatever else is attached.
        versions: Version of every record that it may hold; empty in recordings of the first version.
        switches: What the online adaptation of EMG might do, in order, those of the lead-in first.
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
        """Whether a real vest was worn, which is told only what changes."""
        return self.facts["live_vest"] == "true"


class Recorded(msgspec.Struct):
    """Content of a recording, pictures and samples left out.

    Attributes:
        head: What is known before the first message.
        contacts: By finger, in order.
        levels: In order.
        events: Events of touch, in order.
        vest: Frames of the loop: time, layout, intensities.
        vest_sent: Times at which a real vest was sent one.
        hand: Per tick: time, level asked for, frames.
        exchanges: What a real hand was told and said, in order, as recorded.
        skipped: Deadlines that the loop left out.
        haptics: When the motors were switched off or on: which asking, whether on, and at what tick.
        tried: When somebody tried a motor: time, its place in the frame, percent (0 for no longer).
        turns: What led an arm took in and gave, in order, as recorded.
        beside: What the stages beside the connected ones said, by topic, as recorded.
        adaptations: Gains and offsets of EMG, in order, as recorded.
        imposed: When a level was set against the muscles: time, level (0 for no longer).
        reflex: What the reflex added, tick by tick, as recorded.
        looks: Looks at hand and arm by which slips were told, by tick; none in recordings that told them by touch.
        markers: Marked moments: time, text.
        end: How the loop ended; ``None`` where the recording was cut.
        dropped: Records lost, by topic.
        complete: Whether the file was finished, or else recovered or cut.
        n_frames: Pictures, by finger.
        from_ns: Where it begins, nanoseconds since the start of the session; what is from before that is its lead-in.
        n_early: Items of the lead-in, by finger, ``emg`` for levels, ``hand`` for exchanges, ``arm`` for its
            turns.
        reader: Passes over the file again; ``None`` before the first message.
        players: Players of features, which have noted their messages.
    """

    head: Head
    contacts: dict[str, list[Contact]]
    levels: list[Intent] = []
    events: list[Event] = []
    vest: list[tuple[int, str, bytes]] = []
    vest_sent: list[int] = []
    hand: list[tuple[int, float, Sequence[BusFrame]]] = []
    exchanges: list[Any] = []
    turns: list[Any] = []
    skipped: set[int] = set()
    haptics: list[tuple[int, bool, int]] = []
    tried: list[tuple[int, int, int]] = []
    imposed: list[tuple[int, float]] = []
    reflex: list[ReflexGrip] = []
    looks: dict[int, HandLook] = {}
    markers: list[tuple[int, str]] = []
    beside: dict[str, list[Any]] = {}
    adaptations: list[Adaptation] = []
    end: tuple[int, str, int] | None = None
    dropped: dict[str, int] = {}
    complete: bool = False
    n_frames: dict[str, int] = {}
    from_ns: int = 0
    n_early: dict[str, int] = {}
    reader: McapReader | None = None
    players: list[Player] = []

    @property
    def last_tick_ns(self) -> int:
        """The newest tick that anything tells of."""
        ticks = [contact.taken_ns for contacts in self.contacts.values() for contact in contacts[-1:]]
        ticks += [intent.taken_ns for intent in self.levels[-1:]]
        ticks += [row[0] for rows in (self.vest, self.hand) for row in rows[-1:]]
        return max(ticks, default=0)


@tells_damage
def read_recorded(
    path: Path,
    *,
    begin: Callable[[Head], None] = lambda _head: None,
    frame: Callable[[str, TactileFrame, Any], None] = lambda _finger, _frame, _told: None,
    chunk: Callable[[EmgChunk], None] = lambda _chunk: None,
    pictures_wanted: Callable[[Head], bool] = lambda _head: True,
) -> Recorded:
    """Read a recording.

    Args:
        path: The file.
        begin: Given what is known before the first message.
        frame: Given every picture, one at a time (all together they do not fit into memory), and its ``tega.Frame``
            message: the checksum that its pixels had when they were taken, and whether another finger was loaded.
        chunk: Given the EMG samples as they came.
        pictures_wanted: Asked after ``begin`` whether ``frame`` is to be given them; else they are passed over.

    Raises:
        RecordingError: It is no recording of a session, or cut before anything was known.
        MissingExtraError: A package of the extra ``record`` is not installed.
    """
    reader = McapReader(path)
    pictures: dict[str, Message] = {}
    recorded: Recorded | None = None
    passed_over: set[str] = set()
    for message in reader.messages(lambda topic: topic.rpartition("/")[2] not in passed_over):
        if recorded is None:
            recorded = _begin(reader, begin, chunk)
            if not pictures_wanted(recorded.head):
                passed_over.add("image")
        value, topic = message.value, message.topic
        match message.schema:
            case "foxglove.RawImage" | "foxglove.CompressedImage":
                pictures[topic.split("/")[2]] = message
            case "tega.Frame":
                finger = topic.split("/")[2]
                picture = pictures.pop(finger, None)
                if picture is not None and picture.value is not None:
                    image = read_picture(picture)
                    numbered = TactileFrame(value.t_ns, value.seq, image, value.name)
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
    """Take in what comes before the first message, and of a trimmed recording its lead-in."""
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
        recorded.n_early |= {
            "emg": len(recorded.levels),
            "hand": len(recorded.exchanges),
            "arm": len(recorded.turns),
        }
    return recorded


def _take(recorded: Recorded, message: Message, chunk: Callable[[EmgChunk], None]) -> None:
    value = message.value
    match message.schema:
        case "tega.EmgSamples":
            samples = np.array(value.samples, np.float64).reshape(-1, value.n_channels)
            chunk(EmgChunk(value.t_ns, value.first_index, samples))
        case "tega.ArmTurn":
            recorded.turns.append(value)
        case "tega.Marker":
            recorded.markers.append((value.t_ns, value.text))
        case "tega.TriedMotor":
            recorded.tried.append((value.t_ns, value.motor, value.percent))
        case "tega.Event":
            recorded.events.append(read(Event, value))
        case "tega.ReflexGrip":
            recorded.reflex.append(read(ReflexGrip, value))
        case "tega.HandLook":
            recorded.looks[value.t_ns] = read(HandLook, value)
        case "tega.Adaptation":
            recorded.adaptations.append(read(Adaptation, value))
        case "tega.BesideContact" | "tega.BesideIntent":
            recorded.beside.setdefault(message.topic, []).append(_beside(message))
        case _:
            _keep(recorded, message)


def _keep(recorded: Recorded, message: Message) -> None:
    value = message.value
    match message.schema:
        case "tega.Contact":
            finger = message.topic.split("/")[2]
            recorded.contacts[finger].append(read(Contact, value, finger=finger))
        case "tega.Levels":
            recorded.levels.append(read(Intent, value))
        case "tega.VestFrame" if message.topic == "/vest/frame":
            recorded.vest.append((value.t_ns, value.layout, bytes(value.intensities)))
        case "tega.VestFrame":
            recorded.vest_sent.append(value.t_ns)
        case "tega.CanFrames":
            command = read(HandCommand, value)
            recorded.hand.append((command.t_ns, joined_level(command.level, command.closure), command.frames))
        case "tega.HandExchange":
            recorded.exchanges.append(read(HandExchange, value))
        case "tega.Skip":
            recorded.skipped.add(value.t_ns)
        case "tega.Haptics":
            recorded.haptics.append((value.n_asked, value.on, value.t_ns))
        case "tega.Imposed":
            imposed = read(Imposed, value)
            recorded.imposed.append((imposed.t_ns, joined_level(imposed.level, imposed.closure)))
        case "tega.End":
            recorded.end = (value.end_ns, value.ended, value.n_waits)
        case "tega.Status":
            recorded.dropped = dict(zip(value.dropped_topics, value.dropped_counts, strict=True))
        case _:
            _note(recorded, message)


def _note(recorded: Recorded, message: Message) -> None:
    """Offer a message that is none of TEGA's own to the players of features."""
    for player in recorded.players:
        player.note(message)


def _beside(message: Message) -> BesideContact | BesideIntent:
    _, _, stage, finger = message.topic.split("/")
    if message.schema == "tega.BesideIntent":
        return read(BesideIntent, message.value, stage=stage)
    return read(BesideContact, message.value, stage=stage, finger=finger)


def _head(reader: McapReader) -> Head:
    facts = reader.metadata.get("tega", {})
    if facts.get("format") != FORMAT:
        raise RecordingError(
            f"{reader.path.name}: no recording of a session", "name a file made with --record"
        )
    _refuse_newer(reader)
    try:
        tree = parse_toml(reader.files["session.toml"].decode())
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
    """Refuse records that a later TEGA wrote, whose meaning is not known here; those of an earlier one are read."""
    for name, version in reader.metadata.get("records", {}).items():
        if not version.isdecimal() or int(version) > VERSIONS.get(name, 0):
            made = reader.metadata.get("versions", {}).get("tega", "unknown")
            raise RecordingError(
                f"{reader.path.name}: its record {name} has version {version}, this TEGA knows "
                f"{VERSIONS.get(name, 'none')}",
                f"read it with the TEGA that made it ({made}) or a later one",
            )


def without_devices(tree: dict[str, Any], sets: Sequence[str] = ()) -> SessionConfig:
    """Check settings without the devices they name, which need not be installed to replay what they gave.

    Args:
        tree: The settings.
        sets: What is to be otherwise, as ``key=value``.

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


def _as_named_now(tree: dict[str, Any]) -> dict[str, Any]:
    """Return the settings of an earlier version's recording under the names that they have now."""
    vest = dict(tree.get("vest", {}))
    feedback, pulses = vest.pop("feedback", "continuous"), vest.pop("pulses", {})
    if feedback != "events":
        return tree | {"vest": vest}
    mapping = {"name": "pulses", "options": pulses}
    return tree | {"vest": vest, "stages": tree.get("stages", {}) | {"mapping": mapping}}
