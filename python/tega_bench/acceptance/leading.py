"""Accept what leads an arm: a forearm's tracker, a switch, a pedal or a SpaceMouse. A person moves it by hand."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any, Final

import numpy as np

from tega.arm.pose import StampedPose
from tega.arm.settings import GateSettings
from tega.runtime.device_items import InputEvent, InputReading
from tega_bench.acceptance.report import AcceptanceGuide, AcceptanceStatus, AcceptanceStep, spread_ms

_WATCH_S: Final = 5.0
_HIDDEN_S: Final = 3.0
_BACK_S: Final = 10.0
_POLL_S: Final = 0.002
# A switch that sticks may read as let go at first.
_LET_GO_S: Final = 0.5
_SLOW: Final = 0.9
_GAP_MS: Final = 100.0
"""Between two poses; after so long a run's target rests."""
_MOST_INVALID: Final = 0.01
_MOVED_M: Final = 0.03
_DRIFT: Final = 0.05
"""Deflection of an untouched axis that is worth a look."""
_PUSHED: Final = 0.2


def accept_tracker(source: Any, gate: GateSettings, guide: AcceptanceGuide) -> Iterator[AcceptanceStep]:
    """Accept an open tracker."""
    guide.say("Hold the forearm still in the tracker's sight.")
    guide.ask("Does it rest? Press Enter, and rest for five seconds.")
    seen = _poses(source, _WATCH_S)
    good = [(at_ns, pose) for at_ns, pose in seen if pose.valid]
    if len(good) < 2:
        text = f"{len(good)} poses that are believed came in {_WATCH_S:g} s"
        todo = source.problem or "is the forearm in its sight?"
        yield AcceptanceStep(name="rate", status="failed", said=text, todo=todo)
        return
    yield _pose_rate(good, source.info.rate_hz)
    ages_ms = np.array([(at_ns - pose.t_ns) * 1e-6 for at_ns, pose in good])
    old = float(ages_ms.max()) > gate.age_ms
    yield AcceptanceStep(
        name="latency",
        status="look" if old else "passed",
        said="from a pose's time stamp until it was read here; without the tracker's delay before its stamp"
        + (f"; poses older than {gate.age_ms:g} ms are not used" if old else ""),
        measured=spread_ms("age", ages_ms),
    )
    yield _pose_limits(seen, good, gate)
    guide.say("Move the forearm forward by about 10 cm, slowly, and back.")
    guide.ask("Ready? Press Enter, and move it within five seconds.")
    rest_m = np.array([pose.position_m for _, pose in good], np.float64).mean(axis=0)
    moving = [pose for _, pose in _poses(source, _WATCH_S) if pose.valid]
    gone_m = max((float(np.linalg.norm(np.asarray(p.position_m) - rest_m)) for p in moving), default=0.0)
    yield AcceptanceStep(
        name="least",
        status="passed" if gone_m >= _MOVED_M else "look",
        said=f"the forearm was seen to go {100 * gone_m:.0f} cm",
        todo="" if gone_m >= _MOVED_M else "it was not moved, or the tracker does not see it",
        measured={"moved_m": round(gone_m, 3)},
    )
    yield _lost(source, guide)


def _poses(source: Any, seconds: float) -> list[tuple[int, StampedPose]]:
    """Return what comes in a while, each with the time at which it was read."""
    found: list[tuple[int, StampedPose]] = []
    source.read(time.monotonic_ns())  # what waited is of before
    until_s = time.monotonic() + seconds
    while time.monotonic() < until_s:
        now_ns = time.monotonic_ns()
        found += [(now_ns, pose) for pose in source.read(now_ns)]
        time.sleep(_POLL_S)
    return found


