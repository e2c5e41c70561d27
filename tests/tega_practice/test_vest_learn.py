"""Learning to read the vest, by scripted and simulated people; and the page of a practice or a test in a browser."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reference.chromium import launched, opened
from reference.wizard import Wizard
from tega.config import SessionConfig, load_config
from tega.config.calibration.folder import CalibrationFolder
from tega.devices.base import DeviceInfo
from tega.errors import CalibrationError, DeviceUnavailableError
from tega.haptics import MotorLevels
from tega.runtime.clock import ManualClock
from tega.runtime.guide import Bar, Undecided
from tega.safety.motor_budget import MotorBudget
from tega.ui.cli.guide import LineGuide
from tega.ui.cli.guide_page import PageGuide
from tega_emulators.process import Emulator
from tega_emulators.vest_bench import seen_by
from tega_practice.kept import VestSkillRecord, kept_records
from tega_practice.live import Target, _bars
from tega_practice.vest_course import LONGEST, TwoDownOneUp, learn_vest
from tega_practice.vest_lesson import Lesson


class LimitedVest:
    """A vest with a budget at the edge of a lesson; keeps what it was sent."""

    def __init__(self, *, dead: bool = False) -> None:
        self.info = DeviceInfo(driver="limited", kind="vest", label="limited", live=True, notes=("off",))
        self.budget = MotorBudget()
        self.sent: list[MotorLevels] = []
        self._dead = dead

    def write(self, t_ns: int, frame: MotorLevels) -> MotorLevels:
        allowed = self.budget.allow(t_ns, frame.x40())[frame.motors]
        displayed = np.zeros_like(allowed) if self._dead else allowed
        self.sent.append(frame)
        return MotorLevels(frame.layout, displayed)


class Person:
    """Somebody whose ``answer`` is given the question, its answers and the frames since the last one."""

    def __init__(self, vest: LimitedVest, answer: Callable[..., str]) -> None:
        self._vest, self._answer = vest, answer
        self._n_felt = 0
        self.said: list[str] = []

    def part(self, title: str, why: str) -> None:
        self.said.append(f"{title}: {why}")

    def say(self, text: str, *, tone: str = "plain") -> None:
        del tone
        self.said.append(text)

    def ready(self, prompt: str) -> None:
        self.said.append(prompt)

    def show(self, prompt: str, bars: Sequence[Bar], left_s: float | None) -> None:
        del left_s
        assert all(0 <= bar.share <= 1 for bar in bars), prompt

    def ask(self, question: str, answers: Mapping[str, str]) -> str:
        felt = self._vest.sent[self._n_felt :]
        self._n_felt = len(self._vest.sent)
        message = self._answer(question, answers, felt)
        assert message in answers
        return message


def settings(folder: Path, *sets: str) -> SessionConfig:
    person = ("calibration.person=p01", f'calibration.folder="{folder.as_posix()}"')
    return load_config(None, environ={}, sets=(*person, *sets)).config


def knowing(config: SessionConfig) -> Callable[..., str]:
    """Return the answers of somebody who knows every pattern by heart."""
    off: Any = LimitedVest()
    lesson = Lesson(config, off, ManualClock())
    known = {
        (aspect.question, b"".join(frame.levels.tobytes() for _, frame in lesson.frames(one))): one.key
        for aspect in lesson.aspects
        for one in aspect.cues
    }

    def answer(question: str, answers: Mapping[str, str], felt: list[MotorLevels]) -> str:
        del answers
        if question == "Once more?":
            return "n"
        if question == "Which was firmer?":
            half = len(felt) // 2
            first, second = (sum(f.levels.sum() for f in part) for part in (felt[:half], felt[half:]))
            return "1" if first > second else "2"
        # After each cue the vest is sent a silent frame.
        return known[question, b"".join(frame.levels.tobytes() for frame in felt[:-1])]

    return answer


def test_somebody_who_knows_is_right_and_the_score_is_kept(tmp_path: Path) -> None:
    config = settings(tmp_path, "stages.mapping.name=slip-row", "stages.mapping.options.law=linear")
    clock = ManualClock()
    vest: Any = LimitedVest()
    person = Person(vest, knowing(config))
    record, file = learn_vest(config, vest, person, questions=20, seed=3, clock=clock)
    assert record.right_percent == 100
    assert {one.aspect for one in record.scores()} == {"finger", "firmness", "kind", "change", "slip"}
    assert all(one.right == 1 and one.asked >= 4 for one in record.scores())
    assert record.chance_percent < 51
    assert record.difference_percent is not None
    assert record.difference_percent < 15
    assert 0 < record.dose_s == pytest.approx(float(vest.budget.dose_s.max()), abs=0.01)
    assert kept_records(VestSkillRecord, CalibrationFolder(tmp_path), "p01") == [record]
    assert file.is_relative_to(tmp_path / "people" / "p01")
    assert not vest.sent[-1].intensities.any()
    lesson = Lesson(config, vest, clock)
    firm = next(aspect for aspect in lesson.aspects if aspect.name == "firmness").cues[1]
    both = np.max([frame.x40() for _, frame in lesson.frames(firm)], axis=0)
    assert both[:20].max() > 80 < both[20:].max(), "a firm touch is felt as one, in front and behind"
    # In the test nothing is said about right and wrong.
    test = next(n for n, message in enumerate(person.said) if message.startswith("Test:"))
    assert not any(message.startswith(("Right", "No")) for message in person.said[test:])


def test_what_a_mapping_does_not_show_is_not_asked(tmp_path: Path) -> None:
    def aspects(*sets: str) -> set[str]:
        vest: Any = LimitedVest()
        return {one.name for one in Lesson(settings(tmp_path, *sets), vest, ManualClock()).aspects}

    assert aspects() == {"finger", "firmness", "kind", "change"}
    assert aspects("stages.mapping.name=pulses") == {"finger", "slip"}
    assert aspects("stages.mapping.name=place") == {"finger", "firmness", "kind", "change", "place"}
    assert "firmness" in aspects(
        "stages.mapping.options.front_max=0.002", "stages.mapping.options.back_max=50"
    )


@pytest.mark.slow
def test_somebody_who_guesses_is_at_chance_and_the_staircase_says_so(tmp_path: Path) -> None:
    config = settings(tmp_path)
    clock = ManualClock()
    vest: Any = LimitedVest()
    rng = np.random.default_rng(1)

    def guess(question: str, answers: Mapping[str, str], _felt: list[MotorLevels]) -> str:
        keys = [key for key in answers if key != "a"]
        return "n" if question == "Once more?" else str(rng.choice(keys))

    record, _ = learn_vest(config, vest, Person(vest, guess), questions=160, clock=clock)
    assert record.right_percent == pytest.approx(record.chance_percent, abs=12)
    assert record.difference_percent is None or record.difference_percent > 30


def test_a_lesson_ends_where_the_day_is_used_up_and_where_the_vest_is_dead(tmp_path: Path) -> None:
    config = settings(tmp_path)
    clock = ManualClock()
    vest: Any = LimitedVest()
    vest.budget.carry(dose_s=np.full(40, 1700.0), heat=np.zeros(40))
    with pytest.raises(CalibrationError, match="day's vibration is nearly used up"):
        learn_vest(config, vest, Person(vest, knowing(config)), clock=clock)
    assert not vest.sent[-1].intensities.any()
    assert kept_records(VestSkillRecord, CalibrationFolder(tmp_path), "p01") == []
    clock = ManualClock()
    dead: Any = LimitedVest(dead=True)
    with pytest.raises(DeviceUnavailableError, match=r"did not show .*: off"):
        learn_vest(config, dead, Person(dead, knowing(config)), clock=clock)
    assert not dead.sent[-1].intensities.any()


@given(st.lists(st.booleans(), min_size=LONGEST, max_size=LONGEST))
def test_the_staircase_ends_and_stays_within_its_limits(answers: list[bool]) -> None:
    stairs = TwoDownOneUp(start=0.4, least=0.02, most=0.6)
    for right in answers:
        if stairs.ended:
            break
        assert 0.02 <= stairs.difference <= 0.6
        before = stairs.difference
        stairs.answer(right=right)
        assert stairs.difference >= before or right
        assert stairs.difference <= before or not right
    assert stairs.ended
    assert stairs.threshold is None or 0.02 <= stairs.threshold <= 0.6


@pytest.mark.parametrize("limen", [0.05, 0.1, 0.25])
def test_the_staircase_finds_where_71_percent_are_right(limen: float) -> None:
    rng = np.random.default_rng(2)
    found = []
    for _ in range(100):
        stairs = TwoDownOneUp(start=0.4, least=0.005, most=0.6)
        while not stairs.ended:
            # 70.7 % at the limen.
            chance_right = 0.5 + 0.5 * (1 - np.exp(-0.534 * (stairs.difference / limen) ** 2))
            stairs.answer(right=bool(rng.random() < chance_right))
        assert stairs.threshold is not None
        found.append(stairs.threshold)
    assert np.exp(np.mean(np.log(found))) == pytest.approx(limen, rel=0.15)


@pytest.mark.slow
def test_the_verb_teaches_on_an_emulated_vest(tmp_path: Path) -> None:
    with Emulator("bhaptics_player", "--port", "0") as player:
        options = "\n".join(f"{name} = {json.dumps(value)}" for name, value in player.address.items())
        (tmp_path / "lab.toml").write_text(
            f"[vest]\ndriver = 'bhaptics-player'\n[vest.options]\n{options}\n"
            "[stages.mapping]\nname = 'pulses'\n[tactile.index]\ndriver = 'synthetic-touch'\n"
        )
        words = ["vest", "learn", str(tmp_path / "lab.toml"), "--person", "p01", "--questions", "2", "--json"]
        person = Wizard([*words, "--test-only"], lambda prompt: "n" if "slip" in prompt else "").run()
        reported: Any = person.reported
        history = seen_by(player).history
    assert reported["mapping"] == "pulses"
    assert reported["aspects"] == [{"aspect": "slip", "asked": 4, "right": 0.5, "chance": 0.5}]
    assert any(any(motors) for _, motors in history)
    assert not any(history[-1][1])
    assert Path(reported["file"]).is_file()
    assert any((tmp_path / "calibrations").rglob("vest-dose.json"))


@pytest.mark.slow
def test_a_page_asks_shows_bars_and_tells(capsys: pytest.CaptureFixture[str]) -> None:
    with (
        launched() as browser,
        ThreadPoolExecutor(1) as person,
        PageGuide("TEGA Fitts test of p01", yes=False, get_ready_s=0.0) as guide,
        opened(browser, guide.url) as page,
    ):
        guide.part("Fitts test", "fast <and> exactly")
        waits = person.submit(guide.ready, "Arm as in use")
        page.get_by_text("Arm as in use").wait_for()
        assert not waits.done()
        page.get_by_role("button", name="Ready").click()
        waits.result(10)
        guide.show("Go", _bars(Target(0.5, 0.2), 0.25), 7.4)
        page.get_by_text("7 s left").wait_for()
        for text in ("Fitts test", "fast <and> exactly", "Go", "3.0 ± 0.40 level", "2.00"):
            assert page.get_by_text(text, exact=text == "Go").first.is_visible(), text
        assert page.get_by_role("button", name="Ready").count() == 0
        track, filled = "div[style*='background:#e9ecef']", "xpath=./div"
        target, cursor = page.locator(track).nth(0), page.locator(track).nth(1)
        low, high = (target.bounding_box(), target.locator(filled).bounding_box())
        # Levels 2.6 to 3.4 of five.
        assert (high["x"] - low["x"]) / low["width"] == pytest.approx(2.6 / 5, abs=0.01)
        assert high["width"] / low["width"] == pytest.approx(0.8 / 5, abs=0.01)
        box = cursor.locator(filled).bounding_box()
        assert box["width"] / low["width"] == pytest.approx(2.0 / 5, abs=0.01)
        requested = person.submit(guide.ask, "Again?", {"y": "yes", "n": "no"})
        page.get_by_role("button", name="no", exact=True).click()
        assert requested.result(10) == "n"
        guide.say("0.42 bits/s", tone="good")
        page.get_by_text("0.42 bits/s").wait_for()
    assert "0.42 bits/s" in capsys.readouterr().err
    # Nobody is waited for where nobody is there.
    with PageGuide("TEGA", yes=True, get_ready_s=0.01) as guide:
        guide.ready("Arm as in use")
        with pytest.raises(Undecided):
            guide.ask("Again?", {"y": "yes"})


def test_a_bar_with_two_ends_is_drawn_between_them(capsys: pytest.CaptureFixture[str]) -> None:
    LineGuide(yes=True, get_ready_s=0.0).show("Go", _bars(Target(0.5, 0.2), 0.25), None)
    bars = re.findall("[·█]{8}", capsys.readouterr().err)
    assert bars == ["····█···", "███·····"]
    # However narrow it is, there is something to hit.
    LineGuide(yes=True, get_ready_s=0.0).show("Go", [Bar("target", 0.51, "", low=0.5)], None)
    assert "···█····" in capsys.readouterr().err
