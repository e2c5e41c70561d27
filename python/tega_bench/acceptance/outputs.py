"""Accept a vest or a hand: rate, latency, limits, one pulse or motion at the least strength, and its stop."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.devices.base import AnsweringHand, HarmlessDevice, ReportingHand, StampingVest, optional
from tega.errors import InvalidValueError
from tega.haptics import Layout, MotorLevels, vest_frame
from tega.setup.calibration.identify import motor_place
from tega_bench.acceptance.report import STEPS, AcceptanceGuide, AcceptanceStatus, AcceptanceStep, spread_ms

LEAST_PERCENT: Final = 20
"""The strength of a vest's pulses: the lowest that is felt on most places; the driver is opened with this limit."""
LEAST_TORQUE: Final = 0.3
"""The share of the vendor's torque limits that the hand is opened with."""
LEAST_LEVEL: Final = 1.25
"""How far the hand closes: a quarter of the way to the second of five poses."""

_PERIOD_S: Final = 0.05
_PULSES: Final = 20
_SILENT_S: Final = 0.5
_MOVE_S: Final = 2.0
_MOVED_RAD: Final = 0.01
_NOT_CONFIRMED: Final = "was not confirmed"


def skipped_steps(names: Sequence[str], why: str) -> list[AcceptanceStep]:
    """Return steps that were not made, and why."""
    return [AcceptanceStep(name=name, status="skipped", said=why) for name in names]


def least_options(options: Any) -> Any | None:
    """Return a vest's or hand's options with the least strength; ``None`` where its driver has no limit of it."""
    for name, least in (("limit", LEAST_PERCENT), ("torque_share", LEAST_TORQUE)):
        if hasattr(options, name):
            return msgspec.structs.replace(options, **{name: min(least, getattr(options, name))})
    return None


def accept_vest(vest: Any, layout: Layout, percent: int, guide: AcceptanceGuide) -> Iterator[AcceptanceStep]:
    """Accept an open vest: the steps rate, latency, limits, least and stop; those that vibrate need a yes.

    ``vest`` is open with :func:`least_options`; ``percent`` is its limit; ``guide`` holds or wears it.
    """
    dark = vest_frame([0] * 4, [0] * 4, layout=layout)
    motors = dark.motors.tolist()
    question = f"May motors {motors[0]} and {motors[-1]} vibrate by turns, at {percent} %, for a second?"
    if not guide.confirm(question):
        yield from skipped_steps(STEPS[1:], f"the pulse {_NOT_CONFIRMED}")
        return
    vest.write(time.monotonic_ns(), dark)
    largest, n_zero, left_ms = _pulse(vest, dark, motors)
    first, last = motor_place(motors[0], layout), motor_place(motors[-1], layout)
    where = guide.ask(f"Where was it felt? Expected: {first}, and {last}.")
    yield _vest_rate(left_ms)
    if isinstance(vest, StampingVest):
        yield _left_step(left_ms, n_zero)
    yield AcceptanceStep(
        name="limits",
        status="passed" if largest <= percent else "failed",
        said=f"100 % was asked for, {largest} % is the most that was sent; the limit is {percent} %",
        measured={"largest_percent": float(largest)},
    )
    yield AcceptanceStep(
        name="least",
        status="failed" if n_zero == _PULSES else "look" if n_zero or not where else "passed",
        said=f"{_PULSES - n_zero} of {_PULSES} frames were sent to a vest that is connected",
        todo="" if where else "no answer where it was felt: tega-teleop vest identify names every place",
        measured={"strength_percent": float(percent)},
        answers={"Where was it felt?": where},
    )
    yield _vest_stop(vest, dark, percent, guide)


def _pulse(vest: Any, dark: MotorLevels, motors: list[int]) -> tuple[int, int, list[tuple[float, float]]]:
    """Light two motors by turns.

    Returns the largest strength sent, frames not shown, and of each that left when (s) and how late (ms).
    """
    largest = n_zero = 0
    if isinstance(vest, StampingVest):
        vest.handed_over()
    try:
        for k in range(_PULSES):
            intensities = np.zeros(len(motors), np.uint8)
            intensities[0 if k % 2 else -1] = 100  # the limit brings it down
            sent = vest.write(time.monotonic_ns(), MotorLevels(dark.layout, intensities))
            largest = max(largest, int(sent.intensities.max()))
            n_zero += not sent.intensities.any()
            time.sleep(_PERIOD_S)
    finally:
        vest.write(time.monotonic_ns(), dark)
    time.sleep(_PERIOD_S)
    handed = vest.handed_over() if isinstance(vest, StampingVest) else []
    return largest, n_zero, [(left_ns * 1e-9, (left_ns - t_ns) * 1e-6) for t_ns, _, left_ns in handed]


