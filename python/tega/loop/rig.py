"""Open every device and output of a run, in the order in which a problem is reported first; have a guard watch them."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from functools import partial
from typing import NamedTuple

from tega.config import SessionConfig
from tega.devices.base import optional
from tega.errors import ConfigError
from tega.loop.arm import Steering, open_arm
from tega.loop.beside import open_beside
from tega.loop.controls import Controls
from tega.loop.emg_condition import open_condition
from tega.loop.inbox.inputs import Inputs, Prepared
from tega.loop.opening import Opening
from tega.loop.pacing import refuse_live
from tega.loop.parts import Part, PartContext, open_parts
from tega.loop.prepare import Progress, prepare, to_be_read
from tega.loop.sinks import Sinks, open_inputs, open_sinks
from tega.records import BesideContact, BesideIntent, Picture
from tega.records.bus import Bus
from tega.safety.guard import Guard, Watched
from tega.stages.base import MeasuredPicture

_STEP_NS = 500_000_000
_REPORTED_NS = 5_000_000_000


class ClockStep:
    """Compares the time of day with the run's clock, which is never set."""

    def __init__(self) -> None:
        self._offset_ns = time.time_ns() - time.monotonic_ns()
        self._until_ns = 0
        self._text = ""

    def __call__(self) -> str:
        """Return by how much the time of day jumped, for five seconds from then on; ``""`` else."""
        now_ns = time.monotonic_ns()
        step_ns = time.time_ns() - now_ns - self._offset_ns
        if abs(step_ns) > _STEP_NS:
            self._offset_ns += step_ns
            self._until_ns = now_ns + _REPORTED_NS
            self._text = (
                f"clock: the time of day jumped by {step_ns / 1e9:+.1f} s; this run counts on as before"
            )
        return self._text if now_ns < self._until_ns else ""


def watch_over(
    config: SessionConfig,
    prepared: Prepared,
    sinks: Sinks,
    bus: Bus,
    parts: Sequence[Part],
    *,
    controls: Controls,
    steering: Steering | None,
    condition: Callable[[], str],
) -> Guard:
    """Make the guard of the live devices; recordings cannot be lost and need none."""
    alerts: dict[str, Callable[[], str]] = {"subscribers": bus.problem}
    streams = [
        Watched(name, "tactile", f.source.info.rate_hz, f.report, partial(optional, f.source, "faults"))
        for name, f in prepared.fingers.items()
        if f.source.info.live
    ]
    if (m := prepared.muscles) is not None and m.source.info.live:
        streams.append(Watched("emg", "emg", m.maxima.rate_hz / m.maxima.tau, m.report))
        # What the driver finds in the newest second of the signal, and channels without a vote.
        alerts["signal"] = lambda: _faults("", optional(m.source, "faults"))
        alerts["votes"] = lambda: _faults("no vote for ", m.report.faults)
    alerts["muscles"] = condition
    needs: dict[str, Callable[[], str]] = {}
    if m is not None and not m.source.info.live and sinks.steered is not None:
        needs["emg"] = lambda: "emg: its recording has ended" if m.report.end_ns is not None else ""
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
        alerts["hand"] = lambda: "" if _first(hands, "unsteered") else _first(hands, "problem")
        needs["hand's guard"] = lambda: _first(hands, "guard_problem")
        needs["hand's link"] = lambda: _first(hands, "unsteered")
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
    return next(filter(None, (optional(hand, name) for hand in hands)), "")


def _faults(subject: str, faults: Sequence[str]) -> str:
    return f"emg: {subject}{'; '.join(faults)}" if faults else ""


class Rig(NamedTuple):
    """Devices and outputs of a run, all of them open; ``parts`` are those of features and of the caller."""

    config: SessionConfig
    bus: Bus
    prepared: Prepared
    sinks: Sinks
    inputs: Inputs
    guard: Guard
    steering: Steering | None
    parts: list[Part]

    @property
    def devices(self) -> frozenset[str]:
        """Which of ``emg``, ``hand`` and ``vest`` are connected, for displays."""
        present = {
            "emg": self.prepared.muscles,
            "hand": self.sinks.steered,
            "vest": self.sinks.live_vests or None,
        }
        return frozenset(name for name, device in present.items() if device is not None)


def open_rig(
    stack: ExitStack,
    config: SessionConfig,
    bus: Bus,
    *,
    opening: Opening,
    prepared: Prepared | None,
    parts: Sequence[Part],
    progress: Progress,
    controls: Controls,
    settings: str,
) -> Rig:
    """Open the devices that the settings name; the arguments are those of :func:`tega.loop.run_session`."""
    hand = opening.begin_rest()
    own = open_parts(PartContext(config, bus, stack, controls.stop, progress))
    joined = [*own, *parts]
    if not names_input(config) and prepared is None and not any(part.brings_input for part in joined):
        raise ConfigError(
            "no input: neither a tactile source nor EMG is set, nor an arm",
            "set at least one, such as [tactile.thumb], [emg] or [arm]",
        )
    origin = next((part.origin for part in joined if part.origin), "")
    if prepared is None:
        sources, emg = opening.sources()
        for source in (*sources.values(), *([] if emg is None else [emg])):
            refuse_live(source.info, config.session.pace)
        prepared = prepare(
            config, sources, emg, progress=progress, stop=controls.stop, settings=settings, origin=origin
        )
    for part in joined:
        prepared = part.prepared(prepared)
    if bus.wants(Picture) or bus.wants(MeasuredPicture):
        prepared = to_be_read(prepared)
    if bus.wants(BesideIntent) or bus.wants(BesideContact):
        open_beside(stack, config, prepared, bus)
    condition = open_condition(stack, config, prepared, bus)
    sinks = open_sinks(stack, config, bus, hand, controls.stop)
    inputs = open_inputs(stack, config)
    for part in joined:
        sinks, inputs = part.sinks(sinks), part.inputs(stack, inputs)
    steering = None
    if config.arm is not None:
        tracker = next((part.tracker for part in joined if part.tracker is not None), None)
        steering = open_arm(stack, config, inputs, tracker=tracker)
    progress("running", 0, 0)
    guard = watch_over(
        config, prepared, sinks, bus, joined, controls=controls, steering=steering, condition=condition
    )
    return Rig(config, bus, prepared, sinks, inputs, guard, steering, joined)


def names_input(config: SessionConfig) -> bool:
    """Return whether settings name a device that gives input: a fingertip camera, an EMG amplifier or an arm."""
    return bool(config.tactile) or config.emg is not None or config.arm is not None
