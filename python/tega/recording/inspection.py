"""Inspect a recording: its streams, their true rates, gaps, losses, latency."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from tega.config.person import ONSET_STAGE
from tega.loop.inbox.histogram import LEAST_SAMPLES
from tega.recording.mcap_folder import noted
from tega.recording.mcap_reader import McapReader, Message
from tega.recording.origin import absent_features, origins, span
from tega.records import Latency as LatencyRecord
from tega.records.schema import read
from tega.runtime.files.foreign_file import reports_damage

# Two and a half periods without an item are a gap: one was lost, and not only late.
_GAP_PERIODS = 2.5
_PATHS = {"touch": "camera to vest", "intent": "muscle to hand", "motion": "muscle to joint"}


class StreamFacts(msgspec.Struct, frozen=True):
    """Facts about one stream of a recording.

    Attributes:
        rate_hz: Rate of the messages between the first and the last stamp; for EMG, of the samples; ``None``
            if there are too few.
        median_ms: The usual distance of two stamps.
        longest_ms: Their longest distance.
        gaps: Distances longer than two and a half times the usual one.
        missing: Items that never came, by the gaps in their numbers.
        dropped: Items that were not recorded, since the disk did not keep up.
        mib: Size before the file's compression.
        back: Stamps before the one before them; if there are any, rate, distances and gaps are of the arrivals.
    """

    topic: str
    schema: str
    messages: int
    rate_hz: float | None
    median_ms: float | None
    longest_ms: float | None
    gaps: int | None
    missing: int
    dropped: int
    mib: float
    back: int


class StageLatency(msgspec.Struct, frozen=True):
    """Latency of one stage, milliseconds; fewer than 100 samples have no percentiles."""

    stage: str
    n: int
    p50_ms: float | None
    p95_ms: float | None
    p99_ms: float | None
    worst_ms: float


class Marked(msgspec.Struct, frozen=True):
    """A marker or a change of the run's state."""

    t_s: float
    text: str


class Inspection(msgspec.Struct, frozen=True):
    """Contents of a recording.

    Attributes:
        complete: Whether the run that made it finished it.
        cut: Reason for an early end of reading, in a word; ``""`` for none.
        stopped: Reason why the recording ended before its run, such as a full disk; ``""`` for none.
        lossless: Whether the pictures are as they were.
        origin: For one made by `trim` or `merge`, the steps from the run's own file to this one.
        from_s: Beginning of the recording in its session.
        start: Time of day at the start of the session, nanoseconds since 1970.
        duration_s: From there to the newest stamp.
        ended: Way in which the run ended; ``""`` if it was not recorded.
        versions: Versions of the recording itself, and of everything the results may depend on.
        sources: Names of the inputs, as their drivers report them.
        absent: Features that it was recorded with and that are not installed here, a sentence each.
        latency: Latency by stage; empty if the run was not in real time, and without stages that a recorded
            source does not have.
        states: Changes of the run's state and alerts, in order.
    """

    file: str
    complete: bool
    cut: str
    stopped: str
    lossless: bool
    origin: list[dict[str, str]]
    from_s: float
    start: int
    duration_s: float
    ended: str
    mib: float
    config_sha256: str
    versions: dict[str, str]
    sources: dict[str, str]
    absent: list[str]
    streams: list[StreamFacts]
    latency: list[StageLatency]
    markers: list[Marked]
    states: list[Marked]
    log: list[Marked]


class _Topic:
    def __init__(self, schema: str) -> None:
        self.schema = schema
        self.stamps: list[int] = []
        self.arrived: list[int] = []
        self.numbers: list[tuple[int, int]] = []
        self.n_bytes = 0


