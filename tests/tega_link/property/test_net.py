# mypy: allow-untyped-defs, allow-incomplete-defs, allow-untyped-calls, allow-untyped-decorators
from __future__ import annotations

import itertools
import math
import time
from pathlib import Path
from typing import Any, get_args

import msgspec
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from tega.config import check_tree
from tega.devices.base import EmgChunk
from tega.loop.inbox.sources import samples_of
from tega.records import Contact, Intent, PoseNumbers
from tega.records.bus import Bus
from tega_link.behind import SampleReceiver, SampleSender
from tega_link.clock import ClockEstimate, Offset, Refusal, StampGate
from tega_link.commands import Commands
from tega_link.ends import FarMuscles, FarTracker
from tega_link.messages import (
    ArmMessage,
    Feature,
    HandMessage,
    Join,
    Ping,
    Pong,
    Samples,
    Stamped,
    Welcome,
    decode,
    encode,
)
from tega_link.robot import RobotStation
from tega_link.touch import FarTouch

TTL_NS = 100_000_000
_ns = st.integers(-(10**10), 10**10)
_clock = st.none() | st.builds(Offset, _ns, st.integers(0, 10**9))
_stamp = st.builds(Stamped, session=st.integers(1, 3), sequence=st.integers(-5, 30), sent_ns=_ns)


