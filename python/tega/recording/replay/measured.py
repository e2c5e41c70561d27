"""Measure a recording's raw streams again, and pair the results with the records that the loop took in."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path

import msgspec
from msgspec.structs import replace

from tega.config.attached import with_attached
from tega.config.calibration import EmgMaxima
from tega.config.choose import chosen_stage, finger_metric, is_outside, muscle_decoder
from tega.errors import TegaError
from tega.loop.beside import measure_beside_on
from tega.loop.emg_adaptation import ChannelAdaptation, read_switches
from tega.loop.inbox.frames import FrameMeter
from tega.loop.inbox.sources import BlockMeter, SourceReport, chunk_of, frame_of
from tega.loop.inbox.stream import NEVER_NS
from tega.recording.pictures import has_cells, read_sums
from tega.recording.replay.compare import MEASURED
from tega.recording.replay.feed import Newest, RecordFeed
from tega.recording.replay.head import Head, contacts_kept, levels_kept, metric_change, with_changes
from tega.records import AdaptationSwitch, BesideContact, BesideIntent, Contact, EmgSamples, Intent, Picture
from tega.records.bus import Bus
from tega.stages.base import MeasuredPicture

_STEP_NS = 1_000_000_000


class PictureError(msgspec.Struct):
    """Errors of a finger's contacts measured in a recording's pictures, or in their cells, against those recorded.

    ``contact_changed`` counts frames in which only one of the two has contact, ``fields`` those in which a field
    differs, by its name. The area (``eda``) is in pixels, over all frames; ``cci`` is the concentration.
    """

    finger: str
    compared: int = 0
    contact_changed: int = 0
    eda_mean_px: float = 0.0
    eda_max_px: float = 0.0
    cci_mean: float = 0.0
    cci_max: float = 0.0
    fields: dict[str, int] = {}

    def note(self, recorded: Contact, again: Contact) -> None:
        """Compare a contact with that measured again in the same frame."""
        eda, cci = float(abs(recorded.eda - again.eda)), abs(recorded.cci - again.cci)
        self.compared += 1
        for name in MEASURED.differing(recorded, again):
            self.fields[name] = self.fields.get(name, 0) + 1
        self.contact_changed += recorded.in_contact != again.in_contact
        self.eda_mean_px += (eda - self.eda_mean_px) / self.compared
        self.cci_mean += (cci - self.cci_mean) / self.compared
        self.eda_max_px, self.cci_max = max(self.eda_max_px, eda), max(self.cci_max, cci)


class MeasuredFingers:
    """Measures a recording's pictures as they are read, in other threads unless there is a ``notify``.

    It is called with each picture, and may ask its metric for the map of it.
    """

    def __init__(self, feed: RecordFeed, notify: Callable[[MeasuredPicture], object] | None = None) -> None:
        head, self._notify = feed.head, notify
        self._meters = {finger: finger_meter(head, finger) for finger in head.baselines}
        self._contacts = {finger: Newest[Contact]() for finger in head.baselines}
        if notify is not None:
            feed.bus.subscribe(Picture, lambda picture: self._measure(picture)(), vital=True)
        else:
            feed.ahead.append(self._measure)
            # Since version 4 of its record a JPEG of the baseline's size stands beside its cells.
            beside = int(head.versions.get("Frame", "1")) >= 4 and not head.lossless
            beside = beside and all(has_cells(*image.shape[:2]) for image in head.baselines.values())
            by_sums = beside and all(meter.metric.reads_sums for meter in self._meters.values())
            feed.by_cells = by_sums and not feed.bus.wants(Picture)

    def at(self, recorded: Contact) -> Contact | None:
        """Return the contact measured in the picture of a recorded one, ``None`` where there is none."""
        return self._contacts[recorded.finger].at(recorded.t_ns)

    def _measure(self, picture: Picture) -> Callable[[], object]:
        """Measure a picture; return a function that passes the contact on."""
        try:
            contact = measure(self._meters[picture.finger], picture)
        except TegaError:  # a bad picture of a live sensor, dropped then as now
            contact = None
        return lambda: None if contact is None else self._pass_on(picture, contact)

    def _pass_on(self, picture: Picture, contact: Contact) -> None:
        self._contacts[picture.finger].rows.append(contact)
        if self._notify is not None:
            metric = self._meters[picture.finger].metric
            self._notify(MeasuredPicture(image=picture.image, contact=contact, metric=metric))


def picture_errors(path: Path, config: Path | None, sets: Sequence[str]) -> list[PictureError]:
    """Return the errors of contacts measured in a recording's pictures, by finger.

    ``config`` and ``sets`` are other settings, as for :func:`~tega.recording.replay.replay_file`.
    """
    feed = RecordFeed(path)
    feed.head = with_changes(feed.head, config, sets)
    errors = {finger: PictureError(finger) for finger in feed.head.baselines}
    measured, contacts, t_ns = MeasuredFingers(feed), deque[Contact](), 0
    feed.bus.subscribe(Contact, contacts.append, vital=True)
    while not feed.ended or contacts:
        # A contact may come before its picture, and is compared when the loop took it in.
        t_ns = NEVER_NS if feed.ended else t_ns + _STEP_NS
        feed.read_until(t_ns)
        while contacts and contacts[0].taken_ns <= t_ns:
            recorded = contacts.popleft()
            if (again := measured.at(recorded)) is not None:
                errors[recorded.finger].note(recorded, again)
    return list(errors.values())


class Measured:
    """Measures pictures and samples of a recording as they are read.

    The bus receives adaptations, the output of stages beside the connected ones, and pictures measured as in
    the run. ``again`` is whether contacts are those measured again, and not :func:`contacts_kept`.
    """

    def __init__(self, feed: RecordFeed, bus: Bus) -> None:
        head, config = feed.head, feed.head.config
        decoder = chosen_stage("decoder", config.stages, config.session.preset).kind
        self.again = not contacts_kept(head)
        self._from_ns = head.from_ns
        # Else the pictures are not what the contacts were measured in.
        exact = head.lossless and not metric_change(head)
        notify = bus.publish if exact and bus.wants(MeasuredPicture) else None
        self._fingers = MeasuredFingers(feed, notify) if self.again or notify else None
        self._intents = Newest[Intent]()
        emg = head.calibration.emg if "emg" in head.sources else None
        maxima = None if emg is None else replace(emg, kind=head.emg_kind)
        # The intents of an operator's station or of another program are those recorded.
        self._decodes = "emg" in head.sources and not levels_kept(head)
        beside = tuple(one for one in config.stages.beside if not is_outside(one))
        if beside and (bus.wants(BesideContact) or bus.wants(BesideIntent)):
            feed.bus.subscribe(Picture, bus.publish, vital=True)
            feed.bus.subscribe(EmgSamples, bus.publish, vital=True)
            measure_beside_on(
                ExitStack(),  # nothing in it, as no stage has a thread of its own
                replace(config, stages=replace(config.stages, beside=beside)),
                bus,
                baselines=head.baselines,
                touch=head.calibration.touch,
                muscles=maxima,
                live="emg" in head.sources and head.sources["emg"].live,
            )
        if maxima is not None and not decoder.outside:
            decode = partial(self._decode, _block_meter(feed, maxima, bus))
            feed.bus.subscribe(EmgSamples, decode, vital=True)

    def contact(self, recorded: Contact) -> Contact | None:
        """Return what a recorded contact is now, measured or as recorded; ``None`` where its picture is left out."""
        again = None if self._fingers is None else self._fingers.at(recorded)
        # Of contacts before the recording's beginning there are no pictures.
        return again if self.again and recorded.taken_ns >= self._from_ns else recorded

    def intent(self, recorded: Intent) -> Intent | None:
        """Return what a recorded intent is now; ``None`` where its samples are left out."""
        return self._intents.at(recorded.t_ns) if self._decodes else recorded

    def _decode(self, muscles: BlockMeter, given: EmgSamples) -> None:
        try:
            intents = muscles.take(chunk_of(given))
        except TegaError:
            return
        if self._decodes:
            self._intents.rows.extend(intents)


def finger_meter(head: Head, finger: str) -> FrameMeter:
    """Make the meter of a finger's pictures, as in the run."""
    config, baseline = head.config, head.baselines[finger]
    with with_attached(config.stages, head.files) as stages:
        maxima = head.calibration.touch(finger)
        metric = finger_metric(stages, config.session.preset, finger, baseline, maxima)
    # A picture out of a JPEG has no bits of its own to compare with the one before.
    return FrameMeter(baseline, metric, SourceReport(), live=head.sources[finger].live and head.lossless)