def _vest_rate(left_ms: list[tuple[float, float]]) -> AcceptanceStep:
    if len(left_ms) < 2:
        text = "this driver does not report when a frame leaves"
        return AcceptanceStep(name="rate", status="skipped", said=text)
    times_s = np.array([left_s for left_s, _ in left_ms])
    rate_hz = (len(times_s) - 1) / max(float(times_s[-1] - times_s[0]), 1e-9)
    requested_hz = 1 / _PERIOD_S
    return AcceptanceStep(
        name="rate",
        status="passed" if rate_hz > 0.8 * requested_hz else "look",
        said=f"{len(left_ms)} new frames left at {rate_hz:.1f} a second, {requested_hz:g} were asked for",
        measured={"rate_hz": round(rate_hz, 2)},
    )


def _left_step(left_ms: list[tuple[float, float]], n_zero: int) -> AcceptanceStep:
    late = [ms for _, ms in left_ms]
    return AcceptanceStep(
        name="latency",
        status="passed" if late and not n_zero else "failed",
        said="from a frame that is written until it has left this machine; the motor's start is not in it "
        "(tega-teleop vest onset)",
        measured=spread_ms("left", late),
    )


def _vest_stop(vest: Any, dark: MotorLevels, percent: int, guide: AcceptanceGuide) -> AcceptanceStep:
    """Light one motor, write no more, and see that the driver silences it; then close."""
    counters = getattr(vest, "counters", None)
    before = 0 if counters is None else counters.silenced
    lit = np.zeros_like(dark.intensities)
    lit[0] = percent
    start_s = time.monotonic()
    try:
        while time.monotonic() - start_s < _SILENT_S:
            vest.write(time.monotonic_ns(), MotorLevels(dark.layout, lit))
            time.sleep(_PERIOD_S)
        time.sleep(_SILENT_S)  # nothing is written: the driver's watchdog has 0.2 s
        silenced = 0 if counters is None else counters.silenced - before
    finally:
        vest.write(time.monotonic_ns(), dark)
    start_s = time.monotonic()
    vest.close()
    closed_s = time.monotonic() - start_s
    text = "this driver does not count what its watchdog does"
    if counters is not None:
        text = f"the watchdog sent zeros {silenced} times after writing had stopped"
    if optional(vest, "confirmed_rest"):
        text += ", and the vest has answered behind the zeros of closing"
    else:
        text += "; this driver does not report whether the zeros of closing arrived"
    silent = guide.ask("Is every motor silent now?")
    seen = seen_status(silent)
    return AcceptanceStep(
        name="stop",
        status="failed" if counters is not None and not silenced else seen,
        said=text,
        todo="use the vest's switch, and report it" if seen == "failed" else "",
        measured={"closed_s": round(closed_s, 3)},
        answers={"Is every motor silent?": silent},
    )


def accept_hand(
    make: Any, options: Any, guide: AcceptanceGuide, measured: Mapping[str, float]
) -> Iterator[AcceptanceStep]:
    """Accept a hand that was read with its motors off; after a yes, with the least torque.

    The steps are rate, latency, limits, least and stop. ``make`` is the driver's class, ``guide`` the person
    at the hand's switch; ``measured`` is what ``doctor`` measured with the motors off.
    """
    yield _reported_rate(make(options).info.rate_hz or 0.0, measured)
    least = least_options(options)
    guide.say("The hand is free of people and things; one of you has a finger on its emergency switch.")
    share = 0.0 if least is None else least.torque_share
    question = (
        f"May its motors go on, with {100 * share:.0f} % of the torque, and the fingers close a little?"
    )
    if least is None or not guide.confirm(question):
        why = "the driver has no ceiling of torque" if least is None else f"the motion {_NOT_CONFIRMED}"
        yield from skipped_steps(STEPS[2:], why)
        return
    with make(least) as hand:
        yield from _move(hand, share, guide)
        stopped = _hand_stop(hand, guide)
    yield _motors_off(make, options, stopped)


