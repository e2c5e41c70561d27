"""Run the dual loop over an open rig, and write the run's summary at its end."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from functools import partial
from typing import Any

from tega.config import DEFAULT_LAYOUT, DEFAULT_PACE, Pace
from tega.config.choose import finger_metric
from tega.loop.adapting import open_adaptation
from tega.loop.controls import Controls
from tega.loop.hand import Hand, ModelledAllegro, open_hand_polls
from tega.loop.latency import LatencyTrace
from tega.loop.loop import DualLoop
from tega.loop.open_streams import StreamMaker, is_fed, latency_trace
from tega.loop.outputs import HandOutput, VestOutput
from tega.loop.pacing import Pacer, settle
from tega.loop.parts import RunStart
from tega.loop.reflex import open_reflex
from tega.loop.rig import Rig
from tega.loop.snapshot import Moments, Snapshot
from tega.loop.summary import RunFacts, summarise
from tega.loop.touch import touch_loop
from tega.records import Alert, Event, RunState, Value
from tega.records.bus import Bus
from tega.runtime.clock import Clock, SystemClock
from tega.runtime.threads import Bell, all_along, run_realtime
from tega.safety.guard import Guard
from tega.stages.base import Metric


def run_loop(stack: ExitStack, rig: Rig, *, clock: Clock, controls: Controls) -> dict[str, Any]:
    """Run the dual loop until it ends, close everything that is open, and write the summary; then raise its error."""
    config, prepared, sinks, guard = rig.config, rig.prepared, rig.sinks, rig.guard
    session, muscles = config.session, prepared.muscles
    layout = config.vest.layout or DEFAULT_LAYOUT[session.preset]

    pace, bell = _pace(rig, clock)
    flows = stack.enter_context(ExitStack())
    real_time = False
    if isinstance(clock, SystemClock):
        settle()
        if any(source.info.live for source in prepared.sources):
            real_time = flows.enter_context(run_realtime("act"))
            flows.enter_context(all_along())
    model: Hand = sinks.steered or ModelledAllegro(device_id=config.hand.device_id)
    pacer = Pacer(clock, bell=bell)
    run = RunStart(
        config,
        prepared,
        sinks,
        guard,
        arm_infos={} if rig.steering is None else rig.steering.infos,
        trial=next((part.trial for part in rig.parts if part.trial), "start"),
        layout=layout,
        pace=pace,
        observed=rig.bus.wants(Snapshot),
        real=isinstance(clock, SystemClock),
        bell=bell,
    )
    for part in rig.parts:
        part.head(run)
    # Before the clock starts: what a stage computes when it is made would come off the first ticks.
    unmeasured = [name for name, f in prepared.fingers.items() if f.stream is None and f.measured is None]
    metrics = {name: _metric(rig, name) for name in unmeasured}
    fed = {name: is_fed(finger, partial(_metric, rig, name)) for name, finger in prepared.fingers.items()}
    touch = touch_loop(config, prepared.calibration, {n: f.baseline for n, f in prepared.fingers.items()})
    if rig.bus.wants(Snapshot) or rig.bus.wants(Event):
        touch.find_events()
    start_ns = pacer.start()
    trace = None
    if isinstance(clock, SystemClock):
        trace = latency_trace(rig, pacer, start_ns=start_ns, steady=pace == "steady")
    _publish_states(rig.bus, pacer, guard, trace)
    run = run._replace(start_ns=start_ns, now_ns=clock.now_ns(), trace=trace)
    for part in rig.parts:
        part.begin(run)
        flows.callback(part.end)
    if trace is not None and trace.motor is not None:  # after the recorder has begun
        rig.bus.publish(Value(t_ns=0, name=trace.motor.stage, value=trace.motor.ms))
    if rig.steering is not None:
        rig.steering.start(rig.bus, start_ns, may_move=lambda: guard.state == "active" and not pacer.hangs)
        flows.callback(rig.steering.stop)
    streams = StreamMaker(flows, rig.bus, start_ns=start_ns, trace=trace, bell=bell)
    reflex = open_reflex(
        config,
        rig.bus,
        prepared.fingers,
        active=lambda: guard.state == "active",
        hand=sinks.steered,
        authority=controls.authority,
    )
    controls.motor_tests.begin(partial(_untried, guard, controls.haptics), rig.bus)
    loop = DualLoop(
        pacer=pacer,
        touch=touch,
        contacts={
            name: streams.contacts(name, finger, metrics.get(name), fed=fed[name])
            for name, finger in prepared.fingers.items()
        },
        levels=None
        if muscles is None
        else streams.levels(muscles, open_adaptation(config, muscles, rig.bus)),
        hand=HandOutput(model, sinks.hands, bus=rig.bus, reflex=reflex, trace=trace),
        vest=VestOutput(
            touch,
            sinks.vests,
            live_vests=sinks.live_vests,
            bus=rig.bus,
            now_ns=pacer.elapsed_ns,
            rate_hz=config.vest.rate_hz,
            by_frame=pace == "by-frame",
            haptics=lambda: controls.haptics() and guard.felt,
            tests=controls.motor_tests,
            trace=trace,
        ),
        bus=rig.bus,
        guard=guard,
        inputs=rig.inputs,
        moments=Moments(
            rig.bus,
            None if muscles is None else model,
            inputs=rig.inputs,
            guard=guard,
            trace=trace,
            devices=rig.devices,
            fingers=prepared.fingers,
            complete=[
                one.displayed for one in (reflex, rig.sinks, rig.steering, *rig.parts) if one is not None
            ],
        ),
        poll_hand=prepared.poll_hand
        or open_hand_polls(
            config,
            hand=sinks.steered,
            height_m=None if rig.steering is None else rig.steering.height_m,
            now_ns=pacer.elapsed_ns,
        ),
    )

    facts = RunFacts(rig, layout, pace, loop.report, pacer, trace, real_time, reflex)
    duration_ns = None if session.duration_s is None else round(session.duration_s * 1e9)
    try:
        endless = rig.steering is not None or any(part.endless for part in rig.parts)
        loop.run(duration_ns=duration_ns, stop=controls.stop, endless=endless)
    except BaseException as error:
        _conclude(stack, flows, facts, error)
        raise
    return _conclude(stack, flows, facts, None)


def _conclude(
    stack: ExitStack, flows: ExitStack, facts: RunFacts, error: BaseException | None
) -> dict[str, Any]:
    """Close everything that is open, and have the parts complete and keep the summary, the first part last."""
    flows.close()  # a source is not asked how it was while its thread reads on
    summary = summarise(facts, error=error)
    with ExitStack() as ending:
        for part in facts.rig.parts:
            ending.callback(part.finish, summary)
        for part in facts.rig.parts:
            ending.callback(part.ended, facts.loop, facts.pacing.n_waits)
        stack.pop_all().close()  # tables and recordings are complete before the summary says so
    return summary


def _untried(guard: Guard, haptics: Callable[[], bool]) -> str:
    """Say why no motor may be tried now; ``""`` if one may."""
    if guard.state != "armed":
        return f"the run is {guard.state}, and motors are tried while it is armed"
    return "" if haptics() else "haptics are switched off"


def _metric(rig: Rig, name: str) -> Metric:
    config, prepared = rig.config, rig.prepared
    baseline, calibration = prepared.fingers[name].baseline, prepared.calibration.touch(name)
    return finger_metric(config.stages, config.session.preset, name, baseline, calibration)


def _publish_states(bus: Bus, pacer: Pacer, guard: Guard, trace: LatencyTrace | None) -> None:
    guard.observers.append(
        lambda change: bus.publish(RunState(t_ns=change.t_ns, state=change.state, reason=change.reason))
    )
    guard.alert_observers.append(
        lambda name, text: bus.publish(Alert(t_ns=pacer.tick_ns, name=name, said=text))
    )
    if trace is not None:
        guard.watch("latency", lambda: trace.warning)


def _pace(rig: Rig, clock: Clock) -> tuple[Pace, Bell | None]:
    pace = rig.config.vest.pace or DEFAULT_PACE[rig.config.session.preset]
    fingers = rig.prepared.fingers.values()
    live = isinstance(clock, SystemClock) and any(finger.source.info.live for finger in fingers)
    if not live and not any(finger.stream is not None for finger in fingers):
        pace = "steady"  # the pictures of a file come at no moment of ours; those of a played run do
    return pace, Bell() if live and pace == "by-frame" else None
