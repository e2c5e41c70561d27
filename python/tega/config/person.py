"""Apply calibrations to a run: a person's used records, the refused ones and the warnings; a vest's motor onset."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime, timedelta
from statistics import median
from typing import Any, Final, NamedTuple

import msgspec

from tega.config import CalibrationConfig, EmgConfig, SessionConfig
from tega.config.calibration.folder import CalibrationFolder, Part, device_name, part_of
from tega.config.calibration.records import ArmRecord, EmgRecord, TouchRecord, VestCalibration
from tega.config.calibration.store import Calibration, EmgMaxima, TouchMaxima, refused_law
from tega.devices.base import DeviceInfo, EmgSource, Kind, TactileSource
from tega.devices.registry import driver_class
from tega.errors import CalibrationError, TegaError

# By 5 % a rate is another than the one calibrated with: the same limit as for a device that lies about its rate.
_RATE_TOLERANCE = 0.05
# A record older than this is warned of, hours.
_BASELINE_OLD_H, _TOUCH_OLD_H, _EMG_OLD_H, _VEST_OLD_H, _HEADING_OLD_H = 24.0, 720.0, 12.0, 2160.0, 12.0
_FRAME_S = 1.0
_NOT_SETTINGS = {"port", "baud", "measure_s", "silence_s", "start_s", "channels", "rate_hz", "by", "value"}


class Personal(NamedTuple):
    """Calibration of a run from a person's records; ``name`` is that of the maxima's origin.

    ``warnings`` name records that are old, missing or were stored in spite of a problem, one sentence each.
    """

    calibration: Calibration
    name: str
    warnings: tuple[str, ...]


def calibrate_command(settings: str, person: str, part: Part | None = None, *, refresh: bool = False) -> str:
    """Return the command that makes a calibration, as it is typed."""
    only = f" --only {'tactile' if part == 'touch' else part}" if part else ""
    return f"tega-teleop calibrate {settings} --person {person}{only}{' --refresh' if refresh else ''}"


def whose(config: CalibrationConfig) -> tuple[str, CalibrationFolder]:
    """Return person and folder of some settings; ``CalibrationError`` if they do not name both."""
    if config.person is None or config.folder is None:
        raise CalibrationError("no person is named", "set calibration.person, or run with --person")
    return config.person, CalibrationFolder(config.folder)


def driver_settings(config: EmgConfig) -> str:
    """Return the driver's options that change the numbers, in one fixed order."""
    options = msgspec.to_builtins(config.options) if isinstance(config.options, msgspec.Struct) else {}
    return ", ".join(f"{k}={v}" for k, v in sorted(options.items()) if k not in _NOT_SETTINGS)


def other_conditions(record: EmgRecord, **today: object) -> str:
    """Return the first condition that differs from that of the muscles' calibration; ``""`` for none."""
    for name, now in today.items():
        if (then := getattr(record, name)) != now:
            return f"EMG: {record.person} was calibrated with {name} = {_text(then)}, the settings have {_text(now)}"
    return ""


def _text(value: object) -> str:
    return ", ".join(map(str, value)) if isinstance(value, tuple) else str(value)


