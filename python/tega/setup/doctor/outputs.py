"""Check hand and vest, and time the hand's loop. A check leaves the motors off and sends zeros only."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any, Final

import msgspec
import numpy as np

from tega._native import TOO_HOT_C
from tega.devices import HarmlessDevice, driver_class
from tega.devices.base import ReportingHand, optional
from tega.devices.machine import bluetooth_trouble, can_links, link_trouble
from tega.errors import MissingExtraError, TegaError
from tega.setup.doctor.findings import DriverCase, Finding, failed

if TYPE_CHECKING:
    from tega.devices.hand.allegro import Allegro


# Temperatures come twice a second.
_POLLS, _POLL_S = 10, 0.12


def try_hand(case: DriverCase) -> list[Finding]:
    """Open a hand with its motors off, receive its reports for a moment, close it."""
    driver = driver_class(case.driver, "hand")
    if not isinstance(driver, HarmlessDevice):
        text = f"{case.driver} was not opened: it does not say how to without force"
        return [case.reported("", "warning", text)]
    options = driver.harmless(case.options)
    hand: Any = driver(case.options if options is None else options)
    label = hand.info.label
    if options is None:
        return [case.reported(label, "ok", f"{case.driver} needs no device; it was not opened")]
    why, step = _bus(case)
    if why:
        return [case.reported(label, "error", f"the hand cannot be reached: {why}", todo=(step,))]
    try:
        with hand:
            measured, problem = _check(hand) if isinstance(hand, ReportingHand) else ({}, "")
            info, state = hand.info, hand.state() if measured else None
    except TegaError as error:
        return [failed(case, error, device=label)]
    text = (
        f"the hand on {label} reports {measured.get('rate_hz', 0):.0f} times a second; its motors stayed off"
    )
    if not measured:
        text = f"the bus {label} opens; this driver only sends, so no device on it was detected"
    findings = [case.reported(label, "ok", text, why="; ".join(info.notes), measured=measured)]
    if state is None:
        return findings
    if n_unknown := state.joints_c.count(None):
        text = f"{n_unknown} of {len(state.joints_c)} joints report no temperature"
        findings.append(case.reported(label, "warning", text))
    if problem:
        findings.append(case.reported(label, "warning", problem.removeprefix("hand: ")))
    too_hot = measured.get("warmest_joint_c", 0) >= TOO_HOT_C
    if too_hot or state.must_stop:
        text = f"a joint is at {TOO_HOT_C} °C or more" if too_hot else "the hand reports a temperature fault"
        todo = "let it cool with its power on; then switch it off and on"
        findings.append(case.reported(label, "error", f"{text}: a run lets go of it at once", todo=(todo,)))
    return findings


def _check(hand: Any) -> tuple[dict[str, float], str]:
    """Count a hand's reports for a moment; return the counts, and the trouble that a run would show."""
    started_s, before, problem = time.monotonic(), hand.state().counts, ""
    for _ in range(_POLLS):
        time.sleep(_POLL_S)
        problem = optional(hand, "problem") or problem
    # What went wrong meanwhile is raised here.
    hand.step(1)
    state = hand.state()
    passed_s = time.monotonic() - started_s
    known = [c for c in state.joints_c if c is not None]
    measured = {
        "rate_hz": round((state.counts.sets - before.sets) / passed_s, 1),
        "incomplete_count": float(state.counts.incomplete - before.incomplete),
        "late_count": float(state.counts.late - before.late),
    }
    return measured | ({"warmest_joint_c": float(max(known))} if known else {}), problem


def _bus(case: DriverCase) -> tuple[str, str]:
    """Return the problem of a kernel's bus and its remedy, before it is used; empty for none."""
    if getattr(case.options, "interface", "") != "socketcan":
        return "", ""
    name = str(case.options.channel)
    links = can_links()
    link = next((there for there in links if there.name == name), None)
    if link is not None:
        return link_trouble(link, bitrate=case.options.bitrate)
    others = ", ".join(there.name for there in links) or "none"
    return (
        f"there is no CAN bus {name!r}; there are: {others}",
        "plug the adapter in (dmesg | tail says what became of it), or name another channel",
    )


