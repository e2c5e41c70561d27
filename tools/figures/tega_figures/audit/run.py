"""Audit a recording: several readings on the same pictures, samples and contacts."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import msgspec

from tega.config import check_tree
from tega.config.choose import chosen_stage
from tega.errors import ConfigError, RecordingError
from tega.runtime.files.foreign_file import reports_damage
from tega_figures.audit.emg import EmgScore, emg_scores
from tega_figures.audit.recordings import AuditMaterial, EmgColumns, read_material, recordings_of
from tega_figures.audit.touch import FingerAudit, FingerReading, TouchScore
from tega_figures.audit.truth import Forces, Mark, PictureTruth, mask_of, read_mask
from tega_figures.audit.variants import (
    READINGS,
    Kind,
    SettingSweep,
    Variant,
    kind_of,
    named_variants,
    sweep_variants,
)
from tega_figures.audit.vest import VestScore, vest_score

if TYPE_CHECKING:
    from tega.config import SessionConfig
    from tega.config.calibration import Calibration
    from tega.devices.base import EmgChunk, TactileFrame
    from tega.records import Contact


class AuditRequest(NamedTuple):
    """Readings to compare, and what they are judged by.

    Attributes:
        of: Touch, EMG, vest; empty means what the sweep is of, else what the recording holds.
        names: Readings of :data:`tega_figures.audit.READINGS`; empty means all.
        sweep: One setting over a range of values, instead of named readings.
        sets: Settings of every reading, as ``key=value``.
        marks: Marked circles by the pictures' names; ``None`` without. Pictures without one are left out.
        masks: Folder of masks, named as of :func:`~tega_figures.audit.truth.mask_of`; likewise.
        forces: Measured forces; likewise.
        separate: Whether every picture is of a press of its own.
    """

    of: tuple[Kind, ...] = ()
    names: tuple[str, ...] = ()
    sweep: SettingSweep | None = None
    sets: tuple[str, ...] = ()
    preset: str | None = None
    marks: dict[str, Mark] | None = None
    masks: Path | None = None
    forces: Forces | None = None
    separate: bool = False


class AuditReport(msgspec.Struct, frozen=True, kw_only=True):
    """Scores of the readings on one recording: one a reading, in ``touch`` one a reading and finger.

    ``sweep`` is the setting that was swept, ``""`` for named readings. ``n_left_out`` counts pictures without
    marks, masks or forces, which were not judged.
    """

    recording: str
    sweep: str = ""
    n_left_out: int = 0
    touch: list[TouchScore] = []
    emg: list[EmgScore] = []
    vest: list[VestScore] = []


class Audited(NamedTuple):
    """A report and, by finger, what was seen, from which pictures of it are drawn."""

    report: AuditReport
    fingers: dict[str, FingerAudit]


def audit_recording(
    path: Path,
    requested: AuditRequest = AuditRequest(),  # noqa: B008  # immutable
    *,
    baseline: Path | None = None,
    emg: EmgColumns | None = None,
    progress: Callable[[str, int, int], None] = lambda _subject, _done, _total: None,
) -> list[Audited]:
    """Compare readings on recordings; return one result a recording, in order.

    ``path`` is a folder of pictures, a video, a file of EMG samples, a recording of a session, or a session's
    folder. ``baseline`` is a picture of the untouched gel of loose pictures; ``emg`` is what a file of EMG
    samples does not state. ``progress`` receives how many pictures are read. A recording that holds nothing
    of what is asked for raises :class:`RecordingError`; a reading or a setting that is not known or does not
    fit, :class:`ConfigError`.
    """
    found = []
    for one in recordings_of(path):
        # What a session's records lead to is damage of that file; others have their own readers.
        audited = reports_damage(_audited) if one.suffix == ".mcap" else _audited
        found.append(audited(one, requested, baseline, emg, progress))
    return found


def _audited(
    path: Path,
    requested: AuditRequest,
    baseline: Path | None,
    emg: EmgColumns | None,
    progress: Callable[[str, int, int], None],
) -> Audited:
    audit = _Audit(path, requested)
    read_material(path, audit, preset=requested.preset, baseline=baseline, emg=emg, progress=progress)
    return audit.finished()


class _Audit:
    """What becomes of one recording."""

    def __init__(self, path: Path, requested: AuditRequest) -> None:
        self._path, self._name, self._requested = path, path.name, requested
        self._material = AuditMaterial({}, {})
        self._variants: dict[Kind, list[Variant]] = {}
        self._fingers: dict[str, FingerAudit] = {}
        self._displayed: dict[tuple[str, str], FingerReading] = {}
        self._chunks: list[EmgChunk] = []
        self._recorded: dict[str, list[Contact]] = {}
        self._n_passed = 0

    def begin(self, material: AuditMaterial) -> bool:
        """Make the readings; return whether pictures are wanted."""
        self._material = material
        requested = self._requested
        for kind in self._kinds():
            if requested.sweep is not None:
                self._variants[kind] = sweep_variants(material.tree, requested.sweep, sets=requested.sets)
            else:
                names = tuple(name for name in requested.names if name in READINGS[kind])
                self._variants[kind] = named_variants(material.tree, kind, names, sets=requested.sets)
        for finger, still in material.baselines.items():
            readings = [self._reading(variant, finger) for variant in self._variants.get("touch", [])]
            for variant in self._variants.get("vest", []):
                key = finger, _metric(variant.config)
                if key not in self._displayed and not self._as_recorded(variant.config):
                    self._displayed[key] = self._reading(variant, finger)
            self._fingers[finger] = FingerAudit(readings, still, live=material.live)
        return bool(self._variants.get("touch") or self._displayed)

    def frame(self, finger: str, frame: TactileFrame, *, loaded: bool) -> None:
        """Measure a picture with every reading, where what is to be known of it is known."""
        truth = self._truth(frame)
        if truth is None:
            self._n_passed += 1
            return
        self._fingers[finger].take(frame, truth, loaded=loaded)
        for (whose, _), reading in self._displayed.items():
            if whose == finger:
                reading.take(frame, loaded=loaded)

    def chunk(self, chunk: EmgChunk) -> None:
        """Keep EMG samples."""
        if "emg" in self._variants:
            self._chunks.append(chunk)

    def contacts(self, contacts: dict[str, list[Contact]]) -> None:
        """Keep what the run measured."""
        self._recorded = contacts

    def finished(self) -> Audited:
        """Return how every reading behaved."""
        requested, material = self._requested, self._material
        seen = {finger: audit for finger, audit in self._fingers.items() if audit.press}
        if self._n_passed and not seen:
            raise RecordingError(
                f"{self._name}: no picture has what --marks, --masks or --forces tell",
                "name them as the pictures are",
            )
        emg: list[EmgScore] = []
        if material.muscles is not None and "emg" in self._variants:
            emg = emg_scores(
                self._variants["emg"], self._chunks, material.muscles, requested.forces, live=material.live
            )
        report = AuditReport(
            recording=self._name,
            sweep="" if requested.sweep is None else requested.sweep.key,
            n_left_out=self._n_passed,
            touch=[score for audit in seen.values() for score in audit.scores()],
            emg=emg,
            vest=[self._vest(variant) for variant in self._variants.get("vest", [])],
        )
        return Audited(report, seen)

    def _kinds(self) -> tuple[Kind, ...]:
        requested, material = self._requested, self._material
        held: dict[Kind, bool] = {
            "touch": bool(material.baselines),
            "emg": material.muscles is not None,
            "vest": bool(material.baselines),
        }
        wanted = requested.of
        if not wanted and requested.sweep is not None:
            wanted = (kind_of(requested.sweep.key),)
        elif not wanted and requested.names:
            meant = tuple(kind for kind in READINGS if set(requested.names) & set(READINGS[kind]))
            wanted = tuple(kind for kind in meant if held[kind]) or meant
        for name in requested.names:
            if not any(name in READINGS[kind] for kind in wanted or READINGS):
                known = "; ".join(name for kind in wanted or READINGS for name in READINGS[kind])
                raise ConfigError(f"reading {name!r} is not known", f"choose from {known}")
        if not wanted:
            # The vest of loose pictures is shown when it is asked for: nobody wore one.
            return tuple(kind for kind in READINGS if held[kind] and (kind != "vest" or material.measured))
        for kind in wanted:
            if not held[kind]:
                has = ", ".join(one for one in READINGS if held[one])
                raise RecordingError(f"{self._name}: holds nothing to audit {kind} on", f"it holds {has}")
        return wanted

    def _reading(self, variant: Variant, finger: str) -> FingerReading:
        still = self._material.baselines[finger]
        return FingerReading(
            variant, finger, still, self._material.calibration, separate=self._requested.separate
        )

    def _as_recorded(self, config: SessionConfig) -> bool:
        """Whether the contacts of the run are what these settings measure."""
        if not self._material.measured:
            return False
        return _metric(config) == _metric(check_tree(self._material.tree, {}, base=Path.cwd()).config)

    def _vest(self, variant: Variant) -> VestScore:
        calibration: Calibration | None = None
        contacts: dict[str, list[Contact]] = {}
        if self._as_recorded(variant.config):
            calibration = self._material.calibration
            contacts |= self._recorded
        else:
            for finger in self._material.baselines:
                contacts[finger] = self._displayed[finger, _metric(variant.config)].contacts
        baselines = self._material.baselines
        return vest_score(variant, contacts, calibration, baselines, self._requested.forces)

    def _truth(self, frame: TactileFrame) -> PictureTruth | None:
        """Return what is known of a picture; ``None`` for one that is to be left out."""
        requested = self._requested
        mark = None if requested.marks is None else requested.marks.get(frame.name)
        force_n = (
            None
            if requested.forces is None
            else requested.forces.of_picture(frame.name, frame.seq, frame.t_ns)
        )
        if (requested.marks is not None and mark is None) or (
            requested.forces is not None and force_n is None
        ):
            return None
        shape = frame.image.shape[:2]
        drawn = None if mark is None else mark.distance(shape) <= 1
        if requested.masks is not None:
            path = mask_of(self._path / frame.name, requested.masks)
            if path is None:
                return None
            drawn = read_mask(path, shape)
        return PictureTruth(drawn, force_n, mark)


def _metric(config: SessionConfig) -> str:
    """Return the metric of settings and all that decides what it measures."""
    chosen: Any = chosen_stage("metric", config.stages, config.session.preset)
    return f"{chosen.name} {chosen.kind.version} {chosen.options!r}"
