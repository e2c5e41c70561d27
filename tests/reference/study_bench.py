"""Stand devices ready for a session, on which nothing happens, and a desk that presses what a test wants."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

from tega_study.lead.experimenter import ENTER, Screen
from tega_study.lead.questions import QUESTIONS
from tega_study.lead.running_trial import Going
from tega_study.plan import PlannedTrial, StudyPlan, make_plan, write_plan
from tega_study.state import Where


def quick_study(folder: Path, **settings: Any) -> StudyPlan:
    """Write the plan of a short rehearsal with a bag into a new folder."""
    quick = {"participants": 1, "seed": 3, "objects": ["bag"], "trials": 1, "simulated": True}
    rests = {"rest_s": 0.1, "change_rest_s": 0.1, "long_rest_s": 0.1}
    plan = make_plan(**{**quick, **rests, **settings})
    write_plan(plan, folder)
    return plan


class ScriptedDesk:
    """A desk that answers each question in turn, presses what :meth:`observe` adds, and keeps what is said.

    Args:
        rating: Key that answers each question after a block; empty for a desk that presses nothing there.
        answer: To every line that is asked for; ``None`` where none may be.
    """

    def __init__(self, *, rating: str = "-", answer: str | None = None) -> None:
        self._rating, self._answer = rating, answer
        self.waiting: list[str] = []
        self.said: list[str] = []
        self.phase = ""

    def show(self, screen: Screen) -> None:
        """Take in a screen."""
        if screen.phase == "questions" != self.phase and self._rating:
            self.waiting += [ENTER, *(self._rating * len(QUESTIONS)), ENTER]
        self.observe(screen)
        self.phase = screen.phase

    def observe(self, screen: Screen) -> None:
        """Add keys to press; :attr:`phase` is that of the screen before."""

    def say(self, text: str) -> None:
        """Keep a message."""
        self.said.append(text)

    def keys(self) -> list[str]:
        """Press the keys that wait."""
        keys, self.waiting = self.waiting, []
        return keys

    def line(self, prompt: str) -> str:
        """Answer a question in words."""
        assert self._answer is not None, prompt
        self.said.append(prompt)
        return self._answer


class StandingBench:
    """Devices that stand ready until the experimenter ends the trial.

    Args:
        own_time: Whether a trial's time is the bench's own, not the clock's.
    """

    where: Where = "simulated"
    sees_height = False
    measures_height = False
    closure: Any = None
    rest_tasks: Any = ()
    measurable = False

    def __init__(self, *, own_time: bool = False) -> None:
        self.own_time = own_time

    def felt(self, condition: str) -> bool:
        """Tell whether the vest is on."""
        return condition == "haptic"

    def run(self, _trial: PlannedTrial, going: Going, _folder: Path) -> None:
        """Be armed, begin when told to, and wait for the end."""
        going.notify("armed", "stands ready")
        while not going.over():
            if going.may_go():
                going.begin(0)
            time.sleep(0.001)
