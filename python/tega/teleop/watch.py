"""What a run's guard watches over: streams, vests, and whatever else can say that something is wrong."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

from tega.config import SessionConfig
from tega.safety.clock_step import ClockStep
from tega.safety.guard import Guard, Watched
from tega.safety.hand_alert import HandAlert

if TYPE_CHECKING:
    from tega.markers import RunMarkers
    from tega.net.station import Station
    from tega.recording.session import Recording
    from tega.recording.spared import Disk
    from tega.teleop.arm import Steering
    from tega.teleop.prepare import Prepared
    from tega.teleop.sinks import Sinks

__all__ = ["watch_over"]


def watch_over(
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
    """Make what watches over the live devices; recordings are not lost and need nobody.

    ``go`` is asked all the time whether an armed run may become active; the others are what the run has open.
    """
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