class PersonRecords:
    """The records of the person that some settings name, as a run with these would use them.

    ``settings`` is how the settings file is named in the commands that are suggested; ``now`` is for ages.
    Raises ``CalibrationError`` if the settings do not name person and folder.
    """

    def __init__(self, config: SessionConfig, *, settings: str, now: datetime) -> None:
        self.person, self.folder = whose(config.calibration)
        self._config, self._settings, self._now = config, settings, now
        self._live = config.session.preset == "live"

    def command(self, part: Part | None = None, *, refresh: bool = False) -> str:
        """Return the command that makes the calibration, as it is typed."""
        return calibrate_command(self._settings, self.person, part, refresh=refresh)

    def calibration(
        self, sources: Mapping[str, TactileSource], emg: EmgSource | None, conditions: EmgMaxima | None
    ) -> Personal:
        """Take the maxima for the devices of a run; the sources, by finger, and ``emg`` are open.

        ``conditions`` are those that the EMG's calibration depends on. Raises ``CalibrationError`` if a record
        is missing, or was made for another person, device or way of measuring; the hint is the command to run.
        """
        config, warnings, fingers = self._config, list[str](), dict[str, TouchMaxima]()
        for finger, source in sources.items():
            record = self.needed(TouchRecord, source.info, f"finger {finger!r}")
            self._check_size(record, source, finger)
            fingers[finger] = record.live if self._live else record.paper
            warnings += self.touch_warnings(finger, record)
        muscles = None
        if emg is not None and conditions is not None and config.emg is not None:
            kept = self.needed(EmgRecord, emg.info, "EMG")
            self._check_emg(kept, conditions, config.emg)
            maxima = kept.live_max if self._live else kept.paper_max
            muscles = msgspec.structs.replace(conditions, maxima=maxima)
            warnings += self.emg_warnings(kept)
        warnings += self.vest_warnings()
        tracker = tracker_info(config)
        arm = None if tracker is None else self.folder.record(self.person, ArmRecord, device_name(tracker))
        if arm is not None:  # a headset that was restarted may define forward differently
            warnings += self._old("arm: forward", arm.made, _HEADING_OLD_H, self.command("arm"))
        name = f"calibration of {self.person}"
        calibration = Calibration(preset=config.session.preset, origin=name, tactile=fingers, emg=muscles)
        return Personal(calibration, name, tuple(warnings))

    def needed(self, wanted: type[Any], info: DeviceInfo, subject: str) -> Any:
        """Return a record that a run needs, or say what there is instead."""
        part, person = part_of(wanted), self.person
        if not info.live:
            raise CalibrationError(
                f"{subject}: {info.label} is not a live device, so {person} has no calibration for it",
                "leave calibration.person out, or name calibration.file",
            )
        device = device_name(info)
        try:
            record = self.folder.record(person, wanted, device)
        except CalibrationError as error:
            raise CalibrationError(f"{subject}: {error.message}", self.command(part)) from error
        if record is None:
            instead = self.folder.others(person, part, device)
            text = f"{subject}: {person} has no calibration on {device}{f' ({instead})' if instead else ''}"
            raise CalibrationError(text, self.command(part))
        return record

    def _check_size(self, record: TouchRecord, source: TactileSource, finger: str) -> None:
        frame = source.read(_FRAME_S)
        if frame is None:  # no picture just now; the run says so
            return
        height, width = frame.image.shape[:2]
        if (width, height) != (record.width_px, record.height_px):
            raise CalibrationError(
                f"finger {finger!r}: {record.person} was calibrated with pictures of "
                f"{record.width_px}×{record.height_px}, the sensor gives {width}×{height}",
                self.command("touch"),
            )

    def _check_emg(self, record: EmgRecord, now: EmgMaxima, config: EmgConfig) -> None:
        text = other_conditions(
            record,
            driver=config.driver,
            kind=now.kind,
            channels=now.channels,
            tau_samples=now.tau,
            settings=driver_settings(config),
        )
        if abs(record.rate_hz / now.rate_hz - 1) > _RATE_TOLERANCE:
            text = text or (
                f"EMG: {record.person} was calibrated at {record.rate_hz:g} samples/s, the run has {now.rate_hz:g}"
            )
        lengths = {len(record.live_max), len(record.paper_max), len(record.channels)}
        if len(lengths) > 1 or min(*record.live_max, *record.paper_max) <= 0:
            text = text or f"EMG: the record of {record.person} does not have one maximum above 0 per channel"
        if text:
            raise CalibrationError(text, self.command("emg"))

    def touch_warnings(self, finger: str, record: TouchRecord) -> list[str]:
        """Warn if a fingertip's maxima or baseline are old, and repeat their notes."""
        command = self.command("touch")
        warnings = self._old(f"{finger}: maxima", record.made, _TOUCH_OLD_H, command)
        baseline = self._config.tactile[finger].baseline
        newest = next((g for g in self.folder.gels(record.device) if g.picture == baseline), None)
        if newest is not None:
            made, refresh = newest.record.made, self.command(refresh=True)
            warnings += self._old(f"{finger}: baseline", made, _BASELINE_OLD_H, refresh)
            warnings += [f"{finger}: {note}" for note in newest.record.notes]
        warnings += refused_law(finger, record.live, command)
        return warnings + [f"{finger}: {note}" for note in record.notes]

    def emg_warnings(self, record: EmgRecord) -> list[str]:
        """Warn if rest and maxima of the muscles are old, and repeat their notes."""
        made = max(record.made, record.refreshed or record.made)
        warnings = self._old("EMG", made, _EMG_OLD_H, self.command(refresh=True))
        return warnings + [f"EMG calibration: {note}" for note in record.notes]

    def vest_warnings(self) -> list[str]:
        """Say that a vest's thresholds are old or not known: a run without them shows the law's own intensities."""
        vest, info = self._config.vest, live_info(self._config.vest, "vest")
        if info is None or not self._live:
            return []
        person, device, command = self.person, device_name(info), self.command("vest")
        record = self.folder.record(person, VestCalibration, device)
        if record is None:
            if (vest.threshold, vest.step) != (0.0, 1.0):
                return []  # given in the settings
            instead = self.folder.others(person, "vest", device)
            text = f"vest: {person}'s threshold on {device} is not known{f' ({instead})' if instead else ''}"
            return [f"{text}, so weak touch may not be felt: {command}"]
        warnings = self._old("vest", record.made, _VEST_OLD_H, command)
        if record.layout != (vest.layout or "x40"):
            warnings.append(f"vest: {person}'s threshold was found with layout {record.layout}: {command}")
        return warnings + [f"vest: {note}" for note in record.notes]

    def _old(self, subject: str, made: datetime, limit_h: float, command: str) -> list[str]:
        hours = (self._now - made) / timedelta(hours=1)
        if hours <= limit_h:
            return []
        text = f"{hours:.0f} hours" if hours < 72 else f"{hours / 24:.0f} days"
        return [f"{subject}: {text} old, warned of after {limit_h:g} hours: {command}"]


