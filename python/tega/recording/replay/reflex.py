"""Impose the levels of a recorded run's guard, and compute its reflex from the recorded circumstances."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING

from tega.config.choose import grip_reflex
from tega.hand import joined_level
from tega.loop.reflex import ReflexArc, ReflexMoment
from tega.records import Imposed, ReflexGrip
from tega.safety.guard import Guard

if TYPE_CHECKING:
    from tega.config import SessionConfig
    from tega.recording.replay.feed import Newest


class RecordedGuard(Guard):
    """Guard of a recorded run: it imposes the recorded levels, each from its tick on.

    Args:
        imposed: Levels set against the muscles.
        tick_ns: Returns the time of the tick.
    """

    def __init__(self, imposed: Newest[Imposed], tick_ns: Callable[[], int]) -> None:
        super().__init__()
        self._imposed, self._tick_ns = imposed, tick_ns

    def due(self, t_ns: int, late_ns: int) -> bool:  # noqa: ARG002
        """Return false: the guard's findings are in the recording."""
        return False

    def level(self, wanted: float) -> float:
        """Return the imposed level, or the wanted one where none is imposed."""
        imposed = self._imposed.until(self._tick_ns())
        return wanted if imposed is None else joined_level(imposed.level, imposed.closure) or wanted


def recorded_arc(
    grips: Newest[ReflexGrip],
    fingers: Iterable[str],
    config: SessionConfig,
    *,
    tell: Callable[[ReflexGrip], None],
) -> ReflexArc | None:
    """Make the reflex of a recorded run; ``None`` where the settings name none.

    Args:
        grips: Its turns at which the reflex was asked.
        fingers: Names of its fingers.
        config: Its settings.
        tell: Called with every tick at which the reflex was asked.
    """
    reflex = grip_reflex(config.stages, config.session.preset, list(fingers))
    if reflex is None:
        return None

    def moment(t_ns: int) -> ReflexMoment:
        row = grips.at(t_ns)
        if row is None:
            return ReflexMoment(0.0, allowed=True, measured=None)
        return ReflexMoment(row.authority, row.allowed, row.measured)

    return ReflexArc(reflex, config.stages.reflex, moment=moment, tell=tell)