def measure(meter: FrameMeter, picture: Picture) -> Contact | None:
    """Measure a recorded picture as in the run; see :meth:`~tega.loop.inbox.frames.FrameMeter.take`.

    A picture out of a JPEG is measured by its cells where they are recorded and the metric reads no more.
    """
    meter.metric.loaded = picture.loaded
    if picture.rezeroed:
        meter.metric.rezero()
    if picture.cells and meter.metric.reads_sums:
        return meter.take_sums(picture.seq, picture.t_ns, read_sums(picture.cells))
    return meter.take(frame_of(picture))


def _block_meter(feed: RecordFeed, maxima: EmgMaxima, bus: Bus) -> BlockMeter:
    """Make the meter of EMG samples, with the adaptation of the run and its switches as the run read them."""
    head, config, adaptation = feed.head, feed.head.config, None
    if config.stages.adaptation.on:
        # One is recorded after the samples that it is for.
        switches = read_switches(feed.beforehand(AdaptationSwitch))
        adaptation = ChannelAdaptation(
            maxima, config.stages.adaptation, switches=switches, notify=bus.publish
        )
    with with_attached(config.stages, head.files) as stages:
        decoder = muscle_decoder(stages, config.session.preset, maxima)
    return BlockMeter(
        decoder, SourceReport(), maxima=maxima, live=head.sources["emg"].live, adaptation=adaptation
    )
