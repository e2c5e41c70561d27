"""Slips in a run are told by the hand's joints and the arm's height where both are known, else by touch alone."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace
from numpy.typing import NDArray

from reference.scripted import MS, Sink
from reference.wired import wired_loop
from tega.config import ReflexSection, load_config
from tega.config.calibration import TouchMaxima
from tega.errors import ConfigError
from tega.hand import CLOSURE_POSES_RAD
from tega.hand.poses import ClosureScale
from tega.loop.hand import HandPolls, fresh_angles_rad, open_hand_polls
from tega.loop.inbox.stream import PulledStream
from tega.loop.pacing import Pacer
from tega.loop.reflex import ReflexArc, ReflexInputs, open_reflex
from tega.loop.snapshot import LoopView
from tega.loop.touch import TouchLoop
from tega.recording.replay.played_run import played_checks
from tega.recording.replay.playhead import Playhead
from tega.records import Contact, Event, HandLook, Intent, ReflexGrip
from tega.records.bus import Bus
from tega.runtime.clock import ManualClock
from tega.stages.base import ReflexSetup
from tega.stages.grip_reflex import GripReflex, GripReflexOptions
from tega.stages.pulses import PulsesMapping, PulsesOptions
from tega_study.attempt_rows import HandRow
from tega_study.lead.running_trial import Going

_END_S, _LIFTED_S, _SLIDES_S = 3.5, 1.0, 2.5
_NONE = Contact(finger="thumb", t_ns=0, in_contact=False)
_FIRM = replace(_NONE, mass=6e4, centroid_xy=(120.0, 100.0), eda=3000, cci=0.5, peak=30.0, in_contact=True)


def _angles_rad(t_s: float) -> NDArray[np.float64]:
    """A hand that holds at level 3 less a little, and from 2.5 s on gives way at 0.5 levels a second."""
    give = min(max(t_s - _SLIDES_S, 0.0), 0.5)
    two, three = CLOSURE_POSES_RAD[1:3]
    angles: NDArray[np.float64] = two + (0.6 - 0.5 * give) * (three - two)
    # The fingers' first joints spread: what is held goes down with them.
    angles[[0, 4, 8]] -= 0.4 * give
    return angles


def _height_m(t_s: float) -> float:
    return 0.1 + 0.1 * min(max(t_s - _LIFTED_S, 0.0), 1.0)


def _loaded(t_s: float) -> Contact:
    """A light grip that load comes upon from 2.5 s on, while what is touched moves on: a slip for touch alone."""
    if t_s <= 0.3:
        return _NONE
    share = min(max(t_s - _SLIDES_S, 0.0), 1.0)
    mass = 3000 * 3**share
    return replace(_FIRM, mass=mass, centroid_xy=(120.0, 100 + 25 * share), peak=30 * mass / 6e4)


class Ran:
    """A run on recorded input: thumb and index hold something, and from 2.5 s on the hand's joints give way."""

    def __init__(
        self,
        *,
        touch: Callable[[float], Contact] = lambda t_s: _FIRM if t_s > 0.3 else _NONE,
        angles_rad: Callable[[float], NDArray[np.float64] | None] | None = _angles_rad,
        height_m: Callable[[float], float | None] = _height_m,
        pulses: bool = True,
        reflex: bool = False,
    ) -> None:
        bus, self.events, self.looks, self.vest = Bus(), list[Event](), list[HandLook](), Sink()
        self.grips = list[ReflexGrip]()
        bus.subscribe(Event, self.events.append, vital=True)
        bus.subscribe(HandLook, self.looks.append, vital=True)
        pacer = Pacer(ManualClock())
        looks = None
        if angles_rad is not None:
            looks = HandPolls(
                lambda: angles_rad(pacer.tick_ns / 1e9),
                lambda: height_m(pacer.tick_ns / 1e9),
                ClosureScale(),
                lambda: pacer.tick_ns,
            )
        frames = [replace(touch(k / 60), t_ns=round(k * 1e9 / 60)) for k in range(round(60 * _END_S))]
        fingers = ("thumb", "index")
        arc = ReflexArc(
            GripReflex(ReflexSetup(fingers), GripReflexOptions()),
            ReflexSection(name="grip", authority=1.0),
            snapshot=lambda _t_ns: ReflexInputs(1.0, allowed=True, measured=None),
            notify=self.grips.append,
        )
        wired_loop(
            pacer,
            TouchLoop(
                dict.fromkeys(fingers, TouchMaxima(cci_max=1.0, eda_max=3000.0)),
                layout="x40",
                mapping=(lambda setup: PulsesMapping(setup, PulsesOptions())) if pulses else None,
            ),
            contacts={finger: PulledStream(list(frames)) for finger in fingers},
            levels=PulledStream([Intent(t_ns=0, channels=(3,), level=3)], end_ns=round(_END_S * 1e9)),
            vests=[self.vest],
            hands=[],
            bus=bus,
            reflex=arc if reflex else None,
            poll_hand=looks,
        ).run()

    @property
    def slips_s(self) -> list[float]:
        return [event.t_ns / 1e9 for event in self.events if event.kind == "slip"]

    def full_s(self) -> list[float]:
        """When all columns of fingers in use were shown at once, as a slip is."""
        return [t_ns / 1e9 for t_ns, frame in self.vest.sent if frame.intensities.max() == 100]


