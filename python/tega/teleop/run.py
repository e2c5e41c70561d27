"""Run the dual loop over an open rig, and write the run's summary at its end."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack, closing
from functools import partial
from typing import TYPE_CHECKING, Any

from tega.calibration.motor_onset import motor_onset
from tega.clock import Clock, SystemClock
from tega.config import DEFAULT_LAYOUT, DEFAULT_PACE, Pace
from tega.inbox.wake import Bell
from tega.records import Alert, Event, RunState, Value
from tega.stages.choose import finger_metric
from tega.teleop.adapting import open_adaptation
from tega.teleop.gc_pause import settle
from tega.teleop.hand import Hand, ModelledAllegro
from tega.teleop.hand_look import open_looks
from tega.teleop.loop import DualLoop
from tega.teleop.moment import LoopView, Moment
from tega.teleop.motor_tests import MotorTests
from tega.teleop.open_streams import contact_stream, is_fed, latency_trace, level_stream
from tega.teleop.pacing import Pacer
from tega.teleop.reflex import open_reflex
from tega.teleop.rig import Rig
from tega.teleop.summary import RunFacts, summarise, write_summary
from tega.teleop.touch_loop import touch_loop
from tega.teleop.touching import RecordedFingers, Touching
from tega.threads import all_along, run_realtime

if TYPE_CHECKING:
    from tega.bus import Bus
    from tega.safety.guard import Guard
    from tega.safety.states import Transition
    from tega.stages.base import Metric
    from tega.teleop.latency import LatencyTrace


def run_loop(
    stack: ExitStack,
    rig: Rig,
    *,
    clock: Clock,
    observer: Callable[[LoopView], None] | None,
    stop: Callable[[], bool],
    haptics: Callable[[], bool],
    tests: MotorTests,
    shown: Callable[[LoopView], LoopView] = lambda view: view,
    authority: Callable[[], float | None] = lambda: None,
) -> dict[str, Any]:
    """Run the dual loop until it ends, close what is open and write down what was.

    Args:
        stack: Holds what the rig has open; closed here where tables or a recording have to be complete.
        rig: What the run is made of.
        clock: The session's clock.
        observer: Called once per vest tick with what a display may show.
        stop: Asked all the time whether to end.
        haptics: Asked at every vest tick; every motor rests while it says no.
        tests: Wishes to feel a motor while the run is armed.
        shown: Completes each moment for a display.
        authority: Asked at each tick of the hand what authority a page gives the reflex.

    Returns:
        The summary.

    Raises:
        TegaError: Whatever ended the loop; the summary is written first.
    """
    config, prepared, sinks, guard, recording = rig.config, rig.prepared, rig.sinks, rig.guard, rig.recording
    session, muscles, station = config.session, prepared.muscles, rig.station
    layout = config.vest.layout or DEFAULT_LAYOUT[session.preset]

    def may_feel() -> bool:
        return haptics() and guard.felt

    if observer is not None:
        rig.bus.subscribe(Moment, lambda moment: observer(moment.view), name="display", vital=True)
    if station is not None:
        rig.bus.subscribe(Moment, lambda moment: station.seen(moment.view), name="link")
    pace, bell = _pace(rig, clock)
    flows = stack.enter_context(ExitStack())
    real_time = False
    if isinstance(clock, SystemClock):
        settle()
        if any(source.info.live for source in prepared.sources):
            real_time = flows.enter_context(run_realtime("act"))
            flows.enter_context(all_along())
    hand: Hand = sinks.steered or ModelledAllegro(device_id=config.hand.device_id)
    pacer = Pacer(clock, bell=bell)
    if recording is not None:
        recording.head(rig, layout=layout, pace=pace, observed=rig.bus.wants(Moment))
    # Before the clock starts: what a stage computes when it is made would come off the first ticks.
    unmeasured = [name for name, f in prepared.fingers.items() if f.stream is None and f.measured is None]
    metrics = {name: _metric(rig, name) for name in unmeasured}
    fed = {name: is_fed(finger, partial(_metric, rig, name)) for name, finger in prepared.fingers.items()}
    touch = touch_loop(
        config,
        prepared.calibration,
        prepared.fingers,
        find_events=rig.bus.wants(Moment) or rig.bus.wants(Event),
    )
    start_ns = pacer.start()
    if recording is not None:
        recording.begin(start_ns, clock.now_ns())
    trace = None
    if isinstance(clock, SystemClock):
        trace = latency_trace(
            prepared,
            sinks,
            pacer,
            start_ns=start_ns,
            safety=config.safety,
            steady=pace == "steady",
            motor=motor_onset(config),
            bus=rig.bus,
        )
    _tell(rig.bus, pacer, guard, trace)
    if rig.markers is not None:
        trial = "start" if recording is None else recording.name
        rig.markers.begin(
            start_ns,
            trial=trial,
            real=isinstance(clock, SystemClock),
            emg_hz=None if muscles is None else muscles.source.info.rate_hz,
        )
    if station is not None:
        station.begin(prepared, start_ns=start_ns, bell=bell, trace=trace, guard=guard)
        flows.callback(station.end)
    _steer(flows, rig, start_ns)
    touching, recorded = Touching(), flows.enter_context(closing(RecordedFingers()))
    loop = DualLoop(
        pacer=pacer,
        touch=touch,
        contacts={
            name: contact_stream(
                flows,
                name,
                finger,
                metric=metrics.get(name),
                fed=fed[name],
                touching=touching,
                recorded=recorded,
                start_ns=start_ns,
                trace=trace,
                bell=bell,
                bus=rig.bus,
            )
            for name, finger in prepared.fingers.items()
        },
        levels=None
        if muscles is None
        else level_stream(
            flows,
            muscles,
            start_ns=start_ns,
            trace=trace,
            bus=rig.bus,
            adaptation=open_adaptation(config, muscles, rig.bus),
        ),
        hand=hand,
        vests=sinks.vests,
        hands=sinks.hands,
        bus=rig.bus,
        live_vests=sinks.live_vests,
        vest_rate_hz=config.vest.rate_hz,
        by_frame=pace == "by-frame",
        haptics=may_feel,
        inputs=rig.inputs,
        guard=guard,
        trace=trace,
        complete=[*(part.shown for part in (sinks, rig.steering, station) if part is not None), shown],
        endless=rig.steering is not None or station is not None,
        tried=lambda t_ns, frame: tests.frame(
            t_ns, frame, refused=partial(_untried, guard, haptics), bus=rig.bus
        ),
        sent=lambda t_ns, sent: tests.sent(t_ns, sent, rig.bus),
        reflex=open_reflex(
            config,
            rig.bus,
            prepared.fingers,
            active=lambda: guard.state == "active",
            hand=sinks.steered,
            authority=authority,
        ),
        look=prepared.look
        or open_looks(config, hand=sinks.steered, arm=rig.steering, now_ns=pacer.elapsed_ns),
    )

    def conclude(error: BaseException | None) -> dict[str, Any]:
        flows.close()  # a source is not asked how it was while its thread reads on
        facts = RunFacts(rig, layout, pace, loop.report, pacer.report(), trace, real_time, loop.reflex)
        return _conclude(stack, facts, error, n_waits=pacer.n_waits)

    duration_ns = None if session.duration_s is None else round(session.duration_s * 1e9)
    try:
        loop.run(duration_ns=duration_ns, stop=stop)
    except BaseException as error:
        conclude(error)
        raise
    return conclude(None)


def _untried(guard: Guard, haptics: Callable[[], bool]) -> str:
    """Say why no motor may be tried now; ``""`` if one may."""
    if guard.state != "armed":
        return f"the run is {guard.state}, and motors are tried while it is armed"
    return "" if haptics() else "haptics are switched off"


def _metric(rig: Rig, name: str) -> Metric:
    """Make the metric of a finger."""
    config, prepared = rig.config, rig.prepared
    baseline, calibration = prepared.fingers[name].baseline, prepared.calibration.touch(name)
    return finger_metric(config.stages, config.session.preset, name, baseline, calibration)


def _tell(bus: Bus, pacer: Pacer, guard: Guard, trace: LatencyTrace | None) -> None:
    """Publish the run's states, what is wrong, and how long the vest's motors take to start."""

    def changed(change: Transition) -> None:
        bus.publish(RunState(t_ns=change.t_ns, state=change.state, reason=change.reason))

    guard.observers.append(changed)
    guard.alert_observers.append(
        lambda name, said: bus.publish(Alert(t_ns=pacer.tick_ns, name=name, said=said))
    )
    if trace is not None and trace.motor is not None:
        bus.publish(Value(t_ns=0, name=trace.motor.stage, value=trace.motor.ms))


def _steer(flows: ExitStack, rig: Rig, start_ns: int) -> None:
    """Let the arm follow, and the scene cameras film, until the run ends."""
    if rig.cameras is not None:
        rig.cameras.begin(start_ns)
        flows.callback(rig.cameras.end)
    if rig.steering is not None:
        rig.steering.start(rig.bus, start_ns, may_move=lambda: rig.guard.state == "active")
        flows.callback(rig.steering.stop)


def _pace(rig: Rig, clock: Clock) -> tuple[Pace, Bell | None]:
    """When the vest is told, and what a camera's frame rings for it."""
    pace = rig.config.vest.pace or DEFAULT_PACE[rig.config.session.preset]
    fingers = rig.prepared.fingers.values()
    live = isinstance(clock, SystemClock) and any(finger.source.info.live for finger in fingers)
    if not live and not any(finger.stream is not None for finger in fingers):
        pace = "steady"  # the pictures of a file come at no moment of ours; those of a played run do
    return pace, Bell() if live and pace == "by-frame" else None


def _conclude(
    stack: ExitStack, state: RunFacts, error: BaseException | None, *, n_waits: int
) -> dict[str, Any]:
    """Close what is open and write down what was."""
    recording, markers = state.rig.recording, state.rig.markers
    summary = summarise(state, error=error)
    out_dir = state.rig.config.session.out_dir
    try:
        if out_dir is not None or recording is not None:
            stack.pop_all().close()  # the tables are complete before the summary says so
    finally:
        if markers is not None:
            summary["markers"] = markers.summary()  # with those that came last
        if recording is not None:
            recording.ended(state.loop, n_waits)
            summary["recording"] = recording.finish(summary)
    if out_dir is not None:
        write_summary(summary, out_dir / "summary.json")
    return summary
