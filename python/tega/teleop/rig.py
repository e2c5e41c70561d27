"""Open every device and output of a run, in the order in which what is missing is told first."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from typing import TYPE_CHECKING, NamedTuple

from tega.config import SessionConfig
from tega.inbox.inputs import Inputs
from tega.inbox.prepared import Prepared
from tega.records import BesideContact, BesideIntent
from tega.safety.guard import Guard
from tega.safety.states import Transition
from tega.stages.base import MeasuredPicture
from tega.teleop.arm import Steering, open_arm
from tega.teleop.beside import open_beside
from tega.teleop.condition import open_condition
from tega.teleop.opening import Opening, reached
from tega.teleop.pacing import refuse_live
from tega.teleop.prepare import Progress, prepare, to_be_read
from tega.teleop.sinks import Sinks, open_inputs, open_sinks, with_tables
from tega.teleop.watch import watch_over
from tega.threads import run_realtime

if TYPE_CHECKING:
    from tega.bus import Bus
    from tega.lsl_events import RunMarkers
    from tega.net.station import Station
    from tega.recording.session import Recording
    from tega.scene.filmed_run import RunCameras


class Rig(NamedTuple):
    """Devices and outputs of a run, all of them open.

    Attributes:
        config: The settings.
        bus: Told of everything that comes in and goes out.
        prepared: The sources, with their baselines and maxima.
        sinks: What is written to.
        inputs: What the operator holds or steps on.
        guard: What watches over the live devices.
        recording: The recording; ``None`` without one, like those below.
        markers: The streams of markers.
        steering: What leads the arm.
        station: This end of the link to another station.
        cameras: What films the run.
    """

    config: SessionConfig
    bus: Bus
    prepared: Prepared
    sinks: Sinks
    inputs: Inputs
    guard: Guard
    recording: Recording | None
    markers: RunMarkers | None
    steering: Steering | None
    station: Station | None
    cameras: RunCameras | None


def open_rig(
    stack: ExitStack,
    config: SessionConfig,
    bus: Bus,
    *,
    opening: Opening,
    prepared: Prepared | None,
    on_prepared: Callable[[Prepared], Prepared],
    progress: Progress,
    stop: Callable[[], bool],
    settings: str,
    go: Callable[[], bool],
    on_state: Callable[[Transition], None],
    tell: Callable[[str], None],
) -> Rig:
    """Open what the settings name; the arguments are those of :func:`tega.teleop.run_session`.

    Args:
        stack: Closes all of it.
        config: The settings.
        bus: Told of everything that comes in and goes out.
        opening: Opens the EMG already.
        prepared: What to start with instead of the sources of the settings.
        on_prepared: Given what the run starts with; returns what it is to start with.
        progress: Told how preparation goes.
        stop: Asked whether to give up.
        settings: How the settings file is named in the commands that an error suggests.
        go: Asked all the time whether an armed run may become active.
        on_state: Told of every change of the run's state.
        tell: Told what happens on the link to the other station.

    Raises:
        TegaError: Whatever is wrong with settings, recordings, calibration or devices.
        KeyboardInterrupt: ``stop`` said so.
    """
    reached("loaded")
    hand = opening.begin_rest()
    recording = _recording(stack, config, bus)
    reached("recorder ready")
    markers = _markers(stack, config, bus)
    station = None
    if config.net is not None:
        from tega.net.station import open_station

        progress("opening the link", 0, 0)
        station = open_station(config, bus, tell=tell, stop=stop)
        # The link's own threads, which others wait for at the other station.
        with run_realtime("act", inherited=True):
            stack.enter_context(station)
    if prepared is None:
        sources, emg = opening.sources()
        for source in (*sources.values(), *([] if emg is None else [emg])):
            refuse_live(source.info, config.session.pace)
        prepared = prepare(config, sources, emg, progress=progress, stop=stop, settings=settings)
    if station is not None:
        prepared = station.prepared(prepared)
    prepared = on_prepared(prepared)
    if recording is not None or bus.wants(MeasuredPicture):
        prepared = to_be_read(prepared)
    if recording is not None or bus.wants(BesideIntent) or bus.wants(BesideContact):
        open_beside(stack, config, prepared, bus)
    condition = open_condition(stack, config, prepared, bus)
    cameras = _cameras(stack, config, bus, stop)  # before what moves: an address may take its time
    reached("prepared")
    sinks = open_sinks(stack, config, bus, hand)
    reached("vest and hand open")
    inputs = open_inputs(stack, config)
    if station is not None:
        sinks, inputs = station.sinks(sinks), station.inputs(stack, inputs)
    steering = None
    if config.arm is not None:
        steering = open_arm(stack, config, inputs, tracker=None if station is None else station.tracker)
    sinks = with_tables(stack, config, prepared, bus, sinks, tell=tell)
    progress("running", 0, 0)
    guard = watch_over(
        config,
        prepared,
        sinks,
        bus,
        recording,
        markers=markers,
        go=go,
        steering=steering,
        station=station,
        condition=condition,
        cameras=cameras,
    )
    guard.observers.append(on_state)
    return Rig(config, bus, prepared, sinks, inputs, guard, recording, markers, steering, station, cameras)


def _recording(stack: ExitStack, config: SessionConfig, bus: Bus) -> Recording | None:
    """Make the recording, if one is asked for: what is missing there is told before any device is waited for."""
    if config.recording.dir is None:
        return None
    from tega.recording.session import Recording

    recording = Recording(config, config.recording.dir, bus)
    stack.callback(recording.abandon)
    return recording


def _markers(stack: ExitStack, config: SessionConfig, bus: Bus) -> RunMarkers | None:
    """Open the streams of markers, if there are any."""
    if config.markers == type(config.markers)():
        return None
    from tega.lsl_events import RunMarkers

    markers = RunMarkers(config.markers, bus)
    stack.callback(markers.close)
    return markers


def _cameras(
    stack: ExitStack, config: SessionConfig, bus: Bus, stop: Callable[[], bool]
) -> RunCameras | None:
    """Open the scene cameras, where what they film is recorded or shown."""
    from tega.records import SceneVideo
    from tega.scene.decode import ScenePicture

    if not config.scene or not (bus.wants(SceneVideo) or bus.wants(ScenePicture)):
        return None
    from tega.scene.filmed_run import RunCameras

    return RunCameras(config.scene, bus, stack, stop)
