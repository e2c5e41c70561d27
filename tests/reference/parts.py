"""Follow a run in a test: by its bus, and by parts of a test's own."""

from __future__ import annotations

from collections.abc import Callable

from tega.loop.inbox.inputs import Prepared
from tega.loop.parts import Part
from tega.loop.snapshot import LoopView, Snapshot
from tega.records import RunState
from tega.records.bus import Bus
from tega.records.display import Notice


def observed(
    observer: Callable[[LoopView], object] | None = None,
    bus: Bus | None = None,
    *,
    on_state: Callable[[RunState], object] | None = None,
    notices: Callable[[str], object] | None = None,
) -> Bus:
    """Return a bus, with subscribers to moments, states and notices."""
    bus = Bus() if bus is None else bus
    if observer is not None:
        bus.subscribe(Snapshot, lambda snapshot: observer(snapshot.view), name="display", vital=True)
    if on_state is not None:
        bus.subscribe(RunState, on_state, name="states", vital=True)
    if notices is not None:
        bus.subscribe(Notice, lambda notice: notices(notice.text), name="notices")
    return bus


class Given(Part):
    """Part that changes the inputs of a run."""

    def __init__(self, change: Callable[[Prepared], Prepared]) -> None:
        self._change = change

    def prepared(self, prepared: Prepared) -> Prepared:
        """Return the changed inputs."""
        return self._change(prepared)