def _pose_rate(good: list[tuple[int, StampedPose]], agreed_hz: float | None) -> AcceptanceStep:
    spans_ms = np.diff([pose.t_ns for _, pose in good]) * 1e-6
    rate_hz = 1e3 * len(spans_ms) / max(float(spans_ms.sum()), 1e-6)
    slow = agreed_hz is not None and rate_hz < _SLOW * agreed_hz
    gap_ms = float(spans_ms.max())
    agreed = "" if agreed_hz is None else f", {agreed_hz:g} were agreed"
    return AcceptanceStep(
        name="rate",
        status="look" if slow or gap_ms > _GAP_MS else "passed",
        said=f"{rate_hz:.1f} poses a second for {_WATCH_S:g} s{agreed}; the longest gap was {gap_ms:.0f} ms",
        todo="look at the network, the light and what hides the forearm" if slow or gap_ms > _GAP_MS else "",
        measured={"rate_hz": round(rate_hz, 1), "longest_gap_ms": round(gap_ms, 1)},
    )


def _pose_limits(
    seen: list[tuple[int, StampedPose]], good: list[tuple[int, StampedPose]], gate: GateSettings
) -> AcceptanceStep:
    places_m = np.array([pose.position_m for _, pose in good], np.float64)
    steps_m = np.linalg.norm(np.diff(places_m, axis=0), axis=1)
    invalid = 1 - len(good) / len(seen)
    noise_mm = 1000 * float(np.sqrt(((places_m - places_m.mean(axis=0)) ** 2).sum(axis=1).mean()))
    refused = int((steps_m > gate.step_m).sum() + (np.abs(places_m) > gate.room_m).any(axis=1).sum())
    return AcceptanceStep(
        name="limits",
        status="look" if refused or invalid > _MOST_INVALID else "passed",
        said=f"at rest the place is off its mean by {noise_mm:.1f} mm; a run would have refused {refused} poses, and "
        f"the tracker itself did not believe {100 * invalid:.1f} %",
        todo="look for mirrors, sunlight and other markers" if refused or invalid > _MOST_INVALID else "",
        measured={
            "noise_rms_mm": round(noise_mm, 2),
            "largest_step_mm": round(1000 * float(steps_m.max()), 2),
            "invalid_percent": round(100 * invalid, 2),
        },
    )


def _lost(source: Any, guide: AcceptanceGuide) -> AcceptanceStep:
    """Have the forearm hidden, see that the tracker says so; then close it, open it again, and wait for poses."""
    guide.say("Take the forearm out of the tracker's sight, such as behind your back.")
    guide.ask("Is it out of sight? Press Enter, and keep it there for three seconds.")
    hidden = _poses(source, _HIDDEN_S)
    last_ns = time.monotonic_ns() - 1_000_000_000
    believed = sum(pose.valid for at_ns, pose in hidden if at_ns > last_ns)
    source.close()
    guide.say("Bring it back into sight.")
    start_s = time.monotonic()
    source.open()
    back = False
    while not back and time.monotonic() < start_s + _BACK_S:
        back = any(pose.valid for pose in source.read(time.monotonic_ns()))
        time.sleep(_POLL_S)
    text, todo = "a forearm that is out of sight is reported as lost", ""
    if believed:
        text = f"{believed} poses of a forearm that is out of sight were believed in the last second"
        todo = "was it hidden? a tracker that guesses on leads the arm"
    return AcceptanceStep(
        name="stop",
        status="failed" if not back else "look" if believed else "passed",
        said=f"{text}; closed and opened again, {'poses' if back else 'no pose'} came",
        todo=todo,
        measured={"reopened_s": round(time.monotonic() - start_s, 2)},
    )


