"""Accept an arm: rate and delays, then 2 cm up and back under the dead-man, through the chain of every motion."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Final

import msgspec
import numpy as np

from tega.config import ArmConfig, SessionConfig
from tega.records import ArmTurn
from tega.records.bus import Bus
from tega_bench.acceptance.outputs import seen_status, skipped_steps
from tega_bench.acceptance.report import STEPS, AcceptanceGuide, AcceptanceStatus, AcceptanceStep, spread_ms
from tega_bench.homing import go_to_start, watch_arm

LEAST_UP_M: Final = 0.02
LEAST_SPEED_M_S: Final = 0.05

_WATCH_S: Final = 3.0
_STILL_M: Final = 0.001
_BACK_M: Final = 0.005
_SPRING: Final = (
    "an arm that a spring pulls stays behind by its friction over the spring's stiffness: a larger stiffness_n_m "
    "brings it nearer"
)
_OVER: Final = 1.5
"""How much faster than its limit a measured arm may be: its place is noisy."""
_SPAN_NS: Final = 50_000_000
_SLOW: Final = 0.9


class _EchoedOnce:
    """Shows progress to the guide, each message once."""

    def __init__(self, guide: AcceptanceGuide) -> None:
        self._guide, self._last = guide, ""

    def show(self, prompt: str, _bars: object, _left_s: float | None, /) -> None:
        words = prompt.partition(" (")[0]
        if words.startswith("the arm moves"):
            words = "the arm moves"
        if words != self._last:
            self._last = words
            self._guide.say(words)


def accept_arm(config: SessionConfig, arm: ArmConfig, guide: AcceptanceGuide) -> Iterator[AcceptanceStep]:
    """Accept the arm of the settings: the steps rate, latency, limits, least and stop.

    All are skipped without a yes, and nothing is opened. ``ConfigError`` without a dead-man switch, or if 2
    cm up is outside of the workspace.
    """
    question = (
        f"Is everybody out of the arm's reach, and one of you at its emergency stop? It may go up by "
        f"{100 * LEAST_UP_M:g} cm and come back, at {100 * LEAST_SPEED_M_S:g} cm/s, while the dead-man is held."
    )
    if not guide.confirm(question):
        yield from skipped_steps(STEPS[1:], "the motion was not confirmed")
        return
    limits = msgspec.structs.replace(arm.limits, speed_m_s=min(arm.limits.speed_m_s, LEAST_SPEED_M_S))
    alone = msgspec.structs.replace(config.hand, driver=None, options={})  # the hand is not part of this
    config = msgspec.structs.replace(config, hand=alone)
    seen = _watched(config, arm)
    yield _turn_rate(seen, arm.rate_hz)
    places = _places(seen)
    if not places:
        yield AcceptanceStep(name="latency", status="failed", said="it does not say where its hand is")
        return
    ages_ms = [(t.t_ns - m.t_ns) * 1e-6 for t in seen for m in t.measured]
    yield AcceptanceStep(
        name="latency",
        status="passed",
        said="from the arm's own time stamp of its place until the chain used it",
        measured=spread_ms("age", ages_ms),
    )
    home = next(t.measured[0] for t in reversed(seen) if t.measured)
    turns, bus = _turns()
    reported, text = _EchoedOnce(guide), ""
    try:
        for up_m in (LEAST_UP_M, 0.0):
            guide.say("Let go of dead-man and clutch; hold both once you are asked to, until it is there.")
            x, y, z = home.position
            goal = msgspec.structs.replace(
                arm, limits=limits, start_m=(x, y, z + up_m), start_xyzw=home.quaternion
            )
            text = go_to_start(msgspec.structs.replace(config, arm=goal), reported, bus=bus)
    except TimeoutError as error:
        yield from skipped_steps(("limits",), "the arm did not move")
        todo = "hold dead-man and clutch when you are asked to; else check the arm's own messages"
        yield AcceptanceStep(name="least", status="failed", said=str(error), todo=todo)
    else:
        yield _speed_step(turns, limits.speed_m_s)
        answer = guide.ask("Did the hand go up by 2 cm and come back?")
        yield _least_step(turns, home.position, text, answer)
    yield _stands(config, arm, guide)


def _turns() -> tuple[list[ArmTurn], Bus]:
    """Return the arm's turns, which are appended as they come, and the bus that they come on."""
    turns, bus = list[ArmTurn](), Bus()
    bus.subscribe(ArmTurn, turns.append)
    return turns, bus


def _watched(config: SessionConfig, arm: ArmConfig) -> list[ArmTurn]:
    turns, bus = _turns()
    watch_arm(config, arm, _WATCH_S, bus=bus)
    return turns