_PERCENTILES = (50, 99, 99.9, 100)


class LoopTiming(msgspec.Struct, frozen=True, kw_only=True):
    """Timing of the hand's loop, as measured once.

    ``rate_hz`` counts sets of positions that were answered. ``period_ms`` is from one answer to the next,
    ``answer_ms`` from taking the frames to having sent the torques, percentiles 50, 99, 99.9 and 100.
    ``cpu_percent`` is the load of one core by the hand's loop alone. ``incomplete`` sets missed a finger's
    frame, ``late`` gaps were longer than 9 ms, at ``silences`` the motors went off, ``unsent`` frames the
    adapter did not take.
    """

    seconds: float
    rate_hz: float
    period_ms: tuple[float, ...]
    answer_ms: tuple[float, ...]
    cpu_percent: float
    incomplete: int
    late: int
    silences: int
    unsent: int


def time_loop(hand: Allegro, *, seconds: float) -> LoopTiming:
    """Watch an open hand for up to 45 s; its level changes every second.

    Raises ``DeviceUnavailableError`` if the hand had to be let go.
    """
    start_ns, before = time.monotonic_ns(), hand.news
    level = 1
    while (now_ns := time.monotonic_ns()) - start_ns < seconds * 1e9:
        level = 1 + (now_ns - start_ns) // 1_000_000_000 % 5
        hand.step(level)
        time.sleep(0.01)
    spent_s = (now_ns - start_ns) * 1e-9
    news = hand.news
    before_counts, counts = before.state.counts, news.state.counts
    cycles = (
        np.array([c for c in hand.cycles if start_ns <= c[0] <= now_ns], np.float64).reshape(-1, 2) * 1e-6
    )
    periods = np.diff(cycles[:, 0]) if len(cycles) > 1 else np.zeros(1)
    answers = cycles[:, 1] if len(cycles) else np.zeros(1)
    return LoopTiming(
        seconds=spent_s,
        rate_hz=(counts.sets - before_counts.sets) / spent_s,
        period_ms=tuple(float(p) for p in np.percentile(periods, _PERCENTILES)),
        answer_ms=tuple(float(p) for p in np.percentile(answers, _PERCENTILES)),
        cpu_percent=100 * (news.cpu_s - before.cpu_s) / spent_s,
        incomplete=counts.incomplete - before_counts.incomplete,
        late=counts.late - before_counts.late,
        silences=counts.silences - before_counts.silences,
        unsent=news.n_unsent,
    )


_ASK: Final = (
    "the vest cannot detect its own fit. Check it with the participant:\n"
    "tega-teleop calibrate SETTINGS.toml --person ID --only vest"
)


def try_vest(case: DriverCase) -> list[Finding]:
    """Open a vest, which begins with zeros, read the status that it reports, close it."""
    driver = driver_class(case.driver, "vest")
    options = case.options
    if isinstance(driver, HarmlessDevice):
        options = driver.harmless(options)
    vest: Any = driver(case.options if options is None else options)
    label = vest.info.label
    if options is None:
        return [case.reported(label, "ok", f"{case.driver} needs no device; it was not opened")]
    try:
        with vest:
            info, condition = vest.info, optional(vest, "condition")
            battery = optional(vest, "battery_percent")
    except TegaError as error:
        why, hint = bluetooth_trouble() if case.driver == "bhaptics-ble" else ("", "")
        if isinstance(error, MissingExtraError):
            why, hint = "", ""
        return [failed(case, error, device=label, why=why, todo=(hint,))]
    text = f"{case.driver}, {label}: the vest answers{f' ({condition})' if condition else ''}; it was sent zeros only"
    measured = {} if battery is None else {"battery_percent": float(battery)}
    return [
        case.reported(label, "ok", text, measured=measured, todo=(_ASK,) if condition else ()),
        *(case.reported(label, "warning", note) for note in info.notes),
    ]