@reports_damage
def inspect_file(path: Path) -> Inspection:
    """Look through a recording; pictures are counted, not decoded."""
    reader, seen = McapReader(path), _Messages()
    for message in reader.messages(lambda topic: not topic.endswith("/image")):
        if not seen.epoch_ns:
            seen.epoch_ns = int(reader.metadata.get("tega", {}).get("epoch_ns", "0"))
        seen.take(message)
    dropped = seen.dropped | {name: int(n) for name, n in reader.metadata.get("dropped", {}).items()}
    facts = reader.metadata.get("tega", {})
    sources = {
        name: f"{info['driver']}: {info['label']}"
        for name, text in reader.metadata.get("sources", {}).items()
        if (info := msgspec.json.decode(text))
    }
    # Earlier versions, and files that took no more, have the reason only in the index.
    stopped = reader.metadata.get("end", {}).get("reason") or noted(path, "reason")
    paced = b'pace = "real"' in reader.files.get("session.toml", b"")
    return Inspection(
        file=path.name,
        complete=reader.complete and not stopped,
        cut=reader.cut,
        stopped=stopped,
        lossless=facts.get("lossless") == "true",
        origin=origins(reader.metadata),
        from_s=span(reader.metadata).from_ns / 1e9,
        start=seen.epoch_ns,
        duration_s=(seen.newest_ns - span(reader.metadata).from_ns) / 1e9,
        ended=seen.ended,
        mib=path.stat().st_size / 2**20,
        config_sha256=facts.get("config_sha256", ""),
        versions={"recording": facts.get("version", ""), **reader.metadata.get("versions", {})},
        sources=sources,
        absent=absent_features(reader.metadata),
        streams=[_facts(name, topic, dropped.get(name, 0)) for name, topic in sorted(seen.topics.items())],
        latency=_with_skin([_latency(*one) for one in seen.stages.items() if any(one[1]) and paced]),
        markers=seen.markers,
        states=seen.states,
        log=seen.log,
    )


