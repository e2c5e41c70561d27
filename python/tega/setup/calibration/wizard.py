"""Run a whole calibration: choose its steps, leave out those that are done, and write the records."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

import msgspec

from tega.config import EmgConfig, SessionConfig, TactileConfig, TrackerConfig
from tega.config.calibration.folder import device_name
from tega.config.calibration.records import (
    ArmRecord,
    EmgRecord,
    GelRecord,
    TouchRecord,
    VestCalibration,
    read_record,
)
from tega.config.choose import block_s
from tega.config.person import closed_info, driver_settings
from tega.devices.registry import driver_class
from tega.errors import ConfigError
from tega.loop.maxima import emg_conditions
from tega.runtime.files.foreign_file import path_below
from tega.runtime.opencv import read_image
from tega.setup.calibration.effort import Maxima, Quiet
from tega.setup.calibration.presses import Ball
from tega.setup.calibration.sitting import Journal, Sitting, check_live, drawing
from tega.setup.calibration.steps_arm import take_base_yaw, take_heading
from tega.setup.calibration.steps_emg import MuscleSteps, muscle_names
from tega.setup.calibration.steps_touch import TakenBaseline, take_baseline, take_presses
from tega.setup.calibration.steps_vest import VestChoices, calibrate_vest

Only = Literal["tactile", "emg", "vest", "arm"]


class _KeptBaseline(msgspec.Struct, frozen=True):
    file: str


def _tracker_of(config: SessionConfig) -> TrackerConfig | None:
    """Return the forearm's tracker: the arm's, or that of a guest's table, as an operator's station has it."""
    trackers = (getattr(table, "tracker", None) for table in (config.arm, *config.guests.values()))
    return next((tracker for tracker in trackers if tracker is not None), None)


def parts_of(config: SessionConfig, only: Sequence[Only] = ()) -> tuple[str, ...]:
    """Return the parts to calibrate: ``tactile.thumb``, ``emg``, ``vest``, ``arm``; no ``only`` means all."""
    have = [f"tactile.{finger}" for finger in config.tactile]
    have += ["emg"] if config.emg is not None else []
    have += ["vest"] if config.vest.driver is not None else []
    have += ["arm"] if _tracker_of(config) is not None else []
    for subject in only:
        if not any(part.startswith(subject) for part in have):
            raise ConfigError(
                f"--only {subject}: the settings have no [{'arm.tracker' if subject == 'arm' else subject}] device",
                f"they have {', '.join(have) or 'no device; to detect some: tega-teleop init'}",
            )
    wanted = tuple(part for part in have if not only or part.split(".")[0] in only)
    if not wanted:
        raise ConfigError(
            "nothing to calibrate: the settings name no device", "set [tactile.thumb], [emg] or [vest]"
        )
    return wanted


class Calibrating:
    """Calibrates the devices of some settings for one person, step by step.

    The result of each step is stored at once. An interrupted calibration can be continued within four hours.
    """

    def __init__(
        self, sitting: Sitting, *, vest: VestChoices | None = None, ball: Ball | None = None
    ) -> None:
        self._sitting, self._vest_choices, self._ball = sitting, vest or VestChoices(), ball
        self._config, self._guide, self._folder = sitting.config, sitting.guide, sitting.folder
        self._journal = Journal(sitting)
        self._place = ""
        self.files: list[Path] = []
        self.left: list[str] = []

    def run(self, parts: Sequence[str], *, restart: bool = False) -> None:
        """Do all steps that are not done; finished ones stay if the person stops (``KeyboardInterrupt``)."""
        if text := self._journal.begin({part: self._device(part) for part in parts}, restart=restart):
            self._guide.say(text)
        self.left = [part for part in parts if part not in self.done]
        if parts and not self.left:
            self._guide.say("All steps are done already; use --restart to start again", tone="warn")
        for part in list(self.left):
            self._place = f" ({list(parts).index(part) + 1} of {len(parts)})"
            file = self._folder.keep(self._part(part))
            self.files.append(file)
            self._journal.keep(part, self._folder.named(file))
            self.left.remove(part)
            self._guide.say(f"kept: {self._folder.named(file)}", tone="good")
        self._journal.end()

    @property
    def done(self) -> tuple[str, ...]:
        """The steps that are finished."""
        return self._journal.done

    def _section(self, part: str) -> Any:
        kind, _, finger = part.partition(".")
        if kind == "tactile":
            return self._config.tactile[finger]
        if kind == "arm":
            return _tracker_of(self._config)
        return getattr(self._config, kind)

    def _device(self, part: str) -> str:
        kind: Any = part.partition(".")[0]
        info = closed_info(self._section(part), "tracker" if kind == "arm" else kind)
        return "" if info is None else device_name(info)

    def _part(self, part: str) -> TouchRecord | EmgRecord | ArmRecord | VestCalibration:
        if part == "vest":
            return calibrate_vest(self._sitting, self._journal, self._vest_choices, self._place)
        section = self._section(part)
        if part == "emg":
            return self._emg(section)
        return self._arm(section) if part == "arm" else self._finger(part, section)

    def _begin(self, title: str, why: str) -> None:
        self._guide.part(f"{title}{self._place}", why)

    def _finger(self, part: str, section: TactileConfig) -> TouchRecord:
        finger, step = part.removeprefix("tactile."), f"{part}.baseline"
        self._begin(
            f"Fingertip: {finger}",
            "A baseline frame of the untouched gel, then firm presses with something round and with something flat: "
            "they set the vest's full strength.",
        )
        with driver_class(section.driver, "tactile")(section.options) as source:
            check_live(source)
            taken = self._baseline(step)
            if taken is None:
                taken = take_baseline(finger, source, self._sitting)
                self._journal.keep(step, _KeptBaseline(self._folder.named(taken.file)))
            return take_presses(finger, source, taken, self._sitting, self._ball)

    def _baseline(self, step: str) -> TakenBaseline | None:
        """Return the baseline that was taken before an interruption."""
        kept = self._journal.kept(step, _KeptBaseline)
        if kept is None:
            return None
        path = path_below(self._folder.path, kept.file, subject="picture", source="unfinished.json")
        if not path.is_file():
            return None
        record = read_record(path.with_suffix(".toml"), GelRecord)
        return TakenBaseline(read_image(path, driver="calibrate"), path, record)

    def _emg(self, section: EmgConfig) -> EmgRecord:
        self._begin(
            "Muscles",
            "Rest, three strong squeezes with pauses, then each muscle alone: they set zero and full effort, and "
            "check that each electrode sits on its muscle." + drawing(self._sitting, "emg"),
        )
        with driver_class(section.driver, "emg")(section.options) as source:
            check_live(source)
            chain = emg_conditions(source, section.kind, block_s=block_s(self._config))
            muscles = muscle_names(section, chain.channels)
            steps = MuscleSteps(source, chain, self._guide, self._sitting.times)
            quiet = self._journal.step("emg.rest", Quiet, steps.rest)
            maxima = self._journal.step("emg.squeezes", Maxima, lambda: steps.squeezes(quiet))
            answers, notes = steps.muscles(muscles, quiet, maxima)
            return EmgRecord(
                person=self._sitting.person,
                device=device_name(source.info),
                driver=source.info.driver,
                made=self._sitting.now(),
                notes=(*quiet.notes, *maxima.notes, *notes),
                kind=chain.kind,
                rate_hz=chain.rate_hz,
                tau_samples=chain.tau,
                settings=driver_settings(section),
                unit=source.info.unit,
                channels=chain.channels,
                muscles=muscles,
                offset=quiet.offset,
                rest=quiet.rest,
                live_max=maxima.live,
                paper_max=maxima.paper,
                answers=answers,
            )

    def _arm(self, section: TrackerConfig) -> ArmRecord:
        self._begin(
            "Forearm",
            "Which way is forward for you: two movements of the forearm, the second of which checks the first; and "
            "which way the robot's base points. No robot is opened, and nothing moves.",
        )
        with driver_class(section.driver, "tracker")(section.options) as tracker:
            check_live(tracker)
            yaw_rad, check = take_heading(tracker, self._guide)
            arm = self._config.arm
            reported_rad = 0.0 if arm is None else arm.mapping.base_yaw_rad
            base_yaw_rad = take_base_yaw(tracker, self._guide, yaw_rad=yaw_rad, reported_rad=reported_rad)
            if arm is None:
                values = f"yaw_rad = {yaw_rad}, base_yaw_rad = {base_yaw_rad}"
                self._guide.say(f"The robot's file needs both, in [arm.mapping]: {values}")
            return ArmRecord(
                person=self._sitting.person,
                device=device_name(tracker.info),
                driver=tracker.info.driver,
                made=self._sitting.now(),
                frame=tracker.frame,
                yaw_rad=yaw_rad,
                off_rad=round(check.off_rad, 4),
                base_yaw_rad=base_yaw_rad,
            )
