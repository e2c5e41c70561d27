"""A session: devices, baselines, maxima, the dual loop and its outputs, put together from settings."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Sequence
from contextlib import ExitStack
from functools import partial
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from tega.calibration import Calibration, TouchMaxima, save_calibration
from tega.clock import Clock, ManualClock, SystemClock
from tega.config import DEFAULT_LAYOUT, SessionConfig
from tega.devices.base import EmgSource, HandDriver, SteeredHand, TactileSource, VestSink
from tega.devices.can_recorder import CanRecorder, CanRecorderOptions
from tega.devices.registry import driver_class
from tega.devices.vest_recorder import VestRecorder, VestRecorderOptions
from tega.errors import ConfigError
from tega.haptics import FeltMap
from tega.recording import RunRecorder, prepare_folder
from tega.recording.spared import Disk, Spared
from tega.safety.clock_step import ClockStep
from tega.safety.guard import Guard, Watched
from tega.safety.hand_alert import HandAlert
from tega.safety.states import Transition
from tega.teleop.hand import Hand, ModelledAllegro
from tega.teleop.inputs import Inputs, Seat
from tega.teleop.keepalive import KeepAlive
from tega.teleop.latency import LatencyTrace
from tega.teleop.loop import DualLoop, LoopReport, LoopView, Recorder, Sink
from tega.teleop.pacing import Pacer, PacingReport
from tega.teleop.prepare import Finger, Muscles, Prepared, Progress, prepare
from tega.teleop.sources import Block, Contact, grasp_blocks, measured_contacts
from tega.teleop.streams import PulledStream, Stream, ThreadedStream
from tega.teleop.summary import summarise, write_summary
from tega.teleop.touch import TouchLoop

if TYPE_CHECKING:
    from tega.haptics import Layout, VestFrame
    from tega.markers import RunMarkers
    from tega.recording.session import Recording
    from tega.wire import CanFrame

__all__ = ["DEFAULT_LAYOUT", "LoopParts", "RunState", "Sinks", "run_session", "touch_loop"]


class Sinks(NamedTuple):
    """What a run writes to.

    Attributes:
        kept: The vest of the settings, if it is a real one.
        vests: A vest of the settings that only records, the vest recorder.
        hands: A hand of the settings that only takes frames, the CAN recorder.
        steered: A hand of the settings that closes its own loop.
        recorder: Of contacts and levels; ``None`` without an output folder.
    """

    kept: list[KeepAlive]
    vests: list[VestSink]
    hands: list[HandDriver]
    steered: SteeredHand | None
    recorder: RunRecorder | None


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
    loop: LoopReport
    pacing: PacingReport
    guard: Guard
    trace: LatencyTrace | None


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

    Returns:
        The summary, as it was written to ``summary.json`` where there is a folder for it.

    Raises:
        TegaError: Whatever is wrong with settings, recordings, calibration or devices.
        KeyboardInterrupt: ``stop`` said so before the loop had begun.
    """
    session, fingers = config.session, config.tactile.in_use()
    if not fingers and config.emg is None and prepared is None:
        raise ConfigError(
            "no input: neither a tactile source nor EMG is set",
            "set at least one, such as [tactile.thumb] or [emg]",
        )
    if clock is None:
        clock = SystemClock() if session.pace == "real" else ManualClock()
    if session.out_dir is not None:
        prepare_folder(session.out_dir)
    with ExitStack() as stack:
        recording = _recording(stack, config)
        markers = _markers(stack, config)
        if prepared is None:
            sources, emg = _sources(stack, config)
            prepared = prepare(config, sources, emg, progress=progress, stop=stop, settings=settings)
        prepared = on_prepared(prepared)
        if recording is not None:
            prepared = recording.watch(prepared)
        disk = Disk()
        sinks = _sinks(stack, config, prepared, recording, disk)
        inputs = _inputs(stack, config)
        progress("running", 0, 0)
        guard = _guard(config, prepared, sinks, disk, recording, markers=markers, go=go)
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
            markers=markers,
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
    if sinks.steered is not None:
        from tega.devices.allegro import Allegro

        if isinstance(sinks.steered, Allegro):
            alerts["hand"] = HandAlert(sinks.steered)
    return Guard(config.safety, streams=streams, vests=vests, go=go, alerts=alerts)


