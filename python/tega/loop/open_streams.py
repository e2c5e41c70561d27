"""Build the loop's input streams and the latency trace."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from contextlib import ExitStack
from functools import partial
from typing import Any

from tega.config.motor_onset import MotorOnset
from tega.devices.base import AnsweringHand, EmgChunk, FeedingSource, StampingVest, TactileFrame, optional
from tega.loop.adapting import FingerRezero
from tega.loop.emg_adaptation import ChannelAdaptation
from tega.loop.inbox.frames import FrameMeter, fed_contacts, keeps_up, measured_contacts
from tega.loop.inbox.inputs import Finger, Muscles, Prepared
from tega.loop.inbox.reader import Reader
from tega.loop.inbox.sources import grasp_blocks, picture_of, samples_of
from tega.loop.inbox.stream import LiveStream, PulledStream, Stream
from tega.loop.joint_motion import JointMotion
from tega.loop.latency import LatencyTrace
from tega.loop.pacing import Pacer
from tega.loop.sinks import Sinks
from tega.loop.touching import RecordedFingers, Touching
from tega.records import Contact, EmgSamples, Intent, Picture
from tega.records.bus import Bus
from tega.runtime.threads import Bell
from tega.safety.states import SafetySection
from tega.stages.base import MeasuredPicture, Metric


def latency_trace(
    prepared: Prepared,
    sinks: Sinks,
    pacer: Pacer,
    *,
    start_ns: int,
    safety: SafetySection,
    steady: bool,
    motor: MotorOnset | None,
    bus: Bus,
) -> LatencyTrace | None:
    """Make the trace of frames and blocks through the loop, where there is something live to follow."""
    if not any(source.info.live for source in prepared.sources):
        return None
    hand = sinks.steered
    answering = hand if isinstance(hand, AnsweringHand) else None
    trace = LatencyTrace(
        now_ns=pacer.elapsed_ns,
        start_ns=start_ns,
        budget_ms=safety.latency_budget_ms,
        joint_budget_ms=safety.joint_budget_ms,
        steady=steady,
        vests=[vest for vest in sinks.live_vests if isinstance(vest, StampingVest)],
        answered_ns=None if answering is None else answering.answered_ns,
        joints=None if answering is None else JointMotion(lambda: answering.angles_rad),
        motor=motor,
        bus=bus,
    )
    bus.subscribe(Contact, lambda contact: trace.taken(contact.finger, contact.t_ns), vital=True)
    bus.subscribe(Intent, lambda intent: trace.taken("emg", intent.t_ns), vital=True)
    return trace


def is_fed(finger: Finger, metric: Callable[[], Metric]) -> bool:
    """Return whether a finger's source has its own thread in which a metric keeps up; a trial metric is made."""
    source = finger.source
    if not isinstance(source, FeedingSource) or finger.stream is not None or finger.measured is not None:
        return False
    return keeps_up(metric(), finger.baseline, rate_hz=source.info.rate_hz)


def contact_stream(
    stack: ExitStack,
    name: str,
    finger: Finger,
    *,
    metric: Metric | None,
    fed: bool,
    touching: Touching,
    recorded: RecordedFingers,
    start_ns: int,
    trace: LatencyTrace | None,
    bell: Bell | None,
    bus: Bus,
) -> Stream[Contact]:
    """Make a finger's stream: contacts measured beforehand, or a thread that measures frames as they arrive.

    The stack ends it; every frame is published on the bus. ``metric`` is ``None`` where the pictures are
    measured already. ``fed`` is whether the source's own thread measures (:func:`is_fed`). ``touching`` knows
    which other live fingers bear a load; ``recorded`` measures the fingers that are recordings. ``start_ns``
    is the clock's time at the session's start. ``bell`` wakes the loop for a picture; ``None`` if it has its
    own pace.
    """
    if finger.stream is not None:
        return finger.stream
    if finger.measured is not None:
        return PulledStream(finger.measured, end_ns=finger.report.end_ns or 0)
    assert metric is not None
    live = finger.source.info.live
    reported: dict[str, Any] = {}
    if trace is not None and live:
        reported["stamp"] = trace.source(name)

    rezero = FingerRezero(bus, metric, finger.report)
    rezeroed = False

    def measure_beside(frame: TactileFrame) -> None:
        nonlocal rezeroed
        metric.loaded = touching.beside(name, frame.t_ns - start_ns)
        rezeroed = rezero.before_picture()

    def observe(frame: TactileFrame, received_ns: int) -> None:
        if bus.wants(Picture):
            at_ns = received_ns if live else None
            picture = picture_of(
                name, frame, received_ns=at_ns, start_ns=start_ns, loaded=metric.loaded, rezeroed=rezeroed
            )
            bus.publish(picture)

    def notify(frame: TactileFrame, contact: Contact) -> None:
        if live:
            touching.note(name, contact.t_ns, bears_load=metric.bears_load)
        if bus.wants(MeasuredPicture):
            bus.publish(MeasuredPicture(image=frame.image, contact=contact, metric=metric))

    reported |= {"observe": observe, "notify": notify}
    if not live:
        recorded.add(name, finger, metric, **reported)
        return PulledStream(recorded.contacts(name))
    reported["prepare"] = measure_beside
    produce = partial(
        measured_contacts,
        finger.source,
        finger.baseline,
        metric,
        finger.report,
        start_ns=start_ns,
        **reported,
    )
    stream: LiveStream[Contact] = LiveStream(
        on_loss=finger.report.drop, on_item=bell.ring if bell is not None else lambda: None
    )
    source = finger.source
    if fed and isinstance(source, FeedingSource):
        meter = FrameMeter(finger.baseline, metric, finger.report, live=True, start_ns=start_ns)
        stack.callback(source.feed, None)
        source.feed(
            fed_contacts(meter, finger.report, stream.put, lambda error: stream.end(error=error), **reported)
        )
    else:
        reader = Reader(
            name, lambda stopped: produce(stopped=stopped), stream.put, stream.end, rank="measure"
        )
        stack.callback(reader.close)
    return stream


def level_stream(
    stack: ExitStack,
    muscles: Muscles,
    *,
    start_ns: int,
    trace: LatencyTrace | None,
    bus: Bus,
    adaptation: ChannelAdaptation | None = None,
) -> Stream[Intent]:
    """Make the stream of intents; only a live source is worth a thread."""
    if muscles.stream is not None or muscles.decoder is None:
        assert muscles.stream is not None  # what makes no levels is given them
        return muscles.stream
    live = muscles.source.info.live

    marked = deque(optional(muscles.source, "marked"))

    def observe(chunk: EmgChunk) -> None:
        if bus.wants(EmgSamples):
            bus.publish(samples_of(chunk, live=live, start_ns=start_ns))
        while marked and marked[0].t_ns <= chunk.t_ns:
            bus.publish(marked.popleft())

    produce = partial(
        grasp_blocks,
        muscles.source,
        muscles.decoder,
        muscles.report,
        maxima=muscles.maxima,
        start_ns=start_ns,
        observe=observe,
        adaptation=adaptation,
    )
    if not live:
        return PulledStream(produce())
    if trace is not None:
        produce = partial(produce, stamp=trace.source("emg"))
    stream: LiveStream[Intent] = LiveStream(on_loss=muscles.report.drop)
    # It is short, and comes before the cameras: a block that waits for four of them is late.
    reader = Reader("emg", lambda stopped: produce(stopped=stopped), stream.put, stream.end, rank="act")
    stack.callback(reader.close)
    return stream