def _places(turns: Sequence[ArmTurn]) -> list[tuple[int, tuple[float, ...]]]:
    return [(m.t_ns, m.position) for turn in turns for m in turn.measured if len(m.position) == 3]


def _turn_rate(turns: Sequence[ArmTurn], agreed_hz: float) -> AcceptanceStep:
    if len(turns) < 2:
        return AcceptanceStep(name="rate", status="failed", said="its process made no turn")
    span_s = (turns[-1].t_ns - turns[0].t_ns) * 1e-9
    rate_hz, known_hz = (len(turns) - 1) / span_s, sum(bool(t.measured) for t in turns) / span_s
    fast = rate_hz > _SLOW * agreed_hz
    return AcceptanceStep(
        name="rate",
        status="passed" if fast else "look",
        said=f"{rate_hz:.0f} turns a second of {agreed_hz:g} that the settings ask for; the arm's place was new in "
        f"{known_hz:.0f} of them",
        todo="" if fast else "look at what else this machine does",
        measured={"rate_hz": round(rate_hz, 1), "measured_hz": round(known_hz, 1)},
    )


def _speed_step(turns: Sequence[ArmTurn], limit_m_s: float) -> AcceptanceStep:
    requested_m_s = max(math.hypot(*turn.velocity[:3]) for turn in turns)
    places = _places(turns)
    newest, fastest_m_s = places[0], 0.0
    for place in places:
        if place[0] < newest[0]:  # each way has a clock of its own
            newest = place
        if place[0] - newest[0] >= _SPAN_NS:
            speed_m_s = math.dist(place[1], newest[1]) / ((place[0] - newest[0]) * 1e-9)
            newest, fastest_m_s = place, max(fastest_m_s, speed_m_s)
    held = all(
        math.hypot(*later.velocity[:3]) <= max(math.hypot(*sooner.velocity[:3]), 1e-6)
        for sooner, later in pairwise(turns)
        if not sooner.dead_man and not later.dead_man and later.t_ns > sooner.t_ns
    )
    good = requested_m_s <= limit_m_s * 1.001 and fastest_m_s <= _OVER * limit_m_s and held
    return AcceptanceStep(
        name="limits",
        status="passed" if good else "failed",
        said=f"the limit is {100 * limit_m_s:g} cm/s; the fastest command was {100 * requested_m_s:.1f}, and it was "
        f"measured at {100 * fastest_m_s:.1f}" + ("" if held else "; commands sped up without the dead-man"),
        measured={"told_m_s": round(requested_m_s, 4), "measured_m_s": round(fastest_m_s, 4)},
    )


def _least_step(turns: Sequence[ArmTurn], home: tuple[float, ...], text: str, answer: str) -> AcceptanceStep:
    places = [place for _, place in _places(turns)]
    up_m = max(place[2] for place in places) - home[2]
    off_m = math.dist(places[-1], home)
    moved = up_m > LEAST_UP_M / 2 and off_m < LEAST_UP_M / 2
    near = up_m > LEAST_UP_M - _BACK_M and off_m < _BACK_M
    status: AcceptanceStatus = "failed"
    todo = "look at its page, and at what holds it back"
    if near:
        status, todo = seen_status(answer), ""
    elif moved:
        status, todo = "look", _SPRING
    return AcceptanceStep(
        name="least",
        status=status,
        said=f"by its own word it went up by {1000 * up_m:.1f} mm and came back to {1000 * off_m:.1f} mm ({text})",
        todo=todo,
        measured={"up_m": round(up_m, 4), "left_over_m": round(off_m, 4)},
        answers={"Did the hand go up by 2 cm and come back?": answer},
    )


def _stands(config: SessionConfig, arm: ArmConfig, guide: AcceptanceGuide) -> AcceptanceStep:
    """Have the dead-man let go, and see that the arm stands, by its own word."""
    guide.say("Let go of the dead-man switch.")
    guide.ask("Is it let go? Press Enter.")
    start_s = time.monotonic()
    places = np.array([place for _, place in _places(_watched(config, arm))])
    drift_m = float(np.abs(places - places[0]).max()) if len(places) else math.nan
    answer = guide.ask("Does the arm stand still?")
    stands = drift_m < _STILL_M
    return AcceptanceStep(
        name="stop",
        status="failed" if not stands else seen_status(answer),
        said=f"without the dead-man its place stayed within {1000 * drift_m:.2f} mm for "
        f"{time.monotonic() - start_s:.0f} s",
        todo="" if stands else "press the emergency stop, and report it",
        measured={"drift_mm": round(1000 * drift_m, 3)} if len(places) else {},
        answers={"Does the arm stand still?": answer},
    )
