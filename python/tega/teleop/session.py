"""A session: devices, baselines, maxima, the dual loop and its outputs, put together from settings."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

from tega.calibration import Calibration, TouchMaxima
from tega.calibration.motor_onset import motor_onset
from tega.clock import Clock, ManualClock, SystemClock
from tega.config import DEFAULT_LAYOUT, DEFAULT_PACE, Pace, SessionConfig
from tega.devices.base import EmgSource, TactileSource
from tega.devices.registry import driver_class
from tega.errors import ConfigError
from tega.haptics import FeltMap
from tega.priority import ahead_of_others, all_along, realtime
from tega.recording import prepare_folder
from tega.recording.spared import Disk
from tega.safety.clock_step import ClockStep
from tega.safety.guard import Guard, Watched
from tega.safety.hand_alert import HandAlert
from tega.safety.states import Transition
from tega.teleop.arm import Steering, open_arm
from tega.teleop.bell import Bell
from tega.teleop.collector import settle, settled
from tega.teleop.flows import contact_stream, latency_trace, level_stream
from tega.teleop.hand import Hand, ModelledAllegro
from tega.teleop.inputs import Inputs
from tega.teleop.latency import LatencyTrace
from tega.teleop.loop import DualLoop, LoopView, Recorder, Sink
from tega.teleop.loop_report import LoopReport
from tega.teleop.pacing import Pacer, PacingReport
from tega.teleop.prepare import Prepared, Progress, prepare
from tega.teleop.pulses import PulseLoop
from tega.teleop.sinks import Sinks, open_inputs, open_sinks
from tega.teleop.summary import summarise, write_summary
from tega.teleop.touch import TouchLoop

if TYPE_CHECKING:
    from tega.haptics import Layout, VestFrame
    from tega.markers import RunMarkers
    from tega.net.station import Station
    from tega.recording.session import Recording
    from tega.wire import CanFrame

__all__ = ["DEFAULT_LAYOUT", "LoopParts", "RunState", "Sinks", "run_session", "touch_loop"]


class LoopParts(NamedTuple):
    """What the loop is made of, as far as a recording looks at it."""

    pacer: Pacer
    hand: Hand
    vests: Sequence[Sink[VestFrame]]
    hands: Sequence[Sink[Sequence[CanFrame]]]
    recorder: Recorder | None
    haptics: Callable[[], bool]
    inputs: Inputs


class RunState(NamedTuple):
    """Everything a summary is made of."""

    config: SessionConfig
    prepared: Prepared
    sinks: Sinks
    inputs: Inputs
    layout: Layout
    pace: Pace
    loop: LoopReport
    pacing: PacingReport
    guard: Guard
    trace: LatencyTrace | None
    real_time: bool
    steering: Steering | None
    station: Station | None


def run_session(
    config: SessionConfig,
    *,
    clock: Clock | None = None,
    observer: Callable[[LoopView], None] | None = None,
    progress: Progress = lambda _what, _done, _total: None,
    stop: Callable[[], bool] = lambda: False,
    on_prepared: Callable[[Prepared], Prepared] = lambda prepared: prepared,
    haptics: Callable[[], bool] = lambda: True,
    settings: str = "SETTINGS.toml",
    go: Callable[[], bool] = lambda: True,
    on_state: Callable[[Transition], None] = lambda _change: None,
    prepared: Prepared | None = None,
    tell: Callable[[str], None] = lambda _said: None,
) -> dict[str, Any]:
    """Run a session from its settings.

    Args:
        config: The settings.
        clock: The session's clock; ``None`` for the one its pace asks for.
        observer: Called once per vest tick with what a display may show.
        progress: Told how preparation goes.
        stop: Asked all the time whether to end; whatever was sent to is then left silent.
        on_prepared: Given what the run starts with; returns what it is to start with. A display looks at the sources
            there, or puts others in front of them that let it see what is read.
        haptics: Asked at every vest tick; every motor rests while it says no.
        settings: How the settings file is named in the commands that an error suggests.
        go: Asked all the time whether an armed run may become active.
        on_state: Told of every change of the run's state, in the loop's thread.
        prepared: What to start with instead of the sources of the settings.
        tell: Told in a sentence what happens on the link to the other station, in any thread.

    Returns:
        The summary, as it was written to ``summary.json`` where there is a folder for it.

    Raises:
        TegaError: Whatever is wrong with settings, recordings, calibration or devices.
        KeyboardInterrupt: ``stop`` said so before the loop had begun.
    """
    session, fingers = config.session, config.tactile.in_use()
    alone = config.net is None
    if not fingers and config.emg is None and config.arm is None and prepared is None and alone:
        raise ConfigError(
            "no input: neither a tactile source nor EMG is set, nor an arm",
            "set at least one, such as [tactile.thumb], [emg] or [arm]",
        )
    if clock is None:
        clock = SystemClock() if session.pace == "real" else ManualClock()
    if session.out_dir is not None:
        prepare_folder(session.out_dir)
    with ExitStack() as stack:
        stack.enter_context(realtime(allowed=session.realtime))
        if isinstance(clock, SystemClock):
            stack.enter_context(settled())
        recording = _recording(stack, config)
        markers = _markers(stack, config)
        station = None
        if config.net is not None:
            from tega.net.station import open_station

            progress("opening the link", 0, 0)
            station = open_station(config, tell=tell, stop=stop)
            # The link's own threads, which others wait for at the other station.
            with ahead_of_others("act", inherited=True):
                stack.enter_context(station)
            observer = station.beside(observer)
        if prepared is None:
            sources, emg = _sources(stack, config)
            prepared = prepare(config, sources, emg, progress=progress, stop=stop, settings=settings)
        if station is not None:
            prepared = station.prepared(prepared)
        prepared = on_prepared(prepared)
        if recording is not None:
            prepared = recording.watch(prepared)
        disk = Disk()
        sinks = open_sinks(stack, config, prepared, recording, disk)
        inputs = open_inputs(stack, config)
        if station is not None:
            sinks, inputs = station.sinks(sinks), station.inputs(stack, inputs)
        steering = None
        if config.arm is not None:
            steering = open_arm(stack, config, inputs, tracker=None if station is None else station.tracker)
            if recording is not None:
                recording.lead(steering)
        progress("running", 0, 0)
        guard = _guard(
            config,
            prepared,
            sinks,
            disk,
            recording,
            markers=markers,
            go=go,
            steering=steering,
            station=station,
        )
        guard.observers.append(on_state)
        return _run(
            stack,
            config,
            prepared,
            sinks,
            inputs,
            guard=guard,
            clock=clock,
            observer=observer,
            stop=stop,
            haptics=haptics,
            recording=recording,
            steering=steering,
            markers=markers,
            station=station,
        )


def _sources(stack: ExitStack, config: SessionConfig) -> tuple[dict[str, TactileSource], EmgSource | None]:
    """Open the sources of the settings."""
    sources: dict[str, TactileSource] = {
        finger: stack.enter_context(driver_class(c.driver, "tactile")(c.options))
        for finger, c in config.tactile.in_use().items()
    }
    emg: EmgSource | None = None
    if config.emg is not None:
        emg = stack.enter_context(driver_class(config.emg.driver, "emg")(config.emg.options))
    if config.session.pace == "fast":
        for source in (*sources.values(), *([] if emg is None else [emg])):
            if source.info.live:
                raise ConfigError(
                    f"session.pace = 'fast', but {source.info.label} is live", "set session.pace = 'real'"
                )
    return sources, emg


def _recording(stack: ExitStack, config: SessionConfig) -> Recording | None:
    """Make the recording, if one is asked for, before any device is touched."""
    if config.recording.dir is None:
        return None
    from tega.recording.session import Recording

    recording = Recording(config, config.recording.dir)
    stack.callback(recording.abandon)
    return recording


def _markers(stack: ExitStack, config: SessionConfig) -> RunMarkers | None:
    """Open the streams of markers, if there are any."""
    if config.markers.lsl_out is None and config.markers.lsl_in is None:
        return None
    from tega.markers import RunMarkers

    markers = RunMarkers(config.markers)
    stack.callback(markers.close)
    return markers


def _guard(
    config: SessionConfig,
    prepared: Prepared,
    sinks: Sinks,
    disk: Disk,
    recording: Recording | None,
    *,
    markers: RunMarkers | None,
    go: Callable[[], bool],
    steering: Steering | None,
    station: Station | None,
) -> Guard:
    """Make what watches over the live devices; recordings are not lost and need nobody."""
    alerts: dict[str, Callable[[], str]] = {"disk": lambda: disk.problem}
    streams = [
        Watched(name, "tactile", finger.source.info.rate_hz, finger.report)
        for name, finger in prepared.fingers.items()
        if finger.source.info.live
    ]
    if (m := prepared.muscles) is not None and m.source.info.live:
        streams.append(Watched("emg", "emg", m.maxima.rate_hz / m.maxima.tau, m.report))
        alerts["signal"] = partial(_signal, m.source)

    kept = sinks.kept
    vests = {"vest": lambda: all(vest.reached for vest in kept)} if kept else {}
    if recording is not None:
        alerts["recording"] = recording.problem
    if markers is not None:
        alerts["markers"] = markers.problem
    if config.session.pace == "real":
        alerts["clock"] = ClockStep()
    if steering is not None:
        alerts["arm"] = lambda: steering.problem
    if sinks.steered is not None:
        from tega.devices.allegro import Allegro

        if isinstance(sinks.steered, Allegro):
            alerts["hand"] = HandAlert(sinks.steered)
    needs: dict[str, Callable[[], str]] = {}
    if station is not None:
        needs["link"], alerts["station"] = station.missing, station.alert
    return Guard(config.safety, streams=streams, vests=vests, go=go, alerts=alerts, needs=needs)


def _signal(source: Any) -> str:
    """Say what is wrong with the newest second of a live amplifier's signal, as far as its driver looks."""
    health = getattr(source, "health", None)
    return f"emg: {'; '.join(health.now)}" if health is not None and health.now else ""


