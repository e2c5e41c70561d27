"""Mappings of touch: bounded, monotone, silent without contact, deterministic, and `columns` at neutral options."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from tega.errors import ConfigError
from tega.haptics import FINGERS, FeltMap
from tega.haptics.motor_layout import SHIPPED, Motor, MotorLayout
from tega.records import Contact, Event
from tega.stages import VestSetup
from tega.stages.changes import ChangesMapping, ChangesOptions
from tega.stages.columns import ColumnsMapping, ColumnsOptions
from tega.stages.equal_steps import EqualStepsMapping, EqualStepsOptions
from tega.stages.place import PlaceMapping, PlaceOptions
from tega.stages.slip_row import SlipRowMapping, SlipRowOptions

STEP_NS = 33_333_333
MAXIMA = {finger: {"cci": 0.1, "eda": 8000.0} for finger in FINGERS}
KINDS = [SlipRowMapping, EqualStepsMapping, ChangesMapping, PlaceMapping]

shares = st.floats(0, 1.5).map(lambda x: round(x, 6))
layouts = st.sampled_from(sorted(SHIPPED))
places = st.tuples(st.floats(0, 239), st.floats(0, 319))
touches = st.dictionaries(st.sampled_from(FINGERS), st.tuples(shares, shares, places))
slips = st.lists(st.sampled_from(["", *FINGERS]), max_size=2)
scripts = st.lists(st.tuples(touches, slips), min_size=1, max_size=5)


def contact(finger: str, t_ns: int, cci: float, eda: float, at: tuple[float, float] = (160, 120)) -> Contact:
    on = eda > 0
    return Contact(
        finger=finger,
        t_ns=t_ns,
        in_contact=on,
        cci=0.1 * cci if on else 0.0,
        eda=round(8000 * eda),
        centroid_xy=at if on else (math.nan, math.nan),
    )


def setup(
    layout: str | MotorLayout = "x40", felt: FeltMap | None = None, fingers: Sequence[str] = FINGERS
) -> VestSetup:
    table = SHIPPED[layout] if isinstance(layout, str) else layout
    return VestSetup(table, tuple(fingers), {f: MAXIMA[f] for f in fingers}, felt)


def run(mapping: Any, script: Any) -> list[np.ndarray[Any, Any]]:
    displayed = []
    for n, (touched, slipped) in enumerate(script):
        t_ns = n * STEP_NS
        contacts = {f: contact(f, t_ns, *how) for f, how in touched.items()}
        events = tuple(Event(t_ns=t_ns, finger=f, kind="slip") for f in slipped)
        displayed.append(mapping.levels(t_ns, contacts, events if mapping.wants_events else ()))
    return displayed


def hold(mapping: Any, share: float, n: int = 1, since_ns: int = 0) -> np.ndarray[Any, Any]:
    for t_ns in range(since_ns, since_ns + n * STEP_NS, STEP_NS):
        displayed: np.ndarray = mapping.levels(t_ns, {"index": contact("index", t_ns, share, share)}, ())
    return displayed


@pytest.mark.parametrize("kind", KINDS)
@given(script=scripts, layout=layouts)
def test_levels_are_percents_the_same_again_and_silent_without_contact(kind, script, layout) -> None:
    mapping, other = (kind(setup(layout), kind.options_type()) for _ in range(2))
    displayed = np.array(run(mapping, script))
    assert displayed.shape == (len(script), len(SHIPPED[layout].motors))
    assert ((displayed >= 0) & (displayed <= 100)).all()
    assert displayed.tobytes() == np.array(run(other, script)).tobytes()
    t_ns = len(script) * STEP_NS
    assert not mapping.levels(t_ns, {}, ()).any(), "every finger is lost: at once"
    free = {f: contact(f, t_ns + 3_000_000_000, 0, 0) for f in FINGERS}
    other.levels(t_ns, {f: contact(f, t_ns, 0, 0) for f in FINGERS}, ())
    assert not other.levels(t_ns + 3_000_000_000, free, ()).any(), "every finger has let go: after 3 s"


@pytest.mark.parametrize(
    ("kind", "options"),
    [
        (SlipRowMapping, SlipRowOptions(slip_row="none")),
        (ChangesMapping, ChangesOptions(steady=1, onset=0, offset=0)),
        (PlaceMapping, PlaceOptions(blend="all")),
    ],
)
@given(script=scripts, layout=layouts)
def test_neutral_options_are_columns(kind: Any, options: Any, script: Any, layout: str) -> None:
    script = [({f: (min(c, 1), min(e, 1), at) for f, (c, e, at) in t.items()}, s) for t, s in script]
    neutral, columns = kind(setup(layout), options), ColumnsMapping(setup(layout), ColumnsOptions())
    for one, other in zip(run(neutral, script), run(columns, script), strict=True):
        assert one.tobytes() == other.tobytes()


@given(low=st.floats(0.001, 1), high=st.floats(0.001, 1), seed=st.integers(0, 2**32 - 1))
def test_equal_shares_are_equal_steps_above_threshold_on_every_motor(low, high, seed) -> None:
    low, high = sorted((low, high))
    rng = np.random.default_rng(seed)
    felt = FeltMap(threshold=rng.integers(5, 61, 40), step=rng.integers(2, 21, 40))
    mapping = EqualStepsMapping(setup(felt=felt), EqualStepsOptions(first_steps=1))
    motors = [
        n for n, motor in enumerate(SHIPPED["x40"].motors) if (motor.face, motor.column) == ("front", 1)
    ]
    numbers = SHIPPED["x40"].numbers[motors]
    weber = felt.step[numbers] / ((felt.threshold[numbers] + 100) / 2)

    def steps(share: float) -> Any:
        displayed = hold(mapping, share)[motors]
        assert (displayed >= felt.threshold[numbers] - 1e-9).all()
        return np.log(displayed / felt.threshold[numbers]) / np.log1p(weber)

    below, above = steps(low), steps(high)
    assert np.ptp(below) < 1e-6
    assert (above >= below - 1e-9).all()
    first = min(1.0, mapping.n_steps)
    assert above[-1] == pytest.approx(first + high * (mapping.n_steps - first), abs=1e-6)


@pytest.mark.parametrize("kind", KINDS)
@given(low=st.floats(0, 1), high=st.floats(0, 1), n=st.sampled_from([1, 15]))
def test_a_firmer_even_touch_is_never_weaker(kind: Any, low: float, high: float, n: int) -> None:
    weak, strong = (hold(kind(setup(), kind.options_type()), share, n) for share in sorted((low, high)))
    assert (strong >= weak - 1e-9).all()


@given(share=st.floats(0.4, 1), more=st.floats(0.4, 1))
def test_a_firmer_onset_and_a_larger_fall_are_shown_more_strongly(share: float, more: float) -> None:
    share, more = sorted((share, more))

    def peaks(full: float) -> tuple[float, float, float]:
        mapping = ChangesMapping(setup(), ChangesOptions())
        hold(mapping, 0, 2)
        onset = hold(mapping, full, 1, 2 * STEP_NS).max()
        steady = hold(mapping, full, 45, 3 * STEP_NS).max()
        return onset, steady, hold(mapping, 0, 1, 48 * STEP_NS).max()

    weak, strong = peaks(share), peaks(more)
    assert all(b >= a - 1e-9 for a, b in zip(weak, strong, strict=True))
    assert strong[0] > strong[1]
    assert strong[2] > 0


def test_what_is_shown_after_a_change_does_not_depend_on_how_often_it_is_refreshed() -> None:
    def after(refreshes: list[int]) -> Any:
        mapping = ChangesMapping(setup(), ChangesOptions())
        mapping.levels(0, {"index": contact("index", 0, 0, 0)}, ())
        for t_ms in refreshes:
            displayed = mapping.levels(t_ms * 10**6, {"index": contact("index", 0, 1, 1)}, ())
        return displayed

    assert after([10, 400]) == pytest.approx(after([10, 20, 35, 170, 300, 400]), abs=1e-9)


def test_a_steady_touch_is_reminded_of_on_schedule() -> None:
    mapping = ChangesMapping(setup(), ChangesOptions(remind_every_s=4))
    on = [hold(mapping, 1, 1, n * STEP_NS).any() for n in range(12 * 30)]
    assert on[0]
    assert np.mean(on) == pytest.approx(0.25, abs=0.01)


@given(finger=st.sampled_from(["", *FINGERS]), row=st.sampled_from(["top", "bottom"]), layout=layouts)
def test_a_slip_lights_its_own_row_alone(finger: str, row: Any, layout: str) -> None:
    mapping, plain = (SlipRowMapping(setup(layout), SlipRowOptions(slip_row=row)) for _ in range(2))
    last = {"top": 0, "bottom": SHIPPED[layout].rows("front") - 1}[row]
    spared = np.array([motor.row == last for motor in SHIPPED[layout].motors])
    column = np.array([motor.column for motor in SHIPPED[layout].motors])
    reported = []
    for n in range(60):
        t_ns = n * STEP_NS
        contacts = {f: contact(f, t_ns, 0.7, 0.7) for f in FINGERS}
        events = (Event(t_ns=t_ns, finger=finger, kind="slip"),) if n == 10 else ()
        displayed, without = mapping.levels(t_ns, contacts, events), plain.levels(t_ns, contacts, ())
        assert (displayed[~spared] == without[~spared]).all()
        assert (displayed[~spared] > 0).all()
        assert not without[spared].any()
        lit = displayed[spared] > 0
        reported.append(bool(lit.any()))
        if lit.any():
            assert (lit == ((column[spared] == FINGERS.index(finger)) if finger else True)).all()
    # Two bursts with a rest in between.
    edges = "".join("#" if on else "." for on in reported).strip(".")
    assert sorted(set(edges.replace("#", " ").split())) == [edges.strip("#")]
    assert 0.28 <= sum(reported) / 30 <= 0.36


OWN = [((240, 320), None, {}), ((48, 64), None, {"index": (48, 64)}), ((9, 8), (9, 8), {"index": (99, 8)})]
TIPS = ["up", "down", "left", "right"]


@given(st.floats(0, 1), st.floats(0, 1), st.sampled_from(TIPS), st.sampled_from(OWN))
def test_the_contacts_place_is_where_it_is_felt(x: float, y: float, tip: Any, sizes: Any) -> None:
    (width, height), picture_px, pictures_px = sizes
    known = setup("paper32", fingers=["index"])._replace(pictures_px=pictures_px)
    mapping = PlaceMapping(known, PlaceOptions(tip=tip, picture_px=picture_px))
    at = x * (width - 1), y * (height - 1)
    displayed = mapping.levels(0, {"index": contact("index", 0, 1, 1, at)}, ()).reshape(2, 4, 4)
    rows, columns = np.mgrid[:4, :4]
    right, down = {"up": (x, y), "down": (1 - x, 1 - y), "left": (1 - y, x), "right": (y, 1 - x)}[tip]
    for face in displayed**2:
        # The middle of the power is the place itself, and all of it that of the intensity.
        assert face.sum() == pytest.approx(99**2, abs=1e-6)
        assert (face * rows).sum() / face.sum() == pytest.approx(3 * down, abs=1e-6)
        assert (face * columns).sum() / face.sum() == pytest.approx(3 * right, abs=1e-6)


def test_four_fingers_keep_a_column_each_and_an_unknown_place_lights_it() -> None:
    mapping = PlaceMapping(setup(), PlaceOptions())
    displayed = mapping.levels(0, {"middle": contact("middle", 0, 1, 1, (300, 0))}, ()).reshape(2, 5, 4)
    assert (displayed > 1).nonzero()[1].tolist() == [0, 0]
    assert (displayed > 1).nonzero()[2].tolist() == [2, 2]
    displayed = mapping.levels(0, {"middle": contact("middle", 0, 1, 1, (math.nan, math.nan))}, ())
    assert (displayed.reshape(2, 5, 4) > 90).sum(axis=(0, 1)).tolist() == [0, 0, 10, 0]


@pytest.mark.parametrize("law", ["linear", "logistic", "power"])
def test_a_value_is_an_error_at_rest_if_it_is_not_measured_and_silent_while_it_is_missing(law: Any) -> None:
    mapping = EqualStepsMapping(setup(), EqualStepsOptions(front="force_n", front_max=5.0, law=law))
    with pytest.raises(ConfigError, match="no value 'force_n'; it measures cci, eda"):
        mapping.levels(0, {"index": contact("index", 0, 0, 0)}, ())
    for force_n, lit in ((math.nan, 5), (5.0, 10)):
        touching = replace(contact("index", 0, 1, 1), force_n=force_n)
        assert np.count_nonzero(mapping.levels(0, {"index": touching}, ())) == lit


@pytest.mark.parametrize("kind", [ColumnsMapping, *KINDS])
@given(
    touched=st.dictionaries(st.sampled_from("abcdefgh"), st.tuples(shares, shares, places)),
    columns=st.permutations("abcdefgh").map(lambda order: tuple(map(tuple, (order[k::4] for k in range(4))))),
    layout=layouts,
)
def test_the_strongest_finger_of_a_column_is_shown(kind, touched, columns, layout) -> None:
    maxima = dict.fromkeys("abcdefgh", MAXIMA["thumb"])
    made = VestSetup(SHIPPED[layout], tuple(maxima), maxima, None), kind.options_type(fingers=columns)

    def levels(contacts: dict[str, Contact]) -> Any:
        return kind(*made).levels(0, contacts, ())

    contacts = {finger: contact(finger, 0, *how) for finger, how in touched.items()}
    alone = [levels({finger: one}) for finger, one in contacts.items()]
    assert levels(contacts).tobytes() == np.maximum.reduce([levels({}), *alone]).tobytes()


def test_a_bar_stands_on_the_row_above_the_slips() -> None:
    mapping = SlipRowMapping(setup("paper32"), SlipRowOptions(rows="bar", law="linear"))
    displayed = hold(mapping, 1 / 3).reshape(2, 4, 4)[:, :, 1]
    assert displayed == pytest.approx(np.array([[0, 0, 100, 0]] * 2), abs=0.1)


def test_a_column_without_a_finger_is_silent() -> None:
    wide = MotorLayout("wide", "six columns", [Motor("front", 0, c, c) for c in range(6)])
    mapping = ColumnsMapping(setup(wide), ColumnsOptions())
    shown = mapping.levels(0, {finger: contact(finger, 0, 1.0, 1.0) for finger in FINGERS}, ())
    assert (shown > 0).tolist() == [True] * 4 + [False] * 2


def test_what_cannot_be_shown_is_refused() -> None:
    belt = MotorLayout("belt", "four motors", [Motor("front", 0, c, c) for c in range(4)])
    with pytest.raises(ConfigError, match="one row at its front"):
        SlipRowMapping(setup(belt), SlipRowOptions())
    with pytest.raises(ConfigError, match=r"full_percent = 30 .* 40 percent is felt"):
        EqualStepsMapping(setup(felt=FeltMap(threshold=40)), EqualStepsOptions(full_percent=30))
