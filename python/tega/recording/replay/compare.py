"""Compare the records of a recording with those of its replay, type by type, as both are published."""

from __future__ import annotations

import zlib
from bisect import insort
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from operator import attrgetter, eq
from typing import Any, NamedTuple

import msgspec

from tega import records
from tega.config.choose import chosen_stage, is_outside
from tega.hand import joined_level
from tega.loop.inbox.stream import NEVER_NS
from tega.recording.replay.feed import RecordFeed
from tega.recording.replay.head import Head, contacts_kept, levels_kept
from tega.records import (
    BesideContact,
    BesideIntent,
    Contact,
    HandCommand,
    Picture,
    Record,
    SentFrame,
    VestFrame,
)
from tega.records.bus import Bus
from tega.records.outputs import frames_text
from tega.records.schema import values

# Differences are settled so much later than the tick: stages beside the connected ones may have been so late.
_LATE_NS = 60_000_000_000
_KEPT = 5
_BESIDE = (BesideContact, BesideIntent)

_LOOP_TIMES = frozenset({"t_ns", "taken_ns", "known_ns"})
_POSE = ("x", "y", "z", "qx", "qy", "qz", "qw")
_SPEEDS = ("x", "y", "z", "about_x", "about_y", "about_z")


class Difference(msgspec.Struct, frozen=True):
    """One place where two courses differ.

    Attributes:
        recorded: Its value in the recording, as text; ``absent`` where only the replay has it.
        replayed: Its value in the replay, as text; ``absent`` if only the recording has it.
    """

    t_s: float
    field: str
    recorded: str
    replayed: str


class Comparison(msgspec.Struct):
    """One stream compared.

    Attributes:
        differ: Rows that differ or are in one of them only.
        fields: Number of differing rows, by field.
        last_t_s: Time of the last row that differs; ``None`` where none does.
        as_recorded: Why its records were taken as recorded; empty where they were computed.
    """

    stream: str
    recorded: int
    replayed: int
    differ: int
    fields: dict[str, int]
    last_t_s: float | None
    first: list[Difference]
    as_recorded: str = ""


class Rule(NamedTuple):
    """Comparison of the records of one type."""

    values: Callable[[Any], Mapping[str, Any]]  # those that are compared, by name
    left_out: frozenset[str] = frozenset({"t_ns"})  # fields that are not compared
    listed: bool = False  # a stream without a record is listed, too
    shared: bool = False  # what only the replay has is no difference, and does not count
    kept: str = ""  # why the loop was given the records themselves

    def differing(self, ours: Any, theirs: Any) -> dict[str, tuple[str, str]]:
        """Return both values of each field that differs, as text; a record that is missing is ``None``."""
        if isinstance(ours, Record) and theirs is not None:  # at first sight: nearly always they are equal
            fields = _compared_fields(type(ours), self.left_out)
            first, second = fields(ours), fields(theirs)
            if first == second or all(map(_same, first, second)):
                return {}
        now, again = ({} if record is None else self.values(record) for record in (ours, theirs))
        names = [
            n for n in {**now, **again} if n not in self.left_out and not _same(now.get(n), again.get(n))
        ]
        return {n: (str(now.get(n, "absent")), str(again.get(n, "absent"))) for n in names}


MEASURED = Rule(values, _LOOP_TIMES | {"cci_norm", "eda_norm", "front", "back"})
"""What a metric measures of a contact; the loop adds the rest."""


class Compared:
    """Compares a stream's records with those of its replay as they come, by their times.

    Numbers are equal when every bit is; every NaN equals any other. ``found`` are the findings so far, ``waiting`` the
    records without a counterpart yet, by time: whether replayed, the tick at which it was known, and the record.
    """

    def __init__(self, stream: str, rule: Rule) -> None:
        self.found = Comparison(stream, 0, 0, 0, {}, None, [], rule.kept)
        self.rule, self.last_recorded_ns = rule, 0
        self.waiting: dict[int, list[tuple[bool, int, Any]]] = {}

    def add(self, record: Any, t_ns: int, known_ns: int = 0, *, replayed: bool) -> None:
        """Add a record of the recording or of its replay, with its time and the tick at which it was known."""
        if replayed:
            self.found.replayed += not self.rule.shared
        else:
            self.found.recorded, self.last_recorded_ns = self.found.recorded + 1, t_ns
        waiting = self.waiting.get(t_ns)
        if waiting is None or waiting[0][0] == replayed:
            self.waiting.setdefault(t_ns, []).append((replayed, known_ns or t_ns, record))
            return
        other = waiting.pop(0)[-1]
        if not waiting:
            del self.waiting[t_ns]
        self.found.replayed += self.rule.shared
        self._compare(t_ns, *((other, record) if replayed else (record, other)))

    def settle(self, until_ns: int, cut_ns: int = NEVER_NS) -> None:
        """Note what is on one side only: both are complete up to the tick ``until_ns``.

        What only the replay has from ``cut_ns`` on does not count: the recording was cut there.
        """
        for t_ns in sorted(self.waiting):
            if self.waiting[t_ns][-1][1] < until_ns:
                for replayed, _, record in self.waiting.pop(t_ns):
                    if not replayed:
                        self._compare(t_ns, record, None)
                    elif self.rule.shared:
                        continue
                    elif t_ns < cut_ns:
                        self._compare(t_ns, None, record)
                    else:
                        self.found.replayed -= 1

    def _compare(self, t_ns: int, ours: Any, theirs: Any) -> None:
        found, t_s, different = self.found, t_ns / 1e9, self.rule.differing(ours, theirs)
        found.differ += bool(different)
        for name, texts in different.items():
            found.last_t_s = max(t_s, found.last_t_s or t_s)
            found.fields[name] = found.fields.get(name, 0) + 1
            insort(found.first, Difference(t_s, name, *texts), key=attrgetter("t_s"))
            del found.first[_KEPT:]


