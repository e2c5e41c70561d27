"""Events found in the signals: rules on made-up signals, and on a trial of the simulated bench."""

from __future__ import annotations

import math

import pytest

from tega.stages.events import DetectedEvent, Detector, TouchFrame
from tega.stages.events.detector import UNSURE, share_of
from tega.stages.events.settings import FEATURES, HAND_FEATURES, SETTINGS, SINK_FEATURES, Rule
from tega.stages.events.tracks import Low, SinkTrack, TwoMeans

HZ = 60.0
NOTHING = TouchFrame(False, 0, 0.0, 0.0, math.nan, math.nan)
FIRM = TouchFrame(True, 3000, 60_000.0, 30.0, 120.0, 100.0)


def play(
    detector: Detector, touches: list[TouchFrame], *, finger: str = "index", begin_s: float = 0.0
) -> list[DetectedEvent]:
    found = []
    for n, touch in enumerate(touches):
        found += detector.touch(begin_s + n / HZ, finger, touch)
    return found


def test_a_course_says_what_has_changed_whatever_the_rate() -> None:
    for rate_hz in (30.0, 60.0, 200.0):
        course = TwoMeans(0.08, 0.35)
        for n in range(round(4 * rate_hz)):
            course.add(n / rate_hz, 5.0 * n / rate_hz)
        # A ramp lags a mean by its time constant.
        assert course.change == pytest.approx(5.0 * (0.35 - 0.08), rel=0.02)


def test_contact_and_release_are_told_once_and_not_for_single_frames() -> None:
    found = play(Detector(), [NOTHING] * 30 + [FIRM] * 60 + [NOTHING] * 2 + [FIRM] * 60 + [NOTHING] * 60)
    reported = [one for one in found if one.finger]
    assert [(one.kind, round(one.t_s * HZ)) for one in reported] == [("contact", 30), ("release", 152)]
    assert all(0 < one.known_s - one.t_s < 0.12 and one.confidence == 1.0 for one in reported)


def test_what_happened_while_nothing_was_seen_is_no_event() -> None:
    detector = Detector()
    assert play(detector, [NOTHING] * 30) == []
    assert [f for f in play(detector, [FIRM] * 30, begin_s=5.0) if f.finger] == []


def test_lift_off_is_the_height_that_a_grasp_gains() -> None:
    detector, found = Detector(), list[DetectedEvent]()
    for n in range(400):
        t_s = n / 100
        found += detector.touch(t_s, "thumb", FIRM if t_s >= 1 else NOTHING)
        # Down to the object, then up with it.
        height_m = 0.2 - 0.2 * min(t_s, 1.0) if t_s < 2 else 0.1 * (t_s - 2)
        found += detector.hand(t_s, level=3, closure=2.5, height_m=height_m)
    [lift] = [one for one in found if one.kind == "lift_off"]
    assert lift.t_s == pytest.approx(2.05, abs=0.011)
    assert lift.confidence == 0.75


def test_what_is_taken_hold_of_again_in_the_air_does_not_lift_off_twice() -> None:
    detector, found = Detector(), list[DetectedEvent]()
    for n in range(1000):
        t_s = n / 100
        felt = 0.5 < t_s < 2.5 or 5.0 < t_s < 7.0 or t_s > 8.0  # lost in the air, and put down from 7 to 8 s
        height_m = (
            0.1 * min(max(t_s - 1, 0.0), 2.0) + 0.02 * (t_s > 5.5) if t_s < 7 else 0.1 * max(t_s - 9, 0.0)
        )
        found += detector.touch(t_s, "thumb", FIRM if felt else NOTHING)
        found += detector.hand(t_s, level=1, closure=1.0, height_m=height_m)
    assert [round(one.t_s) for one in found if one.kind == "lift_off"] == [1, 9]


def test_a_grip_is_weaker_than_before_only_where_it_never_was_so_weak() -> None:
    low = Low(0.4)
    below = []
    for n in range(60):
        t_s = n / 10
        low.add(t_s, {0: 3.0, 1: 2.5, 2: 3.0, 3: 2.5, 4: 2.0, 5: 2.0}[int(t_s)])
        below.append(round(low.below, 6))
    assert low.fallen == 1.0
    assert below[10] == 0.5, "new when it happens"
    assert below[19] == 0.0, "and no longer when it has been so for a while"
    assert set(below[20:40]) == {0.0}, "nor when it is so again"
    assert below[40] == 0.5


def slide(hold_s: float) -> list[TouchFrame]:
    """A firm hold whose pressure then drops to an eighth in a second, for a while."""
    weak = [
        TouchFrame(True, 3000 - 1500 * f, 60_000 * math.exp(-2 * f), 30 - 14 * f, 120.0, 100 + 25 * f)
        for f in (n / HZ for n in range(60))
    ]
    return [NOTHING] * 6 + [FIRM] * round(hold_s * HZ) + weak + [weak[-1]] * 120


def test_a_record_and_the_run_agree_on_a_slip_and_steady_holds_have_none() -> None:
    # A rule that goes by the fall of what is pressed, lately and over a second, whatever the rules in use are.
    weights = [{"mass_change": -5.0, "mass_trend": -1.0}.get(name, 0.0) for name in FEATURES]
    settings = SETTINGS._replace(touch=Rule(-3.0, tuple(weights), 0.5, 0.2))

    def slips(look_ahead_s: float, touches: list[TouchFrame]) -> list[DetectedEvent]:
        detector = Detector(settings, look_ahead_s=look_ahead_s)
        found = play(detector, touches)
        found += detector.close(len(touches) / HZ)
        return [one for one in found if one.kind == "slip"]

    [live], [later] = slips(0.0, slide(3.0)), slips(0.5, slide(3.0))
    assert live.t_s == later.t_s
    assert 3.1 < live.t_s < 4.1
    assert live.known_s - live.t_s < 0.3 < later.known_s - later.t_s
    assert UNSURE / 2 <= live.confidence <= later.confidence <= UNSURE  # no joints, no height
    assert slips(0.0, [NOTHING] * 6 + [FIRM] * 600) == []
    # A record that ends before the look-ahead is over has the slip all the same.
    end = round(live.known_s * HZ) + 6
    [last] = slips(0.5, slide(3.0)[:end])
    assert (last.t_s, last.known_s) == (live.t_s, end / HZ)


