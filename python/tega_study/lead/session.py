"""Lead a session from the first trial to the last, or from where it was stopped."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from tega.errors import DeviceUnavailableError
from tega.runtime.clock import Clock, SystemClock
from tega_study.journal import Journal
from tega_study.lead.benches import TrialBench
from tega_study.lead.experimenter import ENTER, Desk, check_answer_key, pedal_keys
from tega_study.lead.questions import BlockQuestions, blocks_to_ask
from tega_study.lead.rest_tasks import RestTask, RunningTask
from tega_study.lead.screens import TrialBefore, doing, ended, running, waiting
from tega_study.lead.tell import CommandFile, SessionBoard, Telling, board_path, commands_path
from tega_study.lead.trial import LedTrial, Task
from tega_study.masking_sound import Beeps, MaskingSound
from tega_study.plan import PlannedTrial, StudyPlan, read_plan
from tega_study.side_scores import beep_times, muscle_sentence, squeeze_sentence
from tega_study.state import SessionState, derive, resume

INSTRUCTION = (
    "Grasp the object with as little force as it takes. Lift it to the mark, 0.2 m up, within 15 s, and hold it still. "
    "Squeeze no harder than you need, and do not let it slip."
)
"""Read to the participant, the same in every condition; kept with the session's events."""

_POLL_S = 0.02
_BROKEN_ALONE = 3
"""Attempts after which a trial that breaks off again stops a session without an experimenter."""


class LeadOptions(NamedTuple):
    """Options of a session.

    Attributes:
        time_scale: Scale of all waits; below 1 for rehearsals, as noted in the events.
        answer_key: The key that the participant's pedal types at a beep, where the plan has a second task.
        auto: Go on by the clock and pass over the questions.
        masking: Sounds already, and goes on to the last trial; it plays the beeps of a second task too.
        stop: Asked all the time whether to stop; a running trial is then broken off for technical reasons.
    """

    task: Task = "lift"
    time_scale: float = 1.0
    answer_key: str = "p"
    auto: bool = False
    masking: MaskingSound | None = None
    stop: Callable[[], bool] = lambda: False


def lead_session(
    folder: Path,
    participant: str,
    bench: TrialBench,
    desk: Desk,
    *,
    pedals: str = "",
    trials: int | None = None,
    **options: Any,
) -> SessionState:
    """Lead a session, new or after a stop at any moment.

    ``pedals`` are the keys that foot pedals type, see :func:`tega_study.lead.experimenter.pedal_keys`. It stops
    after so many ``trials``; ``None`` for all. ``options`` are those of :class:`LeadOptions`.

    Raises ``InvalidValueError`` if the plan, a condition, a pedal or the answer key is not for this bench,
    ``RecordingError`` if the study is damaged or the person has withdrawn, ``DeviceUnavailableError`` if another
    program has the session open, the plan's beeps cannot be played, the masking sound has stopped, or a trial
    cannot begin and no experimenter is there; ``KeyboardInterrupt`` if ``stop`` or the desk says so.
    """
    plan, chosen = read_plan(folder), LeadOptions(**options)
    for condition in plan.settings.conditions:
        bench.felt(condition)
    pressed = pedal_keys(pedals, bench.rest_tasks)
    if plan.settings.probe:
        check_answer_key(chosen.answer_key, pedals + "".join(task.key for task in bench.rest_tasks))
        if chosen.masking is None:
            raise DeviceUnavailableError(
                "the plan has a second task, and nothing plays its beeps", "give lead_session a MaskingSound"
            )
    clock = SystemClock()
    journal, _state = resume(folder, plan, participant, t_ns=clock.now_ns(), where=bench.where)
    with journal:
        lead = _Lead(folder, plan, participant, journal, bench, desk, clock, pressed, chosen)
        try:
            return lead.run(trials)
        finally:
            lead.leave()


