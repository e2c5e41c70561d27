"""From what a session starts with to the streams that its loop takes from, and what follows them through it."""

from __future__ import annotations

from collections.abc import Callable, Generator
from contextlib import ExitStack
from functools import partial
from typing import TYPE_CHECKING, Any

from tega.records import EmgSamples, Picture
from tega.teleop.latency import LatencyTrace
from tega.teleop.sources import (
    Block,
    Contact,
    grasp_blocks,
    measured_contacts,
    picture_of,
    samples_of,
)
from tega.teleop.streams import PulledStream, Stream, ThreadedStream

if TYPE_CHECKING:
    from tega.bus import Bus
    from tega.calibration.motor_onset import MotorOnset
    from tega.devices.base import EmgChunk, TactileFrame
    from tega.stages.base import Metric
    from tega.teleop.bell import Bell
    from tega.teleop.pacing import Pacer
    from tega.teleop.prepare import Finger, Muscles, Prepared
    from tega.teleop.sinks import Sinks

__all__ = ["contact_stream", "latency_trace", "level_stream"]


def latency_trace(
    prepared: Prepared,
    sinks: Sinks,
    pacer: Pacer,
    *,
    start_ns: int,
    budget_ms: float,
    steady: bool,
    motor: MotorOnset | None,
    bus: Bus,
) -> LatencyTrace | None:
    """Make what follows frames and blocks through the loop, where there is something live to follow."""
    if not any(source.info.live for source in prepared.sources):
        return None
    vests: list[Any] = [kept.sink for kept in sinks.kept]
    return LatencyTrace(
        now_ns=pacer.elapsed_ns,
        start_ns=start_ns,
        budget_ms=budget_ms,
        steady=steady,
        # Asked by name: a vest whose frames are recorded stands behind another object.
        vests=[vest for vest in vests if hasattr(vest, "handed_over")],
        answered_ns=getattr(sinks.steered, "answered_ns", None),
        motor=motor,
        bus=bus,
    )


def contact_stream(
    stack: ExitStack,
    name: str,
    finger: Finger,
    *,
    metric: Callable[[], Metric],
    start_ns: int,
    trace: LatencyTrace | None,
    bell: Bell | None,
    bus: Bus,
) -> Stream[Contact]:
    """Make a finger's stream: what was measured beforehand, or a thread that measures as frames come."""
    if finger.stream is not None:
        return finger.stream
    if finger.measured is not None:
        return PulledStream(finger.measured, end_ns=finger.report.end_ns or 0)

    live = finger.source.info.live
    told: dict[str, Any] = {}
    if trace is not None and live:
        told["stamp"] = trace.source(name)

    def see(frame: TactileFrame) -> None:
        if bus.wants(Picture):
            bus.publish(picture_of(name, frame, live=live, start_ns=start_ns))

    def produce(stopped: Callable[[], bool]) -> Generator[Contact, None, int]:
        return measured_contacts(
            finger.source,
            finger.baseline,
            metric(),
            finger.report,
            start_ns=start_ns,
            stopped=stopped,
            see=see,
            **told,
        )

    stream: ThreadedStream[Contact] = ThreadedStream(
        name,
        produce,
        live=live,
        on_loss=finger.report.drop,
        on_item=bell.ring if bell is not None else lambda: None,
    )
    stack.callback(stream.close)
    return stream


def level_stream(
    stack: ExitStack, muscles: Muscles, *, start_ns: int, trace: LatencyTrace | None, bus: Bus
) -> Stream[Block]:
    """Make the stream of EMG blocks; only a live source is worth a thread."""
    if muscles.stream is not None or muscles.decoder is None:
        assert muscles.stream is not None  # what makes no levels is given them
        return muscles.stream
    live = muscles.source.info.live

    def see(chunk: EmgChunk) -> None:
        if bus.wants(EmgSamples):
            bus.publish(samples_of(chunk, live=live, start_ns=start_ns))

    produce = partial(
        grasp_blocks,
        muscles.source,
        muscles.decoder,
        muscles.report,
        maxima=muscles.maxima,
        start_ns=start_ns,
        see=see,
    )
    if not live:
        return PulledStream(produce())
    if trace is not None:
        produce = partial(produce, stamp=trace.source("emg"))
    stream: ThreadedStream[Block] = ThreadedStream(
        "emg", lambda stopped: produce(stopped=stopped), live=True, on_loss=muscles.report.drop
    )
    stack.callback(stream.close)
    return stream
