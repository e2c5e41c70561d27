"""Check the hand: whether its bus is up, it is the right one, and it reports. Its motors stay off."""

from __future__ import annotations

import time
from typing import Any

from tega.devices import HarmlessDevice, driver_class
from tega.devices.base import ReportingHand
from tega.devices.machine import can_links, link_trouble
from tega.errors import TegaError
from tega.setup.doctor.case import DriverCase, failed
from tega.setup.doctor.findings import Finding

_POLL_S = 1.2
"""Temperatures come twice a second."""
_WARM_C = 60


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
            measured = _check(hand)
            info, joints_c = hand.info, hand.state().joints_c if isinstance(hand, ReportingHand) else []
    except TegaError as error:
        return [failed(case, error, device=label)]
    text = (
        f"the hand on {label} reports {measured.get('rate_hz', 0):.0f} times a second; its motors stayed off"
    )
    if not measured:
        text = f"the bus {label} opens; this driver only sends, so no device on it was detected"
    findings = [case.reported(label, "ok", text, why="; ".join(info.notes), measured=measured)]
    known = [c for c in joints_c if c is not None]
    if joints_c and len(known) < len(joints_c):
        text = f"{len(joints_c) - len(known)} of {len(joints_c)} joints report no temperature"
        findings.append(case.reported(label, "warning", text))
    if known and max(known) > _WARM_C:
        text = f"a joint is at {max(known)} °C; its torque is reduced above {_WARM_C}, at 80 it is let go"
        findings.append(case.reported(label, "warning", text, todo=("let it cool down",)))
    return findings


def _check(hand: Any) -> dict[str, float]:
    """Count a hand's reports for a moment; a driver without a state has none."""
    if not isinstance(hand, ReportingHand):
        return {}
    started_s, before = time.monotonic(), hand.state().counts
    time.sleep(_POLL_S)
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
    return measured | ({"warmest_joint_c": float(max(known))} if known else {})


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