@dataclass
class _Lead:
    _folder: Path
    _plan: StudyPlan
    _participant: str
    _journal: Journal
    _bench: TrialBench
    _desk: Desk
    _clock: Clock
    _pedals: dict[str, tuple[str, ...]]
    _options: LeadOptions
    _led: LedTrial | None = None

    def __post_init__(self) -> None:
        self._mine = self._plan.of(self._participant)
        self._task, self._scale, self._answer_key, self._auto, self._masking, self._stop = self._options
        self._before = TrialBefore(self._journal, self._desk, self._clock)
        self._telling = Telling(self._desk, board_path(self._folder, self._participant))
        self._reported = CommandFile(commands_path(self._folder, self._participant), self._clock)

    @property
    def _state(self) -> SessionState:
        return derive(self._mine, self._journal.events)

    def run(self, most: int | None) -> SessionState:
        """Run until all trials are over, or the given number of them, or the experimenter quits."""
        self._before.note(INSTRUCTION)
        self._before.note(f"masking sound: {'none' if self._masking is None else self._masking.words}")
        if self._plan.settings.probe:
            self._before.note(f"second task: beeps, answered with the key {self._answer_key}")
        if self._scale != 1.0:
            self._before.note(f"rehearsal: waits are {self._scale:g} times as long")
        self._desk.say(f"Read to the participant: {INSTRUCTION}")
        n_done = 0
        while True:
            self._questions()
            if most is not None and n_done >= most:
                break
            state = self._state
            number, attempt = state.next or (0, 0)
            trial = self._mine[number - 1] if number else None
            if trial is None and self._auto:
                break
            ready = self._wait(trial, attempt)
            if self._state.next != state.next:
                continue  # the trial before is to be done again, and comes first
            if not ready or trial is None:
                break
            self._check_masking("")
            n_done += self._trial(trial, attempt)
            self._check_masking(f" in trial {trial.trial}")
        state = self._state
        if message := state.said():
            self._desk.say(message)
        if state.next is None:
            self._desk.say("All trials are over. Thank the participant; take off vest and electrodes.")
        return state

    def leave(self) -> None:
        """End the running trial and record that the session is not led any more."""
        if self._led is not None:
            self._led.break_off("the session was stopped")
        self._journal.add("session_stop", t_ns=self._clock.now_ns(), source="auto")
        phase = "over" if self._state.next is None else "stopped"
        self._telling.put(self._as_board(phase, None), at_once=True)

    def _heading(self, trial: PlannedTrial | None, again: str = "") -> str:
        if trial is None:
            return f"{self._participant} · all trials are over"
        return f"{self._participant} · trial {trial.trial} of {len(self._mine)}{again} · {trial.object}"

    # The parts of a session.

    def _check_masking(self, when: str) -> None:
        """Stop if the masking sound has stopped: audible motors would be another condition."""
        if self._masking is None or self._masking.playing:
            return
        message = f"the masking sound stopped{when}: the loudspeaker went away"
        self._before.note(message)
        raise DeviceUnavailableError(message, "plug it in again; the same command goes on")

    def _wait(self, trial: PlannedTrial | None, attempt: int) -> bool:
        """Rest, then wait until everybody is ready, or after the last trial until there is no more to note.

        Returns False to quit, and also if another trial is next now.
        """
        next_before = self._state.next
        rest_s = 0.0 if trial is None else trial.rest_s
        if attempt > 1:
            rest_s = max(rest_s, self._plan.settings.rest_s)
        now_ns = self._clock.now_ns()
        ended_ns = self._before.ended_ns(now_ns)
        until_ns = now_ns if ended_ns is None else ended_ns + round(rest_s * self._scale * 1e9)
        heading = self._heading(trial, ", again" if attempt > 1 else "")
        quitting = False
        tasks = {} if trial is None else {task.key: task for task in self._bench.rest_tasks}
        offered = [(key, task.words) for key, task in tasks.items()]
        self._before.following = None if trial is None else (trial.trial, attempt)
        for task in tasks.values():
            if task.after_trials and ended_ns is not None and not self._auto:
                self._rest_task(task, heading)
        while True:
            now_ns = self._clock.now_ns()
            left_s = (until_ns - now_ns) / 1e9
            resting = left_s > 0
            for key in self._received():
                if key == "q":
                    if quitting:
                        return False
                    quitting = True
                    self._desk.say("q once more to stop here; the same command goes on from here")
                elif key == ENTER and not resting:
                    return True
                elif trial is not None and key in tasks:
                    self._rest_task(tasks[key], heading)
                else:
                    self._before.take(key)
                    if self._state.next != next_before:
                        return False
            if self._auto and not resting:
                return True
            thing = "" if trial is None else trial.object
            events = self._journal.events
            reported = [*self._before.lines(), *muscle_sentence(events), *squeeze_sentence(events)]
            screen = waiting(heading, thing, left_s, reported, [*offered, *self._before.keys])
            board = self._as_board(screen.phase, trial, attempt, until_ns=until_ns if resting else None)
            self._telling.show(screen, board)
            time.sleep(_POLL_S)

    def _rest_task(self, task: RestTask, heading: str) -> None:
        """Have the bench do something of a rest, and write down what came of it."""
        found = RunningTask(task).watch(
            self._received, lambda now: self._telling.show(doing(heading, now), self._as_board("task", None))
        )
        if isinstance(found, str):
            self._desk.say(f"{task.words}: {found}")
            return
        self._before.add(task.kind, text=found.text, value=found.value, source="auto")
        self._desk.say(f"{task.words}: {found.text or 'done'}")

    def _trial(self, trial: PlannedTrial, attempt: int) -> bool:
        """Lead a trial; whether it took place."""
        settings, beeps = self._plan.settings, None
        window_s = settings.window_s
        if self._masking is not None and settings.probe:
            at_s = beep_times(trial, attempt, seed=settings.seed or 0, until_s=window_s)
            beeps = Beeps(self._masking, at_s, key=self._answer_key)
        led = self._led = LedTrial(
            self._folder,
            trial,
            attempt,
            bench=self._bench,
            journal=self._journal,
            clock=self._clock,
            task=self._task,
            window_s=window_s,
            stable=settings.stable,
            time_scale=self._scale,
            beeps=beeps,
        )
        heading = self._heading(trial)
        while not led.step(self._received()):
            going = led.going
            shown: dict[str, Any] = {"says": going.reason, "health": going.alerts}
            if going.started_ns is not None:
                shown["until_ns"] = going.started_ns + round(window_s * 1e9)
            if led.phase == "trial":
                shown["started_ns"] = going.started_ns
            board = self._as_board(led.phase, trial, attempt, **shown)
            self._telling.show(running(heading, led, window_s, bench=self._bench), board)
            time.sleep(_POLL_S)
        self._led = None
        if led.broke and self._auto:
            raise DeviceUnavailableError(f"trial {trial.trial} cannot begin: {led.broke}")
        if led.broke:
            self._desk.say(f"The trial did not begin: {led.broke}")
            return False
        end = next(e for e in reversed(self._journal.events) if e.kind == "trial_end")
        for message in ended(led, end):
            self._desk.say(message)
        if self._auto and end.status == "aborted_technical" and attempt >= _BROKEN_ALONE:
            raise DeviceUnavailableError(
                f"trial {trial.trial} broke off {attempt} times: {end.text}", "the same command goes on"
            )
        return True

    def _questions(self) -> None:
        """Ask the questions that are due after a finished block."""
        state = self._state
        left = {number for number, status in state.status.items() if status in {"planned", "running"}}
        if state.next is not None:
            left.add(state.next[0])
        for number in blocks_to_ask(self._mine, self._journal.events, left):
            requested = BlockQuestions(
                self._journal, self._clock, number, f"{self._participant} · after trial {number}"
            )
            if self._auto:
                requested.pass_over()
            while not requested.over:
                self._received_by_program()
                pressed = self._desk.keys()
                for key in pressed:
                    requested.press(key)
                self._telling.show(requested.screen(), self._as_board("questions", None))
                time.sleep(_POLL_S)

    def _received(self) -> list[str]:
        reported, typed = self._received_by_program(), self._desk.keys()
        # A stop is one with Caps Lock on, too.
        keys = {self._answer_key: (self._answer_key,), **self._pedals}
        return [*(own for key in typed for own in keys.get(key, (key.lower(),))), *reported]

    def _received_by_program(self) -> list[str]:
        """Return what another program has pressed; a question is answered by a person, whatever it presses."""
        if self._stop():
            raise KeyboardInterrupt
        return self._reported.take()

    def _as_board(
        self, phase: str, trial: PlannedTrial | None, attempt: int = 1, **shown: Any
    ) -> SessionBoard:
        return SessionBoard(
            t_ns=self._clock.now_ns(),
            phase=phase,
            trial=0 if trial is None else trial.trial,
            attempt=attempt,
            object="" if trial is None else trial.object,
            n_over=self._state.n_over,
            n_trials=len(self._mine),
            window_s=self._plan.settings.window_s,
            n_told=self._reported.n_taken,
            **shown,
        )