def _pace(config: SessionConfig, prepared: Prepared, clock: Clock) -> tuple[Pace, Bell | None]:
    """When the vest is told, and what a camera's frame rings for it."""
    pace = config.vest.pace or DEFAULT_PACE[config.session.preset]
    live = isinstance(clock, SystemClock) and any(f.source.info.live for f in prepared.fingers.values())
    if not live and not any(finger.stream is not None for finger in prepared.fingers.values()):
        pace = "steady"  # the pictures of a file come at no moment of ours; those of a played run do
    return pace, Bell() if live and pace == "by-frame" else None


def _steer(
    flows: ExitStack,
    steering: Steering | None,
    recording: Recording | None,
    guard: Guard,
    observer: Callable[[LoopView], None] | None,
) -> Callable[[LoopView], None] | None:
    """Let the arm follow until the run ends; the observer is told of it."""
    if steering is None:
        return observer
    if recording is not None:
        recording.follow_arm(steering)
    steering.start(may_move=lambda: guard.state == "active")
    flows.callback(steering.stop)
    return None if observer is None else steering.beside(observer)


def _run(
    stack: ExitStack,
    config: SessionConfig,
    prepared: Prepared,
    sinks: Sinks,
    inputs: Inputs,
    *,
    guard: Guard,
    clock: Clock,
    observer: Callable[[LoopView], None] | None,
    stop: Callable[[], bool],
    haptics: Callable[[], bool],
    recording: Recording | None,
    steering: Steering | None,
    markers: RunMarkers | None,
    station: Station | None,
) -> dict[str, Any]:
    session, muscles = config.session, prepared.muscles
    layout = config.vest.layout or DEFAULT_LAYOUT[session.preset]
    hand: Hand = sinks.steered or ModelledAllegro(device_id=config.hand.device_id)

    def may_feel() -> bool:
        return haptics() and guard.felt

    pace, bell = _pace(config, prepared, clock)
    flows = stack.enter_context(ExitStack())
    real_time = False
    if isinstance(clock, SystemClock):
        settle()
        if any(source.info.live for source in prepared.sources):
            real_time = flows.enter_context(ahead_of_others("act"))
            flows.enter_context(all_along())
    parts = LoopParts(
        Pacer(clock, bell=bell), hand, sinks.vests, sinks.hands, sinks.recorder, may_feel, inputs
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
        budget_ms = config.safety.latency_budget_ms
        steady = pace == "steady"
        trace = latency_trace(
            prepared,
            sinks,
            parts.pacer,
            start_ns=start_ns,
            budget_ms=budget_ms,
            steady=steady,
            motor=motor_onset(config),
        )
    if recording is not None:
        recording.follow(guard, trace)
    if markers is not None:
        real_ns = start_ns if isinstance(clock, SystemClock) else None
        markers.begin(real_ns, None if recording is None else recording.recorder)
        markers.follow(guard, inputs)
    if station is not None:
        station.begin(prepared, start_ns=start_ns, bell=bell, trace=trace, guard=guard)
        guard.observers.append(station.changed)
        parts = parts._replace(recorder=station.recorder(parts.recorder))
        flows.callback(station.end)
    observer = _steer(flows, steering, recording, guard, observer)
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
        endless=steering is not None or station is not None,
    )

    def conclude(error: BaseException | None) -> dict[str, Any]:
        flows.close()  # a source is not asked how it was while its thread reads on
        state = RunState(
            config,
            prepared,
            sinks,
            inputs,
            layout,
            pace,
            loop.report,
            parts.pacer.report(),
            guard,
            trace,
            real_time,
            steering,
            station,
        )
        return _conclude(stack, state, recording, markers, error)

    duration_ns = None if session.duration_s is None else round(session.duration_s * 1e9)
    try:
        loop.run(duration_ns=duration_ns, stop=stop)
    except BaseException as error:
        conclude(error)
        raise
    return conclude(None)


def _conclude(
    stack: ExitStack,
    state: RunState,
    recording: Recording | None,
    markers: RunMarkers | None,
    error: BaseException | None,
) -> dict[str, Any]:
    """Close what is open and write down what was."""
    summary = summarise(state, error=error)
    out_dir = state.config.session.out_dir
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


def touch_loop(config: SessionConfig, calibration: Calibration, fingers: Iterable[str]) -> TouchLoop:
    """Make the back loop that settings and a calibration ask for."""
    vest = config.vest
    maxima = {finger: calibration.touch(finger) or TouchMaxima() for finger in fingers}
    felt = None
    if (vest.threshold, vest.step) != (0.0, 1.0):
        felt = FeltMap(threshold=vest.threshold, step=vest.step)
    layout = vest.layout or DEFAULT_LAYOUT[config.session.preset]
    if vest.feedback == "events":
        return PulseLoop(maxima, pulses=vest.pulses, layout=layout, mirror=vest.mirror, felt=felt)
    return TouchLoop(maxima, layout=layout, mirror=vest.mirror, felt=felt)
