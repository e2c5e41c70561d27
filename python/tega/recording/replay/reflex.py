"""Impose the levels of a recorded run's guard, and compute its reflex from the recorded circumstances."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from tega.config.choose import grip_reflex
from tega.loop.reflex import ReflexArc, ReflexMoment
from tega.records import ReflexGrip
from tega.safety.guard import Guard

if TYPE_CHECKING:
    from tega.config import SessionConfig
    from tega.recording.replay.recorded import Recorded


class RecordedGuard(Guard):
    """Guard of a recorded run: it imposes the recorded levels, each from its tick on.

    Args:
        recorded: The run.
        tick_ns: Returns the time of the tick.
    """

    def __init__(self, recorded: Recorded, tick_ns: Callable[[], int]) -> None:
        super().__init__()
        self._at, self._tick_ns, self._imposed = dict(recorded.imposed), tick_ns, 0.0

    def due(self, t_ns: int, late_ns: int) -> bool:  # noqa: ARG002
        """Return false: the guard's findings are in the recording."""
        return False

    def level(self, wanted: float) -> float:
        """Return the imposed level, or the wanted one where none is imposed."""
        self._imposed = self._at.get(self._tick_ns(), self._imposed)
        return self._imposed or wanted


def recorded_arc(
    recorded: Recorded,
    config: SessionConfig,
    *,
    tell: Callable[[ReflexGrip], None],
) -> ReflexArc | None:
    """Make the reflex of a recorded run; ``None`` where the settings name none.

    Args:
        recorded: The run.
        config: Its settings.
        tell: Called with every tick at which the reflex was asked.
    """
    reflex = grip_reflex(config.stages, config.session.preset, recorded.contacts)
    if reflex is None:
        return None
    rows = {row.t_ns: row for row in recorded.of(ReflexGrip)}

    def moment(t_ns: int) -> ReflexMoment:
        row = rows.get(t_ns)
        if row is None:
            return ReflexMoment(0.0, allowed=True, measured=None)
        return ReflexMoment(row.authority, row.allowed, row.measured)

    return ReflexArc(reflex, config.stages.reflex, moment=moment, tell=tell)