def tracker_info(config: SessionConfig) -> DeviceInfo | None:
    """Return the description of the tracker that leads the arm of some settings, if it is a real one."""
    return None if config.arm is None else live_info(config.arm.tracker, "tracker")


def live_info(section: Any, kind: Kind) -> DeviceInfo | None:
    """Return the description of the device that a table of the settings names, if it is a real one."""
    info = closed_info(section, kind)
    return info if info is not None and info.live else None


def closed_info(section: Any, kind: Kind) -> DeviceInfo | None:
    """Return the description that a device gives while it is closed; ``None`` where a table names none."""
    if section is None or section.driver is None:
        return None
    try:
        info: DeviceInfo = driver_class(section.driver, kind)(section.options).info
    except TegaError:  # it needs to be opened, or a package is missing; the run will say so
        return None
    return info


ONSET_STAGE: Final = "motor onset"
"""How the stage's name begins in a recording; the day it was measured follows."""


class MotorOnset(NamedTuple):
    """Measured time from the hand-over of a frame to a vest's first vibration.

    ``made`` is the day of the oldest of these measurements, such as ``2026-11-21``; ``uncertainty_ms`` is how
    far it may be off, by the clock of the recordings.
    """

    ms: float
    device: str
    motors: tuple[int, ...]
    made: str
    uncertainty_ms: float

    @property
    def stage(self) -> str:
        """Name of the onset in a table of stages."""
        return f"{ONSET_STAGE}, measured {self.made}"

    @property
    def words(self) -> str:
        """The onset in one line of words."""
        which = "motor" if len(self.motors) == 1 else "motors"
        return (
            f"{self.stage}: {self.ms:.0f} ms ± {self.uncertainty_ms:.0f} "
            f"({which} {', '.join(map(str, self.motors))} of {self.device}); in the stage 'skin'"
        )


def motor_onset(config: SessionConfig) -> MotorOnset | None:
    """Return the measured onset of the settings' vest, from ``calibration.folder``; ``None`` for none."""
    vest, folder = config.vest, config.calibration.folder
    if vest.driver is None or folder is None:
        return None
    info = closed_info(vest, "vest")
    records = [] if info is None else CalibrationFolder(folder).onsets(device_name(info))
    if not records:
        return None
    return MotorOnset(
        ms=median(record.onset_ms for record in records),
        device=records[0].device,
        motors=tuple(record.motor for record in records),
        made=f"{min(record.made for record in records):%Y-%m-%d}",
        uncertainty_ms=max(record.clock_uncertainty_ms for record in records),
    )