@cache
def _compared_fields(kind: type[Record], left_out: frozenset[str]) -> Callable[[Any], tuple[Any, ...]]:
    return attrgetter("__class__", "t_ns", *(name for name in kind.__struct_fields__ if name not in left_out))


def _same(a: Any, b: Any) -> bool:
    return bool(a == b or (a != a and b != b))  # noqa: PLR0124  # every NaN


class Comparing:
    """Subscribes to every type of record that is compared, in the recording and on the bus of its replay."""

    def __init__(self, feed: RecordFeed, bus: Bus) -> None:
        self._feed, self._rules, self._from_ns = feed, _rules(feed.head), feed.head.from_ns
        self._streams: dict[str, Compared] = {}
        # Those of the recording, which is read ahead, and those of the replay that are not compared yet.
        self._new: dict[type[Record], tuple[list[Any], list[Any]]] = {}
        for kind in self._rules:
            fingers = feed.head.baselines if "{finger}" in kind.topic else [""]
            for finger in [] if kind in _BESIDE else fingers:
                self._stream(kind, kind.topic.format(finger=finger))
            if kind is not Picture:
                recorded, replayed = self._new[kind] = [], []
                feed.bus.subscribe(kind, recorded.append, vital=True)
                bus.subscribe(kind, replayed.append, name="replay", vital=True)
        if Picture in self._rules:
            feed.ahead.append(self._add_checksums)
        if SentFrame in self._rules:  # no vest is worn now, which would send what was made
            bus.subscribe(VestFrame, self._add_made, name="replay", vital=True)

    def settle(self, t_ns: int) -> None:
        """Compare what is complete at a tick."""
        self._take(t_ns)
        for compared in self._streams.values():
            compared.settle(t_ns - _LATE_NS)

    def results(self) -> Iterator[Comparison]:
        """Return the comparison of every stream, once both have ended."""
        self._take(NEVER_NS + 1)
        for topic, compared in self._streams.items():
            # Samples may have been recorded later than what was made of them.
            late = topic == records.Adaptation.topic
            cut_ns = compared.last_recorded_ns + 1 if late else self._feed.last_tick_ns
            compared.settle(NEVER_NS, cut_ns if self._feed.end is None else NEVER_NS)
            found = compared.found
            displayed = compared.rule.listed or found.recorded or found.replayed
            if displayed and self._measurable(topic, found.replayed):
                yield found

    def _stream(self, kind: type[Record], topic: str) -> Compared:
        if topic not in self._streams:
            self._streams[topic] = Compared(topic, self._rules[kind])
        return self._streams[topic]

    def _take(self, t_ns: int) -> None:
        """Compare what both sides begin with as far as it is equal, and the rest before a tick one by one."""
        for kind, (recorded, replayed) in self._new.items():
            n = self._count_equal(kind, recorded, replayed)
            known = [one for one in recorded[n:] if one.log_ns < t_ns]
            recorded[:] = [one for one in recorded[n:] if one.log_ns >= t_ns]
            for one in known:
                self._add(one, replayed=False)
            for one in replayed[n:]:
                self._add(one, replayed=True)
            replayed.clear()

    def _count_equal(self, kind: type[Record], recorded: list[Any], replayed: list[Any]) -> int:
        """Count the first records of both sides that are equal one by one; return how many."""
        rule = self._rules[kind]
        if self._from_ns or any(one.waiting for one in self._streams.values() if one.rule is rule):
            return 0
        fields, most = _compared_fields(kind, rule.left_out), min(len(recorded), len(replayed))
        equal = map(eq, map(fields, recorded), map(fields, replayed))
        n = next((k for k, one in enumerate(equal) if not one), most)
        for where, count in Counter(one.where for one in recorded[:n]).items():
            stream = self._stream(kind, where)
            stream.last_recorded_ns = recorded[n - 1].t_ns
            stream.found.recorded += count
            stream.found.replayed += count
        return n

    def _add(self, record: Any, *, replayed: bool) -> None:
        """Add a record to its stream, unless the recording begins later."""
        if self._from_ns == 0 or record.log_ns >= self._from_ns:
            self._stream(type(record), record.where).add(
                record, record.t_ns, record.log_ns, replayed=replayed
            )

    def _add_made(self, frame: VestFrame) -> None:
        sent = SentFrame(t_ns=frame.t_ns, layout=frame.layout, intensities=frame.intensities)
        self._new[SentFrame][1].append(sent)

    def _add_checksums(self, picture: Picture) -> Callable[[], object]:
        """Return a function that compares the checksum of a picture with that of its pixels as they were taken."""
        where, t_ns = picture.where, picture.t_ns
        recorded, again = picture.pixels_crc32, zlib.crc32(picture.image.data)

        def add() -> None:
            self._stream(Picture, where).add(recorded, t_ns, replayed=False)
            self._stream(Picture, where).add(again, t_ns, replayed=True)

        return add

    def _measurable(self, topic: str, n_shared: int) -> bool:
        """Return whether a stage's output can be computed again: here, and with all that the stage remembers."""
        if not topic.startswith("/beside/"):
            return True
        _, _, stage, finger = topic.split("/")
        head, config = self._feed.head, self._feed.head.config
        # The name of a second one of a kind has a number.
        named = [one for one in config.stages.beside if one.name in {stage, stage.rpartition("-")[0]}]
        if finger == "emg":
            return not any(map(is_outside, named))
        remembers = any(
            chosen_stage("metric", one.stages, config.session.preset).kind.memory
            for one in named
            if one.group == "metric"
        )
        n_pictures = self._stream(Picture, Picture.topic.format(finger=finger)).found.recorded
        whole = head.from_ns == 0 and not any(self._feed.lost.values()) and n_shared == n_pictures
        return whole or not remembers


