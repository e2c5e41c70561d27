"""Stand devices ready for a session, on which nothing happens, and a desk that presses what a test wants."""

from __future__ import annotations

import lzma
import time
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

from tega.runtime.clock import SystemClock
from tega_study.journal import Journal, JournalEvent, events_path, read_events
from tega_study.lead.benches import TrialBench
from tega_study.lead.experimenter import ENTER, Screen
from tega_study.lead.questions import QUESTIONS
from tega_study.lead.running_trial import Going
from tega_study.lead.trial import LedTrial
from tega_study.observers import observer_path
from tega_study.plan import PlannedTrial, StudyPlan, make_plan, read_plan, write_plan
from tega_study.trials import Trial


def quick_study(folder: Path, **settings: Any) -> StudyPlan:
    """Write the plan of a short rehearsal with a bag into a new folder."""
    quick = {"participants": 1, "seed": 3, "objects": ["bag"], "trials": 1, "simulated": True}
    rests = {"rest_s": 0.1, "change_rest_s": 0.1, "long_rest_s": 0.1}
    plan = make_plan(**{**quick, **rests, **settings})
    write_plan(plan, folder)
    return plan


def counted(person: str, condition: str, slips: int = 0, **more: Any) -> Trial:
    """Return the row of a made-up trial that counts."""
    name, number = more.setdefault("object", "bag"), more.setdefault("trial", 1)
    own = {"id": f"{person}-{name}-{condition}-{number}", "participant": person, "condition": condition}
    usual = {"repeat": number, "success": True, "deformations": 0, "duration_s": 10.0, "slips": slips}
    return Trial(**{**usual, **own, **more})


class ScriptedDesk:
    """A desk that presses what :meth:`observe` adds, and keeps what is said.

    ``rating`` answers each question after a block, if any; ``answer`` every line that is asked for, if any may be.
    """

    def __init__(self, *, rating: str = "-", answer: str | None = None) -> None:
        self._rating, self._answer = rating, answer
        self.waiting: list[str] = []
        self.said: list[str] = []
        self.phase = ""

    def show(self, screen: Screen) -> None:
        if screen.phase == "questions" != self.phase and self._rating:
            self.waiting += [ENTER, *(self._rating * len(QUESTIONS)), ENTER]
        self.observe(screen)
        self.phase = screen.phase

    def observe(self, screen: Screen) -> None:
        """Add keys to press; :attr:`phase` is that of the screen before."""

    def say(self, text: str) -> None:
        self.said.append(text)

    def keys(self) -> list[str]:
        keys, self.waiting = self.waiting, []
        return keys

    def line(self, prompt: str) -> str:
        assert self._answer is not None, prompt
        self.said.append(prompt)
        return self._answer


def begin_ready(going: Going) -> None:
    """Stand ready and begin once the experimenter says so, or has ended the trial."""
    going.notify("armed", "stands ready")
    while not going.over() and not going.may_go():
        time.sleep(0.001)
    going.begin(0)


class StandingBench(TrialBench):
    """Devices that stand ready until the experimenter ends the trial; with ``own_time`` not by the clock's time."""

    def __init__(self, *, own_time: bool = False) -> None:
        self.own_time = own_time

    def run(self, _trial: PlannedTrial, going: Going, _folder: Path) -> None:
        going.notify("armed", "stands ready")
        while not going.over():
            if going.may_go():
                going.begin(0)
            time.sleep(0.001)


class LiftingBench(StandingBench):
    sees_height = True

    def __init__(self) -> None:
        super().__init__(own_time=True)

    def run(self, _trial: PlannedTrial, going: Going, _folder: Path) -> None:
        begin_ready(going)
        time.sleep(0.2)  # so that the experimenter sees the trial, and can press a key in it
        for t_ms in range(0, 1500, 50):
            going.observe("height", t_ms * 1_000_000, 0.25)
        while not going.over():
            time.sleep(0.001)


class Experimenter(ScriptedDesk):
    def __init__(self, presses: dict[str, str] | None = None, answer: str = "40") -> None:
        super().__init__(rating="i", answer=answer)
        self._presses = presses or {}
        self.phases: list[str] = []

    def observe(self, screen: Screen) -> None:
        if self.phases[-1:] != [screen.phase]:
            self.phases.append(screen.phase)
            self.waiting += list(self._presses.get(screen.phase, ""))
            if screen.phase == "ready":
                self.waiting.append(ENTER)


def study(folder: Path, **settings: Any) -> Path:
    quick_study(folder / "study", **{"change_rest_s": 0.3, "long_rest_s": 0.3, **settings})
    return folder / "study"


def files_of(folder: Path) -> dict[str, bytes]:
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def ran(
    folder: Path, person: str, trials: Callable[[Journal, PlannedTrial, int], object], begin_ns: int = 0
) -> None:
    """Write a session whose trials last nine seconds each; ``trials`` adds what happens in one, from a time on."""
    plan = read_plan(folder)
    with Journal(events_path(folder, person)) as journal:
        journal.add("session_start", t_ns=begin_ns, text=plan.settings.plan_sha256, item="simulated")
        for trial in plan.of(person):
            at_ns = begin_ns + trial.trial * 20 * 10**9
            journal.add("trial_start", t_ns=at_ns, trial=trial.trial)
            trials(journal, trial, at_ns)
            journal.add("trial_end", t_ns=at_ns + 9 * 10**9, trial=trial.trial, status="done", success=True)


def trial_led(folder: Path, journal: Journal, bench: TrialBench) -> LedTrial:
    """Return the study's first trial, a thousand times as quick as it would be."""
    own: dict[str, Any] = {"bench": bench, "journal": journal, "clock": SystemClock()}
    trial = read_plan(folder).of("p01")[0]
    return LedTrial(folder, trial, 1, task="lift", window_s=15.0, time_scale=0.001, **own)


def events_of(folder: Path) -> list[JournalEvent]:
    return read_events(events_path(folder, "p01"))


def kinds(events: Sequence[JournalEvent]) -> list[str]:
    return [event.kind for event in events]


GOLDEN = Path(__file__).resolve().parents[1] / "golden" / "1-paper.mcap.xz"
RECORDING = "recordings/p01/p01-t01-a1/trial-001.mcap"


@cache
def golden_recording() -> bytes:
    return lzma.decompress(GOLDEN.read_bytes())


def led(folder: Path, person: str, *, recorded: bool = True) -> None:
    """Write what a session leaves: events, a rater's, a recording."""

    def slip(journal: Journal, trial: PlannedTrial, at_ns: int) -> None:
        journal.add("lift_off", t_ns=at_ns + 10**9, trial=trial.trial)
        journal.add("slip", t_ns=at_ns + 2 * 10**9, trial=trial.trial, source="experimenter")

    ran(folder, person, slip)
    with Journal(observer_path(folder, person, "r1")) as journal:
        journal.add("note", t_ns=1, text="the gel is new", source="r1")
    if recorded:
        target = folder / RECORDING.replace("p01", person)
        target.parent.mkdir(parents=True)
        target.write_bytes(golden_recording())
