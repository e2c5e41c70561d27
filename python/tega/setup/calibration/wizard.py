"""Run a whole calibration: choose its steps, leave out those that are done, and write the records."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeVar

import msgspec

from tega.config import DEFAULT_LAYOUT, EmgConfig, SessionConfig, TactileConfig
from tega.config.calibration.folder import CalibrationFolder, Unfinished, device_name
from tega.config.calibration.known_press import Ball
from tega.config.calibration.records import (
    ArmRecord,
    EmgRecord,
    GelRecord,
    TouchRecord,
    VestCalibration,
    read_record,
)
from tega.config.calibration.wearing import middle_sites, site_face
from tega.config.choose import block_s, chosen_stage
from tega.config.person import closed_info, felt_by
from tega.config.sections import TrackerConfig
from tega.devices.registry import driver_class
from tega.errors import CalibrationError, ConfigError
from tega.haptics import FeltMap
from tega.loop.worn_vest import worn_vest
from tega.runtime.files.plain_name import path_below
from tega.runtime.guide import Guide, Undecided
from tega.runtime.opencv import read_image
from tega.setup.calibration.staircase import LEVEL_PERCENT, TOP_LEVEL, highest_level
from tega.setup.calibration.steps_arm import take_base_yaw, take_heading
from tega.setup.calibration.steps_emg import (
    Maxima,
    Quiet,
    chain_of,
    emg_record,
    muscle_names,
    take_muscles,
    take_rest,
    take_squeezes,
)
from tega.setup.calibration.steps_touch import TakenBaseline, take_baseline, take_presses
from tega.setup.calibration.steps_vest import (
    FeltSite,
    Pulses,
    show_steps,
    take_steps,
    take_thresholds,
    take_wearing,
)
from tega.setup.calibration.times import Times
from tega.stages.equal_steps import EqualStepsMapping

if TYPE_CHECKING:
    from tega.devices.base import Device
    from tega.haptics import Layout


Only = Literal["tactile", "emg", "vest", "arm"]
_KINDS: dict[str, Literal["tactile", "emg", "vest", "tracker"]] = {
    "tactile": "tactile",
    "emg": "emg",
    "vest": "vest",
    "arm": "tracker",
}

_Result = TypeVar("_Result", bound=msgspec.Struct)
_Kept = TypeVar("_Kept")


class _KeptBaseline(msgspec.Struct, frozen=True):
    file: str
    made: datetime
    notes: tuple[str, ...]


def parts_of(config: SessionConfig, only: Sequence[Only] = ()) -> tuple[str, ...]:
    """Return the parts of a calibration: ``tactile.thumb``, ``emg``, ``vest``, ``arm``.

    Args:
        config: The settings.
        only: The parts to calibrate; empty for all that the settings have.

    Raises:
        ConfigError: A part is not in the settings, or there is none to calibrate.
    """
    have = [f"tactile.{finger}" for finger in config.tactile.in_use()]
    have += ["emg"] if config.emg is not None else []
    have += ["vest"] if config.vest.driver is not None else []
    have += ["arm"] if config.arm is not None and config.arm.tracker is not None else []
    for subject in only:
        if not any(part.startswith(subject) for part in have):
            raise ConfigError(
                f"--only {subject}: the settings have no [{'arm.tracker' if subject == 'arm' else subject}] device",
                f"they have {', '.join(have)}",
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

    Args:
        config: The settings.
        person: Name of the person.
        folder: Folder of the calibration.
        guide: Shows and asks.
        times: Durations of the steps.
        now: Returns the time of day.
        ceiling_percent: Nothing stronger is shown on the vest.
        each_motor: Ask about every motor of the vest, not about its columns.
        each_step: Look for the step at every column or motor, not at one of each face.
        ball: Known ball and force, to fit each gel's depth and stiffness.
        seed: Seed of the order in which the vest's columns are shown.
    """

    def __init__(
        self,
        config: SessionConfig,
        person: str,
        folder: CalibrationFolder,
        guide: Guide,
        *,
        times: Times,
        now: Callable[[], datetime],
        ceiling_percent: int = 60,
        each_motor: bool = False,
        each_step: bool = False,
        ball: Ball | None = None,
        seed: int = 0,
    ) -> None:
        self._ball = ball
        self._config = config
        self._person = person
        self._folder = folder
        self._guide = guide
        self._times = times
        self._now = now
        self._ceiling_percent = ceiling_percent
        self._each_motor = each_motor
        self._each_step = each_step
        self._seed = seed
        self._unfinished = Unfinished(started=now())
        self._place = ""
        self.files: list[Path] = []
        self.left: list[str] = []

    def run(self, parts: Sequence[str], *, restart: bool = False) -> None:
        """Do all steps that are not done.

        Args:
            parts: As :func:`parts_of` gives them.
            restart: Forget an interrupted calibration.

        Raises:
            CalibrationError: A step cannot be finished, and there is no answer about it.
            DeviceUnavailableError: A device is missing or went away.
            KeyboardInterrupt: The person stopped; finished steps are kept.
        """
        before = None if restart else self._folder.unfinished(self._person, self._now())
        if before is not None:
            self._unfinished = before
        for part in parts:
            device = self._device(part)
            if self._unfinished.devices.get(part, device) != device:
                self._unfinished.steps = {
                    k: v
                    for k, v in self._unfinished.steps.items()
                    if k != part and not k.startswith(f"{part}.")
                }
            self._unfinished.devices[part] = device
        done = [part for part in parts if part in self._unfinished.steps]
        self.left = [part for part in parts if part not in done]
        if before is not None:
            steps = ", ".join(self._unfinished.steps) or "nothing"
            self._guide.say(
                f"Going on with the calibration begun at {before.started:%H:%M} UTC; done: {steps}"
            )
        if done and not self.left:
            self._guide.say("All steps are done already; use --restart to start again", tone="warn")
        self._folder.keep_unfinished(self._person, self._unfinished)
        for part in list(self.left):
            self._place = f" ({list(parts).index(part) + 1} of {len(parts)})"
            file = self._part(part)
            self.files.append(file)
            self._keep(part, self._folder.named(file))
            self.left.remove(part)
            self._guide.say(f"kept: {self._folder.named(file)}", tone="good")
        self._folder.forget_unfinished(self._person)

    def _device(self, part: str) -> str:
        kind, _, finger = part.partition(".")
        config = self._config
        tracker = None if config.arm is None else config.arm.tracker
        section: Any = {"emg": config.emg, "vest": config.vest, "arm": tracker}.get(
            kind
        ) or config.tactile.in_use()[finger]
        info = closed_info(section.driver, _KINDS[kind], section.options)
        return "" if info is None else device_name(info)

    @property
    def done(self) -> tuple[str, ...]:
        """The steps that are finished."""
        return tuple(self._unfinished.steps)

    def _part(self, part: str) -> Path:
        if part.startswith("tactile."):
            finger = part.removeprefix("tactile.")
            return self._folder.keep(self._finger(finger, self._config.tactile.in_use()[finger]))
        if part == "emg" and self._config.emg is not None:
            return self._folder.keep(self._emg(self._config.emg))
        if part == "arm" and self._config.arm is not None and self._config.arm.tracker is not None:
            return self._folder.keep(self._arm(self._config.arm.tracker))
        return self._folder.keep(self._vest())

    # Fingertips.

    def _finger(self, finger: str, section: TactileConfig) -> TouchRecord:
        self._guide.part(
            f"Fingertip: {finger}{self._place}",
            "A baseline frame of the untouched gel, then firm presses with something round and with something flat: "
            "they set the vest's full strength.",
        )
        with driver_class(section.driver, "tactile")(section.options) as source:
            _check_live(source)
            step = f"tactile.{finger}.baseline"
            taken = self._baseline(step)
            if taken is None:
                taken = take_baseline(finger, source, self._folder, self._guide, self._times, now=self._now())
                kept = _KeptBaseline(self._folder.named(taken.file), taken.made, taken.notes)
                self._keep(step, msgspec.to_builtins(kept))
            return take_presses(
                finger,
                source,
                taken,
                self._guide,
                self._times,
                person=self._person,
                folder=self._folder,
                now=self._now(),
                ball=self._ball,
            )

    def _baseline(self, step: str) -> TakenBaseline | None:
        """Return the baseline that was taken before an interruption."""
        kept = self._kept(step, _KeptBaseline)
        if kept is None:
            return None
        path = path_below(self._folder.path, kept.file, subject="picture", source="unfinished.json")
        if not path.is_file():
            return None
        picture = read_image(path, driver="calibrate")
        noise = read_record(path.with_suffix(".toml"), GelRecord).cell_noise_counts
        return TakenBaseline(picture, path, kept.made, kept.notes, noise)

    # Muscles.

    def _emg(self, section: EmgConfig) -> EmgRecord:
        self._guide.part(
            f"Muscles{self._place}",
            "Rest, three strong squeezes with pauses, then each muscle alone: they set zero and full effort, and "
            "check that each electrode sits on its muscle." + self._drawing("emg"),
        )
        with driver_class(section.driver, "emg")(section.options) as source:
            _check_live(source)
            chain = chain_of(source, section, block_s=block_s(self._config))
            muscles = muscle_names(section, chain.channels)
            guide, times = self._guide, self._times
            quiet = self._step("emg.rest", Quiet, lambda: take_rest(source, chain, guide, times))
            maxima = self._step(
                "emg.squeezes", Maxima, lambda: take_squeezes(source, chain, quiet, guide, times)
            )
            answers, notes = take_muscles(source, chain, muscles, guide, times, quiet=quiet, maxima=maxima)
            return emg_record(
                source,
                section,
                chain,
                quiet=quiet,
                maxima=maxima,
                answers=answers,
                person=self._person,
                notes=notes,
                now=self._now(),
            )

    def _drawing(self, subject: str) -> str:
        """Return the drawing of the placement, for a person with a known hand."""
        hand = self._folder.hand(self._person)
        left = "-left" if hand == "left" else ""
        return f" For a {hand} hand: docs/images/placement-{subject}{left}.svg." if hand else ""

    # Vest.

    def _vest(self) -> VestCalibration:
        section, guide = self._config.vest, self._guide
        if section.driver is None:
            raise ConfigError("no vest: vest.driver is not set", "set it, such as bhaptics-player")
        layout: Layout = section.layout or DEFAULT_LAYOUT[self._config.session.preset]
        limit = min(self._ceiling_percent, getattr(section.options, "limit", 100))
        ceiling = highest_level(limit)
        if ceiling < 2:
            raise CalibrationError(
                f"vest: a ceiling of {limit} % leaves no levels to look for",
                "raise --ceiling or vest.options.limit",
            )
        self._guide.part(
            f"Vest{self._place}",
            f"Where columns are felt, from which level on, and which increase is noticed. Nothing above {limit} %."
            + self._drawing("vest"),
        )
        try:
            with worn_vest(section, self._folder.person(self._person) / "vest-dose.json") as vest:
                _check_live(vest)
                pulses = Pulses(vest, layout=layout, ceiling=ceiling, times=self._times)
                where = self._step("vest.places", _Places, lambda: self._places(pulses))
                sites = pulses.sites(each_motor=self._each_motor)
                thresholds = self._felt("vest.threshold")
                guide.ready(
                    "Say each time whether you feel it; it will be faint, and sometimes there is nothing"
                )
                take_thresholds(
                    pulses, sites, thresholds, guide, keep=self._keeper("vest.threshold", thresholds)
                )
                if not any(felt.level for felt in thresholds.values()):
                    self._forget("vest.threshold")
                    raise CalibrationError(
                        f"vest: nothing was felt up to {limit} %",
                        "is it switched on and tight? then the same command again, or with a higher --ceiling",
                    )
                steps = self._felt("vest.step")
                guide.ready("Now two vibrations each time: say which is the stronger one")
                requested = sites
                if not self._each_step:
                    requested = middle_sites({site: felt.level for site, felt in thresholds.items()})
                take_steps(
                    pulses,
                    requested,
                    thresholds,
                    steps,
                    guide,
                    keep=self._keeper("vest.step", steps),
                    seed=self._seed,
                )
                record = VestCalibration(
                    person=self._person,
                    device=device_name(vest.info),
                    driver=vest.info.driver,
                    made=self._now(),
                    notes=where.notes,
                    layout=layout,
                    ceiling_percent=limit,
                    sites=sites,
                    threshold_percent=tuple(
                        float(LEVEL_PERCENT[thresholds[s].level]) if thresholds[s].level else -1.0
                        for s in sites
                    ),
                    step_percent=tuple(_step_percent(s, thresholds, steps) for s in sites),
                    step_sites=tuple(steps),
                    named_right=where.n_right,
                    named=where.n_asked,
                    false_alarms=sum(felt.n_false for felt in (*thresholds.values(), *steps.values())),
                )
                mapping = chosen_stage("mapping", self._config.stages, self._config.session.preset)
                if mapping.kind is EqualStepsMapping:
                    threshold, step = felt_by(record)
                    show_steps(pulses, guide, FeltMap(threshold=threshold, step=step))
        except Undecided:
            raise CalibrationError(
                "vest: its questions need a person to answer them",
                "run it without --yes, or with --only tactile or emg",
            ) from None
        return record

    def _places(self, pulses: Pulses) -> _Places:
        wearing, notes = take_wearing(pulses, self._guide, seed=self._seed)
        return _Places(n_right=wearing.n_right, n_asked=wearing.n_asked, notes=notes)

    def _felt(self, step: str) -> dict[str, FeltSite]:
        return self._kept(step, dict[str, FeltSite]) or {}

    def _keeper(self, step: str, felt: dict[str, FeltSite]) -> Callable[[str, FeltSite], None]:
        def keep(site: str, found: FeltSite) -> None:
            felt[site] = found
            self._keep(step, {s: msgspec.to_builtins(f) for s, f in felt.items()})

        return keep

    # Forearm.

    def _arm(self, section: TrackerConfig) -> ArmRecord:
        self._guide.part(
            f"Forearm{self._place}",
            "Which way is forward for you: two movements of the forearm, the second of which checks the first; and "
            "which way the robot's base points. No robot is opened, and nothing moves.",
        )
        with driver_class(section.driver, "tracker")(section.options) as tracker:
            _check_live(tracker)
            taken = take_heading(tracker, self._guide)
            assert taken.check is not None
            arm = self._config.arm
            reported_rad = 0.0 if arm is None else arm.mapping.base_yaw_rad
            base_yaw_rad = take_base_yaw(
                tracker, self._guide, yaw_rad=taken.yaw_rad, reported_rad=reported_rad
            )
            return ArmRecord(
                person=self._person,
                device=device_name(tracker.info),
                driver=tracker.info.driver,
                made=self._now(),
                frame=tracker.frame,
                yaw_rad=taken.yaw_rad,
                off_rad=round(taken.check.off_rad, 4),
                base_yaw_rad=base_yaw_rad,
            )

    # What is done is kept.

    def _kept(self, name: str, wanted: type[_Kept]) -> _Kept | None:
        """Return the result of a step from before an interruption; ``None`` if it was not done."""
        if name not in self._unfinished.steps:
            return None
        try:
            return msgspec.convert(self._unfinished.steps[name], wanted)
        except msgspec.ValidationError as error:
            raise CalibrationError(
                f"unfinished.json: its entry for the step {name} is damaged: {error}",
                "start again: tega-teleop calibrate --restart",
            ) from error

    def _step(self, name: str, wanted: type[_Result], take: Callable[[], _Result]) -> _Result:
        kept = self._kept(name, wanted)
        if kept is not None:
            return kept
        result = take()
        self._keep(name, msgspec.to_builtins(result))
        return result

    def _forget(self, name: str) -> None:
        self._unfinished.steps.pop(name, None)
        self._folder.keep_unfinished(self._person, self._unfinished)

    def _keep(self, name: str, result: Any) -> None:
        self._unfinished.steps[name] = result
        self._folder.keep_unfinished(self._person, self._unfinished)


def _step_percent(site: str, thresholds: Mapping[str, FeltSite], steps: Mapping[str, FeltSite]) -> float:
    """Return a site's step, or that of its face where only that was looked for; -1 where there is none."""
    measured = steps.get(site) or next((f for s, f in steps.items() if site_face(s) == site_face(site)), None)
    if measured is None or not measured.level or not thresholds[site].level:
        return -1.0
    return round(100 * measured.level / TOP_LEVEL, 2)


class _Places(msgspec.Struct, frozen=True, kw_only=True):
    n_right: int
    n_asked: int
    notes: tuple[str, ...] = ()


def _check_live(device: Device) -> None:
    if not device.info.live:
        raise CalibrationError(
            f"{device.info.driver}: {device.info.label} generates or replays its signal and cannot be calibrated",
            "name a live device in the settings",
        )
