"""Calibrate the vest in steps: where its columns are felt, from which level on, which increase is noticed.

Nothing is shown above the ceiling, and after every vibration, answer, error or interruption the vest is at zero.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping
from functools import partial
from typing import NamedTuple

import msgspec

from tega.config import DEFAULT_LAYOUT
from tega.config.calibration import TouchMaxima
from tega.config.calibration.folder import device_name
from tega.config.calibration.records import VestCalibration
from tega.config.calibration.wearing import (
    Wearing,
    judge_wearing,
    middle_sites,
    site_face,
    site_place,
)
from tega.config.choose import chosen_stage
from tega.config.person_settings import felt_by
from tega.devices.base import VestSink
from tega.errors import CalibrationError
from tega.haptics import FINGERS, FeltMap, Layout
from tega.loop.touch import TouchLoop
from tega.loop.worn_vest import worn_vest
from tega.records import Contact
from tega.runtime.guide import Bar, Guide, Undecided
from tega.setup.calibration.identify import Pulses
from tega.setup.calibration.sitting import Journal, Sitting, check_live, drawing, until_good
from tega.setup.calibration.staircase import LEVEL_PERCENT, TOP_LEVEL, Ladder, highest_level
from tega.stages.equal_steps import EqualStepsMapping, EqualStepsOptions

_DISPLAYED_STEPS = 5
"""Touches of different strength that are shown at the end."""


class FeltSite(msgspec.Struct, frozen=True, kw_only=True):
    """Answers at one site: the level found, 0 for none, and how often nothing was felt to be something."""

    level: int
    n_false: int


class VestSteps:
    """Leads a wearer through the steps; each result is kept in the journal at once.

    Each step raises ``Undecided`` if there is no answer, as without a terminal, and ``DeviceUnavailableError`` if the
    vest went away.
    """

    def __init__(self, pulses: Pulses, guide: Guide, journal: Journal, *, seed: int) -> None:
        self._pulses, self._guide, self._journal, self._seed = pulses, guide, journal, seed

    def places(self) -> Wearing:
        """Show every column once, in an order of chance, and ask where it is felt."""
        pulses = self._pulses
        sites = pulses.sites(each_motor=False)
        last = {site: "front" if site[0] == "f" else "back" for site in {s[0]: s for s in sites}.values()}
        answers = dict.fromkeys(sites, "") | last | {"n": "nothing felt", "r": "again"}
        columns = ", ".join(f"{site[0]}1 to {site} on the {face}" for site, face in last.items())

        def attempt() -> Wearing:
            self._guide.ready(
                f"Something will vibrate in one column at a time. Say where: {columns}, 1 at your own left"
            )
            places = {}
            for site in random.Random(self._seed).sample(sites, len(sites)):
                with pulses.silence():
                    places[site] = self._requested(
                        "Where?", answers, partial(pulses.one, site, pulses.ceiling)
                    )
            return judge_wearing(places, pulses.layout)

        wearing, notes = until_good(self._guide, "vest: places", attempt, lambda w: w.notes)
        self._guide.say(f"vest: {wearing.n_right} of {wearing.n_asked} places named right", tone="good")
        return msgspec.structs.replace(wearing, notes=notes)

    def thresholds(self, sites: tuple[str, ...]) -> dict[str, FeltSite]:
        """Find at each site the lowest level that is felt."""
        answers, pulses = {"y": "yes", "n": "no", "r": "again"}, self._pulses

        def felt(site: str, level: int) -> bool:
            return self._requested("Felt?", answers, lambda: pulses.one(site, level)) == "y"

        left = dict.fromkeys(sites, pulses.ceiling)
        return self._each("threshold", left, felt, lambda level: LEVEL_PERCENT[level])

    def steps(self, sites: tuple[str, ...], thresholds: Mapping[str, FeltSite]) -> dict[str, FeltSite]:
        """Find at some sites the smallest increase that is noticed, half way between threshold and ceiling.

        A site that is not felt, or hardly below the ceiling, is skipped.
        """
        chance, pulses = random.Random(self._seed), self._pulses
        middle = {site: (thresholds[site].level + pulses.ceiling) // 2 for site in sites}
        answers = {"1": "the first", "2": "the second", "s": "the same", "r": "again"}

        def felt(site: str, level: int) -> bool:
            second = chance.random() < 0.5
            pair = (middle[site], middle[site] + level)
            shown = pair if second else pair[::-1]
            answer = self._requested("Which was stronger?", answers, lambda: pulses.pair(site, *shown))
            return answer != "s" if level == 0 else answer == ("2" if second else "1")

        rooms = {s: pulses.ceiling - middle[s] for s in sites if thresholds[s].level}
        left = {site: room for site, room in rooms.items() if room > 0}
        return self._each("step", left, felt, lambda level: 100 * level / TOP_LEVEL)

    def show(self, felt: FeltMap) -> None:
        """Show five touches from light to full, in the equal steps of sensation that ``equal-steps`` makes.

        With a threshold of ``felt``, just measured, at the ceiling there is no room for steps.
        """
        pulses, guide = self._pulses, self._guide
        full_percent = float(LEVEL_PERCENT[pulses.ceiling])
        if felt.threshold.max() >= full_percent:
            guide.say("vest: no room for steps between threshold and ceiling", tone="warn")
            return
        options = EqualStepsOptions(full_percent=full_percent)
        loop = TouchLoop(
            dict.fromkeys(FINGERS, TouchMaxima(cci_max=_DISPLAYED_STEPS, eda_max=_DISPLAYED_STEPS)),
            layout=pulses.layout,
            felt=felt,
            mapping=lambda setup: EqualStepsMapping(setup, options),
        )
        guide.ready("Now five touches in equal steps, the lightest first: a run shows touch like this")
        with pulses.silence():
            for k in range(1, _DISPLAYED_STEPS + 1):
                title = f"touch {k} of {_DISPLAYED_STEPS}"
                guide.show(title, [Bar("touch", k / _DISPLAYED_STEPS)], None)
                touch = {f: Contact(finger=f, t_ns=0, in_contact=True, cci=k, eda=k) for f in FINGERS}
                pulses.all(loop.displayed(0, touch, ()), title)

    def _each(
        self,
        title: str,
        ceilings: Mapping[str, int],
        felt: Callable[[str, int], bool],
        percent: Callable[[int], float],
    ) -> dict[str, FeltSite]:
        """Climb a ladder at each site that is not done, up to its ceiling."""
        done = self._journal.kept(f"vest.{title}", dict[str, FeltSite]) or {}
        for site in [site for site in ceilings if site not in done]:
            ladder, n_done = Ladder(ceilings[site]), sum(one in done for one in ceilings)
            with self._pulses.silence():
                while (level := ladder.level) is not None:
                    share = (n_done + ladder.share) / len(ceilings)
                    bar = Bar(title, share, f"{n_done} of {len(ceilings)}")
                    self._guide.show(f"{title}: {site_place(site, self._pulses.layout)}", [bar], None)
                    ladder.answer(felt=felt(site, level))
            found = ladder.result()
            done[site] = FeltSite(level=found.level or 0, n_false=found.n_false)
            self._journal.keep(f"vest.{title}", done)
            text = "nothing up to the ceiling" if found.level is None else f"{percent(found.level):.0f} %"
            tone = "warn" if found.level is None else "good"
            self._guide.say(f"{site_place(site, self._pulses.layout)}: {title} {text}", tone=tone)
        return done

    def _requested(self, question: str, answers: Mapping[str, str], vibrate: Callable[[], None]) -> str:
        """Vibrate, then ask; repeat while the answer is "again"."""
        while True:
            vibrate()
            if (text := self._guide.ask(question, answers)) != "r":
                return text


class VestChoices(NamedTuple):
    """How a vest is calibrated; nothing stronger than ``ceiling_percent`` is shown.

    ``each_motor`` asks about every motor, not about columns; ``each_step`` looks for the step at every column
    or motor, not at one of each face. ``seed`` is that of the order in which the columns are shown.
    """

    ceiling_percent: int = 60
    each_motor: bool = False
    each_step: bool = False
    seed: int = 0


def calibrate_vest(sitting: Sitting, journal: Journal, choices: VestChoices, place: str) -> VestCalibration:
    """Calibrate the vest of the settings, which must name one."""
    section, guide = sitting.config.vest, sitting.guide
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
    lead = VestSteps(pulses, guide, journal, seed=choices.seed)
    where = journal.step("vest.places", Wearing, lead.places)
    sites = pulses.sites(each_motor=choices.each_motor)
    guide.ready("Say each time whether you feel it; it will be faint, and sometimes there is nothing")
    thresholds = lead.thresholds(sites)
    if not any(felt.level for felt in thresholds.values()):
        journal.forget("vest.threshold")
        raise CalibrationError(
            f"vest: nothing was felt up to {limit} %",
            "is it switched on and tight? then the same command again, or with a higher --ceiling",
        )
    guide.ready("Now two vibrations each time: say which is the stronger one")
    requested = sites
    if not choices.each_step:
        requested = middle_sites({site: felt.level for site, felt in thresholds.items()}, layout)
    steps = lead.steps(requested, thresholds)
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
        step_percent=tuple(_step_percent(s, thresholds, steps, layout) for s in sites),
        step_sites=tuple(steps),
        named_right=where.n_right,
        named=where.n_asked,
        false_alarms=sum(felt.n_false for felt in (*thresholds.values(), *steps.values())),
    )
    if chosen_stage("mapping", config.stages, config.session.preset).kind is EqualStepsMapping:
        threshold, step = felt_by(record)
        lead.show(FeltMap(threshold=threshold, step=step))
    return record


def _step_percent(
    site: str, thresholds: Mapping[str, FeltSite], steps: Mapping[str, FeltSite], layout: Layout
) -> float:
    """Return a site's step, or that of its face where only that was looked for; -1 where there is none."""
    face = site_face(site, layout)
    measured = steps.get(site) or next((f for s, f in steps.items() if site_face(s, layout) == face), None)
    if measured is None or not measured.level or not thresholds[site].level:
        return -1.0
    return round(100 * measured.level / TOP_LEVEL, 2)
