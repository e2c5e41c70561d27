"""Compare the records of a replay with those of its recording, type by type, as both are published."""

from __future__ import annotations

import zlib
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

from tega import records
from tega.config.choose import chosen_stage, is_outside
from tega.hand import joined_level
from tega.recording.replay.compare import Compared, Comparison
from tega.records import Contact, HandCommand, Picture, Record, SentFrame, VestFrame
from tega.records.schema import values

if TYPE_CHECKING:
    from tega.recording.replay.feed import RecordFeed
    from tega.recording.replay.head import Head
    from tega.records.bus import Bus

# Differences are settled so much later than the tick; stages beside the connected ones may have been later still.
_LATE_NS = 10_000_000_000
_BESIDE_LATE_NS = 60_000_000_000

_POSE = ("x", "y", "z", "qx", "qy", "qz", "qw")
_SPEEDS = ("x", "y", "z", "about_x", "about_y", "about_z")


class _Rule(NamedTuple):
    """Comparison of the records of one type."""

    values: Callable[[Any], Mapping[str, Any]]  # those that are compared, by name
    left_out: frozenset[str] = frozenset({"t_ns"})  # fields that are not compared
    listed: bool = False  # a stream without a record is listed, too
    shared: bool = False  # what only the replay has is no difference


def _rules(head: Head) -> dict[type[Record], _Rule]:
    """Return the rule of each type that is compared, in the order of the report."""
    # Before version 3 the activity was lost on the way to the file.
    lost = ("activity",) if int(head.versions.get("Levels", "1")) < 3 else ()
    rules: dict[type[Record], _Rule] = {
        Picture: _Rule(lambda picture: {"pixels_crc32": picture}, listed=True),
        Contact: _Rule(values, frozenset({"t_ns", "taken_ns", "known_ns"}), listed=True),
        records.Intent: _Rule(values, frozenset({"t_ns", "taken_ns", *lost}), listed=True),
        records.Event: _Rule(values),
        VestFrame: _Rule(values, frozenset({"t_ns", "handed_ns"}), listed=True),
        SentFrame: _Rule(lambda _: {"sent": True}, listed=True),
        HandCommand: _Rule(partial(_command_values, steered=head.facts["steered"] == "true"), listed=True),
        records.ReflexGrip: _Rule(values),
        records.Adaptation: _Rule(values),
        records.BesideContact: _Rule(values, shared=True),
        records.BesideIntent: _Rule(values, shared=True),
        records.HandExchange: _Rule(lambda one: {"sent": _hex(one.sent)}),
        records.ArmTurn: _Rule(_turn_values),
    }
    left_out: list[type[Record]] = [] if head.lossless else [Picture]
    left_out += [] if "emg" in head.sources else [records.Intent, HandCommand]
    left_out += [] if "Event" in head.versions else [records.Event]
    left_out += [] if head.live_vest else [SentFrame]
    return {kind: rule for kind, rule in rules.items() if kind not in left_out}


