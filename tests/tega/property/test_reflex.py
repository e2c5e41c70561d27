"""The reflex adds little, slowly, never opens a hand that holds, and is nothing without authority or a cause."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import msgspec
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from tega.config import FINGERS, ReflexSection
from tega.loop.reflex import ReflexArc, ReflexDial, ReflexInputs
from tega.records import Contact, Event, NamedValue, ReflexGrip
from tega.stages.base import Reflex, ReflexSetup
from tega.stages.grip_reflex import GripReflex, GripReflexOptions

TICK_NS = 3_000_000
BACK_LEVELS_PER_S = 5.0


class Asked(Reflex):
    now: float = 0.0

    def wish(self, *_: Any) -> float:
        return self.now


class Bench:
    def __init__(self, reflex: Reflex, settings: ReflexSection) -> None:
        self.reported: list[ReflexGrip] = []
        self.snapshot = ReflexInputs(settings.authority, True, None)
        self.t_ns = 0
        how: Any = {"snapshot": lambda _t_ns: self.snapshot, "notify": self.reported.append}
        self.arc = ReflexArc(reflex, settings, **how)

    def ticks(
        self, n: int, own: float, contacts: Mapping[str, Contact], events: Sequence[Event] = ()
    ) -> float:
        for event in events:
            self.arc.on_event(event)
        for _ in range(n):
            self.t_ns += TICK_NS
            added = self.arc.step(self.t_ns, own, lambda: contacts)
            assert added == self.arc.added
        return own + added


def touch(*names: str, **values: float) -> dict[str, Contact]:
    more = tuple(NamedValue(name, value) for name, value in values.items())
    return {name: Contact(finger=name, t_ns=0, in_contact=True, more=more) for name in names or FINGERS}


def grip(authority: float = 1.0, *, options: GripReflexOptions | None = None, **bounds: float) -> Bench:
    reflex = GripReflex(ReflexSetup(FINGERS), options or GripReflexOptions())
    return Bench(reflex, ReflexSection(name="grip", authority=authority, **bounds))


ANY = st.floats(allow_nan=True, allow_infinity=True)
TICKS = st.lists(
    st.tuples(
        st.floats(1, 5),  # the person's own closure
        ANY,  # the wish
        st.floats(0, 1),  # authority
        st.booleans(),  # whether the run is active
        st.booleans(),  # whether a finger touches
    ),
    min_size=1,
    max_size=60,
)


@example(ticks=[(3.0, 1.0, 1.0, True, True)] * 3, most=1.0, rise=0.1, fall=0.5)
@example(ticks=[(5.0, 1.0, 1.0, True, True)] * 3, most=1.0, rise=0.1, fall=0.5)
@given(ticks=TICKS, most=st.floats(0.01, 1), rise=st.floats(0.01, 10), fall=st.floats(0.1, 5))
def test_the_addition_is_bounded_slow_and_never_below_the_person_s_own_closure(ticks, most, rise, fall):
    reflex = Asked()
    how = {"most_levels": most, "rise_levels_per_s": rise, "fall_levels_per_s": fall, "authority": 1.0}
    bench, before, dt_s = Bench(reflex, ReflexSection(name="x", **how)), 0.0, TICK_NS / 1e9
    additions: list[float] = []
    for own, wish, authority, active, touching in ticks:
        reflex.now = wish
        bench.snapshot = ReflexInputs(authority, active, None)
        reported = bench.ticks(1, own, touch("index") if touching else {})
        added = bench.arc.added
        assert own <= reported <= 5
        assert reported == own + added
        assert 0 <= added <= most
        assert added - before <= rise * dt_s + 1e-12
        if own > 1.25:  # who opens the hand is not held back for a tick
            # All falls are slow, but where the closed hand leaves no room.
            assert added >= min(before - max(fall, BACK_LEVELS_PER_S) * dt_s - 1e-12, 5 - own)
        else:
            assert reported == own
        if added > before:
            assert active
            assert touching
            assert authority * most >= added - 1e-12
        before = added
        additions.append(added)
    assert bench.arc.n_added == sum(one > 0 for one in additions)
    assert bench.arc.most_added == max(additions)


@given(ticks=TICKS)
def test_no_authority_is_the_person_s_own_closure_bit_for_bit_and_tells_nothing(ticks) -> None:
    reflex = Asked()
    bench = Bench(reflex, ReflexSection(name="x"))
    for own, wish, _, active, touching in ticks:
        reflex.now = wish
        bench.snapshot = ReflexInputs(0.0, active, None)
        assert bench.ticks(1, own, touch() if touching else {}) == own
        assert bench.arc.added == 0.0
    assert bench.reported == []


@given(share=st.floats(0.0, 1.0), authority=st.floats(0.05, 1.0))
def test_a_slip_firms_the_grip_by_its_share_and_the_addition_decays_when_it_ends(share, authority) -> None:
    bench = grip(authority)
    reported = bench.ticks(400, 3.0, touch("index", incipient=share))
    expected = authority * 0.5 * max(share - 0.4, 0) / 0.6
    assert reported == pytest.approx(3.0 + expected, abs=1e-9)
    # It is kept for half a second, then it falls by half a level a second.
    assert bench.ticks(160, 3.0, touch("index", incipient=0.0)) == pytest.approx(reported)
    after = bench.ticks(107, 3.0, touch("index", incipient=0.0))
    assert after == pytest.approx(3.0 + max(expected - 0.15, 0.0), abs=0.01)
    assert bench.ticks(400, 3.0, touch("index", incipient=0.0)) == 3.0


def test_a_fast_slip_firms_the_grip_too_and_what_is_not_finite_does_not() -> None:
    assert grip().ticks(400, 3.0, touch("index", slip_mm_s=5.0)) == pytest.approx(3.5)
    assert grip().ticks(400, 3.0, touch("index", slip_mm_s=math.nan, incipient=math.inf)) == 3.0


def test_lost_fingers_add_nothing() -> None:
    bench = grip()
    assert bench.ticks(200, 3.0, {}, [Event(t_ns=0, kind="slip", finger="")]) == 3.0
    reported = bench.ticks(200, 3.0, touch("index", incipient=1.0))
    assert reported == pytest.approx(3.5)
    # The finger is lost while it slips: what was added goes, slowly.
    assert bench.ticks(1, 3.0, {}) < reported
    assert bench.ticks(400, 3.0, {}) == 3.0


def test_a_slip_event_counts_where_the_metric_knows_no_slip_itself() -> None:
    slip = [Event(t_ns=0, kind="slip", finger="", confidence=0.8)]
    assert grip().ticks(100, 3.0, touch("index"), slip) == pytest.approx(3.0 + 0.8 * 0.5)
    assert grip().ticks(100, 3.0, touch("index", incipient=0.0), slip) == 3.0
    assert grip(options=GripReflexOptions(events=False)).ticks(100, 3.0, touch("index"), slip) == 3.0


def test_it_is_eased_before_the_object_gives_too_far() -> None:
    bench = grip(options=GripReflexOptions(most_give_levels=1.0))
    slips = touch("index", incipient=1.0)

    def at(measured: float, n: int = 400) -> float:
        bench.snapshot = ReflexInputs(1.0, True, measured)
        return bench.ticks(n, 3.0, slips)

    assert at(2.0) == pytest.approx(3.5)
    assert at(2.9) == pytest.approx(3.25)
    assert bench.reported[-1].cause == "slip, index"
    assert at(3.0) == 3.0
    assert bench.reported[-1].cause == "eased: the object gives"
    assert at(2.0) == pytest.approx(3.5)
    # Beyond the limit it goes at five levels a second.
    assert at(3.2, 34) == pytest.approx(3.0, abs=0.01)


def test_it_is_eased_where_a_finger_is_loaded() -> None:
    bench = grip(options=GripReflexOptions(most_force_n=5.0))
    for forces_n, level, wish in (
        ([4.5], 3.25, 0.5), ([6.0], 3.0, -1.0), ([1.0, None], 3.0, 0.0), ([math.nan, 6.0], 3.0, -1.0),
    ):  # fmt: skip
        each = zip(touch(incipient=1.0).values(), forces_n, strict=False)
        loaded = {one.finger: msgspec.structs.replace(one, force_n=force_n) for one, force_n in each}
        bench.ticks(400, 3.0, loaded)
        assert (3.0 + bench.arc.added, bench.reported[-1].wish) == pytest.approx((level, wish))


def test_in_a_hold_and_without_authority_what_was_added_is_taken_back_within_a_fifth_of_a_second() -> None:
    for after in (ReflexInputs(1.0, False, None), ReflexInputs(0.0, True, None)):
        bench = grip()
        assert bench.ticks(200, 3.0, touch("index", incipient=1.0)) == pytest.approx(3.5)
        bench.snapshot = after
        assert bench.ticks(40, 3.0, touch("index", incipient=1.0)) == 3.0


def test_who_opens_the_hand_lets_go_at_once() -> None:
    bench = grip()
    assert bench.ticks(200, 3.0, touch("index", incipient=1.0)) == pytest.approx(3.5)
    assert bench.ticks(1, 1.2, touch("index", incipient=1.0)) == 1.2


def test_who_loosens_the_grip_is_not_held_against_it_by_the_slip_that_follows() -> None:
    bench, slips = grip(), touch("index", incipient=1.0)
    assert bench.ticks(200, 4.0, slips) == pytest.approx(4.5)
    assert bench.ticks(40, 3.0, slips) == 3.0
    assert bench.ticks(200, 3.0, slips) == 3.0
    # A second later it is a slip like others; slack and noise of the muscles never count.
    assert bench.ticks(200, 3.0, slips) == pytest.approx(3.5)
    assert bench.ticks(100, 2.8, slips) == pytest.approx(3.3)


def test_the_dial_is_set_by_settings_page_and_button() -> None:
    dial, seen = ReflexDial(0.5), [0.5]
    for wanted in (None, None, 7.0, math.nan, None, 0.3):
        if wanted is None:
            dial.press()
        else:
            dial.authority = wanted
        seen.append(dial.authority)
    assert seen == [0.5, 0.0, 0.5, 1.0, 1.0, 0.0, 0.3]
