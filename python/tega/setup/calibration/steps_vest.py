"""Calibrate the vest in steps: where its columns are felt, from which level on, which increase is noticed.

Nothing is shown above the ceiling, and after every vibration, answer, error or interruption the vest is at zero.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator, Mapping, MutableMapping
from contextlib import contextmanager
from functools import partial

import msgspec
import numpy as np

from tega.config.calibration import TouchMaxima
from tega.config.calibration.wearing import SITES, Wearing, judge_wearing, site_motors, site_place
from tega.devices.base import VestSink
from tega.haptics import FINGERS, FeltMap, Layout, MotorLevels, vest_frame
from tega.loop.touch import TouchLoop
from tega.records import Contact
from tega.runtime.clock import SystemClock
from tega.runtime.guide import Bar, Guide
from tega.setup.calibration.identify import show_frame
from tega.setup.calibration.sitting import Times, until_good
from tega.setup.calibration.staircase import LEVEL_PERCENT, TOP_LEVEL, Ladder
from tega.stages.equal_steps import EqualStepsMapping, EqualStepsOptions

_DISPLAYED_STEPS = 5
"""Touches of different strength that are shown at the end."""


class FeltSite(msgspec.Struct, frozen=True, kw_only=True):
    """Answers at one site: the level found, 0 for none, and how often nothing was felt to be something."""

    level: int
    n_false: int


class Pulses:
    """Vibrations at sites of a vest, never above a ceiling, 1 to 15."""

    def __init__(self, vest: VestSink, *, layout: Layout, ceiling: int, times: Times) -> None:
        self._vest = vest
        self.layout: Layout = layout
        self._silent = vest_frame([0] * 4, [0] * 4, layout=layout)
        self.ceiling = ceiling
        self._times = times
        self._clock = SystemClock()

    def sites(self, *, each_motor: bool) -> tuple[str, ...]:
        """Return the columns, or the motors, that this vest has."""
        return tuple(f"m{m}" for m in self._silent.motors.tolist()) if each_motor else SITES

    def one(self, site: str, level: int) -> None:
        """Vibrate once; level 0 takes as long and does nothing."""
        percent = LEVEL_PERCENT[min(level, self.ceiling)]
        lit = np.isin(self._silent.motors, site_motors(site))
        frame = MotorLevels(self.layout, np.where(lit, np.uint8(percent), np.uint8(0)).astype(np.uint8))
        show_frame(
            self._vest, frame, duration_s=self._times.pulse_s, clock=self._clock, subject=site_place(site)
        )

    def pair(self, site: str, first: int, second: int) -> None:
        """Vibrate twice, with a gap."""
        self.one(site, first)
        self._clock.sleep_until(self._clock.now_ns() + round(self._times.gap_s * 1e9))
        self.one(site, second)

    def all(self, frame: MotorLevels, subject: str) -> None:
        """Show a frame as long as a vibration, nothing of it above the ceiling."""
        limited = np.minimum(frame.intensities, np.uint8(LEVEL_PERCENT[self.ceiling]))
        frame = MotorLevels(frame.layout, limited)
        show_frame(self._vest, frame, duration_s=self._times.pulse_s, clock=self._clock, subject=subject)
        self._clock.sleep_until(self._clock.now_ns() + round(self._times.gap_s * 1e9))

    @contextmanager
    def silence(self) -> Iterator[None]:
        """Leave the vest at zero, however the block is left."""
        try:
            yield
        finally:
            self._vest.write(self._clock.now_ns(), self._silent)


class VestSteps:
    """Leads a wearer through the steps.

    Each raises ``Undecided`` where there is no answer, as without a terminal, and ``DeviceUnavailableError`` if the
    vest went away.
    """

    def __init__(self, pulses: Pulses, guide: Guide, *, seed: int) -> None:
        self._pulses, self._guide, self._seed = pulses, guide, seed

    def places(self) -> tuple[Wearing, tuple[str, ...]]:
        """Show every column once, in an order of chance, and ask where it is felt."""
        answers = dict.fromkeys(SITES, "") | {"f4": "front", "b4": "back", "n": "nothing felt", "r": "again"}
        pulses = self._pulses

        def attempt() -> Wearing:
            self._guide.ready(
                "Something will vibrate in one column at a time. Say where: f1 to f4 on the front, b1 to b4 on "
                "the back, 1 at your own left"
            )
            places = {}
            for site in random.Random(self._seed).sample(SITES, len(SITES)):
                with pulses.silence():
                    places[site] = self._requested(
                        "Where?", answers, partial(pulses.one, site, pulses.ceiling)
                    )
            return judge_wearing(places)

        wearing, notes = until_good(self._guide, "vest: places", attempt, lambda w: w.problems)
        self._guide.say(f"vest: {wearing.n_right} of {wearing.n_asked} places named right", tone="good")
        return wearing, notes

    def thresholds(self, sites: tuple[str, ...], done: MutableMapping[str, FeltSite]) -> None:
        """Find at each site that is not done the lowest level that is felt."""
        answers, pulses = {"y": "yes", "n": "no", "r": "again"}, self._pulses

        def felt(site: str, level: int) -> bool:
            return self._requested("Felt?", answers, lambda: pulses.one(site, level)) == "y"

        left = dict.fromkeys(sites, pulses.ceiling)
        self._each("threshold", left, done, felt, lambda level: LEVEL_PERCENT[level])

    def steps(
        self, sites: tuple[str, ...], thresholds: Mapping[str, FeltSite], done: MutableMapping[str, FeltSite]
    ) -> None:
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
        self._each("step", left, done, felt, lambda level: 100 * level / TOP_LEVEL)

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
        done: MutableMapping[str, FeltSite],
        felt: Callable[[str, int], bool],
        percent: Callable[[int], float],
    ) -> None:
        """Climb a ladder at each site, up to its ceiling; results are put into ``done`` at once."""
        for site in [site for site in ceilings if site not in done]:
            ladder, n_done = Ladder(ceilings[site]), sum(one in done for one in ceilings)
            with self._pulses.silence():
                while (level := ladder.level) is not None:
                    share = (n_done + ladder.share) / len(ceilings)
                    bar = Bar(title, share, f"{n_done} of {len(ceilings)}")
                    self._guide.show(f"{title}: {site_place(site)}", [bar], None)
                    ladder.answer(felt=felt(site, level))
            found = ladder.result()
            done[site] = FeltSite(level=found.level or 0, n_false=found.n_false)
            text = "nothing up to the ceiling" if found.level is None else f"{percent(found.level):.0f} %"
            tone = "warn" if found.level is None else "good"
            self._guide.say(f"{site_place(site)}: {title} {text}", tone=tone)

    def _requested(self, question: str, answers: Mapping[str, str], vibrate: Callable[[], None]) -> str:
        """Vibrate, then ask; repeat while the answer is "again"."""
        while True:
            vibrate()
            if (text := self._guide.ask(question, answers)) != "r":
                return text
