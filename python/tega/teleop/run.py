"""The run itself: the dual loop over an open rig, and what is written down at its end."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any, NamedTuple

from tega.calibration.motor_onset import motor_onset
from tega.clock import Clock, SystemClock
from tega.config import DEFAULT_LAYOUT, DEFAULT_PACE, Pace
from tega.priority import ahead_of_others, all_along
from tega.teleop.bell import Bell
from tega.teleop.collector import settle
from tega.teleop.feedback import touch_loop
from tega.teleop.flows import contact_stream, latency_trace, level_stream
from tega.teleop.hand import Hand, ModelledAllegro
from tega.teleop.inputs import Inputs
from tega.teleop.loop import DualLoop, LoopView, Recorder, Sink
from tega.teleop.pacing import Pacer
from tega.teleop.rig import Rig
from tega.teleop.summary import RunState, summarise, write_summary

if TYPE_CHECKING:
    from tega.haptics import VestFrame
    from tega.wire import CanFrame

__all__ = ["LoopParts", "run_loop"]


class LoopParts(NamedTuple):
    """What the loop is made of, as far as a recording looks at it."""

    pacer: Pacer
    hand: Hand
    vests: Sequence[Sink[VestFrame]]
    hands: Sequence[Sink[Sequence[CanFrame]]]
    recorder: Recorder | None
    haptics: Callable[[], bool]
    inputs: Inputs


def run_loop(
    stack: ExitStack,
    rig: Rig,
    *,
    clock: Clock,
    observer: Callable[[LoopView], None] | None,
    stop: Callable[[], bool],
    haptics: Callable[[], bool],
) -> dict[str, Any]:
    """Run the dual loop until it ends, close what is open and write down what was.

    Args:
        stack: Holds what the rig has open; closed here where tables or a recording have to be complete.
        rig: What the run is made of.
        clock: The session's clock.
        observer: Called once per vest tick with what a display may show.
        stop: Asked all the time whether to end.
        haptics: Asked at every vest tick; every motor rests while it says no.

    Returns:
        The summary.

    Raises:
        TegaError: Whatever ended the loop; the summary is written first.
    """
    config, prepared, sinks, guard, recording = rig.config, rig.prepared, rig.sinks, rig.guard, rig.recording
    session, muscles, station = config.session, prepared.muscles, rig.station
    layout = config.vest.layout or DEFAULT_LAYOUT[session.preset]
    if station is not None:
        observer = station.beside(observer)

    def may_feel() -> bool:
        return haptics() and guard.felt

    pace, bell = _pace(rig, clock)
    flows = stack.enter_context(ExitStack())
    real_time = False
    if isinstance(clock, SystemClock):
        settle()
        if any(source.info.live for source in prepared.sources):
            real_time = flows.enter_context(ahead_of_others("act"))
            flows.enter_context(all_along())
    hand: Hand = sinks.steered or ModelledAllegro(device_id=config.hand.device_id)
    parts = LoopParts(
        Pacer(clock, bell=bell), hand, sinks.vests, sinks.hands, sinks.recorder, may_feel, rig.inputs
    )
    if recording is None:
        start_ns = parts.pacer.start()
    else:
        parts, start_ns = recording.begin(
            parts,
            clock,
            layout=layout,
            pace=pace,
            kept=sinks.kept,
            steered=sinks.steered is not None,
            observed=observer is not None,
        )
    trace = None
    if isinstance(clock, SystemClock):
        trace = latency_trace(
            prepared,
            sinks,
            parts.pacer,
            start_ns=start_ns,
            budget_ms=config.safety.latency_budget_ms,
            steady=pace == "steady",
            motor=motor_onset(config),
        )
    if recording is not None:
        recording.follow(guard, trace)
    if rig.markers is not None:
        real_ns = start_ns if isinstance(clock, SystemClock) else None
        rig.markers.begin(real_ns, None if recording is None else recording.recorder)
        rig.markers.follow(guard, rig.inputs)
    if station is not None:
        station.begin(prepared, start_ns=start_ns, bell=bell, trace=trace, guard=guard)
        guard.observers.append(station.changed)
        parts = parts._replace(recorder=station.recorder(parts.recorder))
        flows.callback(station.end)
    observer = _steer(flows, rig, observer)
    loop = DualLoop(
        pacer=parts.pacer,
        touch=touch_loop(config, prepared.calibration, prepared.fingers),
        contacts={
            name: contact_stream(
                flows, name, finger, reading=session.preset, start_ns=start_ns, trace=trace, bell=bell
            )
            for name, finger in prepared.fingers.items()
        },
        levels=None if muscles is None else level_stream(flows, muscles, start_ns=start_ns, trace=trace),
        hand=parts.hand,
        vests=parts.vests,
        hands=parts.hands,
        recorder=parts.recorder,
        kept=sinks.kept,
        vest_rate_hz=config.vest.rate_hz,
        by_frame=pace == "by-frame",
        observer=observer,
        haptics=parts.haptics,
        inputs=parts.inputs,
        guard=guard,
        trace=trace,
        endless=rig.steering is not None or station is not None,
    )

    def conclude(error: BaseException | None) -> dict[str, Any]:
        flows.close()  # a source is not asked how it was while its thread reads on
        pacing = parts.pacer.report()
        return _conclude(stack, RunState(rig, layout, pace, loop.report, pacing, trace, real_time), error)

    duration_ns = None if session.duration_s is None else round(session.duration_s * 1e9)
    try:
        loop.run(duration_ns=duration_ns, stop=stop)
    except BaseException as error:
        conclude(error)
        raise
    return conclude(None)


def _steer(
    flows: ExitStack, rig: Rig, observer: Callable[[LoopView], None] | None
) -> Callable[[LoopView], None] | None:
    """Let the arm follow until the run ends; the observer is told of it."""
    if rig.steering is None:
        return observer
    if rig.recording is not None:
        rig.recording.follow_arm(rig.steering)
    rig.steering.start(may_move=lambda: rig.guard.state == "active")
    flows.callback(rig.steering.stop)
    return None if observer is None else rig.steering.beside(observer)


def _pace(rig: Rig, clock: Clock) -> tuple[Pace, Bell | None]:
    """When the vest is told, and what a camera's frame rings for it."""
    pace = rig.config.vest.pace or DEFAULT_PACE[rig.config.session.preset]
    fingers = rig.prepared.fingers.values()
    live = isinstance(clock, SystemClock) and any(finger.source.info.live for finger in fingers)
    if not live and not any(finger.stream is not None for finger in fingers):
        pace = "steady"  # the pictures of a file come at no moment of ours; those of a played run do
    return pace, Bell() if live and pace == "by-frame" else None


def _conclude(stack: ExitStack, state: RunState, error: BaseException | None) -> dict[str, Any]:
    """Close what is open and write down what was."""
    recording, markers = state.rig.recording, state.rig.markers
    summary = summarise(state, error=error)
    out_dir = state.rig.config.session.out_dir
    if markers is not None:
        summary["markers"] = markers.summary()
    try:
        if out_dir is not None or recording is not None:
            stack.pop_all().close()  # the tables are complete before the summary says so
    finally:
        if recording is not None:
            recording.ended(state.loop)
            summary["recording"] = recording.finish(summary)
    if out_dir is not None:
        write_summary(summary, out_dir / "summary.json")
    return summary