@pytest.mark.parametrize("rate_hz", [30.0, 100.0, 333.0])
def test_a_fingertip_sinks_by_its_mean_over_a_time_whatever_the_rate(rate_hz: float) -> None:
    track = SinkTrack(0.2)
    for n in range(round(rate_hz) + 1):
        track.add(n / rate_hz, 50.0 - max(8.0 * (n / rate_hz - 0.9), 0.0))
    assert track.speed_mm_s(0.04) == pytest.approx(8.0)
    assert 3.0 < track.speed_mm_s(0.2) < 4.5


def sunk(*, speed_mm_s: float, lowered_m_s: float = 0.0, tips: bool = True) -> list[DetectedEvent]:
    """Give a detector a lift whose fingertips sink for half a second from 3 s on."""
    detector, found = Detector(), list[DetectedEvent]()
    for n in range(400):
        t_s = n / 100
        height_m = min(0.1 * max(t_s - 1.0, 0.0), 0.1) - lowered_m_s * max(t_s - 2.8, 0.0)
        way_mm = speed_mm_s * min(max(t_s - 3.0, 0.0), 0.5)
        heights = dict.fromkeys(("thumb", "index", "ring"), 40.0 - way_mm)
        for finger in ("thumb", "index"):
            found += detector.touch(t_s, finger, FIRM if t_s > 0.5 else NOTHING)
        tips_mm = heights if tips else None
        found += detector.hand(t_s, level=3, closure=2.5, height_m=height_m, tips_mm=tips_mm)
    return [one for one in found if one.kind == "slip"]


def test_fingertips_that_sink_tell_a_slip_within_60_ms_and_what_is_put_down_is_none() -> None:
    [one] = sunk(speed_mm_s=10.0)
    assert 3.0 < one.known_s < 3.06
    assert sunk(speed_mm_s=1.5) == []
    assert sunk(speed_mm_s=10.0, lowered_m_s=0.1) == []
    assert sunk(speed_mm_s=10.0, tips=False) == []


def test_where_the_joints_are_no_longer_told_the_other_rules_take_over() -> None:
    detector, seen = Detector(), []
    detector.hand(0.0, level=3, closure=2.5, height_m=0.0, tips_mm={"thumb": 40.0})
    untouched = detector.features(0.0)
    assert len(untouched) == len(SETTINGS.sink.weights) == len(SINK_FEATURES)
    assert not any(untouched[-len(SETTINGS.sink_s) - 2 :])
    detector = Detector()
    for n, tips_mm in enumerate([{"thumb": 40.0}, {"thumb": 39.0}, None]):
        detector.hand(n / 100, level=3, closure=2.5, height_m=0.0, tips_mm=tips_mm)
        detector.touch(n / 100, "thumb", FIRM)
        seen.append(len(detector.features(n / 100)))
    assert seen == [len(SINK_FEATURES), len(SINK_FEATURES), len(HAND_FEATURES)]


def test_what_is_held_in_the_air_may_slip_unless_the_hand_opens() -> None:
    detector = Detector()

    def held(from_s: float, to_s: float, touch: TouchFrame, level: int) -> bool:
        for n in range(round(100 * from_s), round(100 * to_s)):
            height_m = 0.1 * min(max(n / 100 - 1.0, 0.0), 1.0)
            detector.touch(n / 100, "thumb", touch)
            detector.hand(n / 100, level=level, closure=2.5, height_m=height_m)
        return detector.may_slip

    assert not held(0.0, 0.5, NOTHING, 3)
    assert held(0.5, 3.0, FIRM, 3)
    assert held(3.0, 3.2, FIRM, 2)
    assert not held(3.2, 3.4, FIRM, 1)
    assert held(3.4, 3.6, FIRM, 3)


def test_a_grasp_outlasts_a_moment_without_touch_and_no_more() -> None:
    detector = Detector()
    play(detector, [FIRM] * 60)
    assert detector.may_slip
    play(detector, [NOTHING] * 12, begin_s=1.0)
    assert detector.may_slip
    play(detector, [NOTHING] * round(HZ * (SETTINGS.rest_s + 0.5)), begin_s=1.2)
    assert not detector.may_slip


def test_fingertips_sink_over_each_of_the_settings_times() -> None:
    detector = Detector()
    for n in range(30):
        detector.touch(n / 100, "thumb", FIRM)
        detector.hand(n / 100, level=3, closure=2.5, height_m=0.0, tips_mm={"thumb": 40.0 - 0.1 * n})
    names = ("over_20_ms", "over_40_ms", "over_80_ms", "over_200_ms", "fastest", "slowest")
    seen = dict(zip(SINK_FEATURES, detector.features(0.29), strict=True))
    assert [seen[name] for name in names] == pytest.approx([10.0] * len(names))


def test_a_rule_adds_weighed_products_to_weighed_features() -> None:
    rule = Rule(-1.0, (0.5, 0.25), 0.5, 0.1, ((0, 1, 2.0), (1, 1, -0.5)))
    assert share_of(rule, (0.5, 2.0)) == pytest.approx(1 / (1 + math.exp(1.0 - 0.25 - 0.5 - 2.0 + 2.0)))
