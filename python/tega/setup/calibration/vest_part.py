"""Calibrate the vest for a person: places, thresholds, steps, and a look at the result."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import msgspec

from tega.config import DEFAULT_LAYOUT
from tega.config.calibration.folder import device_name
from tega.config.calibration.records import VestCalibration
from tega.config.calibration.wearing import middle_sites, site_face
from tega.config.choose import chosen_stage
from tega.config.person_settings import felt_by
from tega.devices.base import Device, VestSink
from tega.errors import CalibrationError, ConfigError
from tega.haptics import FeltMap, Layout
from tega.loop.worn_vest import worn_vest
from tega.runtime.guide import Undecided
from tega.setup.calibration.sitting import Journal, Sitting
from tega.setup.calibration.staircase import LEVEL_PERCENT, TOP_LEVEL, highest_level
from tega.setup.calibration.steps_vest import FeltSite, Pulses, VestSteps
from tega.stages.equal_steps import EqualStepsMapping


class VestChoices(NamedTuple):
    """How a vest is calibrated; nothing stronger than ``ceiling_percent`` is shown.

    ``each_motor`` asks about every motor, not about columns; ``each_step`` looks for the step at every column
    or motor, not at one of each face. ``seed`` is that of the order in which the columns are shown.
    """

    ceiling_percent: int = 60
    each_motor: bool = False
    each_step: bool = False
    seed: int = 0


class _Places(msgspec.Struct, frozen=True, kw_only=True):
    n_right: int
    n_asked: int
    notes: tuple[str, ...] = ()


class _KeptSites(dict[str, FeltSite]):
    """Results by site; each is written at once."""

    def __init__(self, journal: Journal, step: str) -> None:
        super().__init__(journal.kept(step, dict[str, FeltSite]) or {})
        self._write: Callable[[], None] = lambda: journal.keep(step, dict(self))

    def __setitem__(self, site: str, found: FeltSite) -> None:
        super().__setitem__(site, found)
        self._write()


def calibrate_vest(sitting: Sitting, journal: Journal, choices: VestChoices, place: str) -> VestCalibration:
    """Calibrate the vest of the settings, which must name one."""
    section, guide = sitting.config.vest, sitting.guide
    if section.driver is None:
        raise ConfigError("no vest: vest.driver is not set", "set it, such as bhaptics-player")
    limit = min(choices.ceiling_percent, getattr(section.options, "limit", 100))
    if highest_level(limit) < 2:
        raise CalibrationError(
            f"vest: a ceiling of {limit} % leaves no levels to look for",
            "raise --ceiling or vest.options.limit",
        )
    guide.part(
        f"Vest{place}",
        f"Where columns are felt, from which level on, and which increase is noticed. Nothing above {limit} %."
        + drawing(sitting, "vest"),
    )
    try:
        with worn_vest(section, sitting.folder.person(sitting.person) / "vest-dose.json") as vest:
            check_live(vest)
            return _record(vest, sitting, journal, choices, limit)
    except Undecided:
        raise CalibrationError(
            "vest: its questions need a person to answer them",
            "run it without --yes, or with --only tactile or emg",
        ) from None


def _record(
    vest: VestSink, sitting: Sitting, journal: Journal, choices: VestChoices, limit: int
) -> VestCalibration:
    """Lead through the steps on an open vest; steps that are done are left out."""
    config, guide = sitting.config, sitting.guide
    layout: Layout = config.vest.layout or DEFAULT_LAYOUT[config.session.preset]
    pulses = Pulses(vest, layout=layout, ceiling=highest_level(limit), times=sitting.times)
    lead = VestSteps(pulses, guide, seed=choices.seed)

    def places() -> _Places:
        wearing, notes = lead.places()
        return _Places(n_right=wearing.n_right, n_asked=wearing.n_asked, notes=notes)

    where = journal.step("vest.places", _Places, places)
    sites = pulses.sites(each_motor=choices.each_motor)
    thresholds, steps = _KeptSites(journal, "vest.threshold"), _KeptSites(journal, "vest.step")
    guide.ready("Say each time whether you feel it; it will be faint, and sometimes there is nothing")
    lead.thresholds(sites, thresholds)
    if not any(felt.level for felt in thresholds.values()):
        journal.forget("vest.threshold")
        raise CalibrationError(
            f"vest: nothing was felt up to {limit} %",
            "is it switched on and tight? then the same command again, or with a higher --ceiling",
        )
    guide.ready("Now two vibrations each time: say which is the stronger one")
    requested = sites
    if not choices.each_step:
        requested = middle_sites({site: felt.level for site, felt in thresholds.items()})
    lead.steps(requested, thresholds, steps)
    record = VestCalibration(
        person=sitting.person,
        device=device_name(vest.info),
        driver=vest.info.driver,
        made=sitting.now(),
        notes=where.notes,
        layout=layout,
        ceiling_percent=limit,
        sites=sites,
        threshold_percent=tuple(
            float(LEVEL_PERCENT[thresholds[s].level]) if thresholds[s].level else -1.0 for s in sites
        ),
        step_percent=tuple(_step_percent(s, thresholds, steps) for s in sites),
        step_sites=tuple(steps),
        named_right=where.n_right,
        named=where.n_asked,
        false_alarms=sum(felt.n_false for felt in (*thresholds.values(), *steps.values())),
    )
    if chosen_stage("mapping", config.stages, config.session.preset).kind is EqualStepsMapping:
        threshold, step = felt_by(record)
        lead.show(FeltMap(threshold=threshold, step=step))
    return record


def _step_percent(site: str, thresholds: Mapping[str, FeltSite], steps: Mapping[str, FeltSite]) -> float:
    """Return a site's step, or that of its face where only that was looked for; -1 where there is none."""
    measured = steps.get(site) or next((f for s, f in steps.items() if site_face(s) == site_face(site)), None)
    if measured is None or not measured.level or not thresholds[site].level:
        return -1.0
    return round(100 * measured.level / TOP_LEVEL, 2)


def drawing(sitting: Sitting, subject: str) -> str:
    """Return a sentence that names the drawing of the placement, for a person with a known hand."""
    hand = sitting.folder.hand(sitting.person)
    left = "-left" if hand == "left" else ""
    return f" For a {hand} hand: docs/images/placement-{subject}{left}.svg." if hand else ""


def check_live(device: Device) -> None:
    """Refuse a device that generates or replays its signal."""
    if not device.info.live:
        raise CalibrationError(
            f"{device.info.driver}: {device.info.label} generates or replays its signal and cannot be calibrated",
            "name a live device in the settings",
        )