class _Messages:
    def __init__(self) -> None:
        self.topics: dict[str, _Topic] = {}
        self.stages: dict[str, list[int]] = defaultdict(list)
        self.dropped: dict[str, int] = {}
        self.markers: list[Marked] = []
        self.states: list[Marked] = []
        self.log: list[Marked] = []
        self.ended = ""
        self.newest_ns = self.epoch_ns = 0
        self._received: dict[tuple[str, int], int] = {}
        self._said: dict[str, str] = {}

    def take(self, message: Message) -> None:
        value, t_ns = message.value, message.log_ns - self.epoch_ns
        topic = self.topics.setdefault(message.topic, _Topic(message.schema))
        topic.n_bytes += message.n_bytes
        # The exchange with a hand is stamped with the machine's clock, as the link received it.
        stamped = message.schema != "tega.HandExchange"
        topic.stamps.append(getattr(value, "t_ns", t_ns) if stamped else t_ns)
        topic.arrived.append(t_ns)
        self.newest_ns = max(self.newest_ns, t_ns)
        if message.schema == "foxglove.Log":
            self.log.append(Marked(t_ns / 1e9, value.message))
        elif message.topic.startswith(("/tactile/", "/emg/", "/vest/")):
            self._signal(message, topic)
        else:
            self._event(message.schema, value)

    def _signal(self, message: Message, topic: _Topic) -> None:
        value, stages = message.value, self.stages
        match message.schema:
            case "tega.Frame":
                topic.numbers.append((value.seq, 1))
                # Into the loop; a picture's way to the vest is in the run's own record of it.
                self._received[message.topic.split("/")[2], value.t_ns] = value.received_ns
                stages["picture: captured to received"].append(value.received_ns - value.t_ns)
            case "tega.Contact":
                received_ns = self._received.pop((message.topic.split("/")[2], value.t_ns), None)
                if received_ns is not None:
                    stages["picture: received to taken in"].append(value.known_ns - received_ns)
            case "tega.EmgSamples":
                topic.numbers.append((value.first_index, len(value.samples) // max(value.n_channels, 1)))
                stages["EMG samples: captured to received"].append(value.received_ns - value.t_ns)
            case "tega.Levels":
                stages["EMG block: captured to taken in"].append(value.taken_ns - value.t_ns)
            case "tega.VestFrame" if message.topic == "/vest/frame":
                stages["vest frame: deadline to handed over"].append(value.handed_ns - value.t_ns)
            case _:
                pass

    def _event(self, schema: str, value: Any) -> None:
        match schema:
            case "tega.Marker":
                self.markers.append(Marked(value.t_ns / 1e9, value.text))
            case "tega.State":
                sentence = f"{value.state}: {value.reason}" if value.reason else value.state
                if value.reason.startswith(f"{value.state}:"):
                    sentence = value.reason
                self.states.append(Marked(value.t_ns / 1e9, sentence))
            case "tega.Alert":
                before, self._said[value.name] = self._said.get(value.name) or value.name, value.said
                self.states.append(Marked(value.t_ns / 1e9, value.said or f"over: {before}"))
            case "tega.Latency":
                route = read(LatencyRecord, value)
                for stage, ns in route.stages_ns().items():
                    self.stages[f"{_PATHS[value.path]}: {stage}"].append(ns)
            case "tega.ArmTurn":
                late = self.stages["forearm pose: captured to taken in"]
                late += [value.t_ns - pose.t_ns for pose in value.poses]
            case "tega.Value":
                self.stages[value.name].append(round(value.value * 1e6))
            case "tega.End":
                self.ended = value.ended
            case "tega.Status":
                self.dropped = dict(zip(value.dropped_topics, value.dropped_counts, strict=True))
            case _:
                pass


def _facts(name: str, topic: _Topic, dropped: int) -> StreamFacts:
    stamps = np.array(topic.stamps, np.int64)
    # A clock that was set, or several sources on one topic: their arrival is on one clock.
    if back := int((np.diff(stamps) < 0).sum()):
        stamps = np.array(sorted(topic.arrived), np.int64)
    steps = np.diff(stamps)
    span_s = int(stamps[-1] - stamps[0]) / 1e9 if len(stamps) else 0.0
    n_items, missing = len(stamps), 0
    if topic.numbers:
        missing = sum(
            max(0, after - (before + n))
            for (before, n), (after, _) in zip(topic.numbers, topic.numbers[1:], strict=False)
        )
    if topic.schema == "tega.EmgSamples":
        n_items = sum(n for _, n in topic.numbers[1:]) + 1
    regular = len(steps) > 1 and span_s > 0
    median_ns = float(np.median(steps)) if regular else 0.0
    return StreamFacts(
        topic=name,
        schema=topic.schema,
        messages=len(stamps),
        rate_hz=(n_items - 1) / span_s if regular else None,
        median_ms=median_ns / 1e6 if regular else None,
        longest_ms=float(steps.max()) / 1e6 if regular else None,
        gaps=int((steps > _GAP_PERIODS * median_ns).sum()) if regular and median_ns > 0 else None,
        missing=missing,
        dropped=dropped,
        mib=topic.n_bytes / 2**20,
        back=back,
    )


def _with_skin(stages: list[StageLatency]) -> list[StageLatency]:
    """Add the way to the skin, where it was known how long the vest's motors take to start."""
    motor = next((s for s in stages if s.stage.startswith(ONSET_STAGE)), None)
    whole = next((s for s in stages if s.stage == "camera to vest: whole"), None)
    if motor is None or whole is None:
        return stages
    rest = [s for s in stages if s is not motor]
    # The motor's onset is one number, measured beforehand: its worst is its only one.
    onset_ms = motor.worst_ms
    p50, p95, p99 = (None if v is None else v + onset_ms for v in (whole.p50_ms, whole.p95_ms, whole.p99_ms))
    skin = StageLatency("camera to skin, with that", whole.n, p50, p95, p99, whole.worst_ms + onset_ms)
    return [*rest, motor, skin]


def _latency(stage: str, times_ns: list[int]) -> StageLatency:
    worst_ms = max(times_ns) / 1e6
    enough = len(times_ns) >= LEAST_SAMPLES
    p50, p95, p99 = (float(v) / 1e6 if enough else None for v in np.percentile(times_ns, (50, 95, 99)))
    return StageLatency(stage, len(times_ns), p50, p95, p99, worst_ms)


def absent_in(path: Path) -> list[str]:
    """Return the sentences of :func:`absent_features` for a file."""
    reader = McapReader(path)
    reader.begin()
    return absent_features(reader.metadata)
