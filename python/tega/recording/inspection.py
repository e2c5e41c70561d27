"""What is in a recording: streams, their true rates, gaps, losses, latency."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from tega.recording.mcap_reader import McapReader

__all__ = ["Inspection", "Latency", "Marked", "StreamFacts", "inspect_file"]

# Two and a half periods without an item are a gap: one was lost, and not only late.
_GAP_PERIODS = 2.5


class StreamFacts(msgspec.Struct, frozen=True):
    """One stream.

    Attributes:
        topic: Its name.
        schema: Name of its messages' schema.
        messages: How many.
        rate_hz: Of messages between the first and the last stamp; of EMG, of samples; ``None`` where there are too few.
        median_ms: The usual distance of two stamps.
        longest_ms: The longest.
        gaps: Distances longer than two and a half times the usual one.
        missing: Items that never came, by the gaps in their numbers.
        dropped: Items that were not recorded, since the disk did not keep up.
        mib: Size before the file's compression.
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


class Latency(msgspec.Struct, frozen=True):
    """How long one stage takes, milliseconds."""

    stage: str
    n: int
    p50_ms: float
    p95_ms: float
    p99_ms: float
    worst_ms: float


class Marked(msgspec.Struct, frozen=True):
    """A marker or a change of the run's state."""

    t_s: float
    text: str


class Inspection(msgspec.Struct, frozen=True):
    """What is in a recording.

    Attributes:
        file: Its name.
        complete: Whether the run that made it finished it.
        cut: Why reading ended early, in a word; ``""`` where it did not.
        lossless: Whether the pictures are as they were.
        start: Time of day at the start of the session, nanoseconds since 1970.
        duration_s: From the start to the newest stamp.
        ended: How the run ended; ``""`` where that was not recorded.
        mib: Size of the file.
        config_sha256: Of the settings' text.
        versions: Of everything the results may depend on.
        sources: What the inputs called themselves.
        streams: By topic.
        latency: By stage; empty where the run's time was not the world's, and without stages that a
            recorded source does not have.
        markers: In order.
        states: In order.
        log: Lines of the program.
    """

    file: str
    complete: bool
    cut: str
    lossless: bool
    start: int
    duration_s: float
    ended: str
    mib: float
    config_sha256: str
    versions: dict[str, str]
    sources: dict[str, str]
    streams: list[StreamFacts]
    latency: list[Latency]
    markers: list[Marked]
    states: list[Marked]
    log: list[Marked]


class _Topic:
    def __init__(self, schema: str) -> None:
        self.schema = schema
        self.stamps: list[int] = []
        self.numbers: list[tuple[int, int]] = []
        self.n_bytes = 0


