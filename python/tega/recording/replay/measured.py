"""Measure a recording's raw streams again, and pair the results with when the loop took them in."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec

from tega.arm.settings import ArmSettings
from tega.config import STAGE_GROUPS, load_config
from tega.config.attached import with_attached
from tega.config.calibration import load_calibration
from tega.config.choose import (
    Chosen,
    chosen_stage,
    finger_metric,
    is_outside,
    metric_told,
    muscle_decoder,
)
from tega.errors import TegaError
from tega.loop.beside import look_on
from tega.loop.emg_adaptation import ChannelAdaptation, read_switches
from tega.loop.inbox.frames import FrameMeter
from tega.loop.inbox.sources import BlockMeter, SourceReport, picture_of, samples_of
from tega.recording.replay.arm import arm_settings
from tega.recording.replay.feed import Newest
from tega.recording.replay.head import Head, without_devices
from tega.records import Contact, Intent
from tega.records.bus import Bus
from tega.stages.base import MeasuredPicture

if TYPE_CHECKING:
    from tega.config import SessionConfig
    from tega.config.calibration import Calibration, EmgMaxima
    from tega.devices.base import EmgChunk, TactileFrame


class Measured:
    """Measures the raw streams of a recording again; its methods are for ``read_recorded``.

    Args:
        other: Settings that replace the run's preset, calibration, kind of EMG, vest and hand.
        sets: Single settings that do, as ``key=value``: preset, stages, vest, hand.
        bus: Here the output of what comes before the loop is published: adaptations, stages beside the connected ones,
            and each picture that is measured as in the run.

    Attributes:
        checked: Called for every lossless picture: finger, stamp, checksum as recorded, checksum now.
        config: The settings of the run, as changed.
        calibration: Maxima of the run, as changed.
        contacts: By finger, as a live loop would get them.
        intents: Intents, as a live loop would get them.
        arm: Settings of the arm's chain, as changed.
        metric: Metric that measures the pictures.
        decodes: Whether the intents are those of the samples here, not of an operator's station or another program.
        same_metric: Whether the recording's contacts were measured by this version of it.
        changed: Settings that differ from the run's own, in words.
        again: Whether measuring the frames again gives the recorded contacts to the last bit: the frames are unchanged,
            the metric has the version that measured them, and either the recording begins with the session or the
            metric has no memory.
    """

    def __init__(self, other: Path | None = None, sets: Sequence[str] = (), bus: Bus | None = None) -> None:
        self._other, self._sets = other, tuple(sets)
        self._bus = Bus() if bus is None else bus
        self.checked: Callable[[str, int, int, int], None] = lambda _finger, _t_ns, _then, _now: None
        self.config: SessionConfig
        self.calibration: Calibration
        self.contacts: dict[str, Newest[Contact]] = {}
        self.intents: Newest[Intent] = Newest()
        self.changed: list[str] = []
        self.arm = ArmSettings()
        self.metric: Chosen
        self.same_metric = self.again = True
        self.decodes = self._beside = False
        self._exact = self._lossless = False
        self._meters: dict[str, FrameMeter] = {}
        self._muscles: BlockMeter | None = None

    def begin(self, head: Head) -> None:
        """Read the head, known before the first frame."""
        self.config, self.calibration, self.arm = head.config, head.calibration, arm_settings(head)
        kind = head.tree.get("emg", {}).get("kind", "raw")
        if self._other is not None or self._sets:
            kind = self._change(head, kind)
        kept = head.files if self._other is None else {}
        for finger, baseline in head.baselines.items():
            # A picture out of a JPEG has no bits of its own to compare with the one before.
            live = head.sources[finger].live and head.lossless
            preset, maxima = self.config.session.preset, self.calibration.touch(finger)
            with with_attached(self.config.stages, kept) as stages:
                metric = finger_metric(stages, preset, finger, baseline, maxima)
            self._meters[finger] = FrameMeter(baseline, metric, SourceReport(), live=live)
            self.contacts[finger] = Newest()
        self.metric = chosen_stage("metric", self.config.stages, self.config.session.preset)
        now = metric_told(self.config.stages, self.config.session.preset)
        then = head.facts.get("metric", f"{self.metric.name} 1")
        self.same_metric = then == now or then.partition(" ")[0] != self.metric.name
        self._lossless = head.lossless
        self._exact = self._lossless and self.same_metric
        self.again = self._exact and (head.from_ns == 0 or not self.metric.kind.memory)
        if not self.same_metric:
            self.changed.append(f"metric: {then} -> {now}, so contacts are those recorded")
        emg = self.calibration.emg
        outside = chosen_stage("decoder", self.config.stages, self.config.session.preset).kind.outside
        self.decodes = "emg" in head.sources and not outside and head.sources["emg"].unit != "level"
        if "emg" in head.sources and emg is not None and not outside:
            used = msgspec.structs.replace(emg, kind=kind)
            with with_attached(self.config.stages, kept) as stages:
                decoder = muscle_decoder(stages, self.config.session.preset, used)
            self._muscles = BlockMeter(
                decoder,
                SourceReport(),
                maxima=used,
                live=head.sources["emg"].live,
                adaptation=self._adaptation(head, used),
            )
        self._look_on(head, None if emg is None else msgspec.structs.replace(emg, kind=kind))

    def _adaptation(self, head: Head, used: EmgMaxima) -> ChannelAdaptation | None:
        """Make the adaptation of the run, with its switches as the run read them."""
        settings = self.config.stages.adaptation
        if not settings.on:
            return None
        return ChannelAdaptation(
            used, settings, switches=read_switches(head.switches), tell=self._bus.publish
        )

    def _look_on(self, head: Head, muscles: EmgMaxima | None) -> None:
        """Have the stages beside the connected ones look on again."""
        beside = tuple(one for one in self.config.stages.beside if not is_outside(one))
        if not beside:
            return
        self._beside = True
        stages = msgspec.structs.replace(self.config.stages, beside=beside)
        with ExitStack() as stack:  # nothing in it has a thread of its own
            look_on(
                stack,
                msgspec.structs.replace(self.config, stages=stages),
                self._bus,
                baselines=head.baselines,
                touch=self.calibration.touch,
                muscles=muscles if "emg" in head.sources else None,
                live="emg" in head.sources and head.sources["emg"].live,
            )

    def _change(self, head: Head, kind: str) -> Any:
        """Apply and note the other settings for the computation."""
        if self._other is None:
            other = without_devices(head.tree, self._sets)
        else:
            other = load_config(self._other, sets=self._sets).config
        if other.calibration.file is not None:
            self.calibration = load_calibration(other.calibration.file)
            if self.calibration != head.calibration:
                self.changed.append(f"calibration: {other.calibration.file.name}")
        vest = msgspec.structs.replace(other.vest, driver=None, options={})
        hand = msgspec.structs.replace(other.hand, driver=None, options={})
        adapted = other.stages.adaptation
        for name, old, new in (
            ("session.preset", head.config.session.preset, other.session.preset),
            ("emg.kind", kind, kind if other.emg is None else other.emg.kind),
            *((f"vest.{f}", getattr(head.config.vest, f), getattr(vest, f)) for f in vest.__struct_fields__),
            *((f"stages.{f}", _told(head.config, f), _told(other, f)) for f in STAGE_GROUPS),
            *(
                (f"stages.adaptation.{f}", getattr(head.config.stages.adaptation, f), getattr(adapted, f))
                for f in adapted.__struct_fields__
            ),
            *(
                (f"stages.reflex.{f}", getattr(head.config.stages.reflex, f), getattr(other.stages.reflex, f))
                for f in other.stages.reflex.__struct_fields__
            ),
            *((f"hand.{f}", getattr(head.config.hand, f), getattr(hand, f)) for f in hand.__struct_fields__),
        ):
            if old != new:
                self.changed.append(f"{name}: {old} -> {new}")
        if other.arm is not None and "arm" in head.tree:
            for name in ArmSettings.__struct_fields__:
                old, new = getattr(self.arm, name), getattr(other.arm.chain, name)
                fields = (f for f in old.__struct_fields__ if getattr(old, f) != getattr(new, f))
                self.changed += [f"arm.{name}.{f}: {getattr(old, f)} -> {getattr(new, f)}" for f in fields]
            self.arm = other.arm.chain
        session = msgspec.structs.replace(head.config.session, preset=other.session.preset)
        self.config = msgspec.structs.replace(
            head.config, session=session, vest=vest, hand=hand, stages=other.stages
        )
        return kind if other.emg is None else other.emg.kind

    def frame(self, finger: str, frame: TactileFrame, told: Any) -> None:
        """Measure a picture; if it is lossless, compare its checksum with the one it had when it was taken."""
        if self._beside:
            self._bus.publish(picture_of(finger, frame))
        if self._lossless:
            self.checked(finger, frame.t_ns, told.pixels_crc32, zlib.crc32(frame.image.data))
        meter = self._meters[finger]
        meter.metric.loaded = getattr(told, "loaded", False)  # earlier recordings do not say
        if getattr(told, "rezeroed", False):
            meter.metric.rezero()
        try:
            contact = meter.take(frame)
        except TegaError:  # a bad picture of a live sensor, dropped then as now
            return
        if contact is not None:
            self.contacts[finger].rows.append(contact)
            # Else the contacts are those recorded, and this is not what they were measured in.
            if self._exact and self._bus.wants(MeasuredPicture):
                self._bus.publish(MeasuredPicture(image=frame.image, contact=contact, metric=meter.metric))

    def chunk(self, chunk: EmgChunk) -> None:
        """Take EMG samples."""
        if self._beside:
            self._bus.publish(samples_of(chunk, live=False, start_ns=0))
        if self._muscles is None:
            return
        try:
            self.intents.rows.extend(self._muscles.take(chunk))
        except TegaError:
            return


def _told(config: SessionConfig, group: Any) -> str:
    """Return a stage of the settings in words."""
    chosen = chosen_stage(group, config.stages, config.session.preset)
    options = ", ".join(f"{k} {v}" for k, v in msgspec.to_builtins(chosen.options, enc_hook=str).items())
    return f"{chosen.name} ({options})" if options else chosen.name
