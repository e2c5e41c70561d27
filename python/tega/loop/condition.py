"""Watch muscles and electrodes during a run: record their condition; report fatigue and moved electrodes."""

from __future__ import annotations

from contextlib import ExitStack
from typing import TYPE_CHECKING, Any

from tega.devices.base import EmgChunk
from tega.loop.emg_condition import ConditionWatch
from tega.records import EmgSamples
from tega.records.bus import Backlog
from tega.runtime.threads import run_realtime

if TYPE_CHECKING:
    from tega.config import SessionConfig
    from tega.config.calibration import EmgMaxima
    from tega.loop.inbox.prepared import Prepared
    from tega.records.bus import Bus

_MOST_CHUNKS = 4096


class MuscleAlert:
    """Publishes the condition of the muscles from the samples on the bus.

    Args:
        maxima: Maxima of the channels, with the kind of the samples.
        bus: Bus with the samples; the condition is published on it.
        backlog: Queue for the samples, so that no spectrum delays a source; ``None`` to process them at once.

    Attributes:
        said: The current alert; ``""`` for none.
    """

    def __init__(self, maxima: EmgMaxima, bus: Bus, backlog: Backlog | None = None) -> None:
        self._watch, self._bus, self.said = ConditionWatch(maxima), bus, ""
        how: dict[str, Any] = {} if backlog is None else {"backlog": backlog}
        bus.subscribe(EmgSamples, self._take, name="condition of the muscles", **how)

    def _take(self, given: EmgSamples) -> None:
        samples = given.samples.reshape(-1, given.n_channels)
        for condition in self._watch.take(EmgChunk(given.t_ns, given.first_index, samples)):
            self.said = f"emg: {condition.said}" if condition.said else ""
            self._bus.publish(condition)


def open_condition(
    stack: ExitStack, config: SessionConfig, prepared: Prepared, bus: Bus
) -> MuscleAlert | None:
    """Watch the muscles of a run; ``None`` where their samples are decoded somewhere else.

    Args:
        stack: Ends the thread in which that is done where time is real.
        config: The settings.
        prepared: The sources of the run.
        bus: Bus with the samples; the condition is published on it.
    """
    muscles = prepared.muscles
    if muscles is None or muscles.decoder is None:
        return None
    backlog = None
    if config.session.pace == "real":
        backlog = Backlog("condition", most=_MOST_CHUNKS, rank=run_realtime("beside"))
        stack.callback(backlog.close)
    return MuscleAlert(muscles.maxima, bus, backlog)