def inspect_file(path: Path) -> Inspection:
    """Look through a recording; pictures are counted, not decoded.

    Raises:
        RecordingError: It cannot be read.
        MissingExtraError: A package of the extra ``record`` is not installed.
    """
    reader = McapReader(path)
    topics: dict[str, _Topic] = {}
    stages: dict[str, list[int]] = defaultdict(list)
    path_of = _Stages(stages)
    dropped: dict[str, int] = {}
    markers: list[Marked] = []
    states: list[Marked] = []
    log: list[Marked] = []
    ended, newest_ns, epoch_ns = "", 0, 0
    for message in reader.messages(lambda topic: not topic.endswith("/image")):
        if not epoch_ns:
            epoch_ns = int(reader.metadata.get("tega", {}).get("epoch_ns", "0"))
        topic = topics.setdefault(message.topic, _Topic(message.schema))
        value, t_ns = message.value, message.log_ns - epoch_ns
        topic.n_bytes += message.n_bytes
        stamp = getattr(value, "t_ns", t_ns)
        if message.schema == "tega.HandExchange":
            stamp = t_ns
        topic.stamps.append(stamp)
        newest_ns = max(newest_ns, t_ns)
        match message.schema:
            case "tega.Frame":
                topic.numbers.append((value.seq, 1))
                path_of.frame(message.topic.split("/")[2], value)
            case "tega.EmgSamples":
                topic.numbers.append((value.first_index, len(value.samples) // max(value.n_channels, 1)))
                stages["EMG samples: captured to received"].append(value.received_ns - value.t_ns)
            case "tega.Contact":
                path_of.contact(message.topic.split("/")[2], value)
            case "tega.Levels":
                stages["EMG block: captured to taken in"].append(value.taken_ns - value.t_ns)
            case "tega.VestFrame" if message.topic == "/vest/frame":
                path_of.vest(value)
            case "tega.Marker":
                markers.append(Marked(value.t_ns / 1e9, value.text))
            case "tega.State":
                said = f"{value.state}: {value.reason}" if value.reason else value.state
                states.append(Marked(value.t_ns / 1e9, said))
            case "foxglove.Log":
                log.append(Marked(t_ns / 1e9, value.message))
            case "tega.Value":
                stages[value.name].append(round(value.value * 1e6))
            case "tega.End":
                ended = value.ended
            case "tega.Status":
                dropped = dict(zip(value.dropped_topics, value.dropped_counts, strict=True))
            case _:
                pass
    dropped |= {name: int(n) for name, n in reader.metadata.get("dropped", {}).items()}
    facts = reader.metadata.get("tega", {})
    sources = {
        name: f"{info['driver']}: {info['label']}"
        for name, text in reader.metadata.get("sources", {}).items()
        if (info := msgspec.json.decode(text))
    }
    pace = b'pace = "real"' in reader.files.get("session.toml", b"")
    return Inspection(
        file=path.name,
        complete=not reader.cut and "end" in reader.metadata,
        cut=reader.cut,
        lossless=facts.get("lossless") == "true",
        start=epoch_ns,
        duration_s=newest_ns / 1e9,
        ended=ended,
        mib=path.stat().st_size / 2**20,
        config_sha256=facts.get("config_sha256", ""),
        versions=reader.metadata.get("versions", {}),
        sources=sources,
        streams=[
            _facts(name, topic, dropped.get(name, 0)) for name, topic in sorted(topics.items())
        ],
        latency=[_latency(stage, times) for stage, times in stages.items() if any(times) and pace],
        markers=markers,
        states=states,
        log=log,
    )


class _Stages:
    """Follows each picture to the first vest frame made with it."""

    def __init__(self, stages: dict[str, list[int]]) -> None:
        self._stages = stages
        self._received: dict[tuple[str, int], int] = {}
        self._waiting: list[tuple[int, int]] = []

    def frame(self, finger: str, value: Any) -> None:
        self._received[finger, value.t_ns] = value.received_ns
        self._stages["picture: captured to received"].append(value.received_ns - value.t_ns)

    def contact(self, finger: str, value: Any) -> None:
        received_ns = self._received.pop((finger, value.t_ns), None)
        if received_ns is None:
            return
        self._stages["picture: received to taken in"].append(value.known_ns - received_ns)
        self._waiting.append((value.t_ns, received_ns))

    def vest(self, value: Any) -> None:
        self._stages["vest frame: deadline to handed over"].append(value.handed_ns - value.t_ns)
        for captured_ns, received_ns in self._waiting:
            self._stages["picture received to vest frame handed over"].append(value.handed_ns - received_ns)
            self._stages["picture captured to vest frame handed over"].append(value.handed_ns - captured_ns)
        self._waiting.clear()


def _facts(name: str, topic: _Topic, dropped: int) -> StreamFacts:
    stamps = np.array(sorted(topic.stamps), np.int64)
    steps = np.diff(stamps)
    span_s = (stamps[-1] - stamps[0]) / 1e9 if len(stamps) else 0.0
    n_items, missing = len(stamps), 0
    if topic.numbers:
        missing = sum(
            max(0, after - (before + n)) for (before, n), (after, _) in zip(topic.numbers, topic.numbers[1:], strict=False)
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
    )


def _latency(stage: str, times_ns: list[int]) -> Latency:
    p50, p95, p99, worst = (float(v) / 1e6 for v in np.percentile(times_ns, (50, 95, 99, 100)))
    return Latency(stage, len(times_ns), p50, p95, p99, worst)