class Comparing:
    """Subscribes to every type of record that is compared, in the recording and on the bus of its replay."""

    def __init__(self, feed: RecordFeed, bus: Bus) -> None:
        self._feed, self._rules = feed, _rules(feed.head)
        self._outside = {one.name for one in feed.head.config.stages.beside if is_outside(one)}
        self._streams: dict[str, tuple[_Rule, Compared]] = {}
        # The loop once left frames out that the vest showed already: a frame sent then was made at that time.
        self._every, self._sent = feed.head.facts.get("sent") == "every", Counter[int]()
        for kind, rule in self._rules.items():
            fingers = feed.head.baselines if "{finger}" in kind.topic else [""]
            for finger in [] if rule.shared else fingers:
                self._stream(kind, kind.topic.format(finger=finger))
            if kind not in {Picture, SentFrame}:
                feed.bus.subscribe(kind, partial(self._add, "recorded"), vital=True)
                bus.subscribe(kind, partial(self._add, "replayed"), name="replay", vital=True)
        if Picture in self._rules:
            feed.ahead.append(self._add_checksums)
        if SentFrame in self._rules:
            feed.bus.subscribe(SentFrame, self._add_sent, vital=True)
            bus.subscribe(VestFrame, self._add_made, name="replay", vital=True)

    def settle(self, t_ns: int) -> None:
        """Compare what is complete at a tick."""
        for rule, compared in self._streams.values():
            compared.settle(t_ns - (_BESIDE_LATE_NS if rule.shared else _LATE_NS))

    def results(self) -> Iterator[Comparison]:
        """Return the comparison of every stream, once both have ended."""
        for topic, (rule, compared) in self._streams.items():
            cut_ns = None
            if self._feed.end is None and not rule.shared:
                # Samples may have been recorded later than what was made of them.
                late = topic == records.Adaptation.topic
                cut_ns = compared.last_recorded_ns + 1 if late else self._feed.last_tick_ns
            result = compared.result(cut_ns)
            displayed = rule.listed or result.recorded or (result.replayed and not rule.shared)
            if displayed and (not rule.shared or self._measurable(topic, result.replayed)):
                yield result

    def _stream(self, kind: type[Record], topic: str) -> Compared:
        if topic not in self._streams:
            rule = self._rules[kind]
            compared = Compared(topic, rule.values, left_out=rule.left_out, shared=rule.shared)
            self._streams[topic] = rule, compared
        return self._streams[topic][1]

    def _add(self, side: str, record: Any) -> None:
        """Add a record to its stream, unless the recording begins later or another process made it."""
        known_ns = getattr(record, "taken_ns", record.t_ns)
        if known_ns < self._feed.head.from_ns > 0:
            return
        if self._rules[type(record)].shared and self._outside & _stage_names(record.stage):
            return
        getattr(self._stream(type(record), record.where), side)(record, record.t_ns, known_ns)

    def _add_checksums(self, picture: Picture) -> Callable[[], object]:
        """Return a function that compares the checksum of a picture with that of its pixels as they were taken."""
        where, t_ns, recorded = picture.where, picture.t_ns, picture.pixels_crc32
        replayed = zlib.crc32(picture.image.data)

        def add() -> None:
            compared = self._stream(Picture, where)
            compared.recorded(recorded, t_ns)
            compared.replayed(replayed, t_ns)

        return add

    def _add_sent(self, frame: SentFrame) -> None:
        self._sent[frame.t_ns] += not self._every
        if frame.t_ns >= self._feed.head.from_ns:
            self._stream(SentFrame, SentFrame.topic).recorded(frame, frame.t_ns)

    def _add_made(self, frame: VestFrame) -> None:
        sent = self._every or self._sent.pop(frame.t_ns, 0)
        if sent and frame.t_ns >= self._feed.head.from_ns:
            self._stream(SentFrame, SentFrame.topic).replayed(frame, frame.t_ns)

    def _measurable(self, topic: str, n_shared: int) -> bool:
        """Return whether a stage's output can be computed again: of lossless pictures, with all that it remembers."""
        _, _, stage, finger = topic.split("/")
        head, config = self._feed.head, self._feed.head.config
        if finger == "emg" or not head.lossless:
            return finger == "emg"
        remembers = any(
            chosen_stage("metric", one.stages, config.session.preset).kind.memory
            for one in config.stages.beside
            if one.group == "metric" and one.name in _stage_names(stage)
        )
        n_pictures = self._stream(Picture, Picture.topic.format(finger=finger)).n_recorded
        whole = head.from_ns == 0 and not any(self._feed.lost.values()) and n_shared == n_pictures
        return whole or not remembers


def _stage_names(stage: str) -> set[str]:
    """Return the names that a stage beside the connected ones may have in the settings: a second one has a number."""
    return {stage, stage.rpartition("-")[0]}


def _command_values(command: HandCommand, *, steered: bool) -> dict[str, Any]:
    level = {"level": joined_level(command.level, command.closure)}
    # The frames of a hand that closes its own loop are compared by its exchanges.
    return level if steered else level | {"frames": _hex(command.frames)}


def _turn_values(turn: records.ArmTurn) -> dict[str, Any]:
    target = {f"target_{axis}": number for axis, number in zip(_POSE, turn.target, strict=False)}
    speeds = {f"velocity_{axis}": number for axis, number in zip(_SPEEDS, turn.velocity, strict=False)}
    return {"state": turn.state, "reason": turn.reason, "holds": turn.holds} | target | speeds


def _hex(frames: tuple[records.BusFrame, ...]) -> str:
    return " ".join(f"{f.id:03X}#{'R' if f.remote else f.data.hex().upper()}" for f in frames)
