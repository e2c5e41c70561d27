"""Move arm and hand to their start at the beginning of a rest, while the experimenter holds the dead-man."""

from __future__ import annotations

from tega.config import SessionConfig
from tega.loop.homing import go_to_start
from tega_study.lead.rest_tasks import RestTask, RestTaskEnd, RunningTask


def start_task(config: SessionConfig) -> RestTask:
    """Return the task, which begins by itself after each trial."""

    def run(running: RunningTask) -> RestTaskEnd:
        return RestTaskEnd(go_to_start(config, running))

    return RestTask("h", "arm and hand to their start", "note", run, after_trials=True)