def _signal(source: Any) -> str:
    """Say what is wrong with the newest second of a live amplifier's signal, as far as its driver looks."""
    health = getattr(source, "health", None)
    return f"emg: {'; '.join(health.now)}" if health is not None and health.now else ""


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
    markers: RunMarkers | None,
) -> dict[str, Any]:
    session, muscles = config.session, prepared.muscles
    layout = config.vest.layout or DEFAULT_LAYOUT[session.preset]
    hand: Hand = sinks.steered or ModelledAllegro(device_id=config.hand.device_id)

    def may_feel() -> bool:
        return haptics() and guard.felt

    parts = LoopParts(Pacer(clock), hand, sinks.vests, sinks.hands, sinks.recorder, may_feel, inputs)
    if recording is None:
        start_ns = parts.pacer.start()
    else:
        parts, start_ns = recording.begin(
            parts,
            clock,
            layout=layout,
            kept=sinks.kept,
            steered=sinks.steered is not None,
            observed=observer is not None,
        )
    trace = None
    if isinstance(clock, SystemClock):
        budget_ms = config.safety.latency_budget_ms
        trace = _trace(prepared, sinks, parts.pacer, start_ns=start_ns, budget_ms=budget_ms)
    if recording is not None:
        recording.follow(guard, trace)
    if markers is not None:
        real_ns = start_ns if isinstance(clock, SystemClock) else None
        markers.begin(real_ns, None if recording is None else recording.recorder)
        markers.follow(guard, inputs)
    flows = stack.enter_context(ExitStack())
    loop = DualLoop(
        pacer=parts.pacer,
        touch=touch_loop(config, prepared.calibration, prepared.fingers),
        contacts={
            name: _contacts(flows, name, finger, reading=session.preset, start_ns=start_ns, trace=trace)
            for name, finger in prepared.fingers.items()
        },
        levels=None if muscles is None else _levels(flows, muscles, start_ns=start_ns, trace=trace),
        hand=parts.hand,
        vests=parts.vests,
        hands=parts.hands,
        recorder=parts.recorder,
        kept=sinks.kept,
        vest_rate_hz=config.vest.rate_hz,
        observer=observer,
        haptics=parts.haptics,
        inputs=parts.inputs,
        guard=guard,
        trace=trace,
    )

    def conclude(error: BaseException | None) -> dict[str, Any]:
        flows.close()  # a source is not asked how it was while its thread reads on
        state = RunState(
            config, prepared, sinks, inputs, layout, loop.report, parts.pacer.report(), guard, trace
        )
        summary = summarise(state, error=error)
        if markers is not None:
            summary["markers"] = markers.summary()
        try:
            if session.out_dir is not None or recording is not None:
                stack.pop_all().close()  # the tables are complete before the summary says so
        finally:
            if recording is not None:
                recording.ended(loop.report)
                summary["recording"] = recording.finish(summary)
        if session.out_dir is not None:
            write_summary(summary, session.out_dir / "summary.json")
        return summary

    duration_ns = None if session.duration_s is None else round(session.duration_s * 1e9)
    try:
        loop.run(duration_ns=duration_ns, stop=stop)
    except BaseException as error:
        conclude(error)
        raise
    return conclude(None)


def _trace(
    prepared: Prepared, sinks: Sinks, pacer: Pacer, *, start_ns: int, budget_ms: float
) -> LatencyTrace | None:
    """Make what follows frames and blocks through the loop, where there is something live to follow."""
    sources: list[TactileSource | EmgSource] = [finger.source for finger in prepared.fingers.values()]
    if prepared.muscles is not None:
        sources.append(prepared.muscles.source)
    if not any(source.info.live for source in sources):
        return None
    vests: list[Any] = [kept.sink for kept in sinks.kept]
    return LatencyTrace(
        now_ns=pacer.elapsed_ns,
        start_ns=start_ns,
        budget_ms=budget_ms,
        # Asked by name: a vest whose frames are recorded stands behind another object.
        vests=[vest for vest in vests if hasattr(vest, "handed_over")],
        answered_ns=getattr(sinks.steered, "answered_ns", None),
    )


def _contacts(
    stack: ExitStack,
    name: str,
    finger: Finger,
    *,
    reading: Literal["paper", "live"],
    start_ns: int,
    trace: LatencyTrace | None,
) -> Stream[Contact]:
    """Make a finger's stream: what was measured beforehand, or a thread that measures as frames come."""
    if finger.stream is not None:
        return finger.stream
    if finger.measured is not None:
        return PulledStream(finger.measured, end_ns=finger.report.end_ns or 0)

    stamps: dict[str, Any] = {}
    if trace is not None and finger.source.info.live:
        stamps["stamp"] = trace.source(name)

    def produce(stopped: Callable[[], bool]) -> Generator[Contact, None, int]:
        return measured_contacts(
            finger.source,
            finger.baseline,
            reading,
            finger.report,
            start_ns=start_ns,
            stopped=stopped,
            **stamps,
        )

    stream: ThreadedStream[Contact] = ThreadedStream(
        name, produce, live=finger.source.info.live, on_loss=finger.report.drop
    )
    stack.callback(stream.close)
    return stream


