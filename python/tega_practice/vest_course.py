"""Teach a person to read a mapping on the vest: shown, practised with a staircase, then tested for a score."""

from __future__ import annotations

import json
import math
import random
from pathlib import Path
from statistics import fmean
from typing import Final

import msgspec

from tega.config import SessionConfig
from tega.config.calibration.folder import device_name
from tega.config.calibration.records import utc_now
from tega.config.choose import chosen_stage
from tega.config.person import whose
from tega.devices.base import VestSink
from tega.runtime.clock import Clock
from tega.runtime.guide import Bar, Guide
from tega_practice.kept import VestSkillRecord, keep_record
from tega_practice.vest_lesson import Aspect, Cue, Lesson, even

STEP: Final = 0.75
"""Factor of a step towards the harder."""

REVERSALS: Final = 8
"""Number of reversals after which the staircase ends; the first two only find the neighbourhood."""

LONGEST: Final = 50
"""And after so many questions, whatever is answered."""

_SETTLING = 2


class TwoDownOneUp:
    """Makes a difference smaller after two right answers and larger after a wrong one.

    It settles where 71 % are right. ``difference`` is the next one to ask about, ``n_asked`` the number of
    questions answered. ``least``, ``start`` and ``most`` must be positive and in order.
    """

    def __init__(self, *, start: float, least: float, most: float) -> None:
        self._least, self._most = least, most
        self._turns: list[float] = []
        self._harder = True
        self._n_right = 0
        self.difference = start
        self.n_asked = 0

    @property
    def ended(self) -> bool:
        """Whether nothing more is to be asked."""
        return len(self._turns) >= REVERSALS or self.n_asked >= LONGEST

    @property
    def share(self) -> float:
        """Share of the search that is done, 0 to 1."""
        return max(len(self._turns) / REVERSALS, self.n_asked / LONGEST)

    @property
    def threshold(self) -> float | None:
        """Geometric mean of the differences at which it turned; ``None`` where it did not turn often enough."""
        turns = self._turns[_SETTLING:]
        return math.exp(sum(map(math.log, turns)) / len(turns)) if len(turns) >= 2 else None

    def answer(self, *, right: bool) -> None:
        """Take the answer to the question about ``difference``; not after the end."""
        self.n_asked += 1
        self._n_right = self._n_right + 1 if right else 0
        if right and self._n_right < 2:
            return
        self._n_right = 0
        if right != self._harder:
            self._turns.append(self.difference)
            self._harder = right
        wanted = self.difference * (STEP if right else 1 / STEP)
        self.difference = min(max(wanted, self._least), self._most)


BASE: Final = 0.4
"""Firmness of the lighter of two touches that are compared, as a share of the maximum."""

_GAP_S = 0.5
_IN_A_ROW, _MOST_REQUESTS = 4, 12


def learn_vest(
    config: SessionConfig,
    vest: VestSink,
    guide: Guide,
    *,
    questions: int = 30,
    seed: int = 0,
    test_only: bool = False,
    clock: Clock | None = None,
) -> tuple[VestSkillRecord, Path]:
    """Teach and test a person; return the score, and where it is kept.

    The lesson covers only differences that the mapping shows: other questions are not asked. Practice goes on
    until four answers in a row are right, twelve questions at most; a staircase finds the smallest
    perceptible difference of firmness. The test gives no feedback on answers.

    ``config`` has ``calibration.person``; ``vest`` is open, with the rest of the person's dose for the day.
    ``questions``, those of the test, are at least two for each thing that can be shown; ``seed`` is that of
    their order. With ``test_only``, lesson, practice and staircase are left out.

    Raises:
        Undecided: No participant is there to answer.
        ConfigError: The mapping shows a value that only a real metric measures.
        CalibrationError: No person is named, or motors are warm or the day's vibration is nearly used up.
        DeviceUnavailableError: The vest went away.
    """
    person, folder = whose(config.calibration)
    lesson = Lesson(config, vest, clock)
    chance = random.Random(seed)
    before_s = lesson.dose_s()
    chosen = chosen_stage("mapping", config.stages, config.session.preset)
    threshold = None
    if not test_only:
        _teach(lesson, guide, chosen.name)
        for aspect in lesson.aspects:
            _practise(lesson, aspect, guide, chance)
        if any(aspect.name == "firmness" for aspect in lesson.aspects):
            threshold = _compare(lesson, guide, chance)
    answers = _test(lesson, guide, chance, questions)
    record = VestSkillRecord(
        device=device_name(vest.info),
        driver=vest.info.driver,
        made=utc_now(),
        person=person,
        mapping=chosen.name,
        options=json.dumps(msgspec.to_builtins(chosen.options, enc_hook=str)),
        seed=seed,
        right_percent=round(100 * fmean(displayed == text for _, displayed, text, _ in answers), 1),
        chance_percent=round(100 * fmean(1 / n for *_, n in answers), 1),
        difference_percent=None if threshold is None else round(100 * threshold, 1),
        dose_s=round(lesson.dose_s() - before_s, 2),
        answers=tuple(answers),
    )
    return record, keep_record(record, folder)