def _reported_rate(agreed_hz: float, measured: Mapping[str, float]) -> AcceptanceStep:
    rate_hz = measured.get("rate_hz")
    if rate_hz is None:
        return AcceptanceStep(name="rate", status="skipped", said="its driver cannot read it without force")
    return AcceptanceStep(
        name="rate",
        status="passed" if rate_hz > 0.9 * agreed_hz else "look",
        said=f"{rate_hz:.0f} whole sets of positions a second with the motors off, {agreed_hz:.0f} are sent by a hand",
        measured=dict(measured),
    )


def _move(hand: Any, share: float, guide: AcceptanceGuide) -> list[AcceptanceStep]:
    try:
        hand.step(6)
        refused = False
    except InvalidValueError:
        refused = True
    _hold(hand, 1.0, hand.angles_rad)
    start_ns, open_rad = time.monotonic_ns(), hand.angles_rad.copy()
    furthest = _hold(hand, LEAST_LEVEL, open_rad)
    answered = hand.answered_ns(start_ns) if isinstance(hand, AnsweringHand) else None
    _hold(hand, 1.0, open_rad)
    back_rad = float(np.abs(hand.angles_rad - open_rad).max())
    problem = optional(hand, "problem")
    seen = guide.ask("Did all fingers close a little and open again?")
    moved = furthest > _MOVED_RAD
    late_ms = None if answered is None else (answered[1] - answered[0]) * 1e-6
    return [
        AcceptanceStep(
            name="latency",
            status="skipped" if late_ms is None else "passed",
            said="from a set of positions that is in until the torques that answer it have left",
            measured={} if late_ms is None else {"answered_ms": round(late_ms, 3)},
        ),
        AcceptanceStep(
            name="limits",
            status="passed" if refused else "failed",
            said="a level above 5 is refused, and the hand holds" if refused else "a level above 5 was taken",
            measured={"torque_share_ratio": share},
        ),
        AcceptanceStep(
            name="least",
            status="failed" if problem else seen_status(seen) if moved else "look",
            said=f"asked to close to level {LEAST_LEVEL:g}, its joints moved by up to {furthest:.3f} rad and came back"
            + (f"; {problem}" if problem else ""),
            todo="" if moved else "so little torque may not move it: raise torque_share by hand",
            measured={"moved_rad": round(furthest, 4), "left_over_rad": round(back_rad, 4)},
            answers={"Did all fingers close a little and open again?": seen},
        ),
    ]


def _hold(hand: Any, level: float, open_rad: NDArray[np.float64]) -> float:
    """Hold a level for a while; return how far any joint went from its open angle, rad."""
    furthest, until_s = 0.0, time.monotonic() + _MOVE_S
    while time.monotonic() < until_s:
        hand.step(level)
        furthest = max(furthest, float(np.abs(hand.angles_rad - open_rad).max()))
        time.sleep(0.02)
    return furthest


def _hand_stop(hand: Any, guide: AcceptanceGuide) -> AcceptanceStep:
    start_s = time.monotonic()
    hand.limp()
    hand.close()
    measured = {"let_go_s": round(time.monotonic() - start_s, 3)}
    limp = guide.ask("Is the hand limp now?")
    return AcceptanceStep(
        name="stop",
        status=seen_status(limp),
        said="it was let go",
        measured=measured,
        answers={"Is the hand limp?": limp},
    )


def seen_status(answer: str) -> AcceptanceStatus:
    """Return the step's result: "no" fails it, no answer means that a person has to look."""
    return "look" if not answer else "failed" if answer.lower().startswith("n") else "passed"


def _motors_off(make: Any, options: Any, step: AcceptanceStep) -> AcceptanceStep:
    """Re-read from the hand whether its motors are off."""
    harmless = make.harmless(options) if isinstance(make, HarmlessDevice) else None
    if harmless is None:
        return step
    driver: Any = make
    with driver(harmless) as hand:
        on = isinstance(hand, ReportingHand) and hand.state().servo_on
    return msgspec.structs.replace(
        step,
        status="failed" if on else step.status,
        said=f"{step.said}; the hand says that its motors are {'ON' if on else 'off'}",
        todo="use the emergency switch" if on else step.todo,
    )
