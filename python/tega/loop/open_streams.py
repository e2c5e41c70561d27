"""Build the loop's input streams and the latency trace."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from contextlib import ExitStack, closing
from functools import partial
from typing import Any

from tega.config.person import motor_onset
from tega.devices.base import AnsweringHand, EmgChunk, FeedingSource, StampingVest, TactileFrame, optional
from tega.loop.adapting import FingerRezero
from tega.loop.emg_adaptation import ChannelAdaptation
from tega.loop.inbox.frames import FrameMeter, FrameWatch, fed_contacts, keeps_up, measured_contacts
from tega.loop.inbox.inputs import Finger, Muscles
from tega.loop.inbox.reader import Reader
from tega.loop.inbox.sources import BlockMeter, grasp_blocks, picture_of, samples_of
from tega.loop.inbox.stream import LiveStream, PulledStream, Stream
from tega.loop.joint_motion import JointMotion
from tega.loop.latency import LatencyTrace
from tega.loop.pacing import Pacer
from tega.loop.rig import Rig
from tega.loop.touching import RecordedFingers, Touching
from tega.records import Contact, EmgSamples, Intent, Picture
from tega.records.bus import Bus
from tega.runtime.threads import Bell, Rank
from tega.stages.base import MeasuredPicture, Metric


def latency_trace(rig: Rig, pacer: Pacer, *, start_ns: int, steady: bool) -> LatencyTrace | None:
    """Make the trace of frames and blocks through the loop, where there is something live to follow."""
    config, bus = rig.config, rig.bus
    if not any(source.info.live for source in rig.prepared.sources):
        return None
    hand = rig.sinks.steered
    answering = hand if isinstance(hand, AnsweringHand) else None
    trace = LatencyTrace(
        now_ns=pacer.elapsed_ns,
        start_ns=start_ns,
        budget_ms=config.safety.latency_budget_ms,
        joint_budget_ms=config.safety.joint_budget_ms,
        steady=steady,
        vests=[vest for vest in rig.sinks.live_vests if isinstance(vest, StampingVest)],
        answered_ns=None if answering is None else answering.answered_ns,
        joints=None if answering is None else JointMotion(lambda: answering.angles_rad),
        motor=motor_onset(config),
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


class StreamMaker:
    """Makes a run's streams: contacts or intents of live sources by threads, which the stack ends, others on demand.

    Every frame and every chunk of samples is published on the bus. ``bell`` wakes the loop for a picture; ``None`` if
    it has its own pace.
    """

    def __init__(
        self, stack: ExitStack, bus: Bus, *, start_ns: int, trace: LatencyTrace | None, bell: Bell | None
    ) -> None:
        self._stack, self._bus, self._start_ns, self._trace, self._bell = stack, bus, start_ns, trace, bell
        self.touching, self.recorded = Touching(), stack.enter_context(closing(RecordedFingers()))

    def contacts(self, name: str, finger: Finger, metric: Metric | None, *, fed: bool) -> Stream[Contact]:
        """Make a finger's stream; ``metric`` is ``None`` where the pictures are measured, ``fed`` as :func:`is_fed`."""
        if finger.stream is not None:
            return finger.stream
        if finger.measured is not None:
            return PulledStream(finger.measured, end_ns=finger.report.end_ns or 0)
        assert metric is not None
        source, bus, live = finger.source, self._bus, finger.source.info.live
        touching, start_ns = self.touching, self._start_ns
        rezero = FingerRezero(bus, metric, finger.report)
        rezeroed = False

        def measure_beside(frame: TactileFrame) -> None:
            nonlocal rezeroed
            metric.loaded = touching.beside(name, frame.t_ns - start_ns)
            rezeroed = rezero.before_picture()

        def observe(frame: TactileFrame, received_ns: int) -> None:
            if bus.wants(Picture):
                at_ns = received_ns if live else None
                state = {"loaded": metric.loaded, "rezeroed": rezeroed}
                bus.publish(picture_of(name, frame, received_ns=at_ns, start_ns=start_ns, **state))

        def notify(frame: TactileFrame, contact: Contact) -> None:
            if live:
                touching.note(name, contact.t_ns, bears_load=metric.bears_load)
            if bus.wants(MeasuredPicture):
                bus.publish(MeasuredPicture(image=frame.image, contact=contact, metric=metric))

        watch = FrameWatch(prepare=measure_beside, observe=observe, notify=notify)
        if not live:
            self.recorded.add(name, finger, metric, watch)
            return PulledStream(self.recorded.contacts(name))
        if self._trace is not None:
            watch = watch._replace(stamp=self._trace.source(name))
        meter = FrameMeter(finger.baseline, metric, finger.report, live=True, start_ns=start_ns)
        stream: LiveStream[Contact] = LiveStream(on_loss=finger.report.drop)
        if self._bell is not None:
            stream.on_item = self._bell.ring
        if fed and isinstance(source, FeedingSource):
            self._stack.callback(source.feed, None)
            source.feed(fed_contacts(meter, stream.put, lambda error: stream.end(error=error), watch))
        else:
            self._read(name, partial(measured_contacts, source, meter, watch), stream, rank="measure")
        return stream

    def levels(self, muscles: Muscles, adaptation: ChannelAdaptation | None) -> Stream[Intent]:
        """Make the stream of intents."""
        if muscles.stream is not None or muscles.decoder is None:
            assert muscles.stream is not None  # what makes no levels is given them
            return muscles.stream
        source, bus, start_ns, live = muscles.source, self._bus, self._start_ns, muscles.source.info.live
        marked = deque(optional(source, "marked"))

        def observe(chunk: EmgChunk) -> None:
            if bus.wants(EmgSamples):
                bus.publish(samples_of(chunk, live=live, start_ns=start_ns))
            while marked and marked[0].t_ns <= chunk.t_ns:
                bus.publish(marked.popleft())

        meter = BlockMeter(
            muscles.decoder,
            muscles.report,
            maxima=muscles.maxima,
            live=live,
            start_ns=start_ns,
            adaptation=adaptation,
        )
        produce = partial(grasp_blocks, source, meter, observe=observe)
        if not live:
            return PulledStream(produce())
        if self._trace is not None:
            produce = partial(produce, stamp=self._trace.source("emg"))
        stream: LiveStream[Intent] = LiveStream(on_loss=muscles.report.drop)
        # It is short, and comes before the cameras: a block that waits for four of them is late.
        self._read("emg", produce, stream, rank="act")
        return stream

    def _read(self, name: str, produce: Callable[..., Any], stream: LiveStream[Any], *, rank: Rank) -> None:
        reader = Reader(name, lambda stopped: produce(stopped=stopped), stream.put, stream.end, rank=rank)
        self._stack.callback(reader.close)