def _teach(lesson: Lesson, guide: Guide, mapping: str) -> None:
    """Show every answer of every aspect, each with its words, as often as the person wants."""
    guide.part("Feel each answer", f"The mapping {mapping} shows contacts. Each is named, then shown.")
    for aspect in lesson.aspects:
        guide.ready(f"Next: {aspect.name}")
        while True:
            for displayed in aspect.cues:
                guide.say(f"Now: {displayed.words}")
                lesson.play(displayed)
                lesson.pause(_GAP_S)
            if guide.ask("Once more?", {"y": "yes", "n": "no"}) == "n":
                break


def _practise(lesson: Lesson, aspect: Aspect, guide: Guide, chance: random.Random) -> None:
    guide.part(
        f"Practice: {aspect.name}", f"{_IN_A_ROW} right answers in a row, or {_MOST_REQUESTS} questions."
    )
    row = 0
    for n in range(_MOST_REQUESTS):
        displayed = chance.choice(aspect.cues)
        guide.show(aspect.name, [Bar("in a row", row / _IN_A_ROW, f"{row} of {_IN_A_ROW}")], None)
        right = _requested(lesson, aspect, displayed, guide, again=True) == displayed.key
        guide.say(
            f"Right: {displayed.words}" if right else f"No: {displayed.words}",
            tone="good" if right else "warn",
        )
        row = row + 1 if right else 0
        if row == _IN_A_ROW or n + 1 == _MOST_REQUESTS:
            return


def _compare(lesson: Lesson, guide: Guide, chance: random.Random) -> float | None:
    """Find the smallest perceptible difference of firmness; the staircase adapts the difficulty."""
    guide.part("Which was firmer?", "Two touches come one after the other; they become more and more alike.")
    guide.ready("Attend to how strong each is")
    stairs = TwoDownOneUp(start=0.4, least=0.02, most=1 - BASE)
    finger = next(a for a in lesson.aspects if a.name == "firmness").cues[0].finger
    while not stairs.ended:
        guide.show("Which was firmer?", [Bar("done", stairs.share, f"{stairs.n_asked} asked")], None)
        pair = [
            Cue("1", "the lighter", finger, even(BASE)),
            Cue("2", "the firmer", finger, even(BASE + stairs.difference)),
        ]
        chance.shuffle(pair)
        for one in pair:
            lesson.play(one)
            lesson.pause(_GAP_S)
        answer = guide.ask("Which was firmer?", {"1": "the first", "2": "the second"})
        right = pair[int(answer) - 1].words == "the firmer"
        guide.say("Right" if right else "No, the other one", tone="good" if right else "warn")
        stairs.answer(right=right)
    found = stairs.threshold
    reported = "not settled" if found is None else f"{100 * found:.0f} % of the maximum"
    guide.say(f"Smallest difference of firmness: {reported}", tone="plain" if found is None else "good")
    return found


def _test(
    lesson: Lesson, guide: Guide, chance: random.Random, questions: int
) -> list[tuple[str, str, str, int]]:
    """Ask about every aspect equally often, each of its answers equally often, in an order of chance."""
    each = questions / len(lesson.aspects)
    requested = [
        (aspect, displayed)
        for aspect in lesson.aspects
        for displayed in aspect.cues * max(2, round(each / len(aspect.cues)))
    ]
    chance.shuffle(requested)
    guide.part("Test", f"{len(requested)} questions. Nothing is said about right and wrong until the end.")
    guide.ready("Attend to the vest")
    answers = []
    for n, (aspect, displayed) in enumerate(requested):
        guide.show("Test", [Bar("done", n / len(requested), f"{n} of {len(requested)}")], None)
        answer = _requested(lesson, aspect, displayed, guide, again=False)
        answers.append((aspect.name, displayed.key, answer, len(aspect.cues)))
    return answers


def _requested(lesson: Lesson, aspect: Aspect, displayed: Cue, guide: Guide, *, again: bool) -> str:
    """Play and ask, again as often as that is the answer."""
    answers = {one.key: one.words for one in aspect.cues} | ({"a": "again"} if again else {})
    while True:
        lesson.play(displayed)
        if (text := guide.ask(aspect.question, answers)) != "a" or not again:
            return text
