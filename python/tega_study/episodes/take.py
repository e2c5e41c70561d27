"""Take episodes, a recording each: start, keep, discard, again, by one key or pedal at a time."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Final

import msgspec

from tega.config import SessionConfig
from tega.errors import TegaError
from tega.loop import run_session
from tega.loop.controls import Controls
from tega.loop.snapshot import Snapshot
from tega.recording.mcap_folder import SessionFolder
from tega.records import RunState
from tega.records.bus import Bus
from tega_study.episodes.journal import EpisodeJournal, EpisodeLine, EpisodeStep
from tega_study.episodes.pedal import EpisodePedal, pedal_names
from tega_study.lead.experimenter import ENTER, Desk, Screen
from tega_study.lead.rest_tasks import RunningTask, start_task
from tega_study.lead.running_trial import in_thread
from tega_study.lead.screens import doing

GO_ON, DISCARD, AGAIN = "g", "x", "r"
_STEPS: Final[dict[str, EpisodeStep]] = {GO_ON: "kept", DISCARD: "discarded", AGAIN: "discarded"}
QUIET_S: Final = 1.0
"""So long after an episode has begun the key that began it does not end it."""
_POLL_S = 0.02
_KEYS: Final = frozenset({"q", GO_ON, DISCARD, AGAIN, "a"})


class _Running:
    """An episode that goes on: a run in a thread of its own."""

    def __init__(self, config: SessionConfig, settings: str, bus: Bus) -> None:
        self._over = threading.Event()
        self._began_s: float | None = None
        self._ended_s: float | None = None
        self.state, self.alerts = "devices start", tuple[str, ...]()
        self.file = ""

        def observe(snapshot: Snapshot) -> None:
            self.alerts = tuple(snapshot.view.alerts)

        bus.subscribe(Snapshot, observe, name="episodes", vital=True)
        bus.subscribe(RunState, self._change, name="episodes", vital=True)

        def run() -> None:
            summary = run_session(
                config,
                bus=bus,
                controls=Controls(stop=self._over.is_set),
                progress=self._prepare,
                settings=settings,
            )
            self.file = summary["recording"]["file"].removesuffix(".part")

        self._thread, self.raised = in_thread(run)

    def _prepare(self, subject: str, done: int, total: int) -> None:
        if self._began_s is None:
            self.state = f"{subject} {done} of {total}" if total else subject

    def _change(self, change: RunState) -> None:
        self.state = change.state
        if change.state == "active" and self._began_s is None:
            self._began_s = time.monotonic()

    @property
    def over(self) -> bool:
        """Whether the run has ended."""
        return not self._thread.is_alive()

    @property
    def elapsed_s(self) -> float:
        """Seconds for which it has been active."""
        until_s = time.monotonic() if self._ended_s is None else self._ended_s
        return 0.0 if self._began_s is None else until_s - self._began_s

    def end(self) -> None:
        """End it, and wait until its recording is finished."""
        if self._ended_s is None:
            self._ended_s = time.monotonic()
        self._over.set()
        self._thread.join()


class EpisodeTaker:
    """Records episodes in a session's folder, new or with recordings, until the operator ends it.

    The recording folder and output folder of ``config`` are ignored. ``pedals`` are one to three keys typed by
    a foot switch, or buttons of ``input.marker``, separated by commas; they mean continue, discard, repeat.
    ``settings`` is how the settings' file is named in what an error suggests. Another program that takes
    episodes there is a ``DeviceUnavailableError``, pedals that mean something else an ``InvalidValueError``.
    """

    def __init__(
        self,
        config: SessionConfig,
        folder: Path,
        desk: Desk,
        *,
        task: str,
        pedals: str = "",
        stop: Callable[[], bool] = lambda: False,
        settings: str = "SETTINGS.toml",
    ) -> None:
        names = pedal_names(pedals, config.input.marker, _KEYS)
        replace = msgspec.structs.replace
        self._config = replace(
            config,
            session=replace(config.session, out_dir=None),
            recording=replace(config.recording, dir=folder.absolute()),
        )
        self._desk, self._task, self._stop, self._settings = desk, task, stop, settings
        self._pedals = dict(zip(names, (GO_ON, DISCARD, AGAIN), strict=False))
        self._means = {ENTER: GO_ON, " ": GO_ON} | self._pedals
        self._pedal = EpisodePedal(config.input.marker if self._pedals else None)
        self._folder = SessionFolder(folder)

    def take(self, *, most: int | None = None) -> list[EpisodeLine]:
        """Take episodes until ``most`` were kept (``None``: until ``q q``), and return how each ended."""
        ended: list[EpisodeLine] = []
        with EpisodeJournal(self._folder) as journal, closing(self._pedal):
            again = False
            while most is None or sum(line.step == "kept" for line in ended) < most:
                if not again and not self._wait(journal, ended):
                    break
                line, again = self._episode(journal)
                ended.append(line)
                if self._config.arm is not None and self._config.arm.start is not None:
                    self._to_start()
        return ended

    def _received(self) -> list[str]:
        """Return the pressed keys, with pedals replaced by their meaning."""
        if self._stop():
            raise KeyboardInterrupt
        keys = self._desk.keys()
        typed = [key for key in keys if key not in self._pedals or not self._pedal.types(key)]
        pressed = [self._pedals[button] for button in self._pedal.presses() if button in self._pedals]
        return [self._means.get(key, key) for key in typed] + pressed

    def _wait(self, journal: EpisodeJournal, ended: list[EpisodeLine]) -> bool:
        """Wait for the start; whether there is one."""
        quitting = False
        self._pedal.listen()
        kept = sum(line.step == "kept" for line in ended)
        heading = f"{self._task} · {kept} kept, {len(ended) - kept} discarded"
        last = "" if not ended else f"episode {ended[-1].episode}: {ended[-1].step} {ended[-1].why}".strip()
        keys = [("Enter", "start"), ("q q", "end")]
        while True:
            for key in self._received():
                if key == GO_ON:
                    return True
                if key == "q":
                    if quitting:
                        return False
                    quitting = True
                    self._desk.say("q once more to end")
            big = f"Enter to start episode {journal.n_episodes + 1}"
            self._desk.show(Screen("ready", heading, big, [last] if last else [], keys, self._pedal.problems))
            time.sleep(_POLL_S)

    def _episode(self, journal: EpisodeJournal) -> tuple[EpisodeLine, bool]:
        """Take one; how it ended, and whether it is to be done again at once."""
        file = self._folder.new_trial().name
        journal.add("begun", file, self._task)
        self._pedal.close()
        bus = Bus()
        self._pedal.watch(bus)
        running = _Running(self._config, self._settings, bus)
        wanted, why = "", ""
        try:
            wanted = self._watch(running, journal.n_episodes)
            running.end()
            if running.raised and not wanted:
                why = _reported(running.raised[0])
            elif not wanted:
                wanted = self._decide(running, journal.n_episodes)
        except KeyboardInterrupt:
            why = "the program was interrupted"
            raise
        finally:
            running.end()
            file = running.file or file  # another program may have begun a recording here meanwhile
            step: EpisodeStep = _STEPS.get(wanted, "cut")  # only a person's word deletes what was recorded
            if step != "discarded" and not self._folder.finished(file):
                step, why = "discarded", why or "nothing was recorded"
            line = journal.add(step, file, self._task, duration_s=round(running.elapsed_s, 3), why=why)
        self._desk.say(f"episode {line.episode}: {line.step}" + (f": {why}" if why else ""))
        return line, wanted == AGAIN

    def _watch(self, running: _Running, number: int) -> str:
        """Show the episode until it ends; return the key that ended it, ``""`` for none yet."""
        keys = [("Enter", "end"), (DISCARD, "discard"), (AGAIN, "discard, and again")]
        while not running.over:
            for key in self._received():
                if key in {DISCARD, AGAIN}:
                    return key
                if key == GO_ON and running.elapsed_s >= QUIET_S:
                    return ""
            big = f"{running.elapsed_s:5.1f} s" if running.elapsed_s else running.state
            heading = f"{self._task} · episode {number}"
            self._desk.show(Screen("episode", heading, big, [running.state], keys, running.alerts))
            time.sleep(_POLL_S)
        return ""

    def _decide(self, running: _Running, number: int) -> str:
        keys = [("Enter", "keep"), (DISCARD, "discard"), (AGAIN, "discard, and again")]
        heading = f"{self._task} · episode {number}, {running.elapsed_s:.1f} s"
        self._pedal.listen()
        while True:
            for key in self._received():
                if key in {GO_ON, DISCARD, AGAIN}:
                    return key
            self._desk.show(Screen("decide", heading, "keep it?", (), keys, self._pedal.problems))
            time.sleep(_POLL_S)

    def _to_start(self) -> None:
        """Move arm and hand to their start. They move only with the dead-man switch held."""
        self._pedal.close()
        found = RunningTask(start_task(self._config)).watch(
            self._received, lambda now: self._desk.show(doing(self._task, now))
        )
        self._desk.say(found if isinstance(found, str) else found.text)


def _reported(error: BaseException) -> str:
    if isinstance(error, TegaError | OSError):
        return str(error)
    if isinstance(error, KeyboardInterrupt):
        return "ended before it began"
    raise error
