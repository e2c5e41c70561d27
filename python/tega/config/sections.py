"""Define a session's settings: one structure a table of the file, with every default and limit.

How they are read, checked and overridden is :mod:`tega.config.load`.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec

from tega.arm.pose import Pose
from tega.arm.settings import (
    ArmSettings,
    FilterSettings,
    GateSettings,
    LimitSettings,
    MappingSettings,
    WatchdogSettings,
)
from tega.arm.workspace import Workspace
from tega.config.fingers import FingerName
from tega.config.stage_sections import Section, StagesSection
from tega.errors import ConfigError
from tega.haptics import Layout
from tega.safety.states import SafetySection

Pace = Literal["steady", "by-frame"]

DEFAULT_LAYOUT: dict[str, Layout] = {"paper": "paper32", "live": "x40"}
"""The vest's layout where the settings name none, by preset."""

DEFAULT_PACE: dict[str, Pace] = {"paper": "steady", "live": "by-frame"}
"""The vest's pace where the settings name none, by preset."""


class SessionSection(Section, frozen=True):
    """The run as a whole.

    Attributes:
        preset: ``paper`` (the paper's equations with minimal safeguards) or ``live`` (for people).
        pace: ``real`` waits for the clock, ``fast`` runs recordings as fast as they can be computed.
        out_dir: Folder for the outputs; none means nothing is written.
        duration_s: Stop after this long; none means when the last recording ends, or never.
        pose_base: Number of the most open level in pictures and summaries: 1 as in Eq 11 and the tables, 0 as in Fig 8.
        realtime: Ask the system to give the threads of a live run priority; see :mod:`tega.runtime.threads`.
        emulated: The devices are emulators, so a study takes the session as a rehearsal only.
    """

    preset: Literal["paper", "live"] = "live"
    pace: Literal["real", "fast"] = "real"
    out_dir: Path | None = None
    duration_s: Annotated[float, msgspec.Meta(gt=0, le=1e6)] | None = None
    realtime: bool = True
    emulated: bool = False
    pose_base: Literal[0, 1] = 1


class CalibrationConfig(Section, frozen=True):
    """Origin of baselines, maxima and the wearer's thresholds.

    Attributes:
        file: A file of maxima; none means those of ``person``, or, for recordings only, of the recording itself, which
            is not causal.
        person: Person with the calibration to use, as stored by ``tega-teleop calibrate``.
        folder: Where it keeps them; none means ``calibrations`` beside the settings file.
    """

    file: Path | None = None
    person: str | None = None
    folder: Path | None = None


class TactileConfig(Section, frozen=True):
    """One fingertip's sensor.

    Attributes:
        driver: Name of a tactile driver.
        baseline: Picture of the untouched gel (an image or ``.npy``); none means it is estimated from the
            recording's quietest frames.
        options: The driver's own settings.
    """

    driver: str
    baseline: Path | None = None
    options: Any = msgspec.field(default_factory=dict)


class EmgConfig(Section, frozen=True):
    """The muscle signal.

    Attributes:
        driver: Name of an EMG driver.
        kind: Kind of the samples: ``raw`` (offset removed and rectified here), ``rectified`` or ``envelope``.
        muscles: Muscle under each channel, for the texts of a calibration; none means ECR, FCU, FDS if there are
            three.
        options: The driver's own settings.
    """

    driver: str
    kind: Literal["raw", "rectified", "envelope"]
    muscles: tuple[str, ...] = ()
    options: Any = msgspec.field(default_factory=dict)


_Threshold = Annotated[float, msgspec.Meta(ge=0, le=99)]
_EachThreshold = Annotated[tuple[_Threshold, ...], msgspec.Meta(min_length=40, max_length=40)]
_Step = Annotated[float, msgspec.Meta(gt=0, le=100)]
_EachStep = Annotated[tuple[_Step, ...], msgspec.Meta(min_length=40, max_length=40)]