def accept_input(source: Any, guide: AcceptanceGuide) -> Iterator[AcceptanceStep]:
    """Accept an open switch, pedal or SpaceMouse."""
    guide.say("Let go of the device: nothing touches it.")
    guide.ask("Is it untouched? Press Enter, and leave it for five seconds.")
    rest, _ = _readings(source, _WATCH_S)
    guide.say("Press and let go of each button, and push each axis to its end.")
    guide.ask("Ready? Press Enter, and do so for five seconds.")
    moved, events = _readings(source, _WATCH_S)
    yield _input_rate(moved)
    ages_ms = [(at_ns - event.t_ns) * 1e-6 for at_ns, event in events]
    status: AcceptanceStatus = "skipped"
    text = "no button was pressed, so none was late"
    if ages_ms:
        status, text = "passed", "from a button that the driver saw until it was read here, every 2 ms"
    yield AcceptanceStep(name="latency", status=status, said=text, measured=spread_ms("age", ages_ms))
    yield _input_limits(rest, moved)
    pressed = sorted({event.button for _, event in events if event.pressed})
    pushed = max((abs(x) for one in moved for x in one.motion), default=0.0)
    touched = bool(pressed) or pushed > _PUSHED
    yield AcceptanceStep(
        name="least",
        status="passed" if touched else "look",
        said=f"pressed: {', '.join(pressed) or 'no button'}; the farthest axis went to {100 * pushed:.0f} %",
        todo="" if touched else "it was not touched, or another device was touched",
        measured={"farthest_percent": round(100 * pushed, 1), "events_count": float(len(events))},
    )
    guide.say("Let go of it again.")
    guide.ask("Is it let go? Press Enter.")
    yield _let_go(source)


def _readings(source: Any, seconds: float) -> tuple[list[InputReading], list[tuple[int, InputEvent]]]:
    """Return the states of a while, and the events with the times at which they were read."""
    states: list[InputReading] = []
    events: list[tuple[int, InputEvent]] = []
    source.events()  # what waited is of before
    until_s = time.monotonic() + seconds
    while time.monotonic() < until_s:
        now_ns = time.monotonic_ns()
        events += [(now_ns, event) for event in source.events()]
        states.append(source.state())
        time.sleep(_POLL_S)
    return states, events


def _input_rate(moved: list[InputReading]) -> AcceptanceStep:
    stamps_ns = sorted({one.t_ns for one in moved})
    spans_ms = np.diff(stamps_ns) * 1e-6
    if not len(spans_ms):
        text = "it said nothing while it was to be moved; at rest such a device may be silent"
        return AcceptanceStep(name="rate", status="skipped", said=text)
    return AcceptanceStep(
        name="rate",
        status="passed",
        said=f"{len(stamps_ns)} reports in {_WATCH_S:g} s; such a device reports when something changes",
        measured={"between_p50_ms": round(float(np.percentile(spans_ms, 50)), 2)},
    )


def _input_limits(rest: list[InputReading], moved: list[InputReading]) -> AcceptanceStep:
    drift = max((abs(x) for one in rest for x in one.motion), default=0.0)
    held = sorted({button for one in rest for button in one.held})
    most = max((abs(x) for one in moved for x in one.motion), default=0.0)
    away = any(not one.live for one in rest)
    bad = bool(held) or most > 1
    findings = [f"untouched, its axes stay within {100 * drift:.1f} %"]
    findings += [f"{', '.join(held)} reads as held although it is untouched"] if held else []
    findings += [f"an axis went to {100 * most:.0f} %, beyond full deflection"] if most > 1 else []
    findings += ["for a while it had no data"] if away else []
    return AcceptanceStep(
        name="limits",
        status="failed" if bad else "look" if drift > _DRIFT or away else "passed",
        said="; ".join(findings),
        todo="a switch that is held by itself is no dead-man: another device" if held else "",
        measured={"drift_percent": round(100 * drift, 2), "largest_percent": round(100 * most, 1)},
    )


def _let_go(source: Any) -> AcceptanceStep:
    """See for a moment that nothing is held any more; then close the device and open it again."""
    states, _ = _readings(source, _LET_GO_S)
    held = sorted({button for one in states for button in one.held})
    quiet = not held and max(abs(x) for one in states for x in one.motion) <= _DRIFT
    source.close()
    start_s = time.monotonic()
    source.open()
    opened_s = time.monotonic() - start_s
    source.close()
    return AcceptanceStep(
        name="stop",
        status="passed" if quiet else "failed",
        said=("nothing is held" if quiet else f"held: {', '.join(held) or 'an axis'}")
        + "; it was closed and opened again",
        todo="" if quiet else "a switch that stays held is no dead-man: another device",
        measured={"reopened_s": round(opened_s, 2)},
    )
