"""Collect the streams, vests and alerts that a run's guard watches."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

from tega.config import SessionConfig
from tega.devices.base import EmgSource, optional
from tega.loop.arm import Steering
from tega.loop.controls import Controls
from tega.loop.emg_condition import MuscleAlert
from tega.loop.inbox.prepared import Prepared
from tega.loop.inbox.sources import SourceReport
from tega.loop.parts import Part
from tega.loop.sinks import Sinks
from tega.records.bus import Bus
from tega.safety.clock_step import ClockStep
from tega.safety.guard import Guard, Watched


def watch_over(
    config: SessionConfig,
    prepared: Prepared,
    sinks: Sinks,
    bus: Bus,
    parts: Sequence[Part],
    *,
    controls: Controls,
    steering: Steering | None,
    condition: MuscleAlert | None = None,
) -> Guard:
    """Make the guard of the live devices; recordings cannot be lost and need none.

    ``controls`` allow an armed run to become active and may set a level; the rest are open devices and parts.
    """
    alerts: dict[str, Callable[[], str]] = {"subscribers": bus.problem}
    streams = [
        Watched(
            name,
            "tactile",
            finger.source.info.rate_hz,
            finger.report,
            partial(optional, finger.source, "faults"),
        )
        for name, finger in prepared.fingers.items()
        if finger.source.info.live
    ]
    if (m := prepared.muscles) is not None and m.source.info.live:
        streams.append(Watched("emg", "emg", m.maxima.rate_hz / m.maxima.tau, m.report))
        alerts["signal"] = partial(_signal, m.source)
        alerts["votes"] = partial(_votes, m.report)
    if condition is not None:
        alerts["muscles"] = lambda: condition.said

    needs: dict[str, Callable[[], str]] = {}
    worn = sinks.live_vests
    vests = {"vest": lambda: all(optional(vest, "reached") for vest in worn)} if worn else {}
    for part in parts:
        alerts |= part.alerts()
        needs |= part.needs()
    if config.session.pace == "real":
        alerts["clock"] = ClockStep()
    if steering is not None:
        alerts["arm"] = lambda: steering.problem
    hands = [*sinks.hands, *([] if sinks.steered is None else [sinks.steered])]
    if hands:
        alerts["hand"] = lambda: _first(hands, "problem")
        needs["hand's guard"] = lambda: _first(hands, "guard_problem")
    return Guard(
        config.safety,
        streams=streams,
        vests=vests,
        go=controls.go,
        program=controls.level,
        alerts=alerts,
        needs=needs,
    )


def _first(hands: Sequence[object], name: str) -> str:
    """Return the first of the hands' reports under this name; empty where there is none."""
    return next(filter(None, (optional(hand, name) for hand in hands)), "")


def _signal(source: EmgSource) -> str:
    """Return the problem in the newest second of a live amplifier's signal, as far as its driver checks."""
    faults = optional(source, "faults")
    return f"emg: {'; '.join(faults)}" if faults else ""


def _votes(report: SourceReport) -> str:
    """Say which channels have no vote, and why."""
    return f"emg: no vote for {'; '.join(report.faults)}" if report.faults else ""