class VestConfig(Section, frozen=True):
    """The vest.

    Attributes:
        driver: Name of a vest driver; none means the frames are only recorded.
        layout: Where the motors are: ``paper32``, ``x40``, ``x16`` or another of the stages' group ``tega.layouts``;
            none means the preset's own.
        rate_hz: Refreshes per second.
        pace: ``steady`` makes frames at the refreshes only, ``by-frame`` also whenever a frame of a live fingertip
            changes the vest's output; none means the preset's own.
        keep_alive_s: A frame equal to the last one sent is sent to a real vest again after this long at the latest;
            0 sends every frame. It stays well below the 200 ms after which a vest has to fall silent by itself.
        mirror: ``back`` reverses the back's columns, ``all`` both faces' (a left hand, or a mirrored vest).
        threshold: The lowest intensity that this person feels, percent: one number, or 40 in the wearer's order.
        step: The smallest increase that this person notices, percent: one number, or 40 in the wearer's order. See
            ``tega.haptics.FeltMap``.
        options: The driver's own settings.
    """

    driver: str | None = None
    layout: str | None = None
    rate_hz: Annotated[float, msgspec.Meta(gt=0, le=100)] = 30.0
    pace: Pace | None = None
    keep_alive_s: Annotated[float, msgspec.Meta(ge=0, le=0.15)] = 0.1
    mirror: Literal["none", "back", "all"] = "none"
    threshold: _Threshold | _EachThreshold = 0.0
    step: _Step | _EachStep = 1.0
    options: Any = msgspec.field(default_factory=dict)


class HandConfig(Section, frozen=True):
    """The robot hand.

    Attributes:
        driver: Name of a hand driver; none means the frames are only recorded.
        device_id: The hand's number on its bus, where the driver has no option of that name.
        options: The driver's own settings.
    """

    driver: str | None = None
    device_id: Annotated[int, msgspec.Meta(ge=0, le=3)] = 0
    options: Any = msgspec.field(default_factory=dict)


class InputConfig(Section, frozen=True):
    """An operator's input device.

    Attributes:
        driver: Name of an input driver.
        button: Button of the device, for ``dead_man`` and ``marker``; none means any.
        options: The driver's own settings.
    """

    driver: str
    button: str | None = None
    options: Any = msgspec.field(default_factory=dict)


class InputSection(Section, frozen=True):
    """The operator's input devices, by purpose.

    Attributes:
        motion: Six axes that are to move the arm.
        dead_man: A switch that is held as long as things may move.
        clutch: A switch that is held as long as the arm follows; without one the dead-man is it.
        recover: A button that says, with the dead-man let go, that the arm may go on after a fault or a stop.
        marker: A switch that marks a moment.
        undo: A button that undoes the online adaptation of EMG; pressing it again restarts the adaptation.
        rezero: A button that has every finger take a new baseline, while nothing touches; a finger refuses while
            another one bears a load.
        reflex: A button that takes the reflex's authority away; pressed again, gives it back.
    """

    motion: InputConfig | None = None
    dead_man: InputConfig | None = None
    clutch: InputConfig | None = None
    recover: InputConfig | None = None
    marker: InputConfig | None = None
    undo: InputConfig | None = None
    rezero: InputConfig | None = None
    reflex: InputConfig | None = None

    def in_use(self) -> dict[str, InputConfig]:
        """Return the inputs that have a device."""
        return {seat: c for seat in self.__struct_fields__ if (c := getattr(self, seat)) is not None}


class TrackerConfig(Section, frozen=True):
    """The tracker that sees the operator's forearm.

    Attributes:
        driver: Name of a tracker's driver.
        options: The driver's own settings.
    """

    driver: str
    options: Any = msgspec.field(default_factory=dict)


