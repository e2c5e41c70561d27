"""Run a bench's task in a rest, such as measuring a squeeze, in a thread that the experimenter can end."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Final, NamedTuple

import numpy as np

from tega.config import SessionConfig
from tega.devices.base import optional
from tega.devices.registry import driver_class
from tega.errors import CalibrationError, ConfigError, TegaError
from tega.loop.prepare import prepare
from tega.runtime.guide import Bar, Shows
from tega.setup.calibration.effort import judge_squeezes
from tega.setup.calibration.steps_emg import collect, drain
from tega_bench.homing import go_to_start
from tega_study.journal import Kind
from tega_study.lead.running_trial import in_thread

_POLL_S = 0.02


class RestTaskEnd(NamedTuple):
    """Result of a task for the session's events."""

    text: str = ""
    value: float | None = None


class RestTask(NamedTuple):
    """Task that a bench offers in a rest; ``after_trials`` it begins by itself, if an experimenter leads.

    ``run`` is called with the running task, on which it shows its progress; that ends it by raising
    :class:`RestTaskEndedError`.
    """

    key: str
    words: str
    kind: Kind
    run: Callable[[RunningTask], RestTaskEnd]
    after_trials: bool = False


class RestTaskEndedError(Exception):
    """Raised in a task's thread where the experimenter or the program has ended it."""


class RunningTask:
    """A task in a thread of its own: ``prompt`` for the person now, ``left_s`` or ``None`` if unknown."""

    def __init__(self, task: RestTask) -> None:
        self.task, self.prompt = task, "devices start"
        self.left_s: float | None = None
        self._ended = threading.Event()
        self._made: list[RestTaskEnd] = []
        self._thread, self._raised = in_thread(lambda: self._made.append(task.run(self)))

    def show(self, prompt: str, _bars: Sequence[Bar], left_s: float | None) -> None:
        """Take in the task's progress, again and again; ``RestTaskEndedError`` once it is to end."""
        self.prompt, self.left_s = prompt, left_s
        if self._ended.is_set():
            raise RestTaskEndedError

    @property
    def over(self) -> bool:
        """Whether it has ended."""
        return not self._thread.is_alive()

    def end(self) -> None:
        """Have it end, and wait until its devices are closed."""
        self._ended.set()
        self._thread.join()

    def watch(self, keys: Callable[[], list[str]], show: Callable[[RunningTask], None]) -> RestTaskEnd | str:
        """Show the task until it ends or ``a`` ends it; return its result."""
        try:
            while not self.over:
                if "a" in keys():
                    self.end()
                show(self)
                time.sleep(_POLL_S)
        finally:
            self.end()
        return self.result()

    def result(self) -> RestTaskEnd | str:
        """Return what came of it, or in a sentence why nothing did."""
        if self._made:
            return self._made[0]
        error = self._raised[0]
        if isinstance(error, RestTaskEndedError):
            return "ended by the experimenter"
        if isinstance(error, TegaError | OSError):
            return str(error) or type(error).__name__
        raise error


def start_task(config: SessionConfig) -> RestTask:
    """Return the task, which begins by itself after each trial."""
    words = "arm and hand to their start"
    return RestTask(
        "h", words, "note", lambda shows: RestTaskEnd(go_to_start(config, shows)), after_trials=True
    )


SQUEEZE_S: Final = 3.0
"""So long a squeeze lasts; its first half second is its rise and does not count."""
_READY_S: Final = 1.0


def squeeze_task(config: SessionConfig, *, settings: str) -> RestTask:
    """Return the task of a squeeze."""
    run = partial(_measure_squeeze, config, settings=settings)
    return RestTask("g", "a squeeze against the first", "squeeze", run)


def _measure_squeeze(config: SessionConfig, shows: Shows, *, settings: str) -> RestTaskEnd:
    """Have the person squeeze once.

    Returns the mean over the channels of the amplitude (electrical, not a force) as a share of the calibrated
    maximum, and the signal's problems. ``CalibrationError`` without a calibration, or with too few samples.
    """
    if config.emg is None:
        raise ConfigError("a squeeze needs muscles: the settings have no [emg]", "set [emg]")
    with driver_class(config.emg.driver, "emg")(config.emg.options) as source:
        made = prepare(
            config, {}, source, progress=lambda *_: None, stop=lambda: False, settings=settings
        ).calibration.emg
        if made is None:
            raise CalibrationError(f"{settings}: has no EMG maxima", "calibrate")
        drain(source)
        collect(source, _READY_S, shows, "get ready to squeeze", names=made.channels)
        chunks = collect(source, SQUEEZE_S, shows, "SQUEEZE as strong as you can", names=made.channels)
        rest = (0.0,) * len(made.channels)
        found = judge_squeezes([chunks], rest, made, limits=optional(source, "limits"))
    tops = found.live if config.session.preset == "live" else found.paper
    return RestTaskEnd("; ".join(found.notes), float(np.mean(np.array(tops) / np.array(made.maxima))))