@given(st.lists(st.tuples(_stamp, _ns, _clock), max_size=60), st.none() | st.integers(1, 3))
def test_whatever_comes_only_the_session_s_own_messages_pass_in_order_and_young(arrivals, session) -> None:
    gate = StampGate(ttl_ns=TTL_NS)
    gate.begin(session)
    newest = -1
    for stamp, now_ns, clock in arrivals:
        refusal = gate.refusal(stamp, now_ns, clock)
        assert refusal in ("", *get_args(Refusal))
        if refusal:
            continue
        assert clock is not None
        assert stamp.session == session
        assert stamp.sequence > newest
        age_ns = now_ns - (stamp.sent_ns - clock.offset_ns)
        assert age_ns >= -(20_000_000 + clock.round_trip_ns // 2)
        assert age_ns + clock.round_trip_ns / 2 <= TTL_NS
        newest = stamp.sequence
    assert sum(gate.counts.values()) == len(arrivals)


@given(st.permutations(range(12)), st.lists(st.integers(0, 11), max_size=12))
def test_reordered_and_repeated_messages_are_used_at_most_once_and_never_backwards(order, again) -> None:
    gate = StampGate(ttl_ns=TTL_NS)
    gate.begin(7)
    used = [
        n
        for n in [*order, *again]
        if not gate.refusal(Stamped(session=7, sequence=n, sent_ns=0), 0, Offset(0, 0))
    ]
    assert used == sorted(set(used))
    assert used[0] == order[0]
    assert used[-1] == 11


_route = st.integers(0, 50_000_000)


@given(
    st.integers(-(10**15), 10**15),
    st.lists(
        st.tuples(st.integers(0, 200_000_000), _route, st.integers(0, 10**6), _route), min_size=1, max_size=40
    ),
)
def test_the_clock_s_offset_is_wrong_by_at_most_half_the_shortest_round_trip(offset_ns, questions) -> None:
    estimate, now_ns, kept = ClockEstimate(), 0, []
    for wait_ns, there_ns, busy_ns, back_ns in questions:
        now_ns += wait_ns
        t1_ns = now_ns + there_ns + offset_ns
        end_ns = now_ns + there_ns + busy_ns + back_ns
        estimate.add(now_ns, t1_ns, t1_ns + busy_ns, end_ns)
        kept.append((end_ns, there_ns + back_ns))
        now_ns = end_ns
    best = estimate.best(now_ns)
    assert best is not None
    assert best.round_trip_ns == min(trip for end_ns, trip in kept if now_ns - end_ns <= 10**10)
    assert abs(best.offset_ns - offset_ns) <= best.round_trip_ns / 2 + 1
    assert estimate.best(now_ns + 10**10 + 1) is None


@given(*[st.integers(-(10**12), 10**12)] * 4)
def test_answers_that_contradict_themselves_change_nothing(t0_ns, t1_ns, t2_ns, t3_ns) -> None:
    estimate = ClockEstimate()
    estimate.add(t0_ns, t1_ns, t2_ns, t3_ns)
    best = estimate.best(t3_ns)
    assert (best is None) == (t2_ns < t1_ns or (t3_ns - t0_ns) < (t2_ns - t1_ns))


class _Machines:
    """Two machines whose clocks are apart, and ways that are as unlike as they please; nobody is told how much."""

    def __init__(self, offset_ns: int) -> None:
        self.now_ns, self.offset_ns, self.sequence = 10**12, offset_ns, 0
        self.estimate = ClockEstimate()
        self.tracker = FarTracker("openxr")
        self.robot = Commands(
            ttl_ns=TTL_NS,
            offset=self.estimate.best,
            hand=True,
            tracker=self.tracker,
            clock=lambda: self.now_ns,
        )
        self.robot.begin(7)
        self.robot.start(self.now_ns, None)
        self.sent_ns: dict[int, int] = {}  # when each was truly sent
        self.levels: dict[int, int] = {}  # level: the newest command with it that was taken in
        self.held = 0  # the newest command for the arm that was taken in

    def ask(self, there_ns: int, back_ns: int) -> None:
        t0_ns = self.now_ns
        t1_ns = t0_ns + there_ns + self.offset_ns
        self.now_ns += there_ns + back_ns
        self.estimate.add(t0_ns, t1_ns, t1_ns, self.now_ns)

    def send(self, way_ns: int) -> None:
        self.sequence += 1
        sent_ns = self.now_ns
        self.now_ns += way_ns
        stamp: dict[str, Any] = {"session": 7, "sequence": self.sequence, "sent_ns": sent_ns + self.offset_ns}
        self.sent_ns[self.sequence] = sent_ns
        level = 1 + self.sequence % 5
        pose = PoseNumbers(stamp["sent_ns"], (float(self.sequence), 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
        if (
            self.robot.hand(encode(HandMessage(**stamp, intent=Intent(t_ns=stamp["sent_ns"], level=level))))
            is not None
        ):
            self.levels[level] = self.sequence
        if self.robot.arm(encode(ArmMessage(**stamp, pose=pose, dead_man=True, recover=True))) is not None:
            self.held = self.sequence

    def uses(self) -> list[int]:
        """Return the numbers of the commands that the robot would use now."""
        used: list[int] = []
        while (block := self.robot.blocks.next_until(2**62)) is not None:
            used.append(self.levels[block.level])
        used += [round(float(pose.position_m[0])) for pose in self.tracker.read(self.now_ns)]
        if self.robot.switch("dead_man")[2] or self.robot.switch("recover")[2]:
            used.append(self.held)
        if not self.robot.missing("alice"):  # else the run holds, whatever the level was
            used.append(max(self.levels.values()))
        return used


_ways = st.integers(0, 120_000_000)
_steps = st.lists(
    st.one_of(
        st.tuples(st.just("ask"), _ways, _ways),
        st.tuples(st.just("send"), _ways),
        st.tuples(st.just("rest"), st.integers(0, 150_000_000)),
    ),
    max_size=40,
)


@given(st.integers(-(10**15), 10**15), _steps)
@example(0, [("ask", 0, 100_000_000), ("send", 110_000_000)])  # by the estimate alone it is 60 ms old
@example(0, [("ask", 0, 0), ("send", 1_000_000), ("rest", 100_000_000)])
def test_whatever_the_ways_and_the_rests_nothing_is_used_that_is_truly_older_than_the_limit(
    offset_ns, steps
) -> None:
    machines = _Machines(offset_ns)
    for subject, *how in steps:
        if subject == "rest":  # this program stands still, and then looks at what lies there
            machines.now_ns += how[0]
        else:
            getattr(machines, subject)(*how)
        if subject != "send" or machines.sequence % 2:  # now and then two commands wait
            assert all(machines.now_ns - machines.sent_ns[n] <= TTL_NS for n in machines.uses())


def test_on_a_quick_link_a_command_is_used_until_just_before_the_limit_and_not_after() -> None:
    for rest_ns, used in ((98_000_000, True), (101_000_000, False)):
        machines = _Machines(10**9)
        machines.ask(200_000, 200_000)
        machines.send(200_000)
        machines.now_ns += rest_ns
        assert bool(machines.uses()) == used


@given(
    st.lists(st.tuples(st.integers(1, 40), st.integers(0, 3), st.booleans()), max_size=40),
    st.integers(-(10**12), 10**12),
)
def test_samples_arrive_as_they_were_and_what_is_lost_shows_in_their_numbers(chunks, offset_ns) -> None:
    sequence, lost = itertools.count(), iter([is_lost for _, _, is_lost in chunks])
    muscles, messages = FarMuscles(), list[bytes]()
    stamp = {"session": 7, "sent_ns": offset_ns}
    receiver = SampleReceiver(muscles)
    sender = SampleSender(messages.append, lambda: stamp | {"sequence": next(sequence)}, lambda: True)
    receiver.begin(7)
    sender.begin(0)
    given: dict[int, list[float]] = {}
    n = t_ns = 0
    for size, gap, _ in chunks:
        n, t_ns = n + gap, t_ns + (size + gap) * 10**6
        samples = np.arange(n, n + size)[:, None] + np.array([[0.0, 0.1, 1 / 3]])
        given |= {n + k: row.tolist() for k, row in enumerate(samples)}
        sender.take(samples_of(EmgChunk(t_ns + offset_ns, n, samples), live=False, start_ns=0))
        n += size
    came: dict[int, list[float]] = {}
    for message in [m for m in messages if not next(lost)]:
        receiver.take(message, 10**12, Offset(offset_ns, 0))
        receiver.take(message, 10**12, Offset(offset_ns, 0))  # one that comes twice counts once
        chunk = muscles.read(0.0)
        assert chunk is not None
        assert muscles.read(0.0) is None
        assert chunk.t_ns >= (chunk.first_index + len(chunk.samples)) * 10**6
        came |= {chunk.first_index + k: row.tolist() for k, row in enumerate(chunk.samples)}
    assert came.items() <= given.items()


@given(st.binary(max_size=80), st.integers(-5, 70), st.integers(-5, 5))
def test_samples_that_are_not_whole_are_not_recorded(data, n_channels, first_index) -> None:
    muscles = FarMuscles()
    receiver = SampleReceiver(muscles)
    receiver.begin(7)
    message = Samples(
        session=7, sequence=0, sent_ns=0, t_ns=0, first_index=first_index, n_channels=n_channels, samples=data
    )
    receiver.take(encode(message), 0, Offset(0, 0))
    receiver.take(data, 0, Offset(0, 0))
    chunk = muscles.read(0.0)
    whole = 1 <= n_channels <= 64 and data and len(data) % (8 * n_channels) == 0 and first_index >= 0
    assert (chunk is not None) == bool(whole)


_HOST = {"station": "robot", "listen": "tcp/127.0.0.1:1"}
_TREE = {"net": _HOST, "arm": {"driver": "simulated-arm"}, "hand": {"driver": "python-can"}}
_KEYS = ("cmd/alice/hand", "cmd/alice/arm", "cmd/alice/clock/ping", "cmd/alice/clock/pong", "cmd/eve/hand")
_number = st.integers(-(2**63), 2**63 - 1)
_real = st.floats(width=64)
_place = st.tuples(_real, _real, _real)
_intent = st.builds(Intent, t_ns=_number, level=st.integers(-9, 9), closure=st.none() | _real)
_message = st.one_of(
    st.builds(
        HandMessage,
        session=st.just(5) | _number,
        sequence=_number,
        sent_ns=_number,
        intent=st.none() | _intent,
    ),
    st.builds(ArmMessage, session=st.just(5) | _number, sequence=_number, sent_ns=_number),
    st.builds(Ping, session=st.just(5) | _number, t0_ns=_number),
    st.builds(Pong, session=st.just(5) | _number, t0_ns=_number, t1_ns=_number, t2_ns=_number),
).map(encode)


@st.composite
def _damaged(draw: st.DrawFn) -> bytes:
    """A message, or one with bytes missing, changed or added, or none at all."""
    whole = bytearray(draw(_message))
    for at, byte in draw(st.lists(st.tuples(st.integers(0, 200), st.integers(0, 255)), max_size=4)):
        whole[at % len(whole)] = byte
    return bytes(whole[: draw(st.integers(0, len(whole)))]) + draw(st.binary(max_size=3))


@given(
    st.lists(st.tuples(st.sampled_from(_KEYS), _message | _damaged() | st.binary(max_size=60)), max_size=30)
)
def test_no_bytes_bring_the_robot_s_station_down_or_close_its_hand(arrivals) -> None:
    station = RobotStation(check_tree(_TREE, {}, base=Path()).config, Bus())
    station._reception.welcome = Welcome(station=1, fingers={}, hand=True, arm=True)
    station._commands.start(time.monotonic_ns(), None)
    join = Join(5, "alice", frame="openxr", dead_man=True, muscles=True)
    assert decode(Welcome, station._reception.join("join/alice", encode(join))).arm
    for key, data in arrivals:
        receive = station._receive_clock if "clock" in key else station._receive_command
        receive(key, data)
    # No question for the clock was ever answered as it was asked, so nothing that came has an age.
    assert station._commands.blocks.next_until(2**62) is None
    assert not any(station._commands.switch(name)[2] for name in ("dead_man", "clutch", "recover"))
    assert "no command from 'alice' yet" in station.missing()


@given(
    st.builds(
        Contact,
        finger=st.text(max_size=5),
        t_ns=_number,
        in_contact=st.booleans(),
        mass=_real,
        cci=_real,
        peak=_real,
        eda=st.integers(0, 80_000) | st.integers(-(2**63), 2**64 - 1),
        force_n=st.none() | _real,
    )
)
@settings(max_examples=15)
def test_a_contact_comes_over_the_link_as_it_was_or_not_at_all(contact) -> None:
    touch = FarTouch("robot", ttl_ns=2**62)
    welcome = Welcome(station=1, fingers={"thumb": 60.0}, hand=False, arm=False)
    touch.welcome(welcome)
    stream = touch.fingers(welcome)["thumb"].stream
    touch._start_ns = 0
    data = encode(Feature(session=1, sequence=0, sent_ns=10, t_ns=5, contact=contact))
    touch.feature("thumb", data, 10, Offset(0, 0))
    assert stream is not None
    item = stream.next_until(10)
    numbers = (contact.mass, contact.cci, contact.peak, contact.force_n or 0.0)
    whole = all(map(math.isfinite, numbers)) and 0 <= contact.eda <= 4096 * 4096
    # By their text, in which one NaN is like another.
    assert repr(item) == (repr(msgspec.structs.replace(contact, t_ns=5)) if whole else "None")
    assert touch.summary()["refused_features"] == ({} if whole else {"malformed": 1})


_STAMP: dict[str, Any] = {"session": 1, "sequence": 0, "sent_ns": 0}
_FLAT: Any = (0.0, 0.0)


@pytest.mark.parametrize(
    ("message", "sentence"),
    [
        (HandMessage(**_STAMP, intent=Intent(t_ns=0, level=6)), "level 6"),
        (HandMessage(**_STAMP, intent=Intent(t_ns=0, level=3, closure=1.5)), "closure 1.5"),
        (HandMessage(**_STAMP, intent=Intent(t_ns=0, level=3, closure=math.nan)), "closure nan"),
        (HandMessage(**_STAMP, intent=Intent(t_ns=0, level=3, closure=0.55)), ""),
        (HandMessage(**_STAMP), ""),
        (ArmMessage(**_STAMP, pose=PoseNumbers(0, _FLAT, (0.0, 0.0, 0.0, 1.0))), "three and four"),
        (ArmMessage(**_STAMP, pose=PoseNumbers(0, (0.0, 0.0, math.inf), (0.0, 0.0, 0.0, 1.0))), "not finite"),
    ],
)
def test_a_command_goes_over_the_link_as_it_is_or_is_refused(message: Any, sentence: str) -> None:
    assert sentence in message.malformed()
    assert bool(message.malformed()) == bool(sentence)
    if not sentence:
        assert decode(type(message), encode(message)) == message