def _levels(
    stack: ExitStack, muscles: Muscles, *, start_ns: int, trace: LatencyTrace | None
) -> Stream[Block]:
    """Make the stream of EMG blocks; only a live source is worth a thread."""
    if muscles.stream is not None:
        return muscles.stream
    produce = partial(
        grasp_blocks,
        muscles.source,
        muscles.intent,
        muscles.report,
        rate_hz=muscles.maxima.rate_hz,
        tau=muscles.maxima.tau,
        start_ns=start_ns,
    )
    if not muscles.source.info.live:
        return PulledStream(produce())
    if trace is not None:
        produce = partial(produce, stamp=trace.source("emg"))
    stream: ThreadedStream[Block] = ThreadedStream(
        "emg", lambda stopped: produce(stopped=stopped), live=True, on_loss=muscles.report.drop
    )
    stack.callback(stream.close)
    return stream


def touch_loop(config: SessionConfig, calibration: Calibration, fingers: Iterable[str]) -> TouchLoop:
    """Make the back loop that settings and a calibration ask for."""
    vest = config.vest
    maxima = {finger: calibration.touch(finger) or TouchMaxima() for finger in fingers}
    felt = None
    if (vest.threshold, vest.step) != (0.0, 1.0):
        felt = FeltMap(threshold=vest.threshold, step=vest.step)
    layout = vest.layout or DEFAULT_LAYOUT[config.session.preset]
    return TouchLoop(maxima, layout=layout, mirror=vest.mirror, felt=felt)


def _inputs(stack: ExitStack, config: SessionConfig) -> Inputs:
    """Open what the operator holds or steps on."""
    seats = {}
    for name, c in config.input.in_use().items():
        source = stack.enter_context(driver_class(c.driver, "input")(c.options))
        if config.session.pace == "fast" and source.info.live:
            raise ConfigError(
                f"session.pace = 'fast', but {source.info.label} is live", "set session.pace = 'real'"
            )
        seats[name] = Seat(source, c.button)
    return Inputs(seats)


def _sinks(
    stack: ExitStack, config: SessionConfig, prepared: Prepared, recording: Recording | None, disk: Disk
) -> Sinks:
    """Open what is written to: the devices of the settings, then the tables of the output folder."""
    kept: list[KeepAlive] = []
    vests: list[VestSink] = []
    hands: list[HandDriver] = []
    steered: SteeredHand | None = None
    if config.vest.driver is not None:
        vest = stack.enter_context(driver_class(config.vest.driver, "vest")(config.vest.options))
        if vest.info.live:
            if recording is not None:
                vest = recording.vest(vest)
            kept.append(
                KeepAlive(
                    vest,
                    keep_alive_ns=round(config.vest.keep_alive_s * 1e9),
                    period_ns=round(1e9 / config.vest.rate_hz),
                )
            )
        else:
            vests.append(vest)
    if config.hand.driver is not None:
        hand: HandDriver | SteeredHand = driver_class(config.hand.driver, "hand")(config.hand.options)
        if recording is not None:
            recording.listen(hand)
        stack.enter_context(hand)
        if isinstance(hand, SteeredHand):
            if config.session.pace == "fast":
                raise ConfigError(
                    f"session.pace = 'fast', but {hand.info.label} is live", "set session.pace = 'real'"
                )
            steered = hand
        else:
            hands.append(hand)
    folder = config.session.out_dir
    if folder is None:
        return Sinks(kept, vests, hands, steered, None)
    vest_table = VestRecorder(VestRecorderOptions(file=folder / "vest.csv"))
    hand_table = CanRecorder(CanRecorderOptions(file=folder / "can.csv"))
    vest_table.open()
    hand_table.open()
    recorder = RunRecorder(folder, prepared.muscles.maxima.channels if prepared.muscles else ())
    tables: list[Any] = [vest_table, hand_table, recorder]
    if config.session.pace == "real":
        # Somebody may be steering a hand; a computation in a hurry had better end with an error.
        tables = [Spared(table, disk) for table in tables]
    for table in tables:
        stack.callback(table.close)
    vests.append(tables[0])
    hands.append(tables[1])
    save_calibration(prepared.calibration, folder / "calibration.toml")
    return Sinks(kept, vests, hands, steered, tables[2])
