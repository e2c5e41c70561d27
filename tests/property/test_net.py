from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from tega.net.clock import ClockEstimate, Offset
from tega.net.gate import REFUSALS, Gate
from tega.net.messages import Stamped

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