def _rules(head: Head) -> dict[type[Record], Rule]:
    """Return the rule of each type that is compared, in the order of the report."""
    steered = ("frames",) if head.facts["steered"] == "true" else ()
    # Before version 3 the activity was lost on the way to the file.
    lost = ("activity",) if int(head.versions.get("Levels", "1")) < 3 else ()
    rules: dict[type[Record], Rule] = {
        Picture: Rule(lambda picture: {"pixels_crc32": picture}, listed=True),
        Contact: Rule(values, _LOOP_TIMES, listed=True, kept=contacts_kept(head)),
        records.Intent: Rule(
            values, frozenset({"t_ns", "taken_ns", *lost}), listed=True, kept=levels_kept(head)
        ),
        records.Event: Rule(values),
        VestFrame: Rule(values, frozenset({"t_ns", "handed_ns"}), listed=True),
        # The loop once left frames out that the vest showed already: a frame sent then was made at that time.
        SentFrame: Rule(lambda _: {"sent": True}, listed=True, shared=head.facts.get("sent") != "every"),
        # The frames of a hand that closes its own loop are compared by its exchanges.
        HandCommand: Rule(
            lambda one: {"level": joined_level(one.level, one.closure), "frames": frames_text(one.frames)},
            frozenset({"t_ns", *steered}),
            listed=True,
        ),
        records.ReflexGrip: Rule(values),
        records.Adaptation: Rule(values),
        BesideContact: Rule(values, shared=True),
        BesideIntent: Rule(values, shared=True),
        records.HandExchange: Rule(lambda one: {"sent": frames_text(one.sent)}),
        records.ArmTurn: Rule(_turn_values),
    }
    left_out: list[type[Record]] = [] if head.lossless else [Picture, BesideContact]
    left_out += [] if "emg" in head.sources else [records.Intent, HandCommand]
    left_out += [] if "Event" in head.versions else [records.Event]
    # A real vest was worn; it was sent changes only.
    left_out += [] if head.facts["live_vest"] == "true" else [SentFrame]
    return {kind: rule for kind, rule in rules.items() if kind not in left_out}


def _turn_values(turn: records.ArmTurn) -> dict[str, Any]:
    target = {f"target_{axis}": number for axis, number in zip(_POSE, turn.target, strict=False)}
    speeds = {f"velocity_{axis}": number for axis, number in zip(_SPEEDS, turn.velocity, strict=False)}
    return {"state": turn.state, "reason": turn.reason, "holds": turn.holds} | target | speeds
