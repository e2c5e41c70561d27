"""A session: devices, baselines, maxima, the dual loop and its outputs, put together from settings."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from tega.calibration import Calibration, EmgMaxima, TouchMaxima, load_calibration, save_calibration
from tega.clock import Clock, ManualClock, SystemClock
from tega.config import SessionConfig
from tega.devices.base import EmgSource, HandDriver, Kind, TactileSource, VestSink
from tega.devices.registry import driver_class
from tega.emg import GraspIntent
from tega.errors import CalibrationError, ConfigError
from tega.recording import RunRecorder, prepare_folder
from tega.teleop.baseline import find_baseline
from tega.teleop.hand import ModelledHand
from tega.teleop.loop import DualLoop, LoopReport, LoopView
from tega.teleop.maxima import SELF_CALIBRATED, emg_conditions, emg_maxima, touch_maxima
from tega.teleop.pacing import Pacer, PacingReport
from tega.teleop.sources import Block, Contact, SourceReport, grasp_blocks, measured_contacts
from tega.teleop.streams import PulledStream, Stream, ThreadedStream
from tega.teleop.summary import summarise, write_summary
from tega.teleop.touch import TouchLoop

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from tega.haptics import Layout

__all__ = ["Finger", "Muscles", "Progress", "RunState", "run_session"]

Progress = Callable[[str, int, int], None]
"""Called with what is being done, how much is done and how much there is (0 where unknown)."""

DEFAULT_LAYOUT: dict[str, Layout] = {"paper": "paper32", "live": "x40"}


class Finger(NamedTuple):
    """One fingertip, ready to run.

    Attributes:
        source: Its open source.
        baseline: Its untouched picture.
        baseline_origin: Where that came from.
        measured: All frames, where they had to be measured beforehand.
        report: What became of the frames.
    """

    source: TactileSource
    baseline: NDArray[np.uint8]
    baseline_origin: str
    measured: list[Contact] | None
    measured_end_ns: int
    report: SourceReport


class Muscles(NamedTuple):
    """The EMG side, ready to run."""

    source: EmgSource
    maxima: EmgMaxima
    intent: GraspIntent
    report: SourceReport


class RunState(NamedTuple):
    """Everything a summary is made of."""

    config: SessionConfig
    calibration: Calibration
    calibration_name: str
    layout: Layout
    fingers: Mapping[str, Finger]
    muscles: Muscles | None
    vests: list[VestSink]
    hands: list[HandDriver]
    loop: LoopReport
    pacing: PacingReport


def run_session(
    config: SessionConfig,
    *,
    clock: Clock | None = None,
    observer: Callable[[LoopView], None] | None = None,
    progress: Progress = lambda _what, _done, _total: None,
    stop: Callable[[], bool] = lambda: False,
) -> dict[str, Any]:
    """Run a session from its settings.

    Args:
        config: The settings.
        clock: The session's clock; ``None`` for the one its pace asks for.
        observer: Called once per vest tick with what a display may show.
        progress: Told how preparation goes.
        stop: Asked all the time whether to end; whatever was sent to is then left silent.

    Returns:
        The summary, as it was written to ``summary.json`` where there is a folder for it.

    Raises:
        TegaError: Whatever is wrong with settings, recordings, calibration or devices.
        KeyboardInterrupt: ``stop`` said so before the loop had begun.
    """
    in_use = config.tactile.in_use()
    if not in_use and config.emg is None:
        raise ConfigError(
            "no input: neither a tactile source nor EMG is set", "set at least one, such as [tactile.thumb] or [emg]"
        )
    session = config.session
    if clock is None:
        clock = SystemClock() if session.pace == "real" else ManualClock()
    if session.out_dir is not None:
        prepare_folder(session.out_dir)
    with ExitStack() as stack:
        sources: dict[str, TactileSource] = {
            finger: stack.enter_context(_driver("tactile", c.driver, c.options)) for finger, c in in_use.items()
        }
        emg: EmgSource | None = None
        if config.emg is not None:
            emg = stack.enter_context(_driver("emg", config.emg.driver, config.emg.options))
        if session.pace == "fast" and any(d.info.live for d in [*sources.values(), *([emg] if emg else [])]):
            raise ConfigError("session.pace = 'fast' with a live device", "use pace = 'real'")
        given = None if config.calibration.file is None else load_calibration(config.calibration.file)
        fingers = _prepare_fingers(config, sources, measure=given is None, progress=progress, stop=stop)
        conditions = None
        if emg is not None and config.emg is not None:
            conditions = emg_conditions(emg, config.emg.kind)
        if given is not None and config.calibration.file is not None:
            name = config.calibration.file.name
            given.check_fits(preset=session.preset, fingers=in_use, emg=conditions, name=name)
            calibration = given
        else:
            name = ""
            calibration = _self_calibrate(fingers, emg, conditions, preset=session.preset)
        if stop():
            raise KeyboardInterrupt
        muscles = None
        if emg is not None and calibration.emg is not None:
            muscles = _muscles(emg, calibration.emg, preset=session.preset)
        return _run(
            stack, config, clock, fingers, muscles, calibration, name, observer=observer, progress=progress, stop=stop
        )


def _driver(kind: Kind, name: str, options: Any) -> Any:
    """Make a driver; the registry has checked that it is of the kind its section asks for."""
    return driver_class(name, kind)(options)


def _prepare_fingers(
    config: SessionConfig,
    sources: Mapping[str, TactileSource],
    *,
    measure: bool,
    progress: Progress,
    stop: Callable[[], bool],
) -> dict[str, Finger]:
    """Find every baseline and, without a calibration, measure every frame: one thread per finger."""
    preset = config.session.preset
    total = sum(s.info.n_items or 0 for s in sources.values()) if measure else 0
    lock, n_done = threading.Lock(), 0
    failed = threading.Event()

    def step() -> None:
        nonlocal n_done
        with lock:
            n_done += 1
            progress("measuring frames", n_done, total)

    def prepare(finger: str) -> Finger:
        try:
            return prepare_one(finger)
        except BaseException:
            failed.set()
            raise

    def prepare_one(finger: str) -> Finger:
        source, report = sources[finger], SourceReport()
        given = config.tactile.in_use()[finger].baseline
        baseline, origin = find_baseline(source, given, finger=finger)
        if not measure:
            return Finger(source, baseline, origin, None, 0, report)
        if source.info.live:
            raise CalibrationError(
                f"finger {finger!r} has a live sensor and the run no calibration", "set calibration.file"
            )
        measured: list[Contact] = []
        frames = measured_contacts(
            source, baseline, preset, report, stopped=lambda: stop() or failed.is_set()
        )
        while True:
            try:
                measured.append(next(frames))
            except StopIteration as end:
                return Finger(source, baseline, origin, measured, end.value, report)
            step()

    if not sources:
        return {}
    with ThreadPoolExecutor(max_workers=len(sources), thread_name_prefix="tega-measure") as pool:
        jobs = {finger: pool.submit(prepare, finger) for finger in sources}
    # In the fingers' order: of several faults the same one is reported every time.
    return {finger: job.result() for finger, job in jobs.items()}


def _self_calibrate(
    fingers: Mapping[str, Finger],
    emg: EmgSource | None,
    conditions: EmgMaxima | None,
    *,
    preset: Literal["paper", "live"],
) -> Calibration:
    if emg is not None and emg.info.live:
        raise CalibrationError("the EMG source is live and the run has no calibration", "set calibration.file")
    return Calibration(
        preset=preset,
        origin=SELF_CALIBRATED,
        tactile={finger: touch_maxima(f.measured or []) for finger, f in fingers.items()},
        emg=emg_maxima(emg, conditions, preset=preset) if emg is not None and conditions is not None else None,
    )


def _muscles(source: EmgSource, maxima: EmgMaxima, *, preset: Literal["paper", "live"]) -> Muscles:
    intent = GraspIntent(maxima.rate_hz, maxima.maxima, tau=maxima.tau, kind=maxima.kind, preset=preset)
    return Muscles(source, maxima, intent, SourceReport())


def _run(
    stack: ExitStack,
    config: SessionConfig,
    clock: Clock,
    fingers: Mapping[str, Finger],
    muscles: Muscles | None,
    calibration: Calibration,
    calibration_name: str,
    *,
    observer: Callable[[LoopView], None] | None,
    progress: Progress,
    stop: Callable[[], bool],
) -> dict[str, Any]:
    session, folder = config.session, config.session.out_dir
    layout = config.vest.layout or DEFAULT_LAYOUT[session.preset]
    vests, hands = _sinks(stack, config, folder)
    recorder = None
    if folder is not None:
        recorder = RunRecorder(folder, muscles.maxima.channels if muscles else ())
        stack.callback(recorder.close)
        save_calibration(calibration, folder / "calibration.toml")
    pacer = Pacer(clock)
    start_ns = pacer.start()
    contacts = {f: _contacts(stack, f, finger, session.preset, start_ns) for f, finger in fingers.items()}
    loop = DualLoop(
        pacer=pacer,
        touch=TouchLoop({f: calibration.tactile.get(f, TouchMaxima()) for f in fingers}, layout=layout),
        contacts=contacts,
        levels=None if muscles is None else _levels(stack, muscles, start_ns),
        hand=ModelledHand(device_id=config.hand.device_id),
        vests=vests,
        hands=hands,
        recorder=recorder,
        vest_rate_hz=config.vest.rate_hz,
        observer=observer,
    )

    def conclude(error: BaseException | None) -> dict[str, Any]:
        state = RunState(
            config, calibration, calibration_name, layout, fingers, muscles, vests, hands, loop.report, pacer.report()
        )
        summary = summarise(state, error=error)
        if folder is not None:
            stack.pop_all().close()  # the tables are complete before the summary says so
            write_summary(summary, folder / "summary.json")
        return summary

    progress("running", 0, 0)
    duration_s = session.duration_s
    try:
        loop.run(duration_ns=None if duration_s is None else round(duration_s * 1e9), stop=stop)
    except BaseException as error:
        conclude(error)
        raise
    return conclude(None)


def _contacts(
    stack: ExitStack, name: str, finger: Finger, preset: Literal["paper", "live"], start_ns: int
) -> Stream[Contact]:
    if finger.measured is not None:
        return PulledStream(finger.measured, end_ns=finger.measured_end_ns)

    def produce(stopped: Callable[[], bool]) -> Any:
        return measured_contacts(
            finger.source, finger.baseline, preset, finger.report, start_ns=start_ns, stopped=stopped
        )

    stream: ThreadedStream[Contact] = ThreadedStream(name, produce, live=finger.source.info.live)
    stack.callback(stream.close)
    return stream


def _levels(stack: ExitStack, muscles: Muscles, start_ns: int) -> Stream[Block]:
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
    stream: ThreadedStream[Block] = ThreadedStream("emg", lambda stopped: produce(stopped=stopped), live=True)
    stack.callback(stream.close)
    return stream


def _sinks(
    stack: ExitStack, config: SessionConfig, folder: Path | None
) -> tuple[list[VestSink], list[HandDriver]]:
    """Open what is written to: the devices of the settings, then the tables of the output folder."""
    vests: list[VestSink] = []
    hands: list[HandDriver] = []
    if config.vest.driver is not None:
        vests.append(_driver("vest", config.vest.driver, config.vest.options))
    if config.hand.driver is not None:
        hands.append(_driver("hand", config.hand.driver, config.hand.options))
    if folder is not None:
        vests.append(_recorder("vest", "vest-recorder", folder / "vest.csv"))
        hands.append(_recorder("hand", "can-recorder", folder / "can.csv"))
    for sink in (*vests, *hands):
        stack.enter_context(sink)
    return vests, hands


def _recorder(kind: Kind, name: str, path: Path) -> Any:
    options: Any = driver_class(name, kind).options_type
    return _driver(kind, name, options(file=path))
