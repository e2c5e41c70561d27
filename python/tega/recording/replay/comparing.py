"""Compare the records of a replay with those of its recording, type by type, as both are published."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence, Set
from functools import partial
from typing import TYPE_CHECKING, Any

from tega.config.choose import chosen_stage, is_outside
from tega.hand import joined_level
from tega.recording.replay.compare import Compared, Comparison
from tega.records import (
    Adaptation,
    BesideContact,
    BesideIntent,
    BusFrame,
    Contact,
    Event,
    HandCommand,
    Intent,
    Record,
    ReflexGrip,
    SentFrame,
    VestFrame,
)
from tega.records.schema import values

if TYPE_CHECKING:
    from tega.recording.replay.feed import RecordFeed
    from tega.recording.replay.measured import Measured
    from tega.records.bus import Bus

# When things were done is no result.
_WHEN = frozenset({"t_ns", "taken_ns", "known_ns"})
# Differences are settled so much later than the tick; stages beside the connected ones may have been later still.
_LATE_NS = 10_000_000_000
_BESIDE_LATE_NS = 60_000_000_000

Values = Callable[[Any], dict[str, Any]]


class Comparing:
    """Subscribes to every type of record of both, the recording and its replay.

    Args:
        feed: The recording.
        measured: What is measured again.
        bus: Bus of the replay.
    """

    def __init__(self, feed: RecordFeed, measured: Measured, bus: Bus) -> None:
        self._feed, self._measured, self._bus = feed, measured, bus
        measured.checked = self._checked
        head = feed.head
        self._pixels = {finger: Compared(f"/tactile/{finger}/image") for finger in head.baselines}
        self._streams: dict[str, Compared] = {}
        self._always: set[str] = set()
        self._beside: dict[str, Compared] = {}
        for finger in head.baselines:
            self._expect(Contact.topic.format(finger=finger), partial(_row, without=_WHEN))
        self._compare(Contact)
        steered = head.facts["steered"] == "true"
        if "emg" in head.sources:
            # Before version 3 it was lost on the way to the file.
            lost = {"activity"} if int(head.versions.get("Levels", "1")) < 3 else set()
            self._expect(Intent.topic, partial(_row, without=_WHEN | lost))
            self._compare(Intent)
        if "Event" in head.versions:
            self._compare(Event, values)
        self._expect(VestFrame.topic, _vest_row)
        self._compare(VestFrame)
        if head.live_vest:
            self._compare_sent()
        if "emg" in head.sources:
            self._expect(HandCommand.topic, partial(_command_row, steered=steered))
            self._compare(HandCommand)
        self._compare(ReflexGrip, values)
        self._compare(Adaptation, values)
        self._compare_beside()

    def settle(self, t_ns: int) -> None:
        """Compare what is complete at a tick."""
        for compared in (*self._pixels.values(), *self._streams.values()):
            compared.settle(t_ns - _LATE_NS)
        for compared in self._beside.values():
            compared.settle(t_ns - _BESIDE_LATE_NS)

    def results(self) -> Iterator[Comparison]:
        """Return the comparison of every stream, once both have ended."""
        if self._feed.head.lossless:
            yield from (compared.result() for compared in self._pixels.values())
        cut = self._feed.end is None
        for topic, compared in self._streams.items():
            if topic in self._always or compared.n_recorded or compared.n_replayed:
                # Samples may have been recorded later than what was made of them.
                last_ns = (
                    compared.last_recorded_ns + 1 if topic == Adaptation.topic else self._feed.last_tick_ns
                )
                yield compared.result(last_ns if cut else None)
        for topic, compared in self._beside.items():
            result = compared.result()
            if result.recorded and self._measurable(topic, result.replayed):
                yield result

    def _checked(self, finger: str, t_ns: int, then: int, now: int) -> None:
        """Compare the checksum of a picture with that of its pixels as they were taken."""
        compared = self._pixels[finger]
        compared.recorded({"pixels_crc32": then}, t_ns)
        compared.replayed({"pixels_crc32": now}, t_ns)

    def _expect(self, topic: str, row: Values) -> None:
        """Show a stream in any case, even without a record."""
        self._streams[topic] = Compared(topic, row)
        self._always.add(topic)

    def _compare(self, kind: type[Record], row: Values = values) -> None:
        streams, from_ns = self._streams, self._feed.head.from_ns
        if kind.topic not in streams and "{" not in kind.topic:
            streams[kind.topic] = Compared(kind.topic, row)

        def recorded(record: Any) -> None:
            if (known_ns := _known_ns(record)) >= from_ns:
                streams[record.where].recorded(record, record.t_ns, known_ns)

        def replayed(record: Any) -> None:
            if (known_ns := _known_ns(record)) >= from_ns:
                streams[record.where].replayed(record, record.t_ns, known_ns)

        self._subscribe(kind, recorded, replayed)

    def _subscribe(
        self, kind: type[Record], recorded: Callable[[Any], None], replayed: Callable[[Any], None]
    ) -> None:
        self._feed.bus.subscribe(kind, recorded, vital=True)
        self._bus.subscribe(kind, replayed, name="replay", vital=True)

    def _compare_sent(self) -> None:
        """Compare the frames sent to a real vest with those that the loop makes."""
        compared = Compared(SentFrame.topic)
        self._streams[SentFrame.topic], from_ns = compared, self._feed.head.from_ns
        self._always.add(SentFrame.topic)
        # The loop once left frames out that the vest showed already: a frame sent then was made at that time.
        every, sent = self._feed.head.facts.get("sent") == "every", Counter[int]()

        def recorded(frame: SentFrame) -> None:
            sent[frame.t_ns] += not every
            if frame.t_ns >= from_ns:
                compared.recorded({"sent": True}, frame.t_ns)

        def replayed(frame: VestFrame) -> None:
            if (every or sent.pop(frame.t_ns, 0)) and frame.t_ns >= from_ns:
                compared.replayed({"sent": True}, frame.t_ns)

        self._feed.bus.subscribe(SentFrame, recorded, vital=True)
        self._bus.subscribe(VestFrame, replayed, name="replay", vital=True)

    def _compare_beside(self) -> None:
        """Compare what the stages beside the connected ones made of each picture and block of samples."""
        config, from_ns = self._measured.config, self._feed.head.from_ns
        outside = {one.name for one in config.stages.beside if is_outside(one)}

        def compared(record: Any) -> Compared | None:
            if {record.stage, record.stage.rpartition("-")[0]} & outside:
                return None  # another process made it
            topic = record.where
            if topic not in self._beside:
                self._beside[topic] = Compared(topic, partial(_row, without={"t_ns"}), shared=True)
            return self._beside[topic]

        def recorded(record: Any) -> None:
            if (found := compared(record)) is not None:
                found.recorded(record, record.t_ns)

        def replayed(record: Any) -> None:
            if record.t_ns >= from_ns and (found := compared(record)) is not None:
                found.replayed(record, record.t_ns)

        kinds: tuple[type[Record], ...] = (BesideContact, BesideIntent)
        for kind in kinds:
            self._subscribe(kind, recorded, replayed)

    def _measurable(self, topic: str, n_shared: int) -> bool:
        """Return whether a stage's output can be computed again: of lossless pictures, with all that it remembers."""
        _, _, stage, finger = topic.split("/")
        if finger == "emg":
            return True
        feed, config = self._feed, self._measured.config
        if not feed.head.lossless:
            return False
        remembers = any(
            chosen_stage("metric", one.stages, config.session.preset).kind.memory
            for one in config.stages.beside
            if one.group == "metric" and one.name in {stage, stage.rpartition("-")[0]}
        )
        whole = feed.head.from_ns == 0 and not feed.dropped and n_shared == feed.n_frames.get(finger, 0)
        return not remembers or whole


def _known_ns(record: Any) -> int:
    """Return the tick at which a record was taken in or made."""
    known_ns: int = getattr(record, "taken_ns", record.t_ns)
    return known_ns


def _row(record: Record, without: Set[str]) -> dict[str, Any]:
    return {name: value for name, value in values(record).items() if name not in without}


def _vest_row(frame: VestFrame) -> dict[str, Any]:
    return {"layout": frame.layout, "intensities": list(frame.intensities)}


def _command_row(command: HandCommand, *, steered: bool) -> dict[str, Any]:
    level = {"level": joined_level(command.level, command.closure)}
    # The frames of a hand that closes its own loop are compared by its exchanges.
    return level if steered else level | {"frames": _hex(command.frames)}


def _hex(frames: Sequence[BusFrame]) -> str:
    return " ".join(f"{f.id:03X}#{'R' if f.remote else f.data.hex().upper()}" for f in frames)