_by_touch = cache(lambda: Ran(touch=_loaded, angles_rad=None))


def test_a_slip_that_touch_does_not_show_is_told_by_joints_and_height_and_pulses() -> None:
    assert Ran(angles_rad=None).slips_s == []
    run = Ran()
    assert len(run.slips_s) == 1
    assert _SLIDES_S < run.slips_s[0] < _SLIDES_S + 0.15
    assert 0 <= run.full_s()[0] - run.slips_s[0] <= 1 / 30 + 0.01
    assert {event.kind for event in run.events} == {"contact", "slip"}
    assert all(check.level in {1, 3} and len(check.tips_mm) == 4 for check in run.looks)
    gaps_ns = np.diff([check.t_ns for check in run.looks])
    assert set(gaps_ns.tolist()) == {9 * MS}


def test_a_reflex_hears_the_slip_that_joints_and_height_tell() -> None:
    run = Ran(pulses=False, reflex=True)
    assert len(run.slips_s) == 1
    firm_s = [grip.t_ns / 1e9 for grip in run.grips if grip.added > 0]
    assert 0 <= firm_s[0] - run.slips_s[0] <= 0.003
    assert Ran(pulses=False, reflex=True, angles_rad=None).slips_s == []
    # What the hand is asked for counts, with what the reflex adds.
    assert 3.4 < max(check.level or 0.0 for check in run.looks) <= 3.5


def test_nobody_looks_where_neither_mapping_nor_reflex_wants_events() -> None:
    requested: list[float] = []

    def angles_rad(t_s: float) -> NDArray[np.float64]:
        requested.append(t_s)
        return _angles_rad(t_s)

    run = Ran(pulses=False, angles_rad=angles_rad)
    assert {event.kind for event in run.events} == {"contact"}, "somebody listens, and hears what touch tells"
    assert run.looks == []
    assert requested == []


_LOST: dict[str, dict[str, Any]] = {
    "a hand that tells no angles": {"angles_rad": lambda _t_s: None},
    "angles before the first report": {"angles_rad": lambda _t_s: np.full(16, np.nan)},
    "one joint that is not a number": {"angles_rad": lambda t_s: np.append(_angles_rad(t_s)[:15], np.inf)},
    "no height": {"height_m": lambda _t_s: None},
    "a height that is not a number": {"height_m": lambda _t_s: math.nan},
}


@pytest.mark.parametrize("lost", list(_LOST))
def test_without_angles_or_height_slips_are_told_by_touch_alone(lost: str) -> None:
    alone, run = _by_touch(), Ran(touch=_loaded, **_LOST[lost])
    assert alone.slips_s != []
    assert run.events == alone.events
    assert [t_ns for t_ns, _ in run.vest.sent] == [t_ns for t_ns, _ in alone.vest.sent]
    looks = {(check.level, check.closure, check.height_m, check.tips_mm) for check in run.looks}
    assert looks == {(None, None, None, ())}


def test_angles_that_stop_leave_slips_to_touch_and_take_over_again() -> None:
    nan = np.full(16, np.nan)
    # Nor does a height that was last known before the lift keep touch from telling.
    for end_s, subject in ((2.0, None), (2.0, nan), (0.9, None)):
        run = Ran(touch=_loaded, angles_rad=lambda t, e=end_s, s=subject: _angles_rad(t) if t < e else s)  # type: ignore[misc]
        assert run.slips_s == pytest.approx(_by_touch().slips_s, abs=0.05)
    # Joints that stand still would have told nothing.
    frozen = Ran(touch=_loaded, angles_rad=lambda t_s: _angles_rad(min(t_s, 2.0)))
    assert frozen.slips_s == []
    again = Ran(angles_rad=lambda t_s: nan if 1.5 < t_s < 2.2 else _angles_rad(t_s))
    assert len(again.slips_s) == 1
    assert _SLIDES_S < again.slips_s[0] < _SLIDES_S + 0.15


