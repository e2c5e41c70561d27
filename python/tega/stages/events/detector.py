"""Detect contact, release, slip and lift-off, as the sensors' numbers come or with a look ahead.

Live and offline use share one implementation. Live, an event is reported as soon as its rule holds. Over a record,
the rule also gets the next half second, which rejects a slip that turns out to be a release and raises the confidence
of a lasting event.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Literal, NamedTuple

from tega.stages.events.settings import SETTINGS, DetectorSettings, Rule
from tega.stages.events.tracks import FingerTrack, Low, SinkTrack, TouchFrame, TwoMeans

EventKind = Literal["contact", "release", "slip", "lift_off"]

UNSURE = 0.49
"""Most that the confidence of a slip can be without the hand's joints and the arm's height, or without either.

Fingertips alone cannot distinguish a slip from a grip that shifts or opens: such a rig cannot observe slips, and 0.5
is the threshold for a certain event (:attr:`tega.records.Event.certain`).
"""


class DetectedEvent(NamedTuple):
    """An event of the grasp, with its time and confidence.

    Attributes:
        kind: Kind of the event.
        t_s: Estimated beginning, seconds.
        confidence: 0 to 1; half where it is just an event. A slip's is the rule's share, shifted so, and never more
            than :data:`UNSURE` without joints and height; how often it is right on other objects or sensors than those
            it was fitted on is not known.
        known_s: Time at which it was reported, seconds.
        finger: Name of the finger; empty for the whole grasp.
    """

    kind: EventKind
    t_s: float
    confidence: float
    known_s: float
    finger: str = ""


class Rise:
    """Makes events of a share that rises and falls."""

    def __init__(self, kind: EventKind, rule: Rule, rest_s: float, look_ahead_s: float) -> None:
        self._kind, self._rule, self._rest_s, self._ahead_s = kind, rule, rest_s, look_ahead_s
        self._since_s: float | None = None
        self._free_s = -math.inf
        self._open: tuple[float, float] | None = None

    def add(self, t_s: float, share: float, *, void: bool) -> DetectedEvent | None:
        """Add the current share; ``void`` cancels an event that is not reported yet."""
        reported = self._waited(t_s, share, void=void)
        if share < self._rule.enter or void:
            self._since_s = None
            return reported
        self._since_s = t_s if self._since_s is None else self._since_s
        began_s = self._since_s
        if t_s - began_s < self._rule.least_s - 1e-9:
            return reported
        fresh, self._free_s = t_s >= self._free_s, t_s + self._rest_s
        if fresh and not self._ahead_s:
            return DetectedEvent(self._kind, began_s, share, t_s)
        if fresh:
            self._open = began_s, share
        return reported

    def _waited(self, t_s: float, share: float, *, void: bool) -> DetectedEvent | None:
        """Return the event that has waited long enough for later data."""
        if self._open is None:
            return None
        began_s, most = self._open[0], max(self._open[1], share)
        self._open = None if void else (began_s, most)
        if void or t_s < began_s + self._rule.least_s + self._ahead_s:
            return None
        self._open = None
        return DetectedEvent(self._kind, began_s, most, t_s)


class Detector:
    """Finds events. Times of a finger must not fall, nor those of hand and arm.

    A slip waits for later data for ``look_ahead_s``; 0 reports it at once.
    """

    def __init__(self, settings: DetectorSettings = SETTINGS, *, look_ahead_s: float = 0.0) -> None:
        self._s, self._ahead_s = settings, look_ahead_s
        self._quick: dict[str, FingerTrack] = {}
        self._trend: dict[str, FingerTrack] = {}
        self._sinking: dict[str, SinkTrack] = {}
        self._reported: dict[str, bool] = {}
        self._grasp_s: float | None = None
        self._lost_s = self._gained_s = -math.inf
        self._next_s = -math.inf
        self._level: float | None = None
        self._closure, self._height = (TwoMeans(settings.quick_s, settings.slow_s) for _ in range(2))
        self._base_m = self._floor_m = math.inf
        self._lifted = False
        self._since_s: float | None = None
        self._grip, self._pressed = Low(settings.before_s), Low(settings.before_s)
        self._rises = {
            rule: Rise("slip", rule, settings.rest_s, look_ahead_s)
            for rule in (settings.touch, settings.hand, settings.sink)
        }

    def touch(self, t_s: float, finger: str, touch: TouchFrame) -> list[DetectedEvent]:
        """Add a frame of a fingertip at a time, seconds, and return the events that it shows."""
        s = self._s
        if finger not in self._quick:
            self._quick[finger] = FingerTrack(s.quick_s, s.slow_s)
            self._trend[finger] = FingerTrack(*s.trend_s)
            self._reported[finger] = touch.in_contact
        track = self._quick[finger]
        if t_s - track.seen_s > s.stale_s and math.isfinite(track.seen_s):  # what was missed is no event
            self._reported[finger] = touch.in_contact
        was = track.touching
        track.add(t_s, touch)
        self._trend[finger].add(t_s, touch)
        if track.touching != was:
            self._lost_s, self._gained_s = (t_s, self._gained_s) if was else (self._lost_s, t_s)
        found = self._contact(t_s, finger, track)
        if any(one.touching for one in self._quick.values()):
            if self._grasp_s is None:
                self._grasp_s = t_s
        elif self._grasp_s is not None and not self._holds and t_s - self._lost_s > s.rest_s:
            self._let_go()
        if t_s >= self._next_s and self._rule() is not s.sink:
            self._next_s = t_s + s.step_s
            found += self._slip(t_s)
        return found

    def hand(
        self,
        t_s: float,
        *,
        level: float | None = None,
        closure: float | None = None,
        height_m: float | None = None,
        tips_mm: Mapping[str, float] | None = None,
    ) -> list[DetectedEvent]:
        """Add a look at hand and arm, and return its events; ``None`` for a quantity that is not measured.

        Args:
            t_s: Time of the look, seconds.
            level: Closure level asked for.
            closure: Closure measured, levels.
            height_m: Height of the arm's end, metres.
            tips_mm: Height of each fingertip over the palm by the hand's joint angles, millimetres, as of
                :func:`tega.hand.mjcf.fingertips_m`.
        """
        found: list[DetectedEvent] = []
        self._level = level
        # What is no longer measured says nothing: the rules that need it give way to those that do not.
        self._closure.add(t_s, math.nan if closure is None else closure)
        self._height.add(t_s, math.nan if height_m is None else height_m)
        if height_m is not None:
            found += self._lift(t_s, height_m)
        if not tips_mm:  # the other rules take over
            self._sinking.clear()
        for finger, tip_mm in (tips_mm or {}).items():
            self._sinking.setdefault(finger, SinkTrack(self._s.sink_s[-1])).add(t_s, tip_mm)
        # The joints are reported more often than pictures, and without a camera's delay.
        return found + self._slip(t_s) if tips_mm and self._rule() is self._s.sink else found

    def close(self, t_s: float) -> list[DetectedEvent]:
        """End the record; return the events that were waiting for later data."""
        found = []
        for rule, rise in self._rises.items():
            if (one := rise.add(t_s + self._ahead_s, 0.0, void=False)) is not None:
                found.append(self._as_sure(rule, one)._replace(known_s=t_s))
        return found

    def features(self, t_s: float) -> tuple[float, ...]:
        """Return the features of a slip: SINK_FEATURES or HAND_FEATURES as far as measured, else FEATURES."""
        if self._rule() is self._s.sink:
            return (*self._held_features(t_s), *self._sink_features())
        on = [(one, self._trend[finger]) for finger, one in self._quick.items() if one.touching]
        sums = [math.exp(one.mass.quick) for one, _ in on]
        mass = sum(sums)
        before = sum(math.exp(one.mass.slow) for one, _ in on)
        long_before = sum(math.exp(trend.mass.slow) for _, trend in on)
        flows = [one.flow_px for one, _ in on]
        mean = sum(flow * part for flow, part in zip(flows, sums, strict=True)) / mass if on else 0.0
        touch = (
            float(len(on)),
            math.log1p(mass / 1e4),
            math.log((mass + 1e3) / (before + 1e3)),
            math.log((mass + 1e3) / (long_before + 1e3)),
            math.log1p(max(flows, default=0.0)),
            math.log1p(max((trend.flow_px for _, trend in on), default=0.0)),
            math.log1p(mean),
            max((one.peak.quick for one, _ in on), default=0.0) / 20,
            min((one.peak.change for one, _ in on), default=0.0) / 10,
            min((one.area.change for one, _ in on), default=0.0) / 20,
            math.exp((self._lost_s - t_s) / self._s.fade_s),
            math.exp((self._gained_s - t_s) / self._s.fade_s),
        )
        if self._level is not None and self._measured:
            return (*touch, *self._held_features(t_s))
        return touch

    def _held_features(self, t_s: float) -> tuple[float, ...]:
        return (
            self._pressed.fallen,
            self._pressed.below,
            self._closure.change,
            (self._level or 0) - self._closure.quick,
            10 * self._height.change,
            self._grip.fallen,
            self._grip.below,
            0.0 if self._since_s is None else math.exp(self._since_s - t_s),
        )

    def _sink_features(self) -> tuple[float, ...]:
        on = [
            (self._sinking[finger], math.exp(one.mass.quick))
            for finger, one in self._quick.items()
            if one.touching and finger in self._sinking
        ]
        if not on:
            return (0.0,) * (len(self._s.sink_s) + 2)
        mass = sum(part for _, part in on)
        means = [sum(part * sink.speed_mm_s(over_s) for sink, part in on) / mass for over_s in self._s.sink_s]
        each = [sink.speed_mm_s(self._s.sink_s[1]) for sink, _ in on]
        return (*means, max(each), min(each))

    @property
    def _measured(self) -> bool:
        return not (math.isnan(self._closure.quick) or math.isnan(self._height.quick))

    def _rule(self) -> Rule:
        if self._level is not None and self._measured:
            return self._s.sink if self._sinking else self._s.hand
        return self._s.touch

    @property
    def _holds(self) -> bool:
        """Whether the hand is known to be closed on something, whatever the fingertips see."""
        return (
            self._level is not None
            and self._level > 1
            and not math.isnan(self._closure.quick)
            and self._level - self._closure.quick > self._s.pressed_levels
        )

    @property
    def may_slip(self) -> bool:
        """Whether something is held that could slip, as far as is known."""
        if self._grasp_s is None:
            return False
        if math.isnan(self._height.quick):
            return True
        opened = self._level is not None and self._level <= 1
        return self._lifted and not opened and self._height.quick > self._base_m + self._s.down_m

    @property
    def _lowered(self) -> bool:
        """Whether the rule of sinking fingertips is paused: an object being put down may slide without a slip."""
        return self._rule() is self._s.sink and self._height.change < -self._s.lowered_m

    def _contact(self, t_s: float, finger: str, track: FingerTrack) -> list[DetectedEvent]:
        least_s = self._s.touch_s if track.touching else self._s.release_s
        if track.touching == self._reported[finger] or t_s - track.since_s < least_s - 1e-9:
            return []
        self._reported[finger] = track.touching
        # Certain as far as the fingertip's own noise goes: the reading calls contact what stands out of it.
        return [DetectedEvent("contact" if track.touching else "release", track.since_s, 1.0, t_s, finger)]

    def _remember(self, t_s: float) -> None:
        """Keep how firm the grip is, from lift-off on."""
        if not self._lifted or self._grasp_s is None:
            return
        self._since_s = t_s if self._since_s is None else self._since_s
        on = (math.exp(one.mass.quick) for one in self._quick.values() if one.touching)
        self._pressed.add(t_s, math.log(self._s.noise_sum + sum(on)))
        if not math.isnan(self._closure.quick):
            self._grip.add(t_s, self._closure.quick)

    def _slip(self, t_s: float) -> list[DetectedEvent]:
        self._remember(t_s)
        seen = self.features(t_s)
        rule = self._rule()
        may = self.may_slip and not self._lowered
        settled = self._grasp_s is not None and t_s - self._grasp_s >= self._s.settle_s
        share = share_of(rule, seen) if settled and may else 0.0
        found = self._rises[rule].add(t_s, share, void=not may)
        return [] if found is None else [self._as_sure(rule, found)]

    def _as_sure(self, rule: Rule, found: DetectedEvent) -> DetectedEvent:
        observed = rule in {self._s.sink, self._s.hand}
        return found if observed else found._replace(confidence=UNSURE * found.confidence)

    def _lift(self, t_s: float, height_m: float) -> list[DetectedEvent]:
        self._floor_m = min(self._floor_m, height_m)
        if self._grasp_s is None and not self._holds:
            # What is taken hold of again in the air does not leave the table a second time.
            self._lifted = self._lifted and height_m > self._floor_m + self._s.down_m
            self._base_m = self._floor_m if self._lifted else height_m
            return []
        self._base_m = min(self._base_m, height_m)
        if self._lifted or height_m - self._base_m < self._s.lift_m:
            return []
        self._lifted = True
        fingers = sum(one.touching for one in self._quick.values())
        # A hand that goes up closed on nothing looks the same; every finger that feels something halves the doubt.
        return [DetectedEvent("lift_off", t_s, 1 - 0.5 ** (1 + fingers), t_s)]

    def _let_go(self) -> None:
        self._grasp_s = self._since_s = None
        self._grip, self._pressed = Low(self._s.before_s), Low(self._s.before_s)


def share_of(rule: Rule, seen: Sequence[float]) -> float:
    """Return the output of a rule for some features."""
    both = sum(w * seen[i] * seen[j] for i, j, w in rule.products)
    x = rule.bias + sum(w * x for w, x in zip(rule.weights, seen, strict=True)) + both
    return 1 / (1 + math.exp(-x)) if x > -700 else 0.0