class ArmConfig(Section, frozen=True):
    """The robot's arm; needs ``input.dead_man``.

    Attributes:
        driver: Name of an arm's driver.
        tracker: Tracker of the forearm; none means that ``input.motion`` is summed up.
        rate_hz: Commands a second.
        gate: Conditions for accepting a pose; these five are those of :mod:`tega.arm.settings`.
        mapping: How motion of the forearm becomes motion of the target.
        filter: The One-Euro filter.
        limits: Where the target may be and how it may move.
        watchdog: Times without news, and their consequences.
        start_m: Where the hand goes between a study's trials, base's axes; none leaves it where it is.
        start_xyzw: How it is turned there; the default has its z along the base's x.
        options: The driver's own settings.
    """

    driver: str
    tracker: TrackerConfig | None = None
    rate_hz: Annotated[float, msgspec.Meta(ge=30, le=500)] = 100.0
    gate: GateSettings = GateSettings()
    mapping: MappingSettings = MappingSettings()
    filter: FilterSettings = FilterSettings()
    limits: LimitSettings = LimitSettings()
    watchdog: WatchdogSettings = WatchdogSettings()
    start_m: tuple[float, float, float] | None = None
    start_xyzw: tuple[float, float, float, float] = (0.0, 0.7071067811865476, 0.0, 0.7071067811865476)
    options: Any = msgspec.field(default_factory=dict)

    @property
    def start(self) -> Pose | None:
        """Where the hand goes between trials, if anywhere; ``ConfigError`` for no pose or one outside the workspace."""
        import math

        import numpy as np

        if self.start_m is None:
            return None
        size = math.hypot(*self.start_xyzw)
        if not (math.isfinite(size) and abs(size - 1) < 1e-3):
            raise ConfigError(f"arm.start_xyzw has length {size:.4g}, not 1", "give x, y, z, w of a turn")
        if not all(map(math.isfinite, self.start_m)):
            raise ConfigError(f"arm.start_m = {self.start_m} is no place", "give x, y, z in metres")
        start = Pose(np.array(self.start_m), np.array(self.start_xyzw) / size)
        if outside := Workspace(self.limits).outside(start):
            raise ConfigError(f"arm.start_m, arm.start_xyzw: {outside}", "change it, or arm.limits")
        return start

    @property
    def chain(self) -> ArmSettings:
        """The settings of the chain."""
        return ArmSettings(
            gate=self.gate,
            mapping=self.mapping,
            filter=self.filter,
            limits=self.limits,
            watchdog=self.watchdog,
        )


class RecordingSection(Section, frozen=True):
    """The recording of a run; needs the extra ``record``.

    Attributes:
        dir: Folder of the session, to which every run adds a file; none means nothing is recorded.
        lossless: Pictures as they are, so that a replay computes the same bits; otherwise as JPEG, and beside one of
            320 x 240 pixels the sums over cells that the metric ``live`` reads.
        jpeg_quality: 1 to 100.
        queue_mib: Maximum size of the data waiting to be encoded, and the same again for the disk; beyond it frames
            are dropped and counted.
        warn_free_mib: A disk with less room than this is warned of.
        stop_free_mib: With less room than this the recording is finished, and the run goes on without.
    """

    dir: Path | None = None
    lossless: bool = False
    jpeg_quality: Annotated[int, msgspec.Meta(ge=1, le=100)] = 95
    queue_mib: Annotated[float, msgspec.Meta(gt=0, le=65536)] = 128.0
    warn_free_mib: Annotated[float, msgspec.Meta(ge=0)] = 2048.0
    stop_free_mib: Annotated[float, msgspec.Meta(ge=0)] = 256.0


class SessionConfig(Section, frozen=True):
    """All settings of a session, checked, with absolute paths and typed driver options.

    ``tactile`` holds the fingertips' sensors by finger, those of the vest's default columns first; a finger that is
    not named has no sensor. ``guests`` holds the tables of features by their key in the file; only those that were
    given.
    """

    session: SessionSection = SessionSection()
    calibration: CalibrationConfig = CalibrationConfig()
    tactile: dict[FingerName, TactileConfig] = msgspec.field(default_factory=dict)
    emg: EmgConfig | None = None
    vest: VestConfig = VestConfig()
    hand: HandConfig = HandConfig()
    stages: StagesSection = StagesSection()
    input: InputSection = InputSection()
    arm: ArmConfig | None = None
    recording: RecordingSection = RecordingSection()
    safety: SafetySection = SafetySection()
    guests: dict[str, Any] = msgspec.field(default_factory=dict)