def test_ticks_that_are_made_up_for_look_once() -> None:
    now_ns = 0
    looks = HandPolls(lambda: _angles_rad(0.0), lambda: 0.1, ClosureScale(), lambda: now_ns)
    first = looks(0, 3.0)
    assert first is not None
    now_ns = 60 * MS
    seen = [looks(t_ns, 3.0) for t_ns in range(3 * MS, 60 * MS, 3 * MS)]
    assert [check is None for check in seen] == [False] + [True] * 18
    assert seen[0] is not None
    assert (seen[0].t_ns, seen[0].seen_ns) == (3 * MS, 60 * MS)


def test_angles_of_a_silent_hand_and_those_that_are_none_are_not_passed_on() -> None:
    def reported(angles_rad: object, **more: bool) -> object:
        hand: Any = SimpleNamespace(
            angles_rad=angles_rad, **more
        )  # of another package, perhaps without `silent`
        return fresh_angles_rad(hand)

    assert np.array_equal(np.asarray(reported([0.5] * 16)), np.full(16, 0.5))
    assert reported([0.5] * 16, silent=True) is None
    assert reported([0.5] * 15) is reported([math.nan] + [0.5] * 15) is None


def test_a_study_keeps_no_closure_of_a_hand_that_has_told_no_angles() -> None:
    def kept(angles_rad: list[float]) -> HandRow:
        going = Going(ManualClock(), feel=True, closure=ClosureScale())
        going.begin(0)
        going.view(LoopView(0, {}, None, None, angles_rad, {}))
        (row,) = going.hand
        return row

    nothing, half = kept([math.nan] * 16), kept(CLOSURE_POSES_RAD[2].tolist())
    assert (nothing.closure, nothing.tips_mm) == (None, None)
    assert half.closure == pytest.approx(3.0)
    assert half.tips_mm is not None


def test_a_reflex_is_told_no_closure_of_a_hand_that_has_told_no_angles() -> None:
    def measured(hand: Any) -> float | None:
        sets = ["stages.reflex.name=grip", "stages.reflex.authority=1"]
        config = load_config(None, environ={}, sets=sets).config
        arc = open_reflex(config, Bus(), ["thumb"], active=lambda: True, hand=hand)
        assert arc is not None
        reported: list[ReflexGrip] = []
        arc._notify = reported.append
        arc.step(0, 3.0, dict)
        return reported[0].measured

    assert measured(SimpleNamespace(angles_rad=[math.nan] * 16)) is None
    assert measured(SimpleNamespace(angles_rad=CLOSURE_POSES_RAD[2])) == pytest.approx(3.0)


def test_the_settings_choose_what_tells_slips() -> None:
    hand = SimpleNamespace(angles_rad=[0.5] * 16)

    def looks(*sets: str, hand: Any = hand, height_m: Any = lambda: 0.1) -> HandPolls | None:
        config = load_config(None, environ={}, sets=sets).config
        return open_hand_polls(config, hand=hand, height_m=height_m, now_ns=lambda: 0)

    check = looks()
    assert check is not None
    seen = check(0, 2.0)
    assert seen is not None
    assert (seen.level, seen.height_m) == (2.0, 0.1)
    assert looks("stages.slips=hand") is not None
    assert looks("stages.slips=touch") is None
    assert looks(hand=None) is None
    assert looks(height_m=None) is None, "without a height nothing is known of a lift-off"
    with pytest.raises(ConfigError, match=r"stages\.slips"):
        looks("stages.slips=joints")


def test_played_looks_go_on_from_where_the_recording_is_jumped_to() -> None:
    playhead = Playhead(from_s=6.0)
    playhead.begin(10_000 * MS, 0)
    check = played_checks([HandLook(t_ns=t * MS, seen_ns=t * MS) for t in range(0, 9000, 9)], playhead)

    def looks(t_ns: int) -> HandLook | None:
        playhead.reach(t_ns)
        return check(t_ns, 3.0)

    assert looks(0) is None
    first = looks(3 * MS)
    assert first is not None
    assert (first.t_ns, first.seen_ns) == (3 * MS, 3 * MS), "6.003 s of the recording"
    playhead.go_to(2.0)
    playhead.reach(900 * MS)
    seen = [one for t in range(900, 930, 3) if (one := looks(t * MS)) is not None]
    assert [one.t_ns // MS for one in seen] == [909, 918, 927]
    assert [(one.seen_ns - playhead.shift_ns) // MS for one in seen] == [2007, 2016, 2025]
