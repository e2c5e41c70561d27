"""Ask a recorded run's reflex again, under the circumstances that the recording holds tick by tick."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

from tega.config.choose import grip_reflex
from tega.loop.reflex import ReflexArc, ReflexMoment

if TYPE_CHECKING:
    from tega.config import ReflexSection, SessionConfig
    from tega.recording.replay.recorded import Recorded
    from tega.records import Contact, ReflexGrip
    from tega.stages.base import Reflex


class RecordedArc(ReflexArc):
    """The arc of a recorded run: what was imposed then comes before what the reflex adds, as it did in the run.

    Args:
        reflex: The stage.
        settings: Its bounds.
        moment: As of :class:`tega.loop.reflex.ReflexArc`, out of the recording.
        tell: As there.
        imposed: Level that was set against the muscles, by the tick from which on; 0 for no longer.
        tick_ns: Tells the tick.
    """

    def __init__(
        self,
        reflex: Reflex,
        settings: ReflexSection,
        *,
        moment: Callable[[int], ReflexMoment],
        tell: Callable[[ReflexGrip], None],
        imposed: Mapping[int, float],
        tick_ns: Callable[[], int],
    ) -> None:
        super().__init__(reflex, settings, moment=moment, tell=tell)
        self._imposed, self._tick_ns, self._set = imposed, tick_ns, 0.0

    def step(
        self, t_ns: int, own: float, contacts: Callable[[], Mapping[str, Contact]]
    ) -> tuple[float, float]:
        """Return what the hand was told at a tick: own level and addition."""
        self._set = self._imposed.get(self._tick_ns(), self._set)
        return super().step(t_ns, self._set or own, contacts)


def recorded_arc(
    recorded: Recorded,
    config: SessionConfig,
    *,
    tick_ns: Callable[[], int],
    tell: Callable[[ReflexGrip], None],
) -> RecordedArc | None:
    """Make the reflex of a recorded run; ``None`` where the settings name none.

    Args:
        recorded: The run.
        config: Its settings.
        tick_ns: Tells the tick.
        tell: Told of every tick at which it was asked.
    """
    reflex = grip_reflex(config.stages, config.session.preset, recorded.contacts)
    if reflex is None:
        return None
    rows = {row.t_ns: row for row in recorded.reflex}

    def moment(t_ns: int) -> ReflexMoment:
        row = rows.get(t_ns)
        if row is None:
            return ReflexMoment(0.0, allowed=True, measured=None)
        return ReflexMoment(row.authority, row.allowed, row.measured)

    return RecordedArc(
        reflex,
        config.stages.reflex,
        moment=moment,
        tell=tell,
        imposed=dict(recorded.imposed),
        tick_ns=tick_ns,
    )
