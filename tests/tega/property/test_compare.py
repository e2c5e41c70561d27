"""Streams compared as they come are found to differ as those compared at once, whenever they are settled."""

from __future__ import annotations

import math

from hypothesis import given
from hypothesis import strategies as st

from tega.loop.inbox.stream import NEVER_NS
from tega.recording.replay.compare import Compared, Comparison, Rule

_VALUES = st.sampled_from([0.0, 1.0, math.nan])
# Time and value; how much later what has a time is known on both sides.
_ROWS = st.lists(st.tuples(st.integers(0, 30), _VALUES), max_size=25)
_LATE = st.lists(st.integers(0, 4), min_size=31, max_size=31)

RULE = Rule(lambda value: {"value": value})
Rows = list[tuple[int, int, float]]


def in_order(rows: list[tuple[int, float]], late_ns: list[int]) -> Rows:
    """Return rows by time, with the ticks at which they are known, which rise with the times."""
    known_ns = [max(t + late_ns[t] for t in range(k + 1)) for k in range(31)]
    return [(t_ns, known_ns[t_ns], value) for t_ns, value in sorted(rows, key=lambda row: row[0])]


def compared(recorded: Rows, replayed: Rows, settled: list[int], cut_ns: int) -> Comparison:
    """Give both sides their rows by the ticks at which they are known, and settle at some of these ticks."""
    found = Compared("stream", RULE)
    for tick in range(40):
        if tick in settled:
            found.settle(tick)
        for side, rows in enumerate((recorded, replayed)):
            for t_ns, known_ns, value in rows:
                if known_ns == tick:
                    found.add(value, t_ns, known_ns, replayed=bool(side))
    found.settle(NEVER_NS, cut_ns)
    return found.found


@given(_ROWS, _ROWS, _LATE, st.lists(st.integers(0, 39)), st.just(NEVER_NS) | st.integers(20, 30))
def test_settling_early_finds_what_settling_once_finds(recorded, replayed, late_ns, settled, cut_ns):
    ours, theirs = in_order(recorded, late_ns), in_order(replayed, late_ns)
    ours = [row for row in ours if row[1] < cut_ns]  # the recording was cut there
    settled = [tick for tick in settled if tick <= cut_ns]
    assert compared(ours, theirs, settled, cut_ns) == compared(ours, theirs, [], cut_ns)


@given(_ROWS, _LATE)
def test_a_stream_is_the_same_as_itself_and_is_not_kept(rows, late_ns):
    found = Compared("stream", RULE)
    for t_ns, known_ns, value in in_order(rows, late_ns):
        found.add(value, t_ns, known_ns, replayed=False)
        found.add(value, t_ns, known_ns, replayed=True)
        found.settle(t_ns)
        assert not found.waiting
    result = found.found
    assert (result.recorded, result.replayed, result.differ) == (len(rows), len(rows), 0)


@given(_ROWS, _LATE, st.data())
def test_a_changed_value_is_one_difference(rows, late_ns, data):
    ours = in_order(rows, late_ns)
    theirs = list(ours)
    k = data.draw(st.integers(0, len(ours) - 1)) if ours else None
    if k is not None:
        theirs[k] = (*ours[k][:2], 7.0)
    result = compared(ours, theirs, list(range(0, 40, 3)), NEVER_NS)
    assert result.differ == (k is not None)
    assert (result.fields == {"value": 1}) == (k is not None)


def test_a_last_frame_that_is_stamped_before_others_is_paired() -> None:
    found = Compared("stream", RULE)
    for t_ns in (10, 15, 20):  # the recording is read in the order of the times
        found.add(0.0, t_ns, replayed=False)
    for t_ns in (10, 20, 15):
        found.add(0.0, t_ns, replayed=True)
    found.settle(NEVER_NS)
    assert found.found.differ == 0
