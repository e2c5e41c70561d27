from __future__ import annotations

import time
from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

from tega.config import check_tree
from tega.net.clock import ClockEstimate, Offset
from tega.net.gate import REFUSALS, Gate
from tega.net.messages import ArmCommand, HandCommand, Join, Ping, Pong, Stamped, Welcome, decode, encode
from tega.net.robot import RobotStation

TTL_NS = 100_000_000
_ns = st.integers(-(10**10), 10**10)
_clock = st.none() | st.builds(Offset, _ns, st.integers(0, 10**9))
_stamp = st.builds(Stamped, session=st.integers(1, 3), sequence=st.integers(-5, 30), sent_ns=_ns)


@given(st.lists(st.tuples(_stamp, _ns, _clock), max_size=60), st.integers(1, 3))
def test_whatever_comes_only_the_session_s_own_messages_pass_in_order_and_young(arrivals, session) -> None:
    gate = Gate(ttl_ns=TTL_NS)
    gate.begin(session)
    newest = -1
    for stamp, now_ns, clock in arrivals:
        refusal = gate.refusal(stamp, now_ns, clock)
        assert refusal in ("", *REFUSALS)
        if refusal:
            continue
        assert clock is not None
        assert stamp.session == session
        assert stamp.sequence > newest
        age_ns = now_ns - (stamp.sent_ns - clock.offset_ns)
        assert -(20_000_000 + clock.round_trip_ns // 2) <= age_ns <= TTL_NS
        newest = stamp.sequence
    assert sum(gate.counts.values()) == len(arrivals)


@given(st.permutations(range(12)), st.lists(st.integers(0, 11), max_size=12))
def test_reordered_and_repeated_messages_are_used_at_most_once_and_never_backwards(order, again) -> None:
    gate = Gate(ttl_ns=TTL_NS)
    gate.begin(7)
    used = [
        n
        for n in [*order, *again]
        if not gate.refusal(Stamped(session=7, sequence=n, sent_ns=0), 0, Offset(0, 0))
    ]
    assert used == sorted(set(used))
    assert used[0] == order[0]
    assert used[-1] == 11


def test_without_a_session_nothing_passes() -> None:
    gate = Gate(ttl_ns=TTL_NS)
    stamp = Stamped(session=1, sequence=0, sent_ns=0)
    assert gate.refusal(stamp, 0, Offset(0, 0)) == "foreign"
    gate.begin(1)
    assert gate.refusal(stamp, 0, None) == "no clock"
    gate.begin(None)
    assert gate.refusal(stamp, 0, Offset(0, 0)) == "foreign"


_way = st.integers(0, 50_000_000)


@given(
    st.integers(-(10**15), 10**15),
    st.lists(
        st.tuples(st.integers(0, 200_000_000), _way, st.integers(0, 10**6), _way), min_size=1, max_size=40
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


_HOST = {"station": "robot", "listen": "tcp/127.0.0.1:1"}
_TREE = {"net": _HOST, "arm": {"driver": "simulated-arm"}, "hand": {"driver": "python-can"}}
_KEYS = ("cmd/alice/hand", "cmd/alice/arm", "cmd/alice/clock/ping", "cmd/alice/clock/pong", "cmd/eve/hand")
_number = st.integers(-(2**63), 2**63 - 1)
_real = st.floats(width=64)
_place = st.tuples(_real, _real, _real)
_message = st.one_of(
    st.builds(
        HandCommand, session=st.just(5) | _number, sequence=_number, sent_ns=_number, level=st.integers(-9, 9)
    ),
    st.builds(ArmCommand, session=st.just(5) | _number, sequence=_number, sent_ns=_number),
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
    station = RobotStation(check_tree(_TREE, {}, base=Path()).config, lambda _said: None)
    station._welcome = Welcome(station=1, fingers={}, hand=True, arm=True)
    station._start_ns = time.monotonic_ns()
    join = Join(5, "alice", frame="openxr", dead_man=True, muscles=True)
    assert decode(Welcome, station._join("join/alice", encode(join))).arm
    for key, data in arrivals:
        hear = station._hear_clock if "clock" in key else getattr(station, f"_hear_{key.rpartition('/')[2]}")
        hear(key, data)
    # No question for the clock was ever answered as it was asked, so nothing that came has an age.
    assert station._blocks.next_until(2**62) is None
    assert not any(station._switch(name)[2] for name in ("dead_man", "clutch", "recover"))
    assert "no command from 'alice' yet" in station.missing()
